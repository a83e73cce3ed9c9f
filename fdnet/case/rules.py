"""What must hold between the keys of a case."""

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.bonds import Bonds
from fdnet.case.clean_up import CLEAN_UP_RULES
from fdnet.case.contact import MODEL_KEYS
from fdnet.case.contact_rules import of_cohesion, of_rolling, of_the_model
from fdnet.case.control import Run
from fdnet.case.coupled_rules import (
    coupled_inertia,
    crowd_scheme,
    flow_field,
    network_grains,
    stop_rate,
    stop_volume,
    update_travel,
)
from fdnet.case.flow_rules import FLOW_RULES
from fdnet.case.particles import Fines, Grains
from fdnet.case.parts import Box, Drag
from fdnet.case.rule import Rule
from fdnet.case.size_rules import SIZE_RULES, SOME_THROAT, concentration_text, size_text
from fdnet.case.spheres import Spheres
from fdnet.case.values import (
    LEAST_SKIN,
    MOST_BINS,
    MOST_FINES,
    MOST_GRAINS,
    MOST_NEIGHBOUR_BINS,
    MOST_SLAB,
)


def cross_problems(tables: Mapping[str, Any], bad: Collection[str] = ()) -> Iterator[str]:
    """What is wrong between the keys of a case.

    A rule is passed over where one of its tables is absent or None, or one of its keys is among
    `bad`: keys whose own value was refused, so that nothing can be said about them.
    """
    unsized = {f"{name}.radius_mm" for name in _SPHERES if not _has_one_curve(tables.get(name))}
    if (fines := tables.get("fines")) is None or not fines.has_one_concentration:
        unsized.add("fines.concentration")
    for rule in RULES:
        given = [tables.get(name) for name in rule.tables]
        silent = set(bad) if rule in SIZE_RULES else unsized | set(bad)
        if all(table is not None for table in given) and not set(rule.keys) & silent:
            yield from rule.check(*given)


def _has_one_curve(spheres: Spheres | None) -> bool:
    return spheres is not None and spheres.has_one_curve


def _rising(name: str) -> Rule:
    def check(spheres: Spheres) -> Iterator[str]:
        pair = spheres.radius_mm
        if isinstance(pair, tuple) and pair[0] >= pair[1]:
            yield f"{name}.radius_mm: {list(pair)} must rise, [smallest, largest]"

    return Rule((f"{name}.radius_mm",), check)


def _number_of_grains(grains: Grains) -> Iterator[str]:
    if grains.porosity is None and grains.count is None:
        yield "grains.porosity: missing, give it (0 to 1) or grains.count"


def _number_of_fines(fines: Fines) -> Iterator[str]:
    if (fines.count is None) == (fines.slab_mm is None):
        yield (
            f"fines.count: {fines.count} with fines.slab_mm: {fines.slab_mm}, "
            "give exactly one of the two"
        )


def _room_for_grains(box: Box, grains: Grains) -> Iterator[str]:
    """Their number is bounded by memory, their plain sum of volumes by the box."""
    volume, grain = math.prod(box.size_mm), grains.mean_volume_m3 * 1e9
    solid = 1 - grains.porosity if grains.porosity is not None else 0.0
    expected = grains.count or solid * volume / grain
    if expected > MOST_GRAINS:
        yield (
            f"box.size_mm: {list(box.size_mm)} holds {expected:.3g} grains; expected at most "
            f"{MOST_GRAINS:.0e}"
        )
    if grains.count is not None and grains.count * grains.mean_volume_m3 * 1e9 >= volume:
        yield (
            f"grains.count: {grains.count} spheres sum to more than the box; expected at most "
            f"{int(volume / grain)}"
        )


def _room_for_one_grain(box: Box, grains: Grains) -> Iterator[str]:
    """A grain fits, and does not meet its own image across a periodic side."""
    diameter = 2e3 * grains.radius_range_m[1]
    for axis, side in zip("xyz", box.size_mm, strict=True):
        imaged = box.sides == "periodic" and axis != "x"
        least = diameter * (2.0 if imaged else 1.0)
        if side < least:
            why = "a grain would meet its own image" if imaged else "a grain does not fit"
            yield (
                f"box.size_mm: side {axis} is {side:g} mm, expected at least {least:g} mm ({why})"
            )


def _slab(box: Box, fines: Fines) -> Iterator[str]:
    """The slab must hold its fines and stay a slab; their number is bounded by memory."""
    area = box.size_mm[1] * box.size_mm[2]
    volume, fraction = fines.mean_volume_m3 * 1e9, fines.placed_fraction
    count = fines.count or fraction * area * (fines.slab_mm or 0.0) / volume
    length = fines.slab_mm or count * volume / (fraction * area)
    if count > MOST_FINES:
        yield (
            f"fines.count: {count:.3g} fines, expected at most {MOST_FINES:.0e}; shorten the slab"
            + (" or raise fines.cut_um" if fines.measured else "")
        )
    if length > MOST_SLAB * box.size_mm[0]:
        yield (
            f"{concentration_text(fines)} makes a slab of {length:.3g} mm, "
            f"expected at most {MOST_SLAB} box lengths; raise it or supply fewer fines"
        )


def _gap_of_sizes(grains: Grains, fines: Fines) -> Iterator[str]:
    none_fits = any(True for _ in SOME_THROAT.check(grains, fines))
    if fines.radius_range_m[1] >= grains.radius_range_m[0] and not none_fits:
        yield (
            f"{size_text('fines', fines)} is not below {size_text('grains', grains)} "
            "(the network needs a clear gap)"
            + ("; narrow sizes.cut_percent of one" if fines.measured or grains.measured else "")
        )


def _skin(run: Run, grains: Grains, fines: Fines) -> Iterator[str]:
    """The skin lies between a hundredth of a fine and a grain."""
    low, high = LEAST_SKIN * 1e3 * fines.radius_range_m[0], 1e3 * grains.radius_range_m[1]
    if run.skin_mm is not None and not low <= run.skin_mm <= high:
        yield (
            f"run.skin_mm: {run.skin_mm:g} mm, expected {low:.3g} ({LEAST_SKIN:g} of the smallest "
            "fine's radius: else neighbours are searched anew nearly every step) to "
            f"{high:.3g} (a grain's radius)"
        )


def _neighbour_bins(run: Run, box: Box, fines: Fines) -> Iterator[str]:
    """The bins of an invasion's neighbour search lie between memory's limit and the box."""
    least, most = (math.prod(box.size_mm) / MOST_NEIGHBOUR_BINS) ** (1 / 3), min(box.size_mm)
    if run.neighbour_bin_mm is not None and not least <= run.neighbour_bin_mm <= most:
        yield (
            f"run.neighbour_bin_mm: {run.neighbour_bin_mm:g} mm, expected {least:.3g} "
            f"({MOST_NEIGHBOUR_BINS:.0e} bins in the box) to {most:.3g} (its shortest side)"
        )


def _refresh(drag: Drag) -> Iterator[str]:
    if drag.scheme != "held" and drag.refresh_steps not in (None, 1):
        yield (
            f"drag.refresh_steps: {drag.refresh_steps} belongs to drag.scheme 'held', not "
            f"{drag.scheme!r}"
        )


def _viscous(drag: Drag, fines: Fines) -> Iterator[str]:
    if drag.scheme == "viscous" and not fines.one_size:
        yield (
            f"drag.scheme: 'viscous' needs fines of one size, {size_text('fines', fines)} "
            "(LIGGGHTS's viscous force is one number a material); take 'held' or 'implicit'"
        )


def _implicit(drag: Drag) -> Iterator[str]:
    if drag.scheme == "implicit" and drag.upstream == "darcy" and not drag.coupled:
        yield (
            "drag.upstream: 'darcy' changes the fluid's velocity at x = 0, drag.scheme "
            "'implicit' keeps one a fine; take 'interstitial', or another drag.scheme"
        )


def _inertia(drag: Drag) -> Iterator[str]:
    if drag.inertia != "none" and drag.scheme in ("viscous", "implicit") and not drag.coupled:
        yield (
            f"drag.inertia: {drag.inertia!r} makes the drag coefficient depend on the slip, "
            f"drag.scheme {drag.scheme!r} keeps one a fine; take 'held'"
        )


def _strengths(bonds: Bonds) -> Iterator[str]:
    """Bonds have both strengths or neither."""
    if (bonds.tensile_strength_MPa is None) != (bonds.shear_strength_MPa is None):
        absent = "tensile" if bonds.tensile_strength_MPa is None else "shear"
        yield (
            f"bonds.{absent}_strength_MPa: missing next to the other strength; give both, or "
            "neither for bonds that never break"
        )


def _end(run: Run) -> Iterator[str]:
    if run.duration_ms is not None and run.cap_ms is not None:
        yield (
            f"run.cap_ms: {run.cap_ms} together with run.duration_ms {run.duration_ms}: "
            "give one of the two"
        )


def _sections(analysis: AnalysisChoices) -> Iterator[str]:
    if isinstance(analysis.sections, tuple):
        yield f"analysis.sections: {analysis.sections}: a case gives the number of sections"


def _laws(analysis: AnalysisChoices) -> Iterator[str]:
    yield from analysis.refusals()


def _profile_bins(box: Box, analysis: AnalysisChoices) -> Iterator[str]:
    thickness = analysis.profile_bin_mm
    if thickness is None:
        yield "analysis.profile_bin_mm: missing, a case gives the thickness of its bins"
    elif box.size_mm[0] / thickness > MOST_BINS:
        yield (
            f"analysis.profile_bin_mm: {thickness:g} cuts {box.size_mm[0]:g} mm into more than "
            f"{MOST_BINS} bins; expected at least {box.size_mm[0] / MOST_BINS:.3g}"
        )


def _of_the_contact(name: str) -> Rule:
    keys = sorted(MODEL_KEYS["hooke"] | MODEL_KEYS["hertz"] | {"damping_ratio"})
    return Rule(("contact.model", *(f"{name}.{key}" for key in keys)), of_the_model(name))


_SPHERES = ("grains", "fines")
_SLAB_KEYS = (
    *("fines.radius_mm", "fines.count", "fines.slab_mm"),
    *("fines.concentration", "fines.solids_kg_m3"),
)
RULES = (
    *SIZE_RULES,
    _rising("grains"),
    _rising("fines"),
    Rule(("grains.porosity", "grains.count"), _number_of_grains),
    Rule(("fines.count", "fines.slab_mm"), _number_of_fines),
    Rule(("box.size_mm", "grains.radius_mm", "grains.porosity", "grains.count"), _room_for_grains),
    Rule(("box.size_mm", "box.sides", "grains.radius_mm"), _room_for_one_grain),
    Rule(("box.size_mm", *_SLAB_KEYS), _slab),
    Rule(("grains.radius_mm", "fines.radius_mm"), _gap_of_sizes),
    SOME_THROAT,
    Rule(("run.skin_mm", "grains.radius_mm", "fines.radius_mm"), _skin),
    Rule(("run.neighbour_bin_mm", "box.size_mm", "fines"), _neighbour_bins),
    *FLOW_RULES,
    *CLEAN_UP_RULES,
    Rule(("drag.field", "drag.upstream", "drag.drive"), flow_field),
    Rule(("drag.field", "grains.motion"), network_grains),
    Rule(("drag.field", "drag.crowd", "drag.inertia"), coupled_inertia),
    Rule(("run.stop_rate", "drag.field", "drag.drive"), stop_rate),
    Rule(("run.stop_pore_volumes", "drag.field"), stop_volume),
    Rule(("drag.scheme", "drag.crowd", "drag.field"), crowd_scheme),
    Rule(("drag.update_travel", "drag.crowd", "drag.field"), update_travel),
    Rule(("drag.scheme", "drag.refresh_steps"), _refresh),
    Rule(("drag.scheme", "fines.radius_mm"), _viscous),
    Rule(("drag.scheme", "drag.upstream"), _implicit),
    Rule(("drag.scheme", "drag.inertia"), _inertia),
    *(_of_the_contact(name) for name in ("grains", "fines")),
    Rule(("contact.model", "contact.cohesion_J_m3"), of_cohesion),
    Rule(("contact.rolling_friction", "grains.friction", "fines.friction"), of_rolling),
    Rule(("bonds.tensile_strength_MPa", "bonds.shear_strength_MPa"), _strengths),
    Rule(("run.duration_ms", "run.cap_ms"), _end),
    Rule(("analysis.sections",), _sections),
    Rule(("analysis.law", "analysis.damage_law"), _laws),
    Rule(("box.size_mm", "analysis.profile_bin_mm"), _profile_bins),
)
"""All rules, in the order in which their problems are reported."""
