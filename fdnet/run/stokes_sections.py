"""Sections of a finished run by resolved Stokes flow, and what the network gives for them.

Resolved flow needs no law of throats. It takes minutes where the network takes seconds, so it is
computed for the sections that a user names, mostly the first, each on two grids
(docs/how-to/check_the_face.md).
"""

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isclose
from pathlib import Path
from typing import Any

import numpy as np
from scipy import fft

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.network.states import cut_out
from fdnet.network.stokes import StokesFlow, Walled, divide, estimate, solve_slab
from fdnet.report.html import STOKES, put_section, stokes_html
from fdnet.report.tables import JsonObject, read_table, write_rows
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import locked
from fdnet.run.records import cores
from fdnet.spheres.snapshot import Array, Snapshot, one_line

ACROSS_A_GRAIN, ACROSS_A_FINE = 15.0, 3.5
"""Cells of the finer grid across the mean radius of the grains, and of the fines."""
COARSER = 1.5  # Edge of a cell of the coarser grid over that of the finer one
K_TOLERANCE = 1e-3  # Of the solves, as of `solve_stokes`
MOST_CELLS = 60_000_000
BYTES = 200  # Memory for each cell
SECONDS = {"initial": 1.2e-5, "damaged": 2.5e-5}  # For each cell, on one core
KEPT_IN, RESOLVED = "stokes", "sections.csv"
"""Folder in the run folder, and the table of the sections in it."""
Follow = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ResolvedSlab:
    """Spheres between two planes."""

    spheres: Snapshot  # those that reach into it
    span: tuple[float, float]  # lower and upper plane, x in m
    closed: Walled  # which sides are walls
    state: str  # "initial" or "damaged"
    across: float  # cells across the mean radius of a fine, on the finer of two grids

    __repr__ = one_line

    @property
    def edges(self) -> Array:
        """(3,) m."""
        return np.array([self.span[1] - self.span[0], *np.diff(self.spheres.box[1:])[:, 0]])

    @property
    def words(self) -> str:
        """The slab in words."""
        state = "after the invasion" if self.state == "damaged" else "before it"
        return f"{1e3 * self.span[0]:g} to {1e3 * self.span[1]:g} mm, {state}"

    @property
    def cells(self) -> tuple[int, int]:
        """Cells on the longest edge of the coarser and of the finer grid."""
        wanted = [
            cells * float(np.sum(r**2) / np.sum(r**3))  # over the Sauter mean radius
            for cells, r in (
                (ACROSS_A_GRAIN, self.spheres.grains().radius),
                (self.across, self.spheres.fines().radius),
            )
            if len(r)
        ]
        if not wanted:
            raise CaseError(f"{self.words}: no sphere reaches into it, expected grains")
        fine = ceil(float(self.edges.max()) * max(wanted))
        return ceil(fine / COARSER), fine

    def size(self, cells: int) -> int:
        """Cells of the grid with `cells` on the longest edge."""
        return int(np.prod(divide(self.edges, cells)))


def flow_through(slab: ResolvedSlab, cells: int, follow: Follow) -> StokesFlow:
    """The flow on one grid."""
    size = slab.size(cells)
    seconds = max(1.0, SECONDS[slab.state] * size / cores() ** 0.5)
    took = f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
    memory = BYTES * size / 2**30
    follow(f"{slab.words}: {size / 1e6:.1f} million cells, about {took} and {memory:.1f} GiB")
    with fft.set_workers(cores()):
        return solve_slab(
            slab.spheres, slab.span, cells=cells, tolerance=K_TOLERANCE, closed=slab.closed
        )


class StokesSection(JsonObject):
    """A section, cut out, by resolved flow: lengths in m, permeabilities in m2.

    An error is a share of its permeability, a cell the edge of one of the finer grid.
    """

    x_lo_m: float
    x_hi_m: float
    k_initial_m2: float
    k_initial_error: float
    k_damaged_m2: float
    k_damaged_error: float
    k_reduction: float
    cell_initial_m: float
    cell_damaged_m: float

    def is_at(self, place: Mapping[str, float]) -> bool:
        """Whether it has these numbers."""
        return all(isclose(getattr(self, key), one, rel_tol=1e-6) for key, one in place.items())


def stokes_sections(
    folder: Path,
    numbers: Sequence[int] = (1,),
    *,
    across: float = ACROSS_A_FINE,
    follow: Follow = lambda line: None,
) -> list[dict[str, Any]]:
    """Sections of a finished run by resolved Stokes flow and by the network, each cut out.

    They are written to the folder `KEPT_IN` of the run and to its report. A section that stands
    there, on the same grids, is not solved again.

    Args:
        folder: of the run.
        numbers: of the sections, from 1 at the face.
        across: cells across the mean radius of a fine, on the finer of two grids.
        follow: takes a line on each grid before it is solved.

    Returns:
        For each section its number, the fields of `StokesSection`, and what `with_network` adds.

    Raises:
        CaseError: there is no such section, the side walls let the fluid slip, the grid would be
            too large, `folder` holds no finished run, or another command is writing there.
        FlowError: a solve fails its checks.
    """
    if not 1.0 <= across <= 20.0:
        raise CaseError(
            f"--across: {across:g}, expected 1 to 20 cells across the radius of a fine"
        )
    with locked(open_run(folder).path):
        run = open_run(folder)
        slabs = _slabs(run, numbers, across)
        table = run.path / KEPT_IN / RESOLVED
        for before, *after in slabs:
            pair = {"initial": before, "damaged": after[0] if after else before}
            row = {"x_lo_m": before.span[0], "x_hi_m": before.span[1]}
            known = [one for one in read_sections(table) if not one.is_at(row)]
            for name, slab in pair.items():
                row[f"cell_{name}_m"] = float(slab.edges.max()) / slab.cells[1]
            if any(one.is_at(row) for one in read_sections(table)):
                continue
            for name, slab in pair.items():
                if name == "initial" or after:
                    flows = [flow_through(slab, cells, follow) for cells in slab.cells]
                    k = estimate(*flows, with_fines=len(slab.spheres.fines()) > 0)
                row |= {f"k_{name}_m2": k.k, f"k_{name}_error": k.error}
            row["k_reduction"] = 1.0 - row["k_damaged_m2"] / row["k_initial_m2"]
            every = sorted([*known, StokesSection(**row)], key=lambda one: one.x_lo_m)
            table.parent.mkdir(exist_ok=True)
            write_rows(table, [vars(one) for one in every])
        rows = with_network(read_sections(table), run.summary)
        if (run.path / "report.html").is_file():
            put_section(run.path / "report.html", STOKES, stokes_html(rows))
        return [row for row in rows if row["section"] in numbers]


def _slabs(run: FinishedRun, numbers: Sequence[int], across: float) -> list[list[ResolvedSlab]]:
    """Each section before and, where fines reach into it or grains moved, after the invasion."""
    if _slips(run.case):
        raise CaseError(
            "analysis.walls: 'slip', but resolved flow knows only side walls that hold the "
            "fluid; analyse the run with analysis.walls = 'no-slip' first"
        )
    spheres = {state: run.spheres(state) for state in ("initial", "damaged")}
    sections, (_, y, z), pairs = run.summary["sections"], run.case.periodic, []
    for number in numbers:
        if not 1 <= number <= len(sections):
            raise CaseError(
                f"--section: {number}, expected 1 to {len(sections)}, the sections of the run"
            )
        span = (sections[number - 1]["x_lo_m"], sections[number - 1]["x_hi_m"])
        pair = [
            ResolvedSlab(
                spheres=cut_out(one, span, run.case.periodic),
                span=span,
                closed=(False, not y, not z),
                state=state,
                across=across,
            )
            for state, one in spheres.items()
        ]
        if not len(pair[1].spheres.fines()) and "k_moved_m2" not in run.summary:
            pair.pop()
        for slab in pair:
            size = slab.size(slab.cells[1])
            if size > MOST_CELLS:
                raise CaseError(
                    f"{slab.words}: {size / 1e6:.0f} million cells, expected at most "
                    f"{MOST_CELLS / 1e6:.0f} million; lower --across from {across:g}, or analyse "
                    "the run with thinner sections"
                )
        pairs.append(pair)
    return pairs


def _slips(case: Case) -> bool:
    """Whether the network has side walls that let the fluid slip; resolved flow has none."""
    return not all(case.periodic[1:]) and case.analysis.walls == "slip"


def report_section(folder: Path, case: Case, summary: Mapping[str, Any]) -> str:
    """The section of the report as HTML; "" where no flow was resolved.

    There is none either where the network was analysed with walls that slip, for those of the
    flow do not. A table that cannot be read is named there. `summary` is that of the run in
    `folder`.
    """
    if _slips(case):
        return ""
    try:
        rows = with_network(read_sections(folder / KEPT_IN / RESOLVED), summary)
    except CaseError as error:
        return f'<p class="note">{html.escape(str(error))}</p>'
    return stokes_html(rows) if rows else ""


def with_network(
    resolved: Sequence[StokesSection], summary: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """The resolved sections that are sections of the `summary`, with what the network gives."""
    rows = []
    law = {"network_damage_law": str(summary.get("damage_law_used") or summary["damage_law"])}
    for section in summary["sections"]:
        for one in resolved:
            if one.x_lo_m == section["x_lo_m"] and one.x_hi_m == section["x_hi_m"]:
                names = ("k_initial_m2", "k_damaged_m2", "k_reduction")
                network = {f"network_{name}": section[name] for name in names}
                rows.append({"section": section["section"]} | vars(one) | network | law)
    return rows


def read_sections(path: Path) -> list[StokesSection]:
    """The resolved sections in a table; none where it does not exist.

    Raises CaseError where it has other columns or no numbers.
    """
    if not path.is_file():
        return []
    try:
        rows = read_table(path, list(StokesSection.model_fields)).to_dict("records")
        return [StokesSection.model_validate(row) for row in rows]
    except (CaseError, ValueError) as error:
        raise CaseError(
            f"{path}: is no table of resolved sections, expected a number in each of its columns; "
            "remove it and call fdnet stokes again"
        ) from error
