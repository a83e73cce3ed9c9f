"""The section of the report on resolved Stokes flow; a report without it has none."""

from collections.abc import Mapping, Sequence
from typing import Any

from fdnet.report.units import in_millidarcy

NAME = "stokes"
_HEAD = (
    "depth (mm)",
    "before, flow (mD)",
    "before, network (mD)",
    "after, flow (mD)",
    "after, network (mD)",
    "lost, flow",
    "lost, network",
    "cells of the flow (&micro;m)",
)
_NOTE = (
    "Resolved flow solves the Stokes equations between all spheres on two grids and needs no law "
    "of throats. The error behind &plusmn; is its own. The columns &ldquo;network&rdquo; hold "
    "what the run has. Where the two differ by more than that error, the difference is the error "
    "of the network. Cells are those of the finer grid, before and after. The damage law of the "
    "network is {}."
)


def section_html(rows: Sequence[Mapping[str, Any]]) -> str:
    """The section as HTML, one row for each section that was resolved."""
    head = "".join(f'<th class="number">{name}</th>' for name in _HEAD)
    body = "\n".join(f"<tr>{_cells(row)}</tr>" for row in rows)
    return (
        "<h2>Sections by resolved Stokes flow</h2>\n"
        f'<div class="scroll"><table>\n<tr>{head}</tr>\n{body}\n</table></div>\n'
        f'<p class="note">{_NOTE.format(rows[0]["network_damage_law"])}</p>'
    )


def _cells(row: Mapping[str, Any]) -> str:
    texts = [
        f"{1e3 * row['x_lo_m']:g} to {1e3 * row['x_hi_m']:g}",
        f"{in_millidarcy(row['k_initial_m2'])} &plusmn; {row['k_initial_error']:.1%}",
        in_millidarcy(row["network_k_initial_m2"]),
        f"{in_millidarcy(row['k_damaged_m2'])} &plusmn; {row['k_damaged_error']:.1%}",
        in_millidarcy(row["network_k_damaged_m2"]),
        _share(row["k_reduction"]),
        _share(row["network_k_reduction"]),
        f"{1e6 * row['cell_initial_m']:.3g}, {1e6 * row['cell_damaged_m']:.3g}",
    ]
    return "".join(f'<td class="number">{text}</td>' for text in texts)


def _share(value: float | None) -> str:
    return "&ndash;" if value is None else f"{value:.1%}"
