"""The answer of a run: how deep the damage reaches, and how sure that is.

The skin of a damaged zone around a well, and the share of its flow that it costs.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.case.tables import Run
from fdnet.names import ALL_SPHERES
from fdnet.report.tables import in_millidarcy, millimetres, percent, two_digits
from fdnet.run.bridging import OpenThroats, open_throats, width_rows
from fdnet.run.cake import cake_words
from fdnet.scales.pack import SHARES
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

SMALL, LARGE = 0.02, 0.2
"""Shares of the flow that a skin costs, below and above which words call it small and large."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A layer of one permeability behind the formation face.

    Attributes:
        near: m, depth where it begins.
        far: m, depth where it ends.
        before: m2, without fines.
        after: m2, with fines.
    """

    near: float
    far: float
    before: float
    after: float

    @property
    def lost(self) -> float:
        """Share of the permeability that is lost; 1 where nothing flows."""
        return 1.0 - self.after / self.before if self.before > 0 else 0.0


def hawkins(ratio: float, *, well: float, damaged: float) -> float:
    """s = (k / k_d - 1) ln(r_d / r_w) (Hawkins 1956, Trans. AIME 207, 356-357).

    Args:
        ratio: k_d / k, permeability of the damaged zone over that of the formation.
        well: radius of the well, m.
        damaged: radius to which the damage reaches, m.

    Returns:
        The skin factor; infinite where the ratio is 0.
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
    lengths = [one.far - one.near for one in rings]
    inverse = sum(far / one.before for far, one in zip(lengths, rings, strict=True))
    k = sum(lengths) / inverse if rings else 0.0
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
    if math.isinf(skin):
        return 1.0
    return skin / (math.log(drainage / well) + skin)


def size_words(lost: float) -> str:
    """Small, moderate or large, by the share of the flow that is lost."""
    return "small" if lost < SMALL else "large" if lost > LARGE else "moderate"


# ------------------------------------------------------------------------------------------------
# How deep the damage reaches and how much permeability is left there.


DAMAGED_FROM = 0.05
"""Share of its permeability that a layer must have lost to count as damaged."""
_TOUCH = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """The damaged zone.

    Attributes:
        depth: m, where its deepest damaged layer ends; 0 without damage.
        ratio: permeability of the zone with the fines over that without, layers in series; 1
            without damage.
        before: m2, permeability of the zone without the fines; None without damage.
        after: m2, with the fines; None without damage.
        open_end: whether the last layer of the specimen is damaged too, so that the damage may
            reach further than the specimen.
    """

    depth: float
    ratio: float
    before: float | None
    after: float | None
    open_end: bool


def steps_of(analysis: "Analysis") -> list[Step]:
    """Permeability by depth, in place: thin layers of the first millimetre, then the sections.

    The layers are left out where the sections are not by the same law, and where those in a
    section resist more than it does. Sections that the layers reach into keep what is left of
    their resistance.
    """
    whole = [
        Step(near=s.x_lo, far=s.x_hi, before=s.k_initial_inplace, after=s.k_damaged_inplace)
        for s in analysis.sections
    ]
    layers = analysis.layers
    if layers is None or analysis.damage_law_used != ALL_SPHERES:
        return whole
    thin = [
        Step(near=float(a), far=float(b), before=float(k0), after=float(k1))
        for a, b, k0, k1 in zip(
            layers.edges[:-1], layers.edges[1:], layers.k_initial, layers.k_damaged, strict=True
        )
    ]
    end = thin[-1].far
    behind = [one for one in whole if one.near >= end * (1 - _TOUCH)]
    cut = [one for one in whole if one.near < end * (1 - _TOUCH) < end * (1 + _TOUCH) < one.far]
    for one in cut:
        inside = [layer for layer in thin if layer.near >= one.near - _TOUCH * end]
        before, after = (_rest(one, inside, which) for which in ("before", "after"))
        if before is None or after is None:
            return whole
        behind = [Step(near=end, far=one.far, before=before, after=after), *behind]
    return [*thin, *behind]


def _rest(section: Step, inside: Sequence[Step], which: str) -> float | None:
    """Permeability of the rest of a section, m2, whose resistances in series make up the whole.

    None where the layers inside resist as much as the section or more.
    """
    k, parts = getattr(section, which), [getattr(one, which) for one in inside]
    if k <= 0 or any(part <= 0 for part in parts):
        return k
    resistance = (section.far - section.near) / k - sum(
        (one.far - one.near) / part for one, part in zip(inside, parts, strict=True)
    )
    return (section.far - inside[-1].far) / resistance if resistance > 0 else None


def zone_of(steps: Sequence[Step]) -> Zone:
    """The zone from the face to the end of the deepest layer that lost `DAMAGED_FROM` or more."""
    damaged = [index for index, one in enumerate(steps) if one.lost >= DAMAGED_FROM]
    if not damaged:
        return Zone(depth=0.0, ratio=1.0, before=None, after=None, open_end=False)
    inside = steps[: damaged[-1] + 1]
    before, after = (series([(s.far - s.near, k) for s, k in pairs]) for pairs in _both(inside))
    return Zone(
        depth=inside[-1].far,
        ratio=after / before if before > 0 else 0.0,
        before=before,
        after=after,
        open_end=len(inside) == len(steps),
    )


def _both(steps: Sequence[Step]) -> Iterator[list[tuple[Step, float]]]:
    yield [(one, one.before) for one in steps]
    yield [(one, one.after) for one in steps]


def series(layers: Sequence[tuple[float, float]]) -> float:
    """Permeability, m2, of layers (thickness m, permeability m2) in series; 0 if one has 0."""
    if any(k <= 0 for _, k in layers):
        return 0.0
    return sum(thick for thick, _ in layers) / sum(thick / k for thick, k in layers)


# ------------------------------------------------------------------------------------------------
# Rules of thumb of the field for the sizes of a bridging solid, set against what the run shows.
#
# They compare sizes only; none of them knows the flow or the time. A throat here is the circle
# that touches the three grains around it.


ABRAMS_SIZE, ABRAMS_SHARE = 1 / 3, 0.05
FILTER_SAFE, FILTER_FAILS = 5.0, 9.0
SQRT_SHARE = (0.5 / 0.9) ** 2
"""D50 over D90 where the share finer grows with the square root of the size."""
SQRT_REACH = 1.5
"""Factor within which D50 counts as on the line of the square root."""
THROUGH = 0.5
"""Share of the fines that entered and came out again above which the sand lets them through."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Diameters in m; shares are by volume.

    Attributes:
        fines: D50, D85 and D90 of the fines by name.
        throat_median: median of the open throats, by number.
        throat_largest: throat that 99 % of the open ones are narrower than.
        grain_d15: D15 of the grains.
        concentration: share of solids in the mud.
    """

    fines: Mapping[str, float]
    throat_median: float
    throat_largest: float
    grain_d15: float
    concentration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """What a rule says.

    Attributes:
        rule: its name.
        source: where it was published.
        quantity: what is compared, in words.
        value: of the case, dimensionless.
        limit: of the rule, in words.
        says: "bridges", "passes" or "between".
        agrees: whether the run shows the same; None where rule or run is undecided.
    """

    rule: str
    source: str
    quantity: str
    value: float
    limit: str
    says: str
    agrees: bool | None


def run_shows(summary: Mapping[str, Any]) -> str:
    """What the sand did with the fines: "bridges", "passes" or "undecided".

    It passes where more than half of the fines that entered left through the outlet, or more than
    5 % of those inside lie in the last tenth of the specimen. It bridges where the face was
    plugged otherwise. A run that ended in another way is undecided.
    """
    entered = summary["invaded_count"] + summary["passed_count"]
    length = summary["sections"][-1]["x_hi_m"]
    through = summary["passed_count"] > THROUGH * entered
    deep = summary["invasion_depth_p95_m"] > 0.9 * length
    if entered and (through or deep):
        return "passes"
    return "bridges" if summary["stop_reason"] == "plugged" else "undecided"


def rules_of(sizes: Sizes, shows: str) -> list[dict[str, Any]]:
    """Every rule as a mapping, with whether it agrees with the run (`run_shows`)."""
    return [asdict(rule) for rule in _rules(sizes, shows)]


def _rules(sizes: Sizes, shows: str) -> Iterator[Rule]:
    fines = sizes.fines
    ratio = fines["D50"] / sizes.throat_median
    abrams = ratio >= ABRAMS_SIZE and sizes.concentration >= ABRAMS_SHARE
    yield _rule(
        "median size and concentration",
        "Abrams 1977, J. Pet. Technol. 29(5), 586-592",
        f"D50 of the fines over the median throat, at {100 * sizes.concentration:.3g} % of "
        "solids by volume",
        ratio,
        "bridges from 1/3 on, at 5 % of solids or more",
        "bridges" if abrams else "passes",
        shows,
    )
    largest = fines["D90"] / sizes.throat_largest
    yield _rule(
        "largest throat",
        "Hands and others 1998, Oil & Gas J. 96(28), 65-68",
        "D90 of the fines over the largest throat (99 % are narrower)",
        largest,
        "bridges from 1 on",
        "bridges" if largest >= 1 else "passes",
        shows,
    )
    line = fines["D50"] / (SQRT_SHARE * sizes.throat_largest)
    on_line = line >= 1 / SQRT_REACH and largest >= 1
    yield _rule(
        "ideal packing (square root of the size)",
        "Dick and others 2000, SPE 58793",
        "D50 of the fines over that of the ideal line, 0.309 of the largest throat",
        line,
        f"bridges from 1/{SQRT_REACH:g} on, where D90 fills the largest throat too",
        "bridges" if on_line else "passes",
        shows,
    )
    kept = sizes.grain_d15 / fines["D85"]
    says = "bridges" if kept <= FILTER_SAFE else "passes" if kept > FILTER_FAILS else "between"
    yield _rule(
        "filter ratio",
        "Sherard, Dunnigan and Talbot 1984, J. Geotech. Eng. 110(6), 684-700",
        "D15 of the grains over D85 of the fines",
        kept,
        "holds the fines up to 5, lets them pass above 9",
        says,
        shows,
    )


def _rule(
    name: str, source: str, quantity: str, value: float, limit: str, says: str, shows: str
) -> Rule:
    decided = {says, shows} <= {"bridges", "passes"}
    agrees = says == shows if decided else None
    return Rule(
        rule=name,
        source=source,
        quantity=quantity,
        value=value,
        limit=limit,
        says=says,
        agrees=agrees,
    )


# ------------------------------------------------------------------------------------------------
# How much the answer of one seed differs from that of another, from published repeats.


SOURCE = "docs/thesis/results.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """One standard deviation of a single run, pooled over cases.

    Attributes:
        depth: of the depth of 95 % of the fines, over its mean.
        loss: of the share of permeability that the first millimetre loses; a difference.
        runs: number of runs.
        cases: the cases whose seeds were repeated.
        source: where their results are, in words.
    """

    depth: float
    loss: float
    runs: int
    cases: tuple[str, ...]
    source: str


QUICK = Scatter(
    depth=0.36,
    loss=0.067,
    runs=30,
    cases=tuple(f"quick-specimen{number}" for number in (1, 2, 4, 5, 7, 8)),
    source=f"quick specimens 1, 2, 4, 5, 7 and 8 of {SOURCE}",
)
"""Specimens of 110 grains, 3 grains wide."""
FULL = Scatter(
    depth=0.42,
    loss=0.019,
    runs=12,
    cases=tuple(f"specimen{number}" for number in (1, 2, 4, 5)),
    source=f"specimens 1, 2, 4 and 5 of {SOURCE}",
)
"""Specimens of 1,200 to 1,400 grains, 8 grains wide."""
QUICK_GRAINS = 500
"""Number of grains below which a specimen is compared with the quick ones."""


def scatter_of(grains: int) -> Scatter:
    """The scatter of published specimens of about as many grains."""
    return QUICK if grains < QUICK_GRAINS else FULL


# ------------------------------------------------------------------------------------------------
# The case in sentences: sand, mud, drive and specimen, in the units of the field.


UM, MM = 1e6, 1e3
PSI = 6894.757
"""Pascal."""


def case_words(case: Case, scales: object = None) -> list[str]:
    """Some sentences that say what was run; `scales` adds the velocity of the fluid."""
    return list(_sentences(case, scales))


def _sentences(case: Case, scales: object) -> Iterator[str]:
    porosity = case.grains.porosity
    packed = f"packed to a porosity of {100 * porosity:.3g} %" if porosity else "packed by number"
    yield f"Sand: grains of {_size_words(case.grains)}, {packed}."
    if not isinstance(case, InvasionCase):
        yield f"No mud. {_box(case)}"
        return
    share = 100 * case.fines.volume_fraction
    yield (
        f"Mud: fines of {_size_words(case.fines)}, {share:.3g} % of solids by volume, in a liquid "
        f"of {1e3 * case.fluid.viscosity_Pa_s:.3g} cP."
    )
    yield _drive(case, scales)
    yield _box(case)


def _size_words(spheres: Spheres) -> str:
    if spheres.one_size:
        return f"{2 * MM * spheres.mean_radius_m:.3g} mm ({2 * UM * spheres.mean_radius_m:.4g} µm)"
    if not spheres.measured:
        low, high = (2 * UM * radius for radius in spheres.radius_range_m)
        return f"{low:.3g} to {high:.3g} µm"
    return _quantiles(spheres)


def _quantiles(spheres: Spheres) -> str:
    """D10, D50 and D90 as the case gives them, where it does, and of what is placed."""
    placed = {share: spheres.curve.size_at(share) for share in SHARES}
    asked = dict(spheres.sizes.asked or {}) if spheres.sizes is not None else {}
    if set(asked) >= set(SHARES):
        return f"{_three(asked)} (of what is placed: {_three(placed)})"
    return f"{_three(placed)} (of what is placed)"


def _three(sizes: Mapping[float, float]) -> str:
    texts = (f"D{100 * share:.0f} {UM * sizes[share]:.3g}" for share in SHARES)
    return f"{', '.join(texts)} µm"


def _drive(case: InvasionCase, scales: object) -> str:
    fluid, well = case.fluid, case.well
    pressure = f"{fluid.overbalance_Pa / 1e6:.3g} MPa ({fluid.overbalance_Pa / PSI:.3g} psi)"
    if fluid.velocity_m_s is not None:
        text = "Drive: a given velocity of the fluid"
    elif well is not None:
        text = (
            f"Drive: an overbalance of {pressure} around a well of {MM * well.radius_m:.3g} mm "
            f"radius with a drainage radius of {well.drainage_radius_m:.3g} m"
        )
    else:
        length = MM * (fluid.darcy_length_m or case.size_m[0])
        text = f"Drive: an overbalance of {pressure}, lost over {length:.3g} mm"
    speed = ""
    if isinstance(scales, InvasionScales):
        speed = f"; between the grains the fluid moves at {scales.interstitial_velocity:.2g} m/s"
    return f"{text}{speed}."


def _box(case: Case) -> str:
    sides = " x ".join(f"{MM * side:.3g}" for side in case.size_m)
    held = {"walls": "between walls", "periodic": "periodic across the flow"}[case.box.sides]
    return f"Specimen: {sides} mm, {held}; the flow goes along the first side. Seed {case.seed}."


# ------------------------------------------------------------------------------------------------
# The answer of a run in words: one sentence to act on, how the run ended, how sure it is.


ENDS = {
    "supply_exhausted": "the supply of fines ran out (the face is still open)",
    "duration": "the set time or volume was over (the face may still be open)",
    "cap": "the run reached its cap before anything else ended it",
}


def end_words(summary: Mapping[str, Any], control: Run) -> str:
    """Why the invasion ended, as a part of a sentence; the case's `control` has the rules."""
    reason, rate = summary["stop_reason"], summary.get("rate_over_initial")
    if reason != "plugged":
        return ENDS[reason]
    if control.stop_rate is not None and rate is not None and rate <= control.stop_rate:
        return f"the rate of flow fell below {percent(control.stop_rate)} % of the first"
    if control.plug_rate:
        most = f"at most {percent(control.plug_rate)} % of the fines of the undisturbed mud"
        return f"the face plugged: {most} crossed it for the set time"
    return "the face plugged: no fine crossed it for the set time"


def in_place_words(counts: Mapping[str, int]) -> str:
    """Why values in place are above the intact ones, a sentence; "" where none is."""
    sections, layers = counts["sections_inplace_above_intact"], counts["layers_above_intact"]
    if not sections and not layers:
        return ""
    return (
        f"In place, {sections} of the sections and {layers} of the thin layers seem to gain: they "
        "take less of the pressure than before, because the fines turn the flow aside, and "
        "because the pores that say the pressure are wider than a thin layer. Fines never raise "
        "the permeability of the specimen or of a slab cut out."
    )


def answer_sentence(summary: Mapping[str, Any]) -> str:
    """One sentence to act on; `summary` has the keys of the answer where there are fines."""
    if "damage" not in summary:
        k, porosity = summary["k_initial_m2"], 100 * summary["porosity_initial"]
        return f"The intact sand has {in_millidarcy(k)} mD at a porosity of {porosity:.1f} %."
    return " ".join(filter(None, (_depth(summary), _skin_words(summary))))


def _depth(summary: Mapping[str, Any]) -> str:
    damage, invaded = summary["damage"], summary["invaded_count"]
    if not invaded:
        return "No fine entered the sand, so it keeps its permeability."
    depth = millimetres(summary["invasion_depth_p95_m"])
    p95 = f"95 % of the fines that entered lie within {depth}"
    if summary["final"] is False:
        return (
            f"So far {p95}, but the run was cut at its cap and this is not final: raise "
            "run.cap_ms and run it again (--force) before you use these numbers."
        )
    if not damage["zone_depth_m"]:
        limit = two_digits(damage["lost_from"])
        return f"{p95}, and no layer loses {limit} of its permeability: the damage is negligible."
    share = f"{two_digits(damage['zone_k_over_k0'])} of the permeability"
    if damage["reaches_the_end"]:
        return (
            f"{p95}, and the damage reaches the end of the specimen, which keeps {share}: "
            "lengthen the box before you rely on the depth."
        )
    zone = millimetres(damage["zone_depth_m"])
    return (
        f"{p95} and the first {zone} keep {share}, so a perforation, a cut or a wash that reaches "
        f"deeper than {zone} meets sand that lost less than {two_digits(damage['lost_from'])}."
    )


def _skin_words(summary: Mapping[str, Any]) -> str:
    if "skin" not in summary or not summary["invaded_count"]:
        return ""
    lost, skin = summary["skin_flow_lost"], summary["skin"]
    if skin is None or math.isinf(skin):
        return "Nothing flows through the plugged layer, so the skin is infinite."
    well = f"a well of {millimetres(summary['skin_well_radius_m'])} radius"
    if skin <= 0:
        return f"For {well} this is no skin."
    return (
        f"For {well} this is a {size_words(lost)} skin of {skin:.2g}, which costs "
        f"{two_digits(lost)} of the flow."
    )


def certainty(summary: Mapping[str, Any]) -> Iterator[str]:
    """How the run ended, whether that is final, and what one seed is worth; sentences."""
    if summary.get("stop_reason") is None:
        return
    final = "final" if summary["final"] else "not final"
    yield f"The result is {final}, because {summary['words']['end']}."
    scatter = summary.get("scatter")
    if scatter and summary.get("invaded_count"):
        yield (
            f"This is one run with one seed ({summary['seed']}). Repeated seeds of such "
            f"specimens differ by {two_digits(scatter['depth_p95_relative'])} in the depth and by "
            f"{100 * scatter['first_mm_loss']:.2g} points in the loss of the first millimetre "
            f"(one standard deviation, {scatter['runs']} runs; {scatter['source']})."
        )


# ------------------------------------------------------------------------------------------------
# What a run says about the well: keys of summary.json that follow from its other results.


LARGEST = 0.99
"""Share of the open throats between grains, by number, that are narrower than the "largest"."""


def with_answer(
    summary: Mapping[str, Any], case: Case, analysis: "Analysis", spheres: Snapshot
) -> dict[str, Any]:
    """`summary` with the keys of the answer; `spheres` are those at the end.

    Adds `answer` and `certainty` (sentences) always; with fines also `words` (parts of
    sentences), `damage`, `throats_bridged`, `rules`, `scatter`, and `skin` and `skin_flow_lost`
    where the case has a well. Infinite skins are null.
    """
    result = dict(summary)
    if isinstance(case, InvasionCase) and analysis.occupancy is not None:
        throats = open_throats(analysis)
        result |= _damage_keys(case, analysis, spheres)
        result["throats_bridged"] = width_rows(throats)
        result["run_shows"] = run_shows(summary)
        result["rules"] = rules_of(_sizes(case, throats), result["run_shows"])
        result["words"] = {
            "end": end_words(summary, case.run),
            "cake": cake_words(summary),
            "in_place": in_place_words(summary["network_counts"]),
        }
    return {**result, "answer": answer_sentence(result), "certainty": list(certainty(result))}


def _damage_keys(case: InvasionCase, analysis: "Analysis", spheres: Snapshot) -> dict[str, Any]:
    steps = steps_of(analysis)
    return {
        "damage": _zone_keys(zone_of(steps)),
        **_skin_keys(case, steps),
        "scatter": _scatter_keys(len(spheres.grains())),
    }


def _zone_keys(zone: Zone) -> dict[str, Any]:
    return {
        "zone_depth_m": zone.depth,
        "zone_k_over_k0": zone.ratio,
        "zone_k_initial_m2": zone.before,
        "zone_k_damaged_m2": zone.after,
        "lost_from": DAMAGED_FROM,
        "reaches_the_end": zone.open_end,
    }


def _skin_keys(case: Case, steps: list[Step]) -> dict[str, float | None]:
    if case.well is None:
        return {}
    radius, drainage = case.well.radius_m, case.well.drainage_radius_m
    skin = layered_skin(steps, radius)
    return {
        "skin": None if math.isinf(skin) else skin,
        "skin_flow_lost": flow_lost(skin, well=radius, drainage=drainage),
        "skin_well_radius_m": radius,
    }


def _scatter_keys(grains: int) -> dict[str, Any]:
    one = scatter_of(grains)
    return {
        "depth_p95_relative": one.depth,
        "first_mm_loss": one.loss,
        "runs": one.runs,
        "source": one.source,
    }


def _sizes(case: InvasionCase, throats: OpenThroats) -> Sizes:
    """Of throats between grains; where all are at walls or end faces, of those."""
    width = throats.width[throats.between | ~throats.between.any()]
    middle, largest = np.quantile(width, (0.5, LARGEST))
    fines = case.fines.curve
    return Sizes(
        fines={f"D{share}": fines.size_at(share / 100) for share in (50, 85, 90)},
        throat_median=float(middle),
        throat_largest=float(largest),
        grain_d15=case.grains.curve.size_at(0.15),
        concentration=case.fines.volume_fraction,
    )
