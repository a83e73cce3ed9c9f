"""The files of a coupled deck that LIGGGHTS includes as the invasion goes on."""

from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import plug_allowance
from fdnet.dem.deck import render_text
from fdnet.dem.drag import drag_variables
from fdnet.dem.fluid import STATE, shown_columns
from fdnet.files.atomic import write_text
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.dump import COLUMNS, FORMAT


def write_coupled_parts(case: InvasionCase, scales: InvasionScales, folder: Path) -> None:
    """Write the files that a coupled deck is continued by."""
    for name, text in coupled_parts(case, scales).items():
        write_text(folder / name, text)


def coupled_parts(case: InvasionCase, scales: InvasionScales) -> dict[str, str]:
    """Name and text of each file that a coupled deck is continued by; empty when it is not."""
    if not case.drag.coupled:
        return {}
    shown = {"dump_columns": COLUMNS, "dump_group": dumped_group(case)}
    coefficient = "Ksl" if case.drag.scheme == "implicit" else "cd"
    drag = drag_variables(case, scales)
    parts = {
        "ask.in": render_text(
            "ask.in.j2", shown | {"dump_columns": shown_columns(case), "state": STATE}
        ),
        "fluid.in": render_text("fluid.in.j2", {"coefficient": coefficient}),
        "checkpoint.in": render_text(
            "checkpoint.in.j2",
            shown | {"dump_format": FORMAT, "allowance": plug_allowance(case, scales)},
        ),
    }
    if drag["hold_steps"]:
        parts["held.in"] = render_text("held.in.j2", {"drag": drag})
    return parts


def dumped_group(case: InvasionCase) -> str:
    """The group of spheres that move, which dumps hold."""
    return "all" if case.grains.motion == "mobile" else "fines"
