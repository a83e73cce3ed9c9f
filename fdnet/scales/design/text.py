"""The case file of a design, with the reason next to each value."""

import json
import textwrap
from collections.abc import Iterator
from typing import Any

from fdnet.scales.design.choice import PLUG_RATE, Design, mm, tables_of, um
from fdnet.scales.design.sizing import FINEST_OF_THROAT, SECTION
from fdnet.scales.forces.throat import throat_width
from fdnet.scales.grain_pack import grain_count
from fdnet.scales.supply import PLUG_SOLIDS
from fdnet.scales.times import spoken_time

_WIDTH = 96


def case_text(design: Design) -> str:
    """A case file that reads as the case of the design."""
    tables, notes = tables_of(design.answers, design.choice), _notes(design)
    lines = [*_comment(_top(design)), *_rows("", {k: tables[k] for k in ("name", "seed")}, {})]
    for name, table in tables.items():
        if isinstance(table, dict) and table:
            lines += ["", f"[{name}]", *_rows(name, table, notes)]
    return "\n".join(lines) + "\n"


def _rows(name: str, table: dict[str, Any], notes: dict[str, str]) -> Iterator[str]:
    for key, value in table.items():
        if f"{name}.{key}" in notes:
            yield from _comment(notes[f"{name}.{key}"])
        yield f"{key} = {_value(value)}"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    return json.dumps(value)


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, _WIDTH)]


def _top(design: Design) -> str:
    answers, fines = design.answers, design.case.fines
    median = (
        um(fines.curve.size_at((0.5 - fines.curve.below) / fines.curve.kept))
        if (fines.curve.below < 0.5)
        else "the solids"
    )
    return (
        f"A mud of {answers.solids} solids (half of them below {median}) at a sand of "
        f"{answers.porosity} porosity, {answers.overbalance} over the formation. Written by "
        f"fdnet init, size {design.budget.name}: the run is expected to take "
        f"{spoken_time(design.seconds)} on one core. fdnet check looks at it, fdnet run runs it."
    )


def _notes(design: Design) -> dict[str, str]:
    return {
        **_specimen_notes(design),
        **_mud_notes(design),
        **_run_notes(design),
    }


def _specimen_notes(design: Design) -> dict[str, str]:
    case, choice = design.case, design.choice
    grains, mean = case.grains.curve, case.grains.sauter_diameter_m
    notes = {
        "box.size": (
            f"Depth, width, width. The width is {choice.width / mean:.2g} mean grains "
            f"({mm(mean)}), and above two of the largest ({mm(grains.high)}), so that no grain "
            f"meets itself across the periodic sides. It holds about {grain_count(case)} grains. "
            f"The depth is {choice.length / mean:.2g} grains."
        ),
        "analysis.sections": (
            f"Slabs by depth of {mm(choice.length / choice.sections)}, "
            f"about {SECTION:g} grains each: thinner ones show single throats."
        ),
        "well.radius": (
            "The overbalance is lost in radial flow around the well, from its face to the "
            f"drainage radius: the mud moves at {design.scales.interstitial_velocity:.2g} m/s in "
            "the pores."
        ),
    }
    if choice.sand_cut > 1.0:
        notes["grains.sizes"] = (
            f"The finest {choice.sand_cut:g} % of the sand are left out, because the coarsest "
            "solids of the mud must stay below the smallest grain."
        )
    return notes


def _mud_notes(design: Design) -> dict[str, str]:
    case, choice, scales = design.case, design.choice, design.scales
    throat = throat_width(scales.porosity, scales.permeability)
    curve = case.fines.curve
    notes = {"fines.sizes": f"The throats of the sand are some {um(throat)} wide."}
    if design.answers.assumed_spread:
        notes["fines.sizes"] += (
            " The spread is assumed, half and twice the median: give D10 and D90 if you know them."
        )
    if choice.mud_cut < 99.0:
        notes["fines.sizes"] += (
            f" The coarsest {100 * curve.above:.2g} % are left out: they are as large as the "
            "smallest grains and would only lie in the cake."
        )
    if choice.cut:
        notes["fines.cut"] = _cut_note(design, throat)
    notes["fines.slab"] = _slab_note(design)
    return notes


def left_out(design: Design) -> Iterator[str]:
    """What of the sand and the mud is not in the case, and whether that was enough."""
    choice, curve = design.choice, design.case.fines.curve
    if choice.sand_cut > 1.0:
        yield f"left out: the finest {choice.sand_cut:g} % of the sand"
    if curve.below > 0.0:
        yield f"left out: {100 * curve.below:.2g} % of the solids, finer than {um(curve.low)}"
    if curve.above > 0.0:
        yield f"left out: {100 * curve.above:.2g} % of the solids, coarser than {um(curve.high)}"
    if choice.supply_share < 1.0:
        yield f"mud: {100 * choice.supply_share:.0f} % of what surely plugs the face"
    if design.seconds > 1.05 * design.budget.seconds:
        yield (
            f"longer than the {spoken_time(design.budget.seconds)} of --size "
            f"{design.budget.name}: no more can be left out; coarser or fewer solids are faster"
        )


def _cut_note(design: Design, throat: float) -> str:
    curve = design.case.fines.curve
    text = f"{100 * curve.below:.0f} % of the solids are finer than this and left out"
    if curve.low <= 1.01 * FINEST_OF_THROAT * throat:
        return f"{text}: below a seventh of a throat they pass."
    return (
        f"{text}, so that the run fits its time ({spoken_time(design.budget.seconds)} for the "
        f"size {design.budget.name}). Those above a seventh of a throat "
        f"({um(FINEST_OF_THROAT * throat)}) matter: lower it when you can wait longer."
    )


def _slab_note(design: Design) -> str:
    scales, choice = design.scales, design.choice
    feeding = scales.slab_length / scales.upstream_velocity
    text = (
        f"Length of mud that is supplied: {scales.supplied_count} fines, all of them at the face "
        f"after {_ms(feeding * scales.force_factor)}. "
    )
    if choice.supply_share >= 1.0:
        return text + (
            f"They would fill {PLUG_SOLIDS:g} of a median grain's depth, two to six times what "
            "plugged the shipped specimens."
        )
    return text + (
        f"It is {100 * choice.supply_share:.0f} % of what surely plugs the face, because more "
        "does not fit the time: if the summary says supply_exhausted, more mud would do more "
        "damage."
    )


def _run_notes(design: Design) -> dict[str, str]:
    scales, choice = design.scales, design.choice
    notes = {
        "run.stiffness": (
            "Contacts as soft as they may be: the time of the run goes with the root of it, and "
            f"the predicted overlap is {100 * max(scales.impact_overlap, scales.drag_overlap):.1f}"
            " % of a fine."
        ),
        "run.plug_rate": (
            f"The face counts as plugged when less than {100 * PLUG_RATE:g} % of the fines that "
            f"arrive still enter, for {_ms(scales.plug_time * scales.force_factor)}."
        ),
        "run.cap": "The end at the latest; a summary that says cap is not final.",
    }
    if choice.driven:
        notes["drag.drive_velocity_m_s"] = (
            "The fines have no inertia to speak of, so the simulation runs "
            f"{scales.force_factor:.2g} times as fast as the fluid."
        )
    if choice.inertia:
        notes["drag.inertia"] = (
            f"The Reynolds number of the largest fine is {scales.reynolds:.2g}: Stokes's drag "
            "would be too small."
        )
    return notes


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"
