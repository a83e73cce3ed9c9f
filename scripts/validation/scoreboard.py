"""The scoreboard: published experiments and outside numbers, a row each, with what fdnet gives.

    python scripts/validation.py scoreboard [--quick] [--only ROW] [--out DIR] [--rows FILE.csv]

The rows of all runs are in docs/validation/scoreboard.csv, the answer in
docs/evidence/scoreboard.md. Nothing here is fitted to a row.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree
from scipy.stats import binomtest, spearmanr
from scipy.stats import t as student

from fdnet.case.file import case_from
from fdnet.classes.capture import HAMAKER, Bed, collector_efficiency
from fdnet.network.field.field import velocity_field
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.network import build_network
from fdnet.network.permeability import analyse
from fdnet.network.states import all_conductances
from fdnet.network.stokes import extrapolate, solve_stokes
from fdnet.run.pipeline import run_case
from fdnet.scales.contacts import sphere_mass
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot, resting
from validation import mechanics, outside, truth
from validation.comparisons import (
    BLACK,
    BLUE,
    ORANGE,
    Finding,
    Trial,
    chapter_of,
    command,
    findings,
    read_rows,
)
from validation.outside import single_fines
from validation.truth import MM
from validation.truth_solved import Recipe, random_grains, relaxed

Seen = Mapping[str, float]
DOCS = Path(__file__).resolve().parents[2] / "docs"

# ---- Row 1. Single fines that a pack holds: equal grains, and sand between two sieves.

GRAIN_MM, SIEVES_MM = 0.5, (0.42, 0.84)
"""Diameters of the equal grains, and of the openings of sieves 40 and 20."""
EFFECTIVE_MM = SIEVES_MM[0] + 0.1 * (SIEVES_MM[1] - SIEVES_MM[0])
"""D10 by weight of sand whose sizes are uniform by volume between the sieves."""
SOLID = 0.6
"""Volume of grains over that of the box: as dense as packs between two end walls come without
overlap."""
LENGTHS = {"equal": (3.0, 1.6), "sieved": (3.8, 2.6)}
"""Length and side of the packs, mm."""


def filtered(trial: Trial) -> Seen:
    """Fines held and supplied; `value` is "SAND, friction F, D/d" and may end in ", fine step"."""
    sand, friction, ratio, *fine_step = trial.value.split(", ")
    length, side = LENGTHS[sand]
    grain, (low, high) = GRAIN_MM, SIEVES_MM
    each = sphere_mass(0.5 * grain, 1.0)
    keys: dict[str, Any] = {"radius_mm": 0.5 * grain}
    if sand == "sieved":
        edges, percent = np.linspace(low, high, 13), np.linspace(0.0, 100.0, 13)
        curve = {"size_mm": edges.tolist(), "passing_percent": percent.tolist()}
        keys = {"sizes": curve | {"cut_percent": [0.0, 100.0]}}
        # one over the mean of 1 / volume by volume
        grain, each = EFFECTIVE_MM, math.pi / 3 * (high - low) / (low**-2 - high**-2)
    return single_fines(
        trial,
        keys | {"count": round(SOLID * length * side**2 / each)},
        (length, side),
        fine=0.5 * grain / float(ratio),
        fines=30 if trial.quick else 200,
        friction=float(friction.removeprefix("friction ")),
        stiffness=1e3,
        step=0.05 if fine_step else 0.2,
    )


def shares(rows: pd.DataFrame, start: str) -> dict[float, tuple[int, int]]:
    """Fines held and supplied, all seeds together, by D/d of the values that begin so."""
    own = rows[rows.value.astype(str).str.startswith(start)]
    sums = own.pivot_table(index="value", columns="quantity", values="observed", aggfunc="sum")
    sums = sums[~sums.index.astype(str).str.endswith("step")]
    every = {
        float(str(name).removeprefix(start)): (round(one["held"]), round(one["supplied"]))
        for name, one in sums.iterrows()
    }
    return dict(sorted(every.items()))


def band_of(held: int, fines: int) -> tuple[float, float]:
    """95 % band of a share (Clopper and Pearson 1934)."""
    band = binomtest(held, fines).proportion_ci(0.95)
    return float(band.low), float(band.high)


def judge_filtered(rows: pd.DataFrame) -> list[Finding]:
    """Shares held at the two ends of the published changeover."""
    lines, source = [], "Wu and Sharma 2017"
    for sand, friction, wide, narrow in (
        ("equal", 0.1, 4.5, 6.6),
        ("equal", 0.5, 4.5, 6.6),
        ("sieved", 0.1, 5.3, 10.0),
        ("sieved", 0.5, 5.3, 10.0),
    ):
        every = shares(rows, f"{sand}, friction {friction}, ")
        for ratio, all_held in ((wide, True), (narrow, False)):
            if ratio not in every:
                continue
            held, fines = every[ratio]
            low, high = band_of(held, fines)
            of = "D" if sand == "equal" else "D10"
            what = f"1: {NAMED[sand]} {of}/{ratio:g}, friction {friction}"
            seen = f"{held / fines:.3f}, {low:.3f} to {high:.3f}, in {LENGTHS[sand][0]} mm"
            over = (1 - high) / 0.01 if all_held else low / 0.01
            number = "1 (99 % or more)" if all_held else "0 (at most 1 %)"
            lines.append(Finding(what, number, source, seen, over))
    return lines


NAMED = {"equal": "equal spheres hold", "sieved": "20-40 mesh sand holds"}

# ---- Rows 6 and 7. What single grains catch: the closed form, and tracers in resolved flow.

PAPER = Bed(diameter=5e-4, porosity=0.40, velocity=1.4e-4, viscosity=1e-3, density=998.0)
"""The paper's example, at 293 K and 1e-20 J."""


def happel(porosity: float) -> float:
    """A_s = 2 (1 - g^5) / (2 - 3 g + 3 g^5 - 2 g^6), g^3 = 1 - porosity (Happel 1958)."""
    g = (1.0 - porosity) ** (1.0 / 3.0)
    return 2.0 * (1.0 - g**5) / (2.0 - 3.0 * g + 3.0 * g**5 - 2.0 * g**6)


def efficiency(diameter: float, density: float, bed: Bed) -> float:
    """Single-collector contact efficiency by the law of the size classes."""
    return float(collector_efficiency(np.array([diameter]), np.array([density]), bed)[0])


def by_interception(diameter: float, bed: Bed) -> float:
    """Its part 0.55 A_s N_R^1.675 N_A^0.125; the attraction number takes the fine's radius."""
    attraction = HAMAKER / (3.0 * math.pi * bed.viscosity * diameter**2 * bed.velocity)
    return 0.55 * happel(bed.porosity) * (diameter / bed.diameter) ** 1.675 * attraction**0.125


def collected(trial: Trial) -> Seen:
    """A_s and the efficiency of the paper's example."""
    return {"A_s": happel(PAPER.porosity), "eta": efficiency(1e-6, 1050.0, PAPER)}


NEAR, SHORTEST, LONGEST = 0.3, 0.002, 0.03
"""Length of a tracer's step: a share of the way to the nearest grain, between two shares of D."""


def intercepted(trial: Trial) -> Seen:
    """Share of the flow through a grain's section whose tracers of `value` D touch a grain.

    Tracers start on the face of a periodic cube of equal grains in proportion to the flux and
    follow the resolved flow through it; passed = exp(-1.5 (1 - porosity) eta length / D).
    """
    grains, cells, count = (40, 8.0, 3000) if trial.quick else (80, 14.0, 10_000)
    pack = random_grains(Recipe(seed=trial.seed, grains=grains, porosity=0.40))
    field = velocity_field(pack, periodic="xyz", cells=cells)
    edge, radius = float(np.ptp(pack.box[0])), float(pack.radius.mean())
    tree = cKDTree((pack.position - pack.box[:, 0]) % edge, boxsize=edge)
    touch, rng = float(trial.value) * radius, np.random.default_rng(trial.seed)

    def gap(points: Array) -> Array:
        return np.asarray(tree.query((points - pack.box[:, 0]) % edge)[0]) - radius

    def ahead(points: Array) -> Array:
        flow = field.at(points)
        return flow / np.maximum(np.linalg.norm(flow, axis=1), 1e-300)[:, None]

    tried = pack.box[:, 0] + edge * rng.random((20 * count, 3)) * [0.0, 1.0, 1.0]
    flux = np.where(gap(tried) > touch, field.at(tried)[:, 0], 0.0)
    place = tried[flux > flux.max() * rng.random(len(tried))][:count]
    start, moving, stuck = place[:, 0].copy(), np.arange(len(place)), 0
    for _ in range(20_000):
        if not len(moving):
            break
        here = place[moving]
        step = np.clip(NEAR * gap(here), 2 * radius * SHORTEST, 2 * radius * LONGEST)[:, None]
        place[moving] = here + step * ahead(here + 0.5 * step * ahead(here))
        caught = gap(place[moving]) < touch
        stuck += int(caught.sum())
        moving = moving[~caught & (place[moving, 0] - start[moving] < edge)]
    layer = 2.0 * radius / (1.5 * 0.60 * edge)
    return {
        "eta": -math.log(1.0 - stuck / len(place)) * layer,
        "tracers": float(len(place)),
        "unfinished": float(len(moving)),
    }


def judge_collected(rows: pd.DataFrame) -> list[Finding]:
    """The paper's example, to its digits; its part by interception beside tracers of row 7."""
    lines, source = [], "Tufenkji and Elimelech 2004"
    for quantity, what, number, within in (
        ("A_s", "A_s at porosity 0.40", 37.98, 0.005),
        ("eta", "η₀ of 1 µm in 0.5 mm, 1.4e-4 m/s", 3.05e-3, 0.005e-3),
    ):
        own = rows[(rows.comparison == "6") & (rows.quantity == quantity)]
        if len(own):
            given = float(own.observed.iloc[0])
            over = (given - number) / within
            lines.append(Finding(f"6: {what}", f"{number:.4g}", source, f"{given:.5g}", over))
    caught = rows[(rows.comparison == "7") & (rows.quantity == "eta")]
    caught = caught[caught.value.astype(float) == 0.02]
    if len(caught):
        law = by_interception(0.02 * PAPER.diameter, PAPER)
        mean, half = mean_band(caught.observed / law)
        what = "6: tracers of 0.02 D over η₀'s interception"
        seen, over = (
            f"{mean:.2f} ± {half:.2f}, {len(caught)} packs",
            math.log(mean) / math.log(1.5),
        )
        lines.append(Finding(what, "1, within a factor of 1.5", source, seen, over))
    return lines


def judge_intercepted(rows: pd.DataFrame) -> list[Finding]:
    """Tracers over Happel's cell, with the band of the mean over the packs."""
    lines = []
    for value in (0.02, 0.01):
        own = rows[(rows.quantity == "eta") & (rows.value == value)]
        if own.empty:
            continue
        law = 1.5 * happel(0.40) * value**2
        mean, half = mean_band(own.observed / law)
        what = f"7: tracers of {value:g} D over 1.5 A_s (d/D)²"
        seen = f"{mean:.2f} ± {half:.2f}, {len(own)} packs"
        source, over = "Happel 1958, Yao and others 1971", math.log(mean) / math.log(1.5)
        lines.append(Finding(what, "1, within a factor of 1.5", source, seen, over))
    return lines


def mean_band(values: Any) -> tuple[float, float]:
    """Mean, and half of its 95 % band by Student's law (nan of one value)."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return float(values.mean()), math.nan
    half = student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return float(values.mean()), float(half)


# ---- Row 8. Single cells of the three cubic lattices of touching spheres.

LATTICES = {
    "SC": ([[0.0, 0, 0]], 0.5, 42.1),
    "BCC": ([[0.0, 0, 0], [0.5, 0.5, 0.5]], math.sqrt(3) / 4, 162.9),
    "FCC": ([[0.0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]], math.sqrt(2) / 4, 435.0),
}
"""Centres and radius over the edge of the cell, and drag over 6 pi mu r U (table 2)."""


def lattice(trial: Trial) -> Seen:
    """K = 2 r^2 / (9 c k), with the solid fraction c, by the network and by resolved flow."""
    places, radius, _ = LATTICES[trial.value]
    cell = resting(np.array(places) + 0.25, radius, np.array([[0.0, 1.0]] * 3))
    cell_mm = resting(cell.position * MM, radius * MM, cell.box * MM)
    solid = len(places) * 4.0 / 3.0 * math.pi * radius**3
    network = analyse(cell_mm, periodic="xyz").k_initial / MM**2
    grids = (24, 36) if trial.quick else {"SC": (32, 48)}.get(trial.value, (48, 64))
    k = extrapolate(*(solve_stokes(cell, cells=n) for n in grids)).k
    drag = 2.0 * radius**2 / (9.0 * solid)
    return {"network": drag / network, "resolved": drag / k}


def judge_lattice(rows: pd.DataFrame) -> list[Finding]:
    """Each K over that of the table."""
    lines = []
    for name, (_, _, number) in LATTICES.items():
        own = rows[rows.value == name].set_index("quantity").observed
        if len(own):
            seen = f"network {own['network']:.1f}, resolved {own['resolved']:.1f}"
            off = max(abs(own["network"] / number - 1), abs(own["resolved"] / number - 1))
            what, source = f"8: drag K of one cell of {name}", "Zick and Homsy 1982"
            lines.append(Finding(what, f"{number:g} ± 2 %", source, seen, off / 0.02))
    return lines


# ---- Row 9. Equal spheres with the surface and porosity of the sand pack LV60A.

SURFACE, IMAGED = 57670.0 / 1.5, 0.377
"""Surface over pore volume, 1/m, and porosity of an image of LV60A (Talabi 2008, table 7-1; the
faces of voxels are 1.5 times the surface)."""


def surface_pack(trial: Trial) -> Seen:
    """k, D, of a random pack of equal spheres with that surface, of porosity 0.368."""
    diameter = 6.0 * (1.0 - IMAGED) / (IMAGED * SURFACE)
    pack = random_grains(Recipe(seed=trial.seed, grains=150, porosity=0.368))
    k = analyse(pack, periodic="xyz").k_initial
    return {"k, D": k * (diameter / (2 * pack.radius.mean())) ** 2 / 9.869233e-13}


def judge_surface(rows: pd.DataFrame) -> list[Finding]:
    """A statement: the grains of the sand are no spheres."""
    if rows.empty:
        return []
    mean, half = mean_band(rows.observed)
    what = "9: LV60A, spheres of its surface, k in D"
    seen = f"{mean:.1f} ± {half:.1f}, {len(rows)} packs"
    note = "cannot be tried yet: its grains are an image, not spheres"
    return [Finding(what, "36.6", "Talabi 2008", seen, math.nan, note)]


# ---- Row 10. Large beads in a bed of small ones.


def mixed(ratio: float, large: int, seed: int, *, solid: float, among: float) -> Snapshot:
    """A periodic cube of `large` equal spheres of 1 mm, and small ones of 1/`ratio` between them.

    `solid` is the volume of the large ones over the cube's, `among` that of the small ones over
    what is left. Small ones start at random and are pushed apart until none overlaps by 3 % of
    its radius.
    """
    rng, radius = np.random.default_rng(seed), 0.5
    small = radius / ratio
    edge = float((large * 4 / 3 * math.pi * radius**3 / solid) ** (1 / 3))
    beads = relaxed(np.full(large, radius), edge, rng.random((large, 3)) * edge)
    count = round(among * (1 - solid) * edge**3 / (4 / 3 * math.pi * small**3))
    tree, place = cKDTree(beads, boxsize=edge), np.empty((0, 3))
    while len(place) < count:
        tried = rng.random((count, 3)) * edge
        place = np.vstack([place, tried[tree.query(tried)[0] > radius + small]])[:count]
    for _ in range(3000):
        pairs = cKDTree(place, boxsize=edge).query_pairs(2 * small, output_type="ndarray")
        apart = place[pairs[:, 0]] - place[pairs[:, 1]]
        apart -= edge * np.round(apart / edge)
        distance = np.linalg.norm(apart, axis=1)
        push = (0.5 * (2 * small - distance) / distance)[:, None] * apart
        away, near = tree.query(place)
        inside = np.flatnonzero(away < radius + small)
        off = place[inside] - beads[near[inside]]
        off -= edge * np.round(off / edge)
        deepest = max(
            float(np.max(2 * small - distance, initial=0.0)),
            float(np.max(radius + small - away, initial=0.0)),
        )
        if deepest < 0.03 * small:
            break
        np.add.at(place, pairs[:, 0], push)
        np.add.at(place, pairs[:, 1], -push)
        place[inside] += ((radius + small - away[inside]) / away[inside])[:, None] * off
        place %= edge
    every = np.concatenate([np.full(large, radius), np.full(count, small)])
    box = np.array([[0.0, edge * MM]] * 3)
    return resting(np.vstack([beads, place]) * MM, every * MM, box)


def tortuosity(trial: Trial) -> Seen:
    """-ln tau / ln porosity of a mix: by k, and by the ways through the network's throats.

    By k, tau^2 = d^2 eps^3 / (72 k (1 - eps)^2) with the surface mean diameter d, which is Kozeny
    and Carman's law with 2 for the shape of the pores. The ways: sum |q| l / sum q l_x.
    """
    large, ratio = (2, 6.0) if trial.quick else (4, float(trial.value))
    pack = mixed(ratio, large, trial.seed, solid=0.4, among=0.55)
    network = build_network(pack, periodic="xyz", walls="slip")
    k, flow = whole_permeability(network, all_conductances(network))
    eps = measure_porosity(pack, periodic=(True,) * 3).mean
    mean = 2 * float(np.sum(pack.radius**3) / np.sum(pack.radius**2))
    by_k = math.sqrt(mean**2 * eps**3 / (72 * k * (1 - eps) ** 2))
    first, second = network.pore_position[network.throat_pores.T]
    way = second + network.throat_shift * np.ptp(network.box, axis=1) - first
    flux = np.nan_to_num(flow.throat_flux)
    ways = float(np.abs(flux) @ np.linalg.norm(way, axis=1) / abs(flux @ way[:, 0]))
    power = 1.0 / -math.log(eps)
    return {
        "porosity": eps,
        "n by k": math.log(by_k) * power,
        "n by ways": math.log(ways) * power,
        "spheres": float(len(pack)),
    }


def judge_tortuosity(rows: pd.DataFrame) -> list[Finding]:
    """The power by both ways, with the bands of the means over the packs."""
    lines = []
    for quantity, label in (("n by ways", "ways"), ("n by k", "k")):
        own = rows[(rows.quantity == quantity) & (rows.value > 10)]
        for value, some in own.groupby("value"):
            mean, half = mean_band(some.observed)
            what = f"10: beads {value:g} to 1, n of ε⁻ⁿ by {label}"
            seen, over = f"{mean:.3f} ± {half:.3f}, {len(some)} packs", (mean - 0.45) / 0.05
            lines.append(Finding(what, "0.4 to 0.5", "Dias and others 2008", seen, over))
    return lines


# ---- Row 14. What a deposit costs, by its share of the bed's volume.


def ball_between(place: Array, radius: Array, low: float, high: float) -> Array:
    """Volume (N,) m3 of balls with centres at `place` (N,) along x between two planes."""

    def below(plane: float) -> Array:
        height = np.clip(plane - place, -radius, radius)
        return math.pi * (radius**2 * height - height**3 / 3)

    return np.asarray(below(high) - below(low))


def deposits() -> pd.DataFrame:
    """D/d, sigma and gamma = ((k/k0)^-1/2 - 1) / sigma of all slabs of known k/k0."""
    made = []
    for slab in truth.slabs():
        spheres = truth.read_pack(slab.specimen)
        fines, area = spheres.fines(), float(np.prod(np.ptp(spheres.box, axis=1)[1:]))
        volume = ball_between(fines.position[:, 0], fines.radius, *slab.planes).sum()
        sigma = float(volume) / (area * (slab.planes[1] - slab.planes[0]))
        ratio = round(float(spheres.grains().radius.mean() / fines.radius.mean()))
        made.append((slab.name, ratio, sigma, (slab.ratio**-0.5 - 1.0) / sigma))
    return pd.DataFrame(made, columns=["slab", "ratio", "sigma", "gamma"])


def clogging_number(trial: Trial) -> Seen:
    """Quartiles of gamma of the slabs with D/d = `value`, and its rank correlation with sigma."""
    own = deposits()
    own = own[own.ratio == trial.value]
    low, middle, high = own.gamma.quantile([0.25, 0.5, 0.75])
    rank = spearmanr(own.sigma, own.gamma)
    seen = {"slabs": float(len(own)), "gamma, median": middle, "gamma, lower quartile": low}
    seen |= {"gamma, upper quartile": high, "rank correlation": float(rank.statistic)}
    return seen | {"chance of it": float(rank.pvalue)}


def judge_clogging_number(rows: pd.DataFrame) -> list[Finding]:
    """One gamma for a size ratio, or one that grows with the deposit."""
    lines = []
    for value, own in rows.groupby("value"):
        seen = own.set_index("quantity").observed
        what = f"14: γ of fines of D/{value:g} at all σ"
        says = f"{seen['gamma, median']:.1f}, {seen['gamma, lower quartile']:.1f} to "
        says += f"{seen['gamma, upper quartile']:.1f} (half of {seen['slabs']:.0f} slabs); "
        says += f"rank correlation with σ {seen['rank correlation']:.2f}"
        over = (
            0.05 / rows.value.nunique() / seen["chance of it"]
            if seen["rank correlation"] > 0
            else 0.0
        )
        lines.append(Finding(what, "k/k₀ = (1 + γσ)⁻², one γ", "Mays and Hunt 2005", says, over))
    return lines


# ---- Rows that other commands keep.


def nothing(trial: Trial) -> Seen:
    """A row that is read has no values to measure."""
    return {}


@cache
def kept(name: str) -> tuple[Finding, ...]:
    """The lines of a chapter's kept rows, in docs/validation."""
    chapter = {"outside": outside, "mechanics": mechanics}[name].CHAPTER
    rows = read_rows(DOCS / "validation" / f"{name}.csv")
    return tuple(findings(chapter.comparisons, rows[rows.status == "done"]))


def numbered(row: int, name: str, *sources: str) -> list[Finding]:
    """The kept lines of these sources, with the number of their row."""
    lines = [line for line in kept(name) if line.source.startswith(sources)]
    return [line._replace(what=f"{row}: {line.what}") for line in lines]


def judge_2(rows: pd.DataFrame) -> list[Finding]:
    """One constriction, `validation.py outside`."""
    return numbered(2, "outside", "Marin", "Souzy")


def judge_12(rows: pd.DataFrame) -> list[Finding]:
    """Sand under stress, `validation.py mechanics`."""
    return numbered(12, "mechanics", "Nazarova")


def judge_13(rows: pd.DataFrame) -> list[Finding]:
    """Ergun's bed, `validation.py outside`."""
    return numbered(13, "outside", "CFDEM")


def judge_11(rows: pd.DataFrame) -> list[Finding]:
    """The thesis: its first millimetre, its counts and its trends, `validation.py thesis`."""
    table = pd.read_csv(DOCS / "thesis" / "tables.csv", keep_default_na=False)
    names = ["run", "quantity", "laws"]
    table = table.drop_duplicates(names).set_index(names)
    source, lines = "thesis (Shi 2011)", []
    for run, quantity, laws, what in (
        ("specimen1", "k reduction in the first mm", "thesis, thesis", "k lost, first mm, %"),
        ("specimen5", "k reduction in the first mm", "thesis, thesis", "k lost, first mm, %"),
        ("specimen1", "invaded fines", "", "fines inside"),
        ("specimen1", "deepest fine", "", "deepest fine, mm"),
    ):
        one = table.xs((run, quantity, laws))
        number, ours, half = (float(str(one[key])) for key in ("thesis", "ours", "half_width"))
        seen, over = f"{ours:.3g} ± {half:.2g}, {one['seeds']} seeds", (ours - number) / half
        name = run.replace("specimen", "specimen ")
        lines.append(Finding(f"11: {name}, {what}", f"{number:g}", source, seen, over))
    trends = pd.read_csv(DOCS / "thesis" / "trends.csv")
    counts = trends[trends.scale == "full scale"].verdict.value_counts()
    seen = f"{counts['holds']} hold, {counts['does not hold']} does not, "
    seen += f"{counts['not decided']} not decided"
    lines.append(Finding("11: seven trends", "all comparisons", source, seen, math.nan, "in part"))
    return lines


# ---- Rows 3 to 5. Fines far too small for spheres.


class Flood(NamedTuple):
    """Fine solids that a flow carries into a sand."""

    sand: tuple[float, float]  # mm, between two sieves
    solids: tuple[float, float]  # mm, likewise
    gradient: float  # kPa/m


FLOODS = {
    "plug": Flood((0.177, 0.210), (0.005, 0.010), 900.0),
    "plateau": Flood((0.250, 0.297), (0.005, 0.010), 450.0),
    "colloids": Flood((0.500, 0.501), (0.004, 0.050), 10.0),
}
"""Of row 3 by what was seen, and of row 5, with solids of 0.008 to 0.1 of a grain."""


def beads(trial: Trial) -> Seen:
    """k/k0 of 4 mm of sand, and its first quarter's share of the deposit.

    Twenty pore volumes of water bring half a percent of solids at constant pressure, as size
    classes on the network. The concentration of the experiment is not known to us.
    """
    flood = FLOODS[trial.value]
    length, side = 4.0, 2.5 * sum(flood.sand)
    sieved = {"cut_percent": [0.0, 100.0], "passing_percent": [0.0, 100.0]}
    tables = {
        "name": "beads",
        "seed": trial.seed,
        "box": {"size_mm": [length, side, side], "sides": "periodic"},
        "grains": {"sizes": {**sieved, "size_mm": list(flood.sand)}, "porosity": 0.38},
        "fines": {
            "sizes": {**sieved, "size_mm": list(flood.solids)},
            "concentration": 0.005,
            "slab_mm": 20 * 0.38 * length,
        },
        "fluid": {
            "viscosity_cP": 1.0,
            "density_kg_m3": 998.0,
            "overbalance_MPa": 1e-6 * flood.gradient * length,
            "darcy_length_mm": length,
        },
        "invasion": {"method": "network", "classes": 3},
        "analysis": {"sections": 4},
    }
    run = run_case(case_from(tables), trial.folder, stages=("pack", "invade", "analyse"))
    lost = run.sections.porosity_initial - run.sections.porosity_damaged
    whole = float(lost.sum())
    seen = {"k over k0": float(run.summary["k_damaged_m2"] / run.summary["k_initial_m2"])}
    return seen | {"first quarter": float(lost.iloc[0]) / whole if whole > 0 else math.nan}


def judge_beads(rows: pd.DataFrame) -> list[Finding]:
    """Means over the packs."""
    lines, source = [], "Gruesbeck and Collins 1982"
    for value in ("plug", "plateau"):
        own = rows[rows.value == value].groupby("quantity")["observed"].apply(mean_band)
        if own.empty:
            continue
        low, high = FLOODS[value].sand
        grains = f"{1e3 * low:.0f}-{1e3 * high:.0f} µm, {FLOODS[value].gradient:g} kPa/m"
        what = f"3: beads of 5-10 µm in {grains}"
        plug = value == "plug"
        number = "deposit at the inlet, k → 0" if plug else "even deposit, k to a plateau"
        (left, half), (first, _) = own["k over k0"], own["first quarter"]
        band = f" ± {half:.2f}" if math.isfinite(half) else ""
        first_quarter = f"{100 * first:.0f} % of the deposit in the first quarter"
        seen = f"k/k₀ {left:.2f}{band}, {first_quarter if left < 0.99 else 'all pass'}"
        even = abs(first - 0.25) / 0.15 if 0.05 < left < 0.99 else math.inf
        lines.append(Finding(what, number, source, seen, left / 0.05 if plug else even))
    return lines


def judge_rate(rows: pd.DataFrame) -> list[Finding]:
    """Row 4 by the law of row 6, which the size classes take: lambda u at 0.95 over 0.66 cm/s."""
    ratios = []
    for grain in (0.84e-3, 1.42e-3, 2.0e-3):
        slow, fast = (replace(PAPER, diameter=grain, velocity=0.4 * u) for u in (0.0066, 0.0095))
        rates = [bed.velocity * efficiency(8e-6, 2710.0, bed) for bed in (slow, fast)]
        ratios.append(rates[1] / rates[0])
    what = "4: CaCO₃, rate at 0.95 over 0.66 cm/s"
    seen = f"{min(ratios):.3f} to {max(ratios):.3f}, sand of 2 to 0.84 mm"
    over = max(abs(one - 1) for one in ratios) / 0.1
    return [Finding(what, "1 ± 10 %", "Gruesbeck and Collins 1982", seen, over)]


def judge_strained(rows: pd.DataFrame) -> list[Finding]:
    """Row 5 by size classes, and by the fines of row 1: smooth spheres that do not stick."""
    held = shares(rows[rows.comparison == "1"], "equal, friction 0.5, ").get(7.0)
    own = rows[(rows.comparison == "5") & (rows.quantity == "k over k0")].observed
    if held is None or own.empty:
        return []
    seen = f"k/k₀ {own.mean():.2f} with 0.008 to 0.1; "
    seen += f"{held[0]} of {held[1]:,} held at 1/7 in {LENGTHS['equal'][0]:g} mm"
    number = "none below 0.008, linear above"
    what = "5: straining of colloids by d/D"
    return [Finding(what, number, "Xu and others 2006", seen, math.inf)]


def judge_read(rows: pd.DataFrame) -> list[Finding]:
    """What else could be read: fines in packs, and deposits at contacts of grains."""
    what = "15: 36 µm that stick in beads of 710-850 µm"
    note = "cannot be tried yet: tracers stick where they first touch"
    last = Finding(what, "20 % touch two beads", "Li and others 2006", "-", math.nan, note)
    return [*numbered(15, "outside", "arXiv"), last]


# ---- The figure.


def draw_filters(axes: Any, rows: pd.DataFrame) -> None:
    """Share of single fines that a pack holds, by D/d, with 95 % bands and what was published."""
    for start, colour, marker, label in (
        ("equal, friction 0.1, ", BLUE, "o", "equal spheres, friction 0.1"),
        ("equal, friction 0.5, ", ORANGE, "s", "equal spheres, friction 0.5"),
        ("sieved, friction 0.1, ", BLACK, "^", "20-40 mesh, friction 0.1, D = D10"),
    ):
        every = shares(rows[rows.comparison == "1"], start)
        for ratio, (held, fines) in every.items():
            low, high = band_of(held, fines)
            middle = held / fines
            axes.errorbar(
                [ratio], [middle], [[middle - low], [high - middle]], fmt=marker, color=colour
            )
        line = [held / fines for held, fines in every.values()]
        axes.plot(list(every), line, f"{marker}-", color=colour, mfc="none", label=label)
    axes.plot([4.5, 6.6], [1, 0], ":", color=BLUE, label="Wu and Sharma: 1 and 0, equal spheres")
    axes.plot([5.3, 10], [1, 0], ":", color=BLACK, label="Wu and Sharma: 1 and 0, 20-40 mesh")
    axes.set(xlabel="D/d", ylabel="share of single fines held")
    axes.legend(fontsize=8)


CHAPTER = chapter_of(Path(__file__).with_suffix(".toml"), globals(), draw_filters)


def main(arguments: list[str]) -> int:
    """The command `validation.py scoreboard`."""
    return command("scoreboard", CHAPTER, arguments)
