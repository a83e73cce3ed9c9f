"""Resolved Stokes flow through one slab of a run, on two grids that the run folder keeps."""

import html
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from math import ceil, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from scipy import fft

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.files import write_text
from fdnet.network.states import cut_out
from fdnet.network.stokes import Closed, Estimate, StokesFlow, estimate, solve_slab, stagger
from fdnet.report.html import STOKES as NAME
from fdnet.report.html import put_section
from fdnet.report.html import stokes_html as section_html
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import locked
from fdnet.run.records import cores
from fdnet.spheres.snapshot import Array, Snapshot, one_line

ACROSS_A_GRAIN, ACROSS_A_FINE = 15.0, 3.5
"""Cells of the finer grid across the mean radius of the grains, and of the fines."""
COARSER = 1.5
"""Edge of a cell of the coarser grid over that of the finer one."""
TOLERANCE = 1e-3
"""Of the solves, as of `solve_stokes`."""
MOST_CELLS = 60_000_000
BYTES = 200
"""Memory for each cell."""
SECONDS = {"initial": 1.5e-5, "damaged": 4e-5}
"""For each cell, on one core of the machine of docs/stokes.md."""
Follow = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Slab:
    """Spheres between two planes.

    Attributes:
        spheres: those that reach into it.
        span: lower and upper plane, x in m.
        closed: which sides are walls.
        state: "initial" or "damaged".
        digest: of the file of the spheres.
    """

    spheres: Snapshot
    span: tuple[float, float]
    closed: Closed
    state: str
    digest: str

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

    def cells(self, across: float) -> tuple[int, int]:
        """Cells on the longest edge of the coarser and of the finer grid.

        `across` is their number across the mean radius of a fine in the finer one.
        """
        grains, fines = self.spheres.grains(), self.spheres.fines()
        wanted = [ACROSS_A_GRAIN / _mean(grains.radius)] if len(grains) else []
        wanted += [across / _mean(fines.radius)] if len(fines) else []
        if not wanted:
            raise CaseError(f"{self.words}: no sphere reaches into it, expected grains")
        fine = ceil(float(self.edges.max()) * max(wanted))
        return ceil(fine / COARSER), fine

    def cell(self, across: float) -> float:
        """Edge of a cell of the finer grid, m."""
        return float(self.edges.max()) / self.cells(across)[1]

    def size(self, cells: int) -> int:
        """Cells of the grid with `cells` on the longest edge."""
        return int(np.prod(stagger(self.edges, cells, closed=self.closed)[0].shape))


def _mean(radius: Array) -> float:
    """Sauter mean: sum of cubes over sum of squares."""
    return float(np.sum(radius**3) / np.sum(radius**2))


class KeptGrids:
    """The solved grids of a run in a file, which is whole after each of them."""

    def __init__(self, path: Path) -> None:
        """Reads what `path` holds. Raises CaseError where it cannot be understood."""
        self.path = path
        self.rows: list[dict[str, Any]] = []
        if path.is_file():
            names = {one.name for one in fields(StokesFlow)}
            try:
                rows = json.loads(path.read_text(encoding="utf-8"))
                if not isinstance(rows, list):
                    raise ValueError(f"{type(rows).__name__}, expected a list")
                self.rows = [dict(row) for row in rows]
                if not all(names <= row.keys() for row in self.rows):
                    raise ValueError(f"a grid lacks one of {', '.join(sorted(names))}")
                if not all(0.0 < float(row["k"]) < np.inf for row in self.rows):
                    raise ValueError("a permeability k is not positive and finite")
            except (ValueError, TypeError) as error:
                raise CaseError(
                    f"{path}: cannot be read as solved grids ({error}); remove it, and its grids "
                    "are solved again"
                ) from error

    def find(self, key: dict[str, Any]) -> StokesFlow | None:
        """The flow of a grid that was solved."""
        names = [one.name for one in fields(StokesFlow)]
        for row in self.rows:
            if all(row.get(name) == value for name, value in key.items()):
                return StokesFlow(**{name: row[name] for name in names})
        return None

    def add(self, key: dict[str, Any], flow: StokesFlow) -> None:
        """Keeps a solved grid."""
        self.rows.append(key | {one.name: getattr(flow, one.name) for one in fields(StokesFlow)})
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_text(self.path, json.dumps(self.rows, indent=1) + "\n")


def refuse_large(slab: Slab, across: float) -> None:
    """Raises CaseError where the finer grid would take more than `MOST_CELLS`."""
    size = slab.size(slab.cells(across)[1])
    if size > MOST_CELLS:
        raise CaseError(
            f"{slab.words}: {size / 1e6:.0f} million cells, expected at most "
            f"{MOST_CELLS / 1e6:.0f} million; lower --across from {across:g}, or analyse the run "
            "with thinner sections"
        )


def permeability_of(slab: Slab, across: float, kept: KeptGrids, follow: Follow) -> Estimate:
    """Permeability of the slab along x, m2, and its error."""
    coarse, fine = (_flow(slab, cells, kept, follow) for cells in slab.cells(across))
    return estimate(coarse, fine, with_fines=len(slab.spheres.fines()) > 0)


def _flow(slab: Slab, cells: int, kept: KeptGrids, follow: Follow) -> StokesFlow:
    key = {
        "state": slab.state,
        "x_lo_m": slab.span[0],
        "x_hi_m": slab.span[1],
        "cells": cells,
        "spheres": slab.digest,
    }
    flow = kept.find(key)
    if flow is None:
        follow(_expected(slab, slab.size(cells)))
        with fft.set_workers(cores()):
            flow = solve_slab(
                slab.spheres, slab.span, cells=cells, tolerance=TOLERANCE, closed=slab.closed
            )
        kept.add(key, flow)
    return flow


def _expected(slab: Slab, size: int) -> str:
    seconds = max(1.0, SECONDS[slab.state] * size / cores() ** 0.5)
    took = f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
    memory = BYTES * size / 2**30
    return f"{slab.words}: {size / 1e6:.1f} million cells, about {took} and {memory:.1f} GiB"


# ------------------------------------------------------------------------------------------------
# Sections of a finished run by resolved Stokes flow, and what the network gives for them.
#
# Resolved flow needs no law of throats. It takes minutes where the network takes seconds, so it is
# computed for the sections that a user names, mostly the first.


FOLDER, GRIDS, TABLE = "stokes", "grids.json", "sections.csv"
"""Folder in the run folder, the file of the solved grids, the table of the sections."""
INITIAL, DAMAGED = "initial", "damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class StokesSection:
    """A section, cut out, by resolved flow.

    Attributes:
        x_lo_m: where it begins, m.
        x_hi_m: where it ends, m.
        k_initial_m2: without fines, m2.
        k_initial_error: share of it.
        k_damaged_m2: with fines, m2.
        k_damaged_error: share of it.
        k_reduction: 1 - k_damaged_m2 / k_initial_m2.
        cell_initial_m: edge of a cell of the finer grid without fines, m.
        cell_damaged_m: edge of a cell of the finer grid with fines, m.
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


def stokes_sections(
    folder: Path,
    numbers: Sequence[int] = (1,),
    *,
    across: float = ACROSS_A_FINE,
    follow: Follow = lambda line: None,
) -> list[dict[str, Any]]:
    """Sections of a finished run by resolved Stokes flow and by the network, each cut out.

    They are written to the folder `FOLDER` of the run and to its report. Every solved grid is kept
    there, so a cut computation goes on behind the last of them.

    Args:
        folder: of the run.
        numbers: of the sections, from 1 at the face.
        across: cells across the mean radius of a fine, on the finer of two grids.
        follow: takes a line on each grid before it is solved.

    Returns:
        For each section its number, the fields of `StokesSection`, and by the network the
        permeabilities (m2), the reduction, the damage law, and what the run took from resolved
        flow.

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
        return _resolved(open_run(folder), numbers, across, follow)


def _resolved(
    run: FinishedRun, numbers: Sequence[int], across: float, follow: Follow
) -> list[dict[str, Any]]:
    spheres = {INITIAL: run.spheres("initial"), DAMAGED: run.spheres("damaged")}
    slabs = {number: _slabs(run, spheres, number) for number in numbers}
    for pair in slabs.values():
        for slab in pair:
            refuse_large(slab, across)
    kept = KeptGrids(run.path / FOLDER / GRIDS)
    table = run.path / FOLDER / TABLE
    read_sections(table)  # refuses a broken table before hours of solving
    for pair in slabs.values():
        by_state = {slab.state: permeability_of(slab, across, kept, follow) for slab in pair}
        cells = {slab.state: slab.cell(across) for slab in pair}
        row = StokesSection(
            x_lo_m=pair[0].span[0],
            x_hi_m=pair[0].span[1],
            **_of(INITIAL, by_state[INITIAL], cells[INITIAL]),
            **_of(DAMAGED, by_state[pair[-1].state], cells[pair[-1].state]),
            k_reduction=1.0 - by_state[pair[-1].state].k / by_state[INITIAL].k,
        )
        _write(table, [one for one in read_sections(table) if not _same(one, row)] + [row])
    rows = with_network(read_sections(table), run.summary)
    if (run.path / "report.html").is_file():
        put_section(run.path / "report.html", NAME, section_html(rows))
    return [row for row in rows if row["section"] in slabs]


def report_section(folder: Path, case: Case, summary: Mapping[str, Any]) -> str:
    """The section of the report as HTML; "" where no flow was resolved.

    There is none either where the network was analysed with walls that slip, for those of the
    flow do not. A table that cannot be read is named there. `summary` is that of the run in
    `folder`.
    """
    if _slips(case):
        return ""
    try:
        rows = with_network(read_sections(folder / FOLDER / TABLE), summary)
    except CaseError as error:
        return f'<p class="note">{html.escape(str(error))}</p>'
    return section_html(rows) if rows else ""


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
                rows.append({"section": section["section"]} | asdict(one) | network | law)
    return rows


def _slabs(run: FinishedRun, spheres: Mapping[str, Snapshot], number: int) -> list[Slab]:
    """The section before and, where fines reach into it or grains moved, after the invasion."""
    sections = run.summary["sections"]
    if not 1 <= number <= len(sections):
        raise CaseError(
            f"--section: {number}, expected 1 to {len(sections)}, the sections of the run"
        )
    if _slips(run.case):
        raise CaseError(
            "analysis.walls: 'slip', but resolved flow knows only side walls that hold the fluid; "
            "analyse the run with analysis.walls = 'no-slip' first"
        )
    span = (sections[number - 1]["x_lo_m"], sections[number - 1]["x_hi_m"])
    before, after = (_slab(run, state, one, span) for state, one in spheres.items())
    changed = len(after.spheres.fines()) or "k_moved_m2" in run.summary
    return [before, after] if changed else [before]


def _slab(run: FinishedRun, state: str, spheres: Snapshot, span: tuple[float, float]) -> Slab:
    _, y, z = run.case.periodic
    return Slab(
        spheres=cut_out(spheres, span, run.case.periodic),
        span=span,
        closed=(False, not y, not z),
        state=state,
        digest=str(run.manifest.get("files", {}).get(f"spheres_{state}.csv", "")),
    )


def _slips(case: Case) -> bool:
    """Whether the network has side walls that let the fluid slip; resolved flow has none."""
    return not all(case.periodic[1:]) and case.analysis.walls == "slip"


def _of(state: str, flow: Estimate, cell: float) -> dict[str, float]:
    return {f"k_{state}_m2": flow.k, f"k_{state}_error": flow.error, f"cell_{state}_m": cell}


def _same(one: StokesSection, other: StokesSection) -> bool:
    return (one.x_lo_m, one.x_hi_m) == (other.x_lo_m, other.x_hi_m)


def _write(path: Path, rows: Sequence[StokesSection]) -> None:
    names = [one.name for one in fields(StokesSection)]
    ordered = sorted(rows, key=lambda row: row.x_lo_m)
    lines = [",".join(repr(value) for value in asdict(row).values()) for row in ordered]
    write_text(path, "\n".join([",".join(names), *lines]) + "\n")


def read_sections(path: Path) -> list[StokesSection]:
    """The resolved sections in a table; none where it does not exist.

    Raises CaseError where it has other columns or no numbers.
    """
    if not path.is_file():
        return []
    names = [one.name for one in fields(StokesSection)]
    try:
        lines = [line.split(",") for line in path.read_text(encoding="utf-8").split()]
        if lines[:1] != [names]:
            raise ValueError(f"expected the columns {','.join(names)}")
        rows = [dict(zip(names, map(float, line), strict=True)) for line in lines[1:]]
        if not all(isfinite(value) for row in rows for value in row.values()):
            raise ValueError("a number is not finite")
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: {error}; remove it and call fdnet stokes again") from error
    return [StokesSection(**row) for row in rows]
