"""What must hold between the tables of a case."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.control import Run
from fdnet.case.particles import Fines, Grains
from fdnet.case.parts import Box, Drag
from fdnet.case.values import (
    LEAST_SKIN,
    MOST_BINS,
    MOST_FINES,
    MOST_GRAINS,
    MOST_NEIGHBOUR_BINS,
    MOST_SLAB,
)


def cross_problems(parts: Mapping[str, Any]) -> Iterator[str]:
    """What is wrong between the parts of a case; parts that did not validate are absent or None."""
    box, grains, fines = parts.get("box"), parts.get("grains"), parts.get("fines")
    for name, spheres in (("grains", grains), ("fines", fines)):
        pair = spheres.radius_mm if spheres else None
        if isinstance(pair, tuple) and pair[0] >= pair[1]:
            yield f"{name}.radius_mm: {list(pair)} must rise, [smallest, largest]"
    if grains and grains.porosity is None and grains.count is None:
        yield "grains.porosity: missing, give it (0 to 1) or grains.count"
    if fines and (fines.count is None) == (fines.slab_mm is None):
        yield f"fines.count: {fines.count} with fines.slab_mm: {fines.slab_mm}, give exactly one of the two"
    if box and grains:
        yield from _box_problems(box, grains)
    if box and fines:
        yield from _supply_problems(box, fines)
    if grains and fines and fines.radius_range_m[1] >= grains.radius_range_m[0]:
        yield (
            f"fines.radius_mm: {fines.radius_mm} is not below grains.radius_mm {grains.radius_mm} "
            "(the network needs a clear gap)"
        )
    run = parts.get("run")
    if run and box and grains and fines:
        yield from _search_problems(run, box, grains, fines)
    yield from _choice_problems(parts)


def _search_problems(run: Run, box: Box, grains: Grains, fines: Fines) -> Iterator[str]:
    """The skin lies between a hundredth of a fine and a grain, the bins between memory's limit and the box."""
    low, high = LEAST_SKIN * 1e3 * fines.radius_range_m[0], 1e3 * grains.radius_range_m[1]
    if run.skin_mm is not None and not low <= run.skin_mm <= high:
        yield (
            f"run.skin_mm: {run.skin_mm:g} mm, expected {low:.3g} ({LEAST_SKIN:g} of the smallest fine's radius: else "
            f"neighbours are searched anew nearly every step) to {high:.3g} (a grain's radius)"
        )
    volume = math.prod(box.size_mm)
    least, most = (volume / MOST_NEIGHBOUR_BINS) ** (1 / 3), min(box.size_mm)
    if run.neighbour_bin_mm is not None and not least <= run.neighbour_bin_mm <= most:
        yield (
            f"run.neighbour_bin_mm: {run.neighbour_bin_mm:g} mm, expected {least:.3g} ({MOST_NEIGHBOUR_BINS:.0e} bins "
            f"in the box) to {most:.3g} (its shortest side)"
        )


def _choice_problems(parts: Mapping[str, Any]) -> Iterator[str]:
    drag, gravity, run, box, analysis = (
        parts.get(name) for name in ("drag", "gravity", "run", "box", "analysis")
    )
    if drag:
        yield from _drag_problems(drag, parts.get("fines"))
    if gravity and gravity.mode != "off" and gravity.buoyancy:
        pulled = [component for component in gravity.acceleration_m_s2 if component]
        if len(pulled) > 1 or any(component > 0 for component in pulled):
            yield (
                f"gravity.acceleration_m_s2: {list(gravity.acceleration_m_s2)}: LIGGGHTS's buoyancy needs "
                "gravity down one axis, "
                "e.g. [0.0, 0.0, -9.81]; turn it, or set gravity.buoyancy = false"
            )
    if run and run.duration_ms is not None and run.cap_ms is not None:
        yield f"run.cap_ms: {run.cap_ms} beside run.duration_ms {run.duration_ms}: give one of the two"
    if analysis:
        yield from _analysis_problems(analysis, box)


def _analysis_problems(analysis: AnalysisChoices, box: Box | None) -> Iterator[str]:
    """Edges of sections and bins without a thickness are for Python, not for a case."""
    if isinstance(analysis.sections, tuple):
        yield f"analysis.sections: {analysis.sections}: a case gives the number of sections"
    thickness = analysis.profile_bin_mm
    if thickness is None:
        yield "analysis.profile_bin_mm: missing, a case gives the thickness of its bins"
    elif box and box.size_mm[0] / thickness > MOST_BINS:
        yield (
            f"analysis.profile_bin_mm: {thickness:g} cuts {box.size_mm[0]:g} mm into more than "
            f"{MOST_BINS} bins; expected at least {box.size_mm[0] / MOST_BINS:.3g}"
        )


def _drag_problems(drag: Drag, fines: Fines | None) -> Iterator[str]:
    if drag.field == "network":
        yield "drag.field: 'network' is not available yet; expected 'uniform'"
    if drag.scheme != "held" and drag.refresh_steps not in (None, 1):
        yield f"drag.refresh_steps: {drag.refresh_steps} belongs to drag.scheme 'held', not {drag.scheme!r}"
    if drag.scheme == "viscous" and fines and isinstance(fines.radius_mm, tuple):
        yield (
            f"drag.scheme: 'viscous' needs fines of one size, fines.radius_mm is {list(fines.radius_mm)} (LIGGGHTS's "
            "viscous force is one number a material); take 'held', 'every_step' or 'implicit'"
        )
    if drag.scheme == "implicit" and drag.upstream == "darcy":
        yield (
            "drag.upstream: 'darcy' changes the fluid's velocity at x = 0, drag.scheme 'implicit' keeps one a fine; "
            "take 'interstitial', or another drag.scheme"
        )


def _supply_problems(box: Box, fines: Fines) -> Iterator[str]:
    """The slab must hold its fines and stay a slab; their number is bounded by memory."""
    area = box.size_mm[1] * box.size_mm[2]
    volume = fines.mean_volume_m3 * 1e9
    count = fines.count or fines.concentration * area * (fines.slab_mm or 0.0) / volume
    length = fines.slab_mm or count * volume / (fines.concentration * area)
    if count > MOST_FINES:
        yield f"fines.count: {count:.3g} fines, expected at most {MOST_FINES:.0e}; shorten the slab"
    if length > MOST_SLAB * box.size_mm[0]:
        yield (
            f"fines.concentration: {fines.concentration:g} makes a slab of {length:.3g} mm, expected at most "
            f"{MOST_SLAB} box lengths; "
            "raise it or supply fewer fines"
        )


def _box_problems(box: Box, grains: Grains) -> Iterator[str]:
    solid = 1 - grains.porosity if grains.porosity is not None else 0.0
    expected = grains.count or solid * math.prod(box.size_mm) / (grains.mean_volume_m3 * 1e9)
    if expected > MOST_GRAINS:
        yield f"box.size_mm: {list(box.size_mm)} holds {expected:.3g} grains; expected at most {MOST_GRAINS:.0e}"
    if grains.count is not None and grains.count * grains.mean_volume_m3 * 1e9 >= math.prod(
        box.size_mm
    ):
        room = int(math.prod(box.size_mm) / (grains.mean_volume_m3 * 1e9))
        yield f"grains.count: {grains.count} spheres sum to more than the box; expected at most {room}"
    diameter_mm = 2e3 * grains.radius_range_m[1]
    need = 2.0 if box.sides == "periodic" else 1.0
    for axis, side in zip("xyz", box.size_mm, strict=True):
        least = diameter_mm * (need if axis != "x" else 1.0)
        if side < least:
            why = (
                "a grain would meet its own image"
                if need == 2.0 and axis != "x"
                else "a grain does not fit"
            )
            yield f"box.size_mm: side {axis} is {side:g} mm, expected at least {least:g} mm ({why})"
