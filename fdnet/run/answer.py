"""What a run says about the well, in numbers: damaged zone, skin, rules of thumb, scatter."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.names import ALL_SPHERES, SIZE_CLASSES
from fdnet.report.text import answer_sentence, cake_words, certainty, end_words, in_place_words
from fdnet.run.bridging import OpenThroats, open_throats
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis


class Step(NamedTuple):
    """A layer of one permeability behind the formation face."""

    near: float  # m, depth where it begins
    far: float  # m, depth where it ends
    before: float  # m2, permeability without fines
    after: float  # m2, with fines


# ---- How deep the damage reaches and how much permeability is left there.
FACE = 2.0
"""Depth behind the face whose loss stands first in an answer, in median grains: a millimetre in
the sand of the thesis."""
DAMAGED_FROM = 0.05  # Share of its permeability that a layer must have lost to count as damaged
_TOUCH = 1e-9


class Zone(NamedTuple):
    """The damaged zone."""

    depth: float = 0.0  # m, where its deepest damaged layer ends; 0 without damage
    # permeability of the zone with the fines over that without, layers in series; 1 without damage
    ratio: float = 1.0
    # m2, permeability of the zone without the fines; None without damage
    before: float | None = None
    after: float | None = None  # m2, with the fines; None without damage
    # whether the last layer of the specimen is damaged too, so that the damage may reach further
    # than the specimen
    open_end: bool = False


def steps_of(analysis: "Analysis") -> list[Step]:
    """Permeability by depth, in place: thin layers of the first millimetre, then the sections.

    The layers are left out where the sections are not by the same law, and where those in a
    section resist more than it does. Sections that the layers reach into keep what is left of
    their resistance.
    """
    whole = [
        Step(s.x_lo, s.x_hi, s.k_initial_inplace, s.k_damaged_inplace) for s in analysis.sections
    ]
    layers = analysis.layers
    if layers is None or analysis.damage_law_used not in (ALL_SPHERES, SIZE_CLASSES):
        return whole
    edges = layers.edges
    columns = (edges[:-1], edges[1:], layers.k_initial, layers.k_damaged)
    thin = [Step(*map(float, row)) for row in zip(*columns, strict=True)]
    end = thin[-1].far
    behind = [one for one in whole if one.near >= end * (1 - _TOUCH)]
    cut = [one for one in whole if one.near < end * (1 - _TOUCH) < end * (1 + _TOUCH) < one.far]
    for one in cut:
        # a layer that begins before the section counts with the part that lies in it
        inside = [
            layer._replace(near=max(layer.near, one.near))
            for layer in thin
            if layer.far > one.near + _TOUCH * end
        ]
        before = _rest(one, one.before, inside, [layer.before for layer in inside])
        after = _rest(one, one.after, inside, [layer.after for layer in inside])
        if before is None or after is None:
            return whole
        behind = [Step(end, one.far, before, after), *behind]
    return [*thin, *behind]


def _rest(section: Step, k: float, inside: Sequence[Step], parts: Sequence[float]) -> float | None:
    """Permeability of the rest of a section, m2, whose resistances in series make up the whole.

    None where the layers inside, of the permeabilities `parts`, resist as much as it or more.
    """
    if k <= 0 or any(part <= 0 for part in parts):
        return k
    resistance = (section.far - section.near) / k - sum(
        (one.far - one.near) / part for one, part in zip(inside, parts, strict=True)
    )
    return (section.far - inside[-1].far) / resistance if resistance > 0 else None


def zone_of(steps: Sequence[Step]) -> Zone:
    """The zone from the face to the end of the deepest layer that lost `DAMAGED_FROM` or more."""
    lost = [1.0 - one.after / one.before if one.before > 0 else 0.0 for one in steps]
    damaged = [index for index, share in enumerate(lost) if share >= DAMAGED_FROM]
    if not damaged:
        return Zone()
    inside = steps[: damaged[-1] + 1]
    before = layers_in_series([(one.far - one.near, one.before) for one in inside])
    after = layers_in_series([(one.far - one.near, one.after) for one in inside])
    ratio = after / before if before > 0 else 0.0
    return Zone(inside[-1].far, ratio, before, after, len(inside) == len(steps))


def face_loss(steps: Sequence[Step], depth: float) -> tuple[float, float]:
    """Share of its permeability that the sand lost from the face to `depth` m, and that depth.

    Layers in series; the depth is at most that of the specimen.
    """
    inside = [one for one in steps if one.near < depth]
    ends = [min(one.far, depth) for one in inside]
    before, after = (
        layers_in_series(
            [(end - one.near, getattr(one, k)) for one, end in zip(inside, ends, strict=True)]
        )
        for k in ("before", "after")
    )
    return (1.0 - after / before if before > 0 else 0.0), ends[-1]


def layers_in_series(layers: Sequence[tuple[float, float]]) -> float:
    """Permeability, m2, of layers (thickness m, permeability m2) in series; 0 if one has 0."""
    if any(k <= 0 for _, k in layers):
        return 0.0
    return sum(thick for thick, _ in layers) / sum(thick / k for thick, k in layers)


# ---- The skin of a damaged zone around a well, and the share of its flow that it costs.
def hawkins(ratio: float, *, well: float, damaged: float) -> float:
    """Skin s = (k / k_d - 1) ln(r_d / r_w) (Hawkins 1956, Trans. AIME 207, 356-357).

    The `ratio` is k_d / k, of the damaged zone over the formation; radii r_w of the `well` and r_d
    to which it is `damaged` in m. The skin is infinite where the ratio is 0.
    """
    return (1.0 / ratio - 1.0) * math.log(damaged / well) if ratio > 0 else math.inf


def layered_skin(steps: Sequence[Step], well: float) -> float:
    """Sum of (k / k_i - k / k_0i) ln(r_{i+1} / r_i) over layers behind the face of a well.

    It is Hawkins's formula for rings in series, with the permeability k of the formation, that of
    all layers before the fines in series: a layer that was more open than the formation, as those
    at the face are, counts no more for that. `well` is the radius of the well, m. Layers without
    permeability before the fines count nothing.
    """
    rings = [one for one in steps if one.before > 0]
    inverse = sum((one.far - one.near) / one.before for one in rings)
    k = sum(one.far - one.near for one in rings) / inverse if rings else 0.0
    return sum(
        k
        / one.before
        * hawkins(one.after / one.before, well=well + one.near, damaged=well + one.far)
        for one in rings
    )


def flow_lost(skin: float, *, well: float, drainage: float) -> float:
    """Share of the steady radial flow that a skin costs: s / (ln(r_e / r_w) + s).

    From Darcy's law for a well of radius r_w `well` m in a formation whose pressure is held at
    r_e `drainage` m (Muskat 1937), with and without the skin.
    """
    return 1.0 if math.isinf(skin) else skin / (math.log(drainage / well) + skin)


# ------------------------------------------------------------------------------------------------
# Rules of thumb of the field for the sizes of a bridging solid, set against what the run shows.
#
# They compare sizes only; none of them knows the flow or the time. A throat here is the circle
# that touches the three grains around it.


ABRAMS_SIZE, ABRAMS_SHARE = 1 / 3, 0.05
FILTER_SAFE, FILTER_FAILS = 5.0, 9.0
SQRT_SHARE = (0.5 / 0.9) ** 2
"""D50 over D90 where the share finer grows with the square root of the size."""
SQRT_REACH = 1.5  # Factor within which D50 counts as on the line of the square root
THROUGH = 0.5
"""Share of the fines that entered and came out again above which the sand lets them through."""
LARGEST = 0.99
"""Share of the open throats between grains, by number, that are narrower than the "largest"."""


def run_shows(summary: Mapping[str, Any]) -> str:
    """What the sand did with the fines: "bridges", "passes" or "undecided".

    It passes where more than half of the fines that entered left through the outlet, or more than
    5 % of those inside lie in the last tenth of the specimen. It bridges where the face was
    plugged otherwise. A run that ended in another way is undecided.
    """
    entered = summary["invaded_count"] + summary["passed_count"]
    through = summary["passed_count"] > THROUGH * entered
    deep = summary["invasion_depth_p95_m"] > 0.9 * summary["sections"][-1]["x_hi_m"]
    if entered and (through or deep):
        return "passes"
    return "bridges" if summary["stop_reason"] == "plugged" else "undecided"


def rules_of(
    shows: str,  # what `run_shows` gives
    *,
    fines: Mapping[str, float],  # D50, D85 and D90 of the fines by name, m, by volume
    throat_median: float,  # median diameter of the open throats, m, by number
    throat_largest: float,  # diameter that 99 % of the open ones are narrower than, m
    grain_d15: float,  # D15 of the grains, m
    concentration: float,  # share of solids in the mud, by volume
) -> list[dict[str, Any]]:
    """What every rule says, and whether it agrees with what the run `shows`.

    `value` is of the case and dimensionless, `limit` of the rule; a rule `says` "bridges",
    "passes" or "between", and `agrees` is None where rule or run is undecided.
    """
    ratio = fines["D50"] / throat_median
    abrams = ratio >= ABRAMS_SIZE and concentration >= ABRAMS_SHARE
    largest = fines["D90"] / throat_largest
    line = fines["D50"] / (SQRT_SHARE * throat_largest)
    on_line = line >= 1 / SQRT_REACH and largest >= 1
    kept = grain_d15 / fines["D85"]
    filtered = "bridges" if kept <= FILTER_SAFE else "passes" if kept > FILTER_FAILS else "between"
    names = ("rule", "source", "quantity", "value", "limit", "says")
    rows = (
        (
            "median size and concentration",
            "Abrams 1977, J. Pet. Technol. 29(5), 586-592",
            f"D50 of the fines over the median throat, at {100 * concentration:.3g} % of "
            "solids by volume",
            ratio,
            "bridges from 1/3 on, at 5 % of solids or more",
            "bridges" if abrams else "passes",
        ),
        (
            "largest throat",
            "Hands and others 1998, Oil & Gas J. 96(28), 65-68",
            "D90 of the fines over the largest throat (99 % are narrower)",
            largest,
            "bridges from 1 on",
            "bridges" if largest >= 1 else "passes",
        ),
        (
            "ideal packing (square root of the size)",
            "Dick and others 2000, SPE 58793",
            "D50 of the fines over that of the ideal line, 0.309 of the largest throat",
            line,
            f"bridges from 1/{SQRT_REACH:g} on, where D90 fills the largest throat too",
            "bridges" if on_line else "passes",
        ),
        (
            "filter ratio",
            "Sherard, Dunnigan and Talbot 1984, J. Geotech. Eng. 110(6), 684-700",
            "D15 of the grains over D85 of the fines",
            kept,
            "holds the fines up to 5, lets them pass above 9",
            filtered,
        ),
    )
    result = []
    for row in rows:
        rule = dict(zip(names, row, strict=True))
        decided = {rule["says"], shows} <= {"bridges", "passes"}
        result.append(rule | {"agrees": rule["says"] == shows if decided else None})
    return result


# ---- How much the answer of one seed differs from that of another, from published repeats.
SOURCE = "docs/thesis/results.csv"


class Scatter(NamedTuple):
    """One standard deviation of a single run, pooled over `cases` whose seeds were repeated."""

    depth: float  # of the depth of 95 % of the fines, over its mean
    loss: float  # of the share of permeability that the sand loses at the face; a difference
    runs: int  # number of runs
    cases: tuple[str, ...]  # what was repeated
    source: str  # where the results are, in words


QUICK = Scatter(
    *(0.36, 0.067, 30),
    cases=tuple(f"quick-specimen{number}" for number in (1, 2, 4, 5, 7, 8)),
    source=f"quick specimens 1, 2, 4, 5, 7 and 8 of {SOURCE}",
)
"""Specimens of 110 grains, 3 grains wide."""
FOLLOWED = Scatter(0.263, 0.0166, 8, cases=("quick",), source="cases/quick.toml")
"""A specimen of 240 grains in a flow that follows the deposit (docs/validation/seeds.csv)."""
FULL = Scatter(
    *(0.42, 0.021, 12),
    cases=tuple(f"specimen{number}" for number in (1, 2, 4, 5)),
    source=f"specimens 1, 2, 4 and 5 of {SOURCE}",
)
"""Specimens of 1,200 to 1,400 grains, 8 grains wide."""
QUICK_GRAINS = 500  # Number of grains below which a specimen is compared with the quick ones


# ---- The keys of summary.json that follow from its other results.
def with_answer(
    summary: Mapping[str, Any], case: Case, analysis: "Analysis", spheres: Snapshot
) -> dict[str, Any]:
    """`summary` with the keys of the answer; `spheres` are those at the end.

    Adds `answer` and `certainty` (sentences) always; with fines also `words` (parts of
    sentences), `damage`, `rules`, `scatter`, and `skin` and `skin_flow_lost` where the case has a
    well. Infinite skins are null.
    """
    result = dict(summary)
    if isinstance(case, InvasionCase) and analysis.occupancy is not None:
        steps = steps_of(analysis)
        zone = zone_of(steps)
        result["damage"] = {
            "zone_depth_m": zone.depth,
            "zone_k_over_k0": zone.ratio,
            "zone_k_initial_m2": zone.before,
            "zone_k_damaged_m2": zone.after,
            "lost_from": DAMAGED_FROM,
            "reaches_the_end": zone.open_end,
        }
        lost, face = face_loss(steps, float(f"{FACE * case.grains.curve.size_at(0.5):.2g}"))
        result["damage"] |= {"face_depth_m": face, "face_lost": lost}
        if case.well is not None:
            radius, drainage = case.well.radius_m, case.well.drainage_radius_m
            skin = layered_skin(steps, radius)
            result["skin"] = None if math.isinf(skin) else skin
            result["skin_flow_lost"] = flow_lost(skin, well=radius, drainage=drainage)
            result["skin_well_radius_m"] = radius
        scatter = QUICK if len(spheres.grains()) < QUICK_GRAINS else FULL
        scatter = FOLLOWED if case.drag.coupled else scatter
        result["scatter"] = {
            "depth_p95_relative": scatter.depth,
            "first_mm_loss": scatter.loss,
            "runs": scatter.runs,
            "source": scatter.source,
        }
        result["run_shows"] = run_shows(summary)
        result["rules"] = rules_of(
            result["run_shows"], **_bridging_sizes(case, open_throats(analysis))
        )
        result["words"] = {
            "end": end_words(summary, case.run),
            "cake": cake_words(summary),
            "in_place": in_place_words(summary["network_counts"]),
        }
    return {**result, "answer": answer_sentence(result), "certainty": list(certainty(result))}


def _bridging_sizes(case: InvasionCase, throats: OpenThroats) -> dict[str, Any]:
    """What `rules_of` compares, of throats between grains; where there are none, of all."""
    width = throats.width[throats.between | ~throats.between.any()]
    middle, largest = np.quantile(width, (0.5, LARGEST))
    fines = case.fines.curve
    return {
        "fines": {f"D{share}": fines.size_at(share / 100) for share in (50, 85, 90)},
        "throat_median": float(middle),
        "throat_largest": float(largest),
        "grain_d15": case.grains.curve.size_at(0.15),
        "concentration": case.fines.volume_fraction,
    }
