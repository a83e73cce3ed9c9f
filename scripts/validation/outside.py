"""The invasion on the real binary against closed forms and published numbers.

    python scripts/validation.py outside [--quick] [--only NAME] [--out DIR] [--rows FILE.csv]

Rows of all runs: docs/validation/outside.csv. Answer: docs/evidence/scoreboard.md.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.stats import binomtest, chi2

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, set_keys
from fdnet.case.spheres import SHEAR_RATIO
from fdnet.dem import deck
from fdnet.dem.checkpoint import Checkpoints
from fdnet.dem.invade_deck import InvadeInputs
from fdnet.dem.invasion import InvadeStage, invade
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.files import write_text
from fdnet.scales import contacts
from fdnet.scales.contacts import sphere_mass
from fdnet.scales.flow import Losses, ergun_inertia, straight
from fdnet.scales.scales import invasion_scales, scales_of
from fdnet.spheres.dump import Frame, read_dump
from fdnet.spheres.geometry import max_overlap
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting
from validation.comparisons import (
    BLACK,
    BLUE,
    ORANGE,
    TEMPLATES,
    Finding,
    Trial,
    chapter_of,
    command,
    packed,
    the_binary,
)

FINE, GRAIN, DENSITY, VISCOSITY, GRAVITY = 5e-5, 2.5e-4, 2146.0, 0.05, 9.81
"""Radii of fines and grains, m, density, kg/m3, viscosity, Pa s, and acceleration, m/s2."""
Seen = Mapping[str, float]

# ---- Fines under a constant force and viscous drag: Stokes drag c (u - v) is c u and -c v.


class Push(NamedTuple):
    """What acts on the fines, and how long they are followed."""

    step: float  # time step, s
    steps: int  # of a chunk, after which the kinetic energy is looked at
    chunks: int = 1  # most chunks
    force: tuple[float, ...] = (0.0, 0.0, 0.0)  # constant, on every fine, N
    damping: float = 0.0  # viscous drag on every fine, N s/m
    settle: int = 0  # steps before the first chunk, after which the fines are seen once
    every: int = 0  # steps from one look at the fines to the next; 0 for the end alone
    rest: float = 0.0  # kinetic energy, J, below which the run ends
    boundary: str = "f f f"  # of the box, as LIGGGHTS names it
    floor: bool = False  # whether a rough plane x = 0 holds the fines


def case_of(stiffness: float, *settings: str, fine: float = FINE) -> InvasionCase:
    """A case whose contacts have this normal stiffness, N/m; `settings` are "key=value"."""
    parts = ["friction=0.1", "damping_ratio=0.5"]
    if "contact.model=hertz" not in settings:
        parts.append(f"normal_stiffness_N_m={2 * stiffness!r}")
    tables: dict[str, Any] = {
        "name": "outside",
        "box": {"size_mm": [2e5 * fine] * 3, "sides": "walls", "wall_friction": 0.1},
        "grains": {"radius_mm": 2e3 * fine, "count": 2},
        "fines": {"radius_mm": 1e3 * fine, "count": 1, "density_kg_m3": DENSITY},
        "fluid": {"velocity_m_s": 1e-3, "viscosity_cP": 1e3 * VISCOSITY},
        "drag": {"field": "uniform"},
        "contact": {"restitution": "dry"},
        "run": {"stiffness_N_m": stiffness},
    }
    both = [f"{kind}.{part}" for kind in ("grains", "fines") for part in parts]
    return with_fines(case_from(set_keys(tables, [*both, *settings])))


def run_pushed(case: InvasionCase, spheres: Snapshot, push: Push, folder: Path) -> list[Frame]:
    """The fines, unwrapped: after settling, then at every look, or at the end.

    Grains stay where they are; the box of the spheres is that of the simulation.
    """
    folder.mkdir(parents=True, exist_ok=True)
    data, density = folder / "pushed.data", np.full(len(spheres), case.fines.density_kg_m3)
    deck.write_data(data, spheres, bounds=spheres.box, density=density, types=3)
    thrown = zip(spheres.id, spheres.velocity.tolist(), strict=True)
    rows = [f"{own} {x!r} {y!r} {z!r} 0.0 0.0 0.0\n" for own, (x, y, z) in thrown]
    write_text(data, "".join([data.read_text(), "\nVelocities\n\n", *rows]))
    plane = {"id": "plane", "group": "fines", "plane": "xplane", "position": "0.0"}
    variables = deck.header_variables(case, "invade", [], 1) | {
        "boundary": push.boundary,
        "skin": deck.number(case.fines.mean_radius_m),
        "contacts": deck.contact_variables(case, scales_of(case), "invade", friction=True),
        "walls": [plane | deck.wall_law(case, "invade", friction=True)] if push.floor else [],
        "time_step": deck.number(push.step),
        "push": " ".join(map(deck.number, push.force)),
        "damping": deck.number(push.damping) if push.damping else "",
        "settle_steps": push.settle,
        "every": push.every,
        "chunk_steps": push.steps,
        "chunks": push.chunks,
        "rest_energy": deck.number(push.rest) if push.rest else "",
        "dump_columns": "id type xu yu zu vx vy vz radius",
        "dump_format": "%d %d" + 7 * " %.17g",
    }
    write_text(folder / "in.pushed", deck.render_text("pushed.in.j2", variables, folder=TEMPLATES))
    run_deck(folder, "in.pushed", Launch(binary=the_binary()))
    settled = read_dump(folder / "settled.dump")[-1:] if push.settle else []
    return [*settled, *read_dump(folder / "motion.dump")]


def contact_step(radius: float, stiffness: float, factor: float) -> float:
    """`factor` sqrt(m/k) of a fine, s."""
    return factor * math.sqrt(sphere_mass(radius, DENSITY) / stiffness)


def stokes_drag(radius: float) -> float:
    """6 pi mu r, N s/m (Stokes 1851)."""
    return 6 * math.pi * VISCOSITY * radius


# ---- The throat of three equal grains of diameter D, each pair of which overlaps by delta D.


def passing_ratio(overlap: float) -> float:
    """2 (1 - delta) / sqrt(3) - 1: diameter over that of the grains of the largest fine."""
    return 2 * (1 - overlap) / math.sqrt(3) - 1


def passes(ratio: float, overlap: float, folder: Path, *, seed: int) -> bool:
    """Whether a fine of `ratio` grain diameters, pushed from off the axis, gets through.

    Raises RuntimeError when it is neither through nor at rest in the end.
    """
    fine, rng, speed = ratio * GRAIN, np.random.default_rng([seed, 5]), 0.1
    turn, angle = rng.uniform(0, 2 * math.pi), 2 * math.pi * np.arange(3) / 3
    off = 0.3 * passing_ratio(overlap) * GRAIN * math.sqrt(rng.uniform())
    far = 2 * GRAIN * (1 - overlap) / math.sqrt(3)
    corners = far * np.column_stack([np.zeros(3), np.cos(angle), np.sin(angle)])
    place = [*corners, [-0.6 * GRAIN, off * math.cos(turn), off * math.sin(turn)]]
    kinds, box = np.array([Kind.GRAIN] * 3 + [Kind.FINE]), np.array([[-6 * GRAIN, 6 * GRAIN]] * 3)
    start = resting(np.array(place), np.array([GRAIN] * 3 + [fine]), box, kinds)
    drag, step = stokes_drag(fine), contact_step(fine, 1e4, 0.2)
    steps, rest = math.ceil(0.036 * GRAIN / speed / step), 0.5e-6 * speed**2
    push = Push(step, steps, 100, (drag * speed, 0.0, 0.0), drag)
    push = push._replace(rest=rest * sphere_mass(fine, DENSITY))
    (end,) = run_pushed(case_of(1e4, fine=fine), start, push, folder)
    if end.column("xu")[0] <= 0.3 * GRAIN and abs(end.column("vx")[0]) > 0.01 * speed:
        raise RuntimeError(f"{folder}: the fine still moves, raise the number of steps")
    return bool(end.column("xu")[0] > 0.3 * GRAIN)


def throat(trial: Trial) -> Seen:
    """Bisected from 2 % below to 2 % above the closed form."""
    low, high = (share * passing_ratio(trial.value) for share in (0.98, 1.02))
    ends = [passes(end, trial.value, trial.folder, seed=trial.seed) for end in (low, high)]
    assert ends == [True, False], f"{low:g} should pass and {high:g} should not: {ends}"
    while high - low > (6e-3 if trial.quick else 1e-3) * low:
        middle = 0.5 * (low + high)
        passed = passes(middle, trial.value, trial.folder, seed=trial.seed)
        low, high = (middle, high) if passed else (low, middle)
    return {"passing ratio": 0.5 * (low + high)}


# ---- Single fines in a pack without overlap: three grains leave 0.1547 of a diameter.


def held(trial: Trial) -> Seen:
    """Fines of 1/`value` in loose packs of grains of 0.5 mm."""
    size, fines = ((2.0, 1.6), 400) if trial.quick else ((4.0, 2.0), 1000)
    count = round(0.58 * size[0] * size[1] ** 2 / sphere_mass(0.25, 1.0))
    sand = {"radius_mm": 0.25, "count": count}
    return single_fines(trial, sand, size, fine=0.25 / trial.value, fines=fines)


def single_fines(
    trial: Trial,
    sand: Mapping[str, Any],
    size: tuple[float, float],
    *,
    fine: float,
    fines: int,
    friction: float = 0.1,
    stiffness: float = 1e4,
    step: float = 0.2,
) -> Seen:
    """fdnet's own pack and invasion, but for a line that keeps fines from touching each other.

    `sand` are keys of [grains]; `size` is length and side of the pack, and `fine` the radius of
    the fines, mm. Contacts have the `stiffness`, N/m, and the time step `step` sqrt(m/k).
    """
    length, side = size
    tables = {
        "name": "passing",
        "seed": trial.seed,
        "box": {"size_mm": [length, side, side], "sides": "periodic"},
        "grains": {**sand, "friction": friction},
        "fines": {"radius_mm": fine, "count": fines, "friction": friction},
        "fluid": {"velocity_m_s": 1.0},
        "contact": {"restitution": "dry"},
        "drag": {
            "field": "uniform",
            "scheme": "viscous",
            "upstream": "interstitial",
            "pressure_gradient": False,
        },
        "run": {
            "stiffness_N_m": stiffness,
            "duration_ms": 5 * length,
            "checkpoint_ms": 0.25 * length,
            "time_step_factor": step,
        },
    }
    case = with_fines(case_from(tables))
    grains, scales = packed(case, trial.folder.parent), invasion_scales(case)
    folder = trial.folder
    (folder / "post").mkdir(parents=True)
    alone = "neigh_modify delay 0\nneigh_modify exclude type 2 2"
    text = InvadeInputs(case, scales, grains, folder).write().text
    text, lines = re.subn("(?m)^neigh_modify delay 0$", alone, text)
    assert lines == 1, f"{lines} lines of the deck choose neighbours, expected 1"
    write_text(folder / "in.invade", text)
    points = Checkpoints(folder=folder, digest=case.digest("invade"))
    points.cut(None)
    launch = Launch(binary=the_binary())
    stage = InvadeStage(case=case, scales=scales, grains=grains, points=points, launch=launch)
    run_deck(folder, "in.invade", replace(launch, follow=stage.follow))
    last = invade(case, scales, grains, folder, launch).history[-1]
    supplied = float(last.upstream + last.invaded + last.passed)
    overlap = max_overlap(grains, case.periodic)
    return {"held": float(last.invaded), "supplied": supplied, "overlap of grains": overlap}


def judge_held(rows: pd.DataFrame) -> list[Finding]:
    """Shares of all packs together with their bands (Clopper and Pearson 1934)."""
    lines = []
    for ratio, expected in ((7.0, "at most 1 %"), (5.0, "most of them")):
        sums = rows[rows.value == ratio].groupby("quantity")["observed"].sum()
        if len(sums):
            held, fines = round(sums["held"]), round(sums["supplied"])
            band = binomtest(held, fines).proportion_ci(0.95)
            over = band.high / 0.01 if ratio == 7.0 else (1 - band.low) / 0.5
            what = f"single fines of 1/{ratio:g} held by a pack"
            seen = f"{held} of {fines:,}, {100 * band.low:.2g} to {100 * band.high:.2g} % (95 %)"
            lines.append(Finding(what, expected, "arXiv 2605.19845", seen, over))
    return lines


# ---- A heap of fines that runs out through a round hole of R fine diameters until it clogs.

STIFFNESS, FLOWING, CLOGGED = 1e3, "escaped, no clog", "escaped before a clog"


def wall_spheres(ratio: float) -> tuple[Array, float, float]:
    """Spheres of half a fine's size in the plane x = 0 that leave a hole of `ratio` diameters.

    Returns:
        Centres (N, 3) m, radius m, side of the periodic square m.
    """
    small = 0.5 * FINE
    reach = ratio * FINE + small
    ring = math.floor(math.pi / math.asin(small / reach))
    angle = 2 * math.pi * np.arange(ring) / ring
    cells = math.ceil((ratio + 3.0) * 2 * FINE / (2 * small))
    side = cells * 2 * small
    along = (np.arange(cells) + 0.5) * 2 * small - 0.5 * side
    y, z = (grid.ravel() for grid in np.meshgrid(along, along))
    far = np.hypot(y, z) >= reach + 0.5 * small
    y = np.concatenate([reach * np.cos(angle), y[far]])
    z = np.concatenate([reach * np.sin(angle), z[far]])
    return np.column_stack([np.zeros_like(y), y, z]), small, side


def heap_of(ratio: float, seed: int) -> Snapshot:
    """The wall, and fines upstream of it by random addition, of which none touch."""
    wall, small, side = wall_spheres(ratio)
    rng, fine, half = np.random.default_rng([seed, 11]), sphere_mass(FINE, 1.0), 0.5 * side
    count = round(4.0 * 2 * FINE * side**2 * 0.6 / fine)
    low = np.array([-count * fine / (0.25 * side**2) - 3 * FINE, -half, -half])
    size = np.array([-3 * FINE, half, half]) - low
    placed = np.empty((0, 3))
    while len(placed) < count:
        gap = placed - (new := low + size * rng.random(3))
        gap[:, 1:] -= side * np.round(gap[:, 1:] / side)
        if np.all(np.sum(gap**2, axis=1) > (2.04 * FINE) ** 2):
            placed = np.vstack([placed, new])
    kinds = np.array([Kind.GRAIN] * len(wall) + [Kind.FINE] * count)
    box = np.array([[low[0] - 2 * FINE, 4 * FINE], [-half, half], [-half, half]])
    radius = np.array([small] * len(wall) + [FINE] * count)
    return resting(np.vstack([wall, placed]), radius, box, kinds)


def discharge(trial: Trial, *, friction: float) -> Seen:
    """Fines that escape; the box is periodic along x, so they fall on the heap again."""
    rare = trial.value > (2.25 if friction == 0.1 else 3.0)
    most = (20.0 if rare else 200.0) if trial.quick else (300.0 if rare else 800.0)
    start, drag = heap_of(trial.value, trial.seed), stokes_drag(FINE)
    step, speed = contact_step(FINE, STIFFNESS, 0.2), 1e-3 * STIFFNESS * FINE / drag
    passage, length = 2 * FINE / speed / step, float(np.ptp(start.box[0]))
    settle, rest = math.ceil(passage * length / (2 * FINE)), 0.5e-7 * speed**2
    push = Push(step, math.ceil(2 * passage), math.ceil(most / 2), (drag * speed, 0.0, 0.0), drag)
    push = push._replace(settle=settle, rest=rest * sphere_mass(FINE, DENSITY), boundary="p p p")
    case = case_of(STIFFNESS, f"grains.friction={friction}", f"fines.friction={friction}")
    before, end = run_pushed(case, start, push, trial.folder)
    through = [
        int(np.sum(np.floor((seen.column("xu") - 1.6 * FINE) / length) + 1))
        for seen in (before, end)
    ]
    stopped = end.step < settle + push.chunks * push.steps
    return {CLOGGED if stopped else FLOWING: float(through[1] - through[0])}


class Clogging(NamedTuple):
    """What runs did at one hole after their first fines, and runs that had fewer of them.

    `counts` are the escapes of each counted run, `clogs` the number of these that clogged.
    """

    counts: tuple[int, ...]
    clogs: int
    early: int

    @property
    def band(self) -> tuple[float, float, float]:
        """Probability of a clog for each fine, and its 95 % band (Clopper and Pearson 1934)."""
        both = binomtest(self.clogs, max(1, self.clogs + sum(self.counts)))
        ends = both.proportion_ci(0.95)
        return float(both.statistic), float(ends.low), float(ends.high)

    @property
    def fitted(self) -> bool:
        """At least 5 clogs, and most runs counted: the others are no sample of the flow."""
        return self.clogs >= 5 and len(self.counts) > self.early


def clogging(runs: list[tuple[int, bool]], ratio: float) -> Clogging:
    """From runs (escaped, clogged) at a hole of R.

    0.3 R^3 fines, those of the half ball over the hole, escape even under an arch; the geometric
    law, which has no memory, holds for what follows them.
    """
    skipped = math.ceil(0.6 * 2 * math.pi / 3 * (0.5 * ratio) ** 3 / (math.pi / 6))
    kept = [(escaped - skipped, clogged) for escaped, clogged in runs if escaped >= skipped]
    counts = tuple(escaped for escaped, _ in kept)
    return Clogging(counts, sum(clogged for _, clogged in kept), len(runs) - len(kept))


class Line(NamedTuple):
    """ln P = start + slope (R^2 - 1), half of the slope's 95 % band, the share of the variance
    that it explains, the chance of a larger scatter, and the holes R that count."""

    slope: float
    start: float
    band: float
    explained: float
    chance: float
    holes: tuple[float, ...]


def fitted_line(holes: Mapping[float, Clogging]) -> Line | None:
    """Least squares with the number of clogs as weight, whose inverse is the variance of ln P."""
    used = {r: one for r, one in holes.items() if one.fitted}
    if len(used) < 3:
        return None
    x, y = np.array(list(used)) ** 2 - 1, np.log([one.band[0] for one in used.values()])
    weight = np.array([float(one.clogs) for one in used.values()])
    (slope, start), cov = np.polyfit(x, y, 1, w=np.sqrt(weight), cov="unscaled")
    left = float(np.sum(weight * (y - start - slope * x) ** 2))
    spread = float(np.sum(weight * (y - np.average(y, weights=weight)) ** 2))
    chance, band = float(chi2.sf(left, len(used) - 2)), 1.96 * math.sqrt(cov[0, 0])
    return Line(float(slope), float(start), band, 1 - left / spread, chance, tuple(used))


def holes_of(rows: pd.DataFrame) -> dict[float, Clogging]:
    """The clogs of one friction by R."""
    runs = list(zip(rows.value, rows.observed.map(int), rows.quantity == CLOGGED, strict=True))
    return {
        ratio: clogging([(n, clogged) for r, n, clogged in runs if r == ratio], ratio)
        for ratio in sorted(set(rows.value))
    }


def judge_low(rows: pd.DataFrame) -> list[Finding]:
    """Below and above three diameters at low friction, and the laws of clogs."""
    source, holes = "Marin and others 2018", holes_of(rows)
    below, above = rows[rows.value < 3], {r: one for r, one in holes.items() if r >= 3}
    stopped, free = int((below.quantity == CLOGGED).sum()), holes.get(2.75)
    lines = []
    if free:
        seen = f"{stopped} of {len(below)}; none of {sum(free.counts):,} fines at 2.75"
        what = "runs that clog, R below 3, friction 0.1"
        lines.append(Finding(what, "all", source, seen, math.nan, "in part"))
    if above:
        clogs, flow = (sum(one.clogs + one.early for one in above.values()), above.values())
        seen = f"{clogs} in {sum(sum(one.counts) for one in flow):,} fines"
        lines.append(Finding("clogs, R from 3 on, friction 0.1", "0", source, seen, float(clogs)))
    return lines + _judge_laws(holes, "0.1")


def judge_high(rows: pd.DataFrame) -> list[Finding]:
    """The range in which a flow stops and starts again, and the laws of clogs."""
    holes = holes_of(rows)
    wide = [one for r, one in holes.items() if r >= 3.03]
    seen = f"{sum(one.clogs for one in wide)} clogs in {sum(sum(o.counts) for o in wide):,} fines"
    what, note = "flow, R 3.03 to 5.26, friction 0.5", "open"
    turns = Finding(what, "flows and stops by turns", "Souzy and Marin 2022", seen, math.nan, note)
    return [*([turns] if wide else []), *_judge_laws(holes, "0.5")]


def geometric_chance(counts: tuple[int, ...]) -> float:
    """How often geometric samples lie as far from their own fit (Kolmogorov and Smirnov)."""

    def distance(sample: Array) -> float:
        values, times = np.unique(sample, return_counts=True)
        shares, rate = np.cumsum(times) / len(sample), sample.mean() / (1 + sample.mean())
        before = shares - times / len(sample) - (1 - rate**values)
        return float(max(np.abs(shares - 1 + rate ** (values + 1)).max(), np.abs(before).max()))

    own, rng = distance(np.asarray(counts)), np.random.default_rng(1)
    draws = rng.geometric(1 / (1 + np.mean(counts)), (2000, len(counts))) - 1
    return float(np.mean([distance(draw) >= own for draw in draws]))


def _judge_laws(holes: Mapping[float, Clogging], friction: str) -> list[Finding]:
    """The fines before a clog follow a geometric law, and ln P is linear in R² − 1."""
    line, lines, source = fitted_line(holes), [], "Lafond and others 2013"
    every = [one.counts for one in holes.values() if 5 <= len(one.counts) == one.clogs]
    if every:
        least = min(map(geometric_chance, every))
        what = f"fines before a clog, friction {friction}"
        seen = f"chance {least:.2g}, least of {len(every)} holes"
        lines.append(Finding(what, "geometric law", source, seen, 0.05 / len(every) / least))
    if line:
        what = f"ln P of a clog, friction {friction}"
        over = max(0.05 / line.chance, (1 - line.explained) / 0.1)
        seen = f"slope −{-line.slope:.2f} ± {line.band:.2f}, explains {100 * line.explained:.0f} %"
        seen += f", chance {line.chance:.2g}"
        lines.append(Finding(what, "linear in R²", source, seen, over))
    return lines


# ---- Ergun's bed of CFDEMcoupling's tutorial ErgunTestMPI, by fdnet's losses of pressure.

DROP, LIFT = "pressure drop, Pa", "velocity that lifts the bed, m/s"


def ergun(trial: Trial) -> Seen:
    """Spheres of 1 mm in a liquid of 1.5 mPa s: 0.02 m/s through 15.6 mm, and its own weight."""
    diameter, porosity, viscosity, density, length = 1e-3, 0.451335, 1.5e-3, 10.0, straight(0.0156)
    permeability = diameter**2 * porosity**3 / (150 * (1 - porosity) ** 2)
    inertial = ergun_inertia(permeability, porosity, diameter, density)
    losses = Losses(viscous=viscosity / permeability, inertial=inertial)
    if trial.value == DROP:
        return {DROP: 0.0156 * losses.gradient(0.02)}
    weight = (1 - porosity) * (2000.0 - density) * GRAVITY
    return {LIFT: losses.velocity(0.0156 * weight, length)}


# ---- One free fine in fdnet's own invasion: it relaxes to the velocity at which forces balance.

LIQUID, SPEED = 1095.0, 0.5
OBLIQUE, GRADIENT, INERTIA = "oblique gravity", "pressure gradient", "finite Reynolds number"
PULL = {OBLIQUE: (1.2e4, -0.9e4, -2.0e4), INERTIA: (0.0, 0.0, -6e3)}


def free(trial: Trial) -> Seen:
    """Distance of the last velocity from the balance, over the slip; far from one grain."""
    pull, thin = PULL.get(trial.value), 0.1 if trial.value == INERTIA else 1.0
    tables = {
        "name": "free-fine",
        "box": {"size_mm": [3.0, 3.0, 3.0], "sides": "periodic"},
        "grains": {"radius_mm": 0.25, "porosity": 0.40},
        "fines": {"radius_mm": 1e3 * FINE, "count": 1, "density_kg_m3": DENSITY},
        "fluid": {
            "viscosity_cP": 50 * thin,
            "density_kg_m3": LIQUID,
            "velocity_m_s": SPEED,
            "darcy_law": "darcy",
        },
        "contact": {"restitution": "dry"},
        "drag": {
            "field": "uniform",
            "scheme": "held",
            "refresh_steps": 1,
            "upstream": "interstitial",
            "pressure_gradient": trial.value == GRADIENT,
            "inertia": "schiller-naumann" if trial.value == INERTIA else "none",
        },
        "gravity": {"mode": "on", "acceleration_m_s2": list(pull)} if pull else {"mode": "off"},
        "run": {"stiffness_N_m": 1e4, "duration_ms": 0.25 if trial.value == OBLIQUE else 1.0},
    }
    case = with_fines(case_from(tables))
    scales, launch = invasion_scales(case), Launch(binary=the_binary())
    lone = resting(np.array([[2.7e-3, 3e-4, 3e-4]]), GRAIN, deck.specimen_box(case), Kind.GRAIN)
    end = invade(case, scales, lone, trial.folder, launch).state.fines().velocity[0]
    share = 2 / 9 * FINE**2 * scales.porosity / scales.permeability
    slip = np.array([share * SPEED, 0.0, 0.0])
    if pull:
        slip = 2 * FINE**2 * (DENSITY - LIQUID) * np.array(pull) / (9 * VISCOSITY * thin)
    if trial.value == INERTIA:
        rate, fall = 2 * FINE * LIQUID / (VISCOSITY * thin), -float(slip[2])
        slip[2] = -brentq(lambda s: s * (1 + 0.15 * (rate * s) ** 0.687) - fall, 0.0, fall)
    off = end - [SPEED, 0.0, 0.0] - slip
    return {"error of the velocity": float(np.linalg.norm(off) / np.linalg.norm(slip))}


# ---- A fine on a slope: it rolls, slips while it rolls, or rests; its weight is the force.


def rolling_gain(slope: float, friction: float = 0.3) -> float:
    """Acceleration over g, down a slope in degrees, of a rigid sphere: 5/7 sin a, or it slips."""
    angle = math.radians(slope)
    rolls = math.tan(angle) <= 3.5 * friction
    return 5 / 7 * math.sin(angle) if rolls else math.sin(angle) - friction * math.cos(angle)


def resisted_gain(slope: float, resistance: float = 0.2) -> float:
    """5/7 (sin a - m cos a) with a coefficient m of rolling friction; 0 where it rests."""
    angle = math.radians(slope)
    return 5 / 7 * max(0.0, math.sin(angle) - resistance * math.cos(angle))


def slope(trial: Trial, *, settings: Sequence[str] = ()) -> Seen:
    """Acceleration over g of a fine that started at rest, once it is steady."""
    stiffness, steps, step = 10.0, 20_000, contact_step(FINE, 10.0, 0.1)
    rough = [f"{key}=0.3" for key in ("grains.friction", "fines.friction", "box.wall_friction")]
    case = case_of(stiffness, *rough, *settings)
    angle, weight = math.radians(trial.value), sphere_mass(FINE, DENSITY) * GRAVITY
    far = 0.5 * GRAVITY * (2 * steps * step) ** 2 + 20 * FINE
    place = [[6, -8, 0], [1 - weight * math.cos(angle) / stiffness / FINE, 0, 0]]
    box = np.array([[-10 * FINE, 10 * FINE], [-12 * FINE, far], [-10 * FINE, 10 * FINE]])
    start = resting(FINE * np.array(place), FINE, box, np.array([Kind.GRAIN, Kind.FINE]))
    force = (-weight * math.cos(angle), weight * math.sin(angle), 0.0)
    push = Push(step, steps, force=force, settle=steps, floor=True)
    first, last = (
        float(one.column("vy")[0]) for one in run_pushed(case, start, push, trial.folder)
    )
    return {"acceleration over g": (last - first) / (steps * step * GRAVITY)}


# ---- Two fines that collide head on, and a fine that falls around the neck of two grains.

LINEAR, HERTZ = "linear, damped", "Hertz, undamped"


def collision(trial: Trial) -> Seen:
    """Errors of the largest overlap, and of the restitution or the duration."""
    linear, stiffness, middle = trial.value == LINEAR, 1e4, 20 * FINE
    zeta, speed = (0.2, 5.0) if linear else (0.0, 1.0)
    law = [f"{kind}.damping_ratio={zeta}" for kind in ("grains", "fines")]
    case = case_of(stiffness, *law, *([] if linear else ["contact.model=hertz"]))
    scales, mass = scales_of(case), 0.5 * sphere_mass(FINE, DENSITY)
    step = 0.02 * scales.contacts["fine-fine"].step_limit
    apart = 2 * FINE + 2.5 * speed * step
    place = np.full((3, 3), middle)
    place[:, 0] = 2 * FINE, middle - 0.5 * apart, middle + 0.5 * apart
    place[0] = 2 * FINE
    kinds, box = np.array([Kind.GRAIN, Kind.FINE, Kind.FINE]), np.array([[0.0, 2 * middle]] * 3)
    velocity = np.array([[0.0, 0, 0], [0.5 * speed, 0, 0], [-0.5 * speed, 0, 0]])
    start = replace(resting(place, FINE, box, kinds), velocity=velocity)
    looks = run_pushed(case, start, Push(step, 1500, every=1), trial.folder)
    gap = np.array([np.ptp(look.column("xu")) for look in looks])
    if linear:
        s, omega = math.sqrt(1 - zeta**2), math.sqrt(stiffness / mass)
        deepest = speed / omega * math.exp(-zeta / s * math.atan2(s, zeta))
        turn = math.pi - math.atan2(2 * zeta * s, 1 - 2 * zeta**2)
        second = float(np.ptp(looks[-1].column("vx"))) / speed / math.exp(-zeta / s * turn) - 1
    else:
        modulus = contacts.pair_elastic(case, ("fine", "fine"), scales.stiffness_factor).modulus
        deepest = contacts.overlap_of_impact(mass, speed, modulus, 0.5 * FINE)
        lasts = contacts.collision_time(mass, speed, modulus, 0.5 * FINE)
        second = step * int(np.count_nonzero(gap < 2 * FINE)) / lasts - 1
    first = float(2 * FINE - gap.min()) / deepest - 1
    return {"error of the overlap": first, "error of restitution or duration": second}


SOFT, LAMMPS = "soft shear on a soft spring", "LAMMPS's own"
NECKS = {SOFT: (12.5, SHEAR_RATIO, 0.1), LAMMPS: (1e4, 0.8235, 0.0)}
"""Stiffness, N/m, that of shear over it, and the time step over sqrt(m/k), 0 for 1e-6 s."""


def leaving_time(stiffness: float, shear: float, step: float, folder: Path) -> float:
    """When a fine of 1/20, which is pulled off the neck of two grains, leaves it, s.

    Infinite where it is held for 0.2 s; `shear` is the tangential over the normal stiffness.
    """
    grain, fine, density, start = 5e-3, 2.5e-4, 2500.0, math.radians(1.0)
    zeta = math.log(2) / math.hypot(math.pi, math.log(2))
    own = ["friction=0.5", f"damping_ratio={zeta!r}", f"density_kg_m3={density}"]
    own += [f"shear_stiffness_N_m={2 * shear * stiffness!r}"]
    both = [f"{kind}.{part}" for kind in ("grains", "fines") for part in own]
    case = case_of(stiffness, *both, f"grains.radius_mm={1e3 * grain}", fine=fine)
    pull = sphere_mass(fine, density) * GRAVITY
    height = contacts.groove_slope(fine / grain) * grain
    top = [0, height * math.sin(start), height * math.cos(start)]
    place = [[-grain, 0, 0], [grain, 0, 0], top]
    box = np.array([[-3 * grain, 3 * grain]] * 2 + [[-3 * grain - 0.02 * GRAVITY, 3 * grain]])
    kinds = np.array([Kind.GRAIN, Kind.GRAIN, Kind.FINE])
    spheres = resting(np.array(place), np.array([grain, grain, fine]), box, kinds)
    steps = math.ceil(0.2 / step)
    push = Push(step, steps, force=(0.0, 0.0, -pull), every=max(1, steps // 400))
    for look in run_pushed(case, spheres, push, folder):
        if math.hypot(look.column("yu")[0], look.column("zu")[0]) > 1.02 * height:
            return look.step * step
    return math.inf


def neck(trial: Trial) -> Seen:
    """When the fine leaves the neck with these contacts."""
    stiffness, shear, factor = NECKS[trial.value]
    step = factor * math.sqrt(sphere_mass(2.5e-4, 2500.0) / stiffness) or 1e-6
    return {"leaves after, s": leaving_time(stiffness, shear, step, trial.folder)}


def draw_clogs(axes: Any, rows: pd.DataFrame) -> None:
    """Probability that the next fine clogs a hole, with its 95 % band, by R² − 1."""
    for friction, colour in ((0.1, BLUE), (0.5, ORANGE)):
        own = rows[rows.comparison == f"constriction, friction {friction}"]
        holes = {ratio: one for ratio, one in holes_of(own).items() if sum(one.counts)}
        for ratio, one in holes.items():
            chance, low, high = one.band
            seen = [ratio**2 - 1], [chance or high]
            off = [[chance - low], [high - chance]] if chance else None
            marker = "v" if not chance else "o" if one.fitted else "x"
            axes.errorbar(*seen, off, fmt=marker, color=colour, mfc="none")
        line = fitted_line(holes)
        if line:
            along = np.array(line.holes) ** 2 - 1
            axes.plot(along, np.exp(line.start + line.slope * along), color=colour)
        axes.plot([], [], "o-", color=colour, mfc="none", label=f"friction {friction}")
    axes.axvline(8.0, color=BLACK, ls="--", label="R = 3: below it clogs (Marin 2018)")
    axes.set(
        yscale="log",
        ylim=(1e-6, 1),
        xlabel="R² − 1, R the hole over the fine",
        ylabel="clogs per fine",
    )
    axes.set_title("o fitted, x too few, v none seen (upper bound)", fontsize=9)
    axes.legend(fontsize=8, loc="upper right")


CHAPTER = chapter_of(Path(__file__).with_suffix(".toml"), globals(), draw_clogs)


def main(arguments: list[str]) -> int:
    """The command `validation.py outside`."""
    return command("outside", CHAPTER, arguments)
