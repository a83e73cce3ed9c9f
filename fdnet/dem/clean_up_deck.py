"""The deck of a clean-up: the end of an invasion, with the flow turned back."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fdnet.dem.clean_up_states import Cleaned
from fdnet.dem.coupled_parts import coupled_parts, dumped_group
from fdnet.dem.deck import Deck, number, render_text
from fdnet.dem.drag import BELOW_ZERO, drag_variables, forces_left_out
from fdnet.dem.gravity import gravity_variables
from fdnet.dem.invade_deck import moving_variables
from fdnet.dem.scene import header_variables
from fdnet.scales.clean_up import BackFlow
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.dump import COLUMNS, FORMAT


@dataclass(frozen=True, slots=True, kw_only=True)
class Beginning:
    """Where LIGGGHTS begins.

    Attributes:
        restart: path of the restart file, from the folder of the deck.
        row: the checkpoint of the clean-up that it holds; None at the end of the invasion.
    """

    restart: str
    row: Cleaned | None


def render_clean_up(flow: BackFlow, digest: str, begin: Beginning, *, ranks: int = 1) -> Deck:
    """The deck of a clean-up, at the end of the invasion or continued from a checkpoint."""
    case, scales = flow.case, flow.scales
    gravity, left_out = gravity_variables(case, scales)
    left_out += forces_left_out(case)
    header = header_variables(case, "invade", left_out, ranks)
    text = render_text(
        "clean_up.in.j2",
        header
        | moving_variables(case, scales)
        | {
            "stage": "clean_up",
            "digest": digest,
            "going_on": begin.row is not None,
            "restart": begin.restart,
            "gravity": gravity,
            "drag": turned_drag(flow),
            "resume": False,
            "regions": _regions(flow),
            "start": _start(begin.row),
            "chunks": flow.chunks,
            "chunk_steps": scales.checkpoint_steps,
            "quiet_chunks": flow.quiet_chunks,
            **_dump(flow),
        },
    )
    return Deck(text=text, stage="clean_up", digest=digest, left_out=tuple(left_out))


def clean_up_parts(flow: BackFlow) -> dict[str, str]:
    """Name and text of each file that a coupled clean-up includes; empty when it is not."""
    parts = coupled_parts(flow.case, flow.scales)
    if parts:
        parts["checkpoint.in"] = render_text("cleaned.in.j2", _dump(flow))
    return parts


def turned_drag(flow: BackFlow) -> dict[str, Any]:
    """The variables of `_drag.in.j2` with the velocities and the gradient below 0.

    What depends on the size of a slip alone is that of the flow ahead.
    """
    ahead = drag_variables(flow.case, flow.scales)
    back = drag_variables(flow.case, _turned(flow.scales))
    return back | {"inertia": ahead["inertia"]} if "inertia" in ahead else back


def _turned(scales: InvasionScales) -> InvasionScales:
    push = scales.push
    return replace(
        scales,
        drive_velocity=-scales.drive_velocity,
        upstream_velocity=-scales.upstream_velocity,
        push=replace(push, velocity=-push.velocity, gradient=-push.gradient, reynolds_slope=0.0),
    )


def _dump(flow: BackFlow) -> dict[str, str]:
    return {
        "dump_group": dumped_group(flow.case),
        "dump_columns": COLUMNS,
        "dump_format": FORMAT,
    }


def _start(row: Cleaned | None) -> dict[str, int]:
    if row is None:
        return {"chunk": 1, "out": 0, "passed": 0, "quiet": 0}
    return {"chunk": row.chunk + 1, "out": row.out, "passed": row.passed, "quiet": row.quiet}


def _regions(flow: BackFlow) -> dict[str, str]:
    length, sides = flow.case.size_m[0], "INF INF INF INF"
    return {
        "specimen": f"0.0 {number(np.nextafter(length, 0))} {sides}",
        "out": f"INF {number(BELOW_ZERO)} {sides}",
        "beyond": f"{number(length)} INF {sides}",
    }
