"""The dense pack of grains (thesis, appendix A).

Small spheres are put at random, grown in stages, and relaxed until they are at rest.
"""

import json
import math
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem import deck
from fdnet.dem.deck import Deck, LeftOut, number
from fdnet.dem.liggghts import SCREEN, Execution, Launch, run_deck
from fdnet.errors import CaseError, DumpError, LiggghtsError
from fdnet.scales.contacts import restitution_of, sphere_mass
from fdnet.scales.pack import (
    PACK_RELAX_STEPS,
    PACK_STAGE_STEPS,
    PACK_STAGES,
    PACK_START,
    PACK_STEP,
    POROSITY_TOLERANCE,
    densest_porosity,
    grain_count,
    pack_step,
    reach_text,
    target_porosity,
    within_limit,
)
from fdnet.scales.scales import packing_scales
from fdnet.spheres.dump import COLUMNS, FORMAT, read_frame
from fdnet.spheres.geometry import max_overlap, measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot, resting

PACK_DAMPING = 0.4 / math.sqrt(2)
"""Damping of two grains over the critical one: 0.8 sqrt(k/m) of their joint mass m/2."""
RELAX_RUN_STEPS = 2500  # Steps between two tests for rest
RADIUS_TOLERANCE = 1e-9  # Largest relative difference by the rounding of the stages of growth
REST_RUNS = 4 * PACK_RELAX_STEPS // RELAX_RUN_STEPS  # Most tests for rest


def write_pack_inputs(case: Case, folder: Path, *, count: int, places: int = 0) -> Deck:
    """Write in.pack and pack.data, `count` small spheres at random, into `folder`.

    `places` numbers the sets of random places that the same grains may start from.
    """
    made = render_pack(case, count=count)
    (folder / "in.pack").write_text(made.text)
    radii, box = draw_radii(case, count), deck.specimen_box(case)
    rng = np.random.default_rng([case.seed, count, *([places] if places else [])])
    small, size = PACK_START * radii, np.array(case.size_m)
    sides = 0.0 if case.box.sides == "periodic" else 1.0
    margin = small[:, None] * np.array([1.0, sides, sides])
    place = margin + rng.random((count, 3)) * (size - 2 * margin)
    density = np.full(count, case.grains.density_kg_m3)
    seeds = resting(place, small, box)
    deck.write_data(folder / "pack.data", seeds, bounds=box, density=density, types=2)
    return made


def draw_radii(case: Case, count: int) -> Array:
    """`count` radii (N,) m.

    Of a measured curve they are its strata in random order. Of a range they are uniform by number,
    the last one chosen so that the sum of volumes comes as near to the expected one as it can.
    """
    if case.grains.measured:
        order = np.random.default_rng([case.seed, 7]).permutation(count)
        return 0.5 * case.grains.curve.strata(count)[order]
    low, high = case.grains.radius_range_m
    radii = np.random.default_rng([case.seed, 7]).uniform(low, high, count)
    if low < high and count > 1:
        wanted = count * case.grains.mean_volume_m3 - 4 / 3 * math.pi * np.sum(radii[:-1] ** 3)
        radii[-1] = np.clip(np.cbrt(max(wanted, 0.0) * 3 / (4 * math.pi)), low, high)
    return radii


def check_radii(grains: Snapshot, case: Case, path: Path) -> None:
    """Raise DumpError unless the grains read from `path` have the radii that the case asks for."""
    asked = draw_radii(case, len(grains))
    wrong = np.flatnonzero(np.abs(grains.radius - asked) > RADIUS_TOLERANCE * asked)
    if len(wrong):
        first = wrong[0]
        raise DumpError(
            f"{path}: {len(wrong)} of {len(grains)} grains have another radius than the case asks "
            f"for, the first (id {grains.id[first]:.0f}) {grains.radius[first]:.9g} m, expected "
            f"{asked[first]:.9g} m; the file was changed, or it is the pack of another case: "
            "start over with --force"
        )


def render_pack(case: Case, *, count: int) -> Deck:
    """The packing deck: soft springs without friction, viscous damping, growth, test for rest."""
    scales = packing_scales(case)
    contact = scales.contacts["grain-grain"]
    stiffness = contact.normal_stiffness
    low, high = case.grains.radius_range_m
    mass = sphere_mass(low, case.grains.density_kg_m3)
    left_out = [
        LeftOut("friction and tangential history", "grains are packed frictionless"),
        LeftOut("gravity", "only the geometry of the pack is wanted"),
        LeftOut("fines and fluid", "the pack is made before the invasion"),
        LeftOut("MPI processor grid", "one rank"),
    ]
    contacts = deck.contact_variables(case, scales, "pack", friction=False)
    damping = ("damping", 0.8 * math.sqrt(stiffness / mass))
    if case.contact.model == "hertz":
        damping = ("restitution", restitution_of(PACK_DAMPING))
    contacts[damping[0]] = " ".join([number(damping[1])] * contacts["size"] ** 2)
    text = deck.render_text(
        "pack.in.j2",
        deck.header_variables(case, "pack", left_out, 1)
        | {
            "skin": number(0.4 * low),
            "contacts": contacts,
            "walls": deck.wall_variables(case, "pack", friction=False),
            "time_step": number(pack_step(case, contact)),
            "viscous": number(0.03 * math.sqrt(stiffness * mass)),
            "thermo_steps": RELAX_RUN_STEPS,
            "density": number(case.grains.density_kg_m3),
            "stages": [
                number((PACK_START + (1 - PACK_START) * s / PACK_STAGES) / PACK_START)
                for s in range(1, PACK_STAGES + 1)
            ],
            "stage_steps": PACK_STAGE_STEPS,
            "relax_runs": REST_RUNS,
            "relax_steps": RELAX_RUN_STEPS,
            "rest_energy": number(count * 1e-10 * 0.5 * stiffness * (0.02 * high) ** 2),
            "dump_columns": COLUMNS,
            "dump_format": FORMAT,
        },
    )
    return Deck(text, tuple(left_out))


# ---- Packs are made until one has the porosity that is asked for.
ATTEMPTS = 8  # Most packs with different numbers of grains that are tried
PLACES = 4
"""Most sets of random places from which the same grains are packed, when they do not come to
rest."""
MOST_CREEP = 1e-5
"""Root-mean-square speed, in grain diameters per sqrt(m/k), up to which a creeping pack is
accepted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """A pack at rest, or nearly."""

    grains: Snapshot
    porosity: float  # overlaps counted once
    porosity_error: float  # its standard error
    porosity_sum: float  # by the plain sum of the spheres' volumes
    max_overlap: float  # largest overlap of two grains over the smaller diameter
    steps: int  # of the last attempt
    step_s: float  # s, time step
    attempts: tuple[dict[str, Any], ...]  # one row for each number of grains that was tried
    left_out: tuple[LeftOut, ...]  # what the deck does without
    run: Execution  # the execution of LIGGGHTS that made it
    # m/s, root-mean-square speed of grains that never came to rest; 0 for a pack at rest
    creep: float
    # packs that did not come to rest, before others from the next random places did
    restless: int = 0


class RestlessError(LiggghtsError):
    """The grains never came to rest."""


def make_pack(case: Case, folder: Path, launch: Launch) -> Pack:
    """Pack with different numbers of grains until the porosity is within 0.003 of the target.

    LIGGGHTS runs on one rank: on others the sums are taken in another order, which makes another
    sand of the same seed.

    Raises CaseError when the porosity cannot be reached, LiggghtsError when a run fails or does
    not come to rest.
    """
    folder.mkdir(parents=True, exist_ok=True)
    count, target, launch = grain_count(case), target_porosity(case), replace(launch, ranks=1)
    tried: list[dict[str, Any]] = []
    while True:
        attempt = folder / f"attempt_{len(tried) + 1}"
        pack = _at_rest(case, attempt, launch, count=count)
        names = "porosity", "porosity_error", "max_overlap", "restless"
        row = {"grains": len(pack.grains)} | {name: getattr(pack, name) for name in names}
        spent = {"liggghts_s": pack.run.seconds, "liggghts_cpu_s": pack.run.cpu_seconds}
        tried.append(row | spent)
        _refuse_overlap(case, pack)
        off = abs(pack.porosity - target) + pack.porosity_error
        if case.grains.count is not None or off <= POROSITY_TOLERANCE:
            break
        count = _next_count(case, target, tried)
        shutil.rmtree(attempt)
    for path in attempt.iterdir():
        final = folder / path.name
        if final.is_dir():
            shutil.rmtree(final)
        path.replace(final)
    attempt.rmdir()
    (folder / "attempts.json").write_text(json.dumps(tried, indent=1) + "\n")
    return replace(pack, attempts=tuple(tried), run=replace(pack.run, directory=folder))


def _refuse_overlap(case: Case, pack: Pack) -> None:
    if pack.max_overlap <= case.grains.max_overlap:
        return
    rigid, can_be = densest_porosity(case.grains), ""
    if pack.porosity < rigid:
        limit = within_limit(rigid, pack.porosity, pack.max_overlap, case.grains.max_overlap)
        can_be = f"{reach_text(rigid)}, and about {limit:.2f} within the limit: "
    raise CaseError(
        f"{_asked(case)} needs grains that overlap by {100 * pack.max_overlap:.1f} % of a "
        f"diameter (limit grains.max_overlap {case.grains.max_overlap:g}); "
        f"{can_be}take a looser pack or raise the limit"
    )


def _asked(case: Case) -> str:
    """The key that sets the number of grains, and its value."""
    grains = case.grains
    count = grains.count
    return f"grains.porosity: {grains.porosity}" if count is None else f"grains.count: {count}"


def _next_count(case: Case, target: float, tried: list[dict[str, Any]]) -> int:
    """The number of grains to try next.

    First one step of Newton's method on the plain sum of volumes, then the secant through the two
    attempts that are nearest to the target.
    """
    grain = case.grains.mean_volume_m3 / math.prod(case.size_m)
    nearest = sorted(tried, key=lambda row: abs(row["porosity"] - target))
    slope, best = -grain, nearest[0]
    if len(nearest) > 1 and best["grains"] != nearest[1]["grains"]:
        secant = best["porosity"] - nearest[1]["porosity"]
        secant /= best["grains"] - nearest[1]["grains"]
        slope = min(max(secant, -1.5 * grain), -0.4 * grain)
    guess = round(best["grains"] + (target - best["porosity"]) / slope)
    done = {row["grains"] for row in tried}
    near = (guess, guess + 1, guess - 1, guess + 2, guess - 2)
    around = [count for count in near if count > 0 and count not in done]
    if not around or len(tried) >= ATTEMPTS:
        raise CaseError(
            f"grains.porosity: {target} not met within {POROSITY_TOLERANCE} after {len(tried)} "
            f"packs, nearest {best['porosity']:.4f} with {best['grains']} grains (one grain is "
            f"{grain:.4f}); use a larger box, another seed, or give grains.count"
        )
    return around[0]


def _at_rest(case: Case, folder: Path, launch: Launch, *, count: int) -> Pack:
    """A pack of `count` grains, from the next random places where it does not come to rest.

    Raises RestlessError when it does not after `PLACES` of them.
    """
    for places in range(PLACES):
        try:
            return _attempt(case, folder, launch, count=count, places=places)
        except RestlessError as error:
            last = error
    raise RestlessError(f"{last} (tried {PLACES} times from other places)") from last


def _attempt(case: Case, folder: Path, launch: Launch, *, count: int, places: int) -> Pack:
    if folder.exists():
        shutil.rmtree(folder)
    (folder / "post").mkdir(parents=True)
    made = write_pack_inputs(case, folder, count=count, places=places)
    step = pack_step(case, packing_scales(case).contacts["grain-grain"])
    try:
        run = run_deck(folder, "in.pack", launch)
    except LiggghtsError as error:
        if "Lost atoms" not in str(error):
            raise
        raise CaseError(
            f"{_asked(case)} makes {count} grains, too many for the box: some were pushed out "
            "of it while growing; raise the porosity, lower the count or enlarge the box"
        ) from error
    dump = folder / "post" / "pack.dump"
    frame = read_frame(dump)
    grains = deck.snapshot_of(frame, case, time_s=0.0)
    restless = "FDNET restless" in (folder / SCREEN).read_text("utf-8", errors="replace")
    creep = creep_of(case, step, folder, grains) if restless else 0.0
    if len(grains) != count:
        raise LiggghtsError(f"{dump}: {len(grains)} grains, expected {count}: some were lost")
    check_radii(grains, case, dump)
    porosity = measure_porosity(grains, periodic=case.periodic)
    return Pack(
        grains=grains,
        porosity=porosity.mean,
        porosity_error=porosity.standard_error,
        porosity_sum=porosity.sum,
        max_overlap=max_overlap(grains, case.periodic),
        steps=frame.step,
        step_s=step,
        attempts=(),
        left_out=made.left_out,
        run=run,
        creep=creep,
        restless=places,
    )


def creep_of(case: Case, step: float, folder: Path, grains: Snapshot) -> float:
    """Root-mean-square speed, m/s, of grains that never came to rest.

    A pack that is barely jammed has such soft modes. Raises RestlessError above `MOST_CREEP` grain
    diameters per sqrt(m/k).
    """
    speed = float(np.sqrt(np.mean(np.sum(grains.velocity**2, axis=1))))
    natural = 2 * case.grains.mean_radius_m * PACK_STEP / step
    if speed > MOST_CREEP * natural:
        raise RestlessError(
            f"{folder}: the pack did not come to rest in {REST_RUNS * RELAX_RUN_STEPS} steps, its "
            f"grains still move at {speed:.3g} m/s (limit {MOST_CREEP * natural:.3g}); take "
            "another seed or porosity"
        )
    return speed
