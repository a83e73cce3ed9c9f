"""Stokes truth on grids: each finished grid is a row, and two grids give an extrapolated value."""

import resource
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from fdnet.network.stokes import StokesFlow, extrapolate, solve_stokes
from fdnet.spheres.geometry import measure_porosity
from validation.engine.csv_rows import read_named, write_named
from validation.truth.made_packs import PACKS, made_deposit, made_grains, write_pack
from validation.truth.packs import MM, read_pack

GRIDS = (
    "case",
    "file",
    "edge_mm",
    "axis",
    "cells",
    "k_mm2",
    "iterations",
    "slip",
    "unknowns",
    "seconds",
    "peak_memory_MB",
    "command",
)
TABLE = ("case", "file", "edge_mm", "axis", "k_mm2", "k_over_k0", "relative_error", "source")


@dataclass(frozen=True, slots=True, kw_only=True)
class Solve:
    """How packs are solved.

    Attributes:
        cells: numbers of cells along the edge, one for each grid.
        axis: direction of the flow, x, y or z.
        tolerance: of the solver's residual.
        grids: table of the finished grids, which is continued.
        table: table of the extrapolated values, which is written anew after every grid.
        command: what was typed, kept in the rows.
    """

    cells: Sequence[int]
    axis: str
    tolerance: float
    grids: Path
    table: Path
    command: str


def make(names: Sequence[str], folder: Path) -> None:
    """Writes the packs `names` of `PACKS` (all of them if empty) to `folder`, in their order."""
    for name in names or PACKS:
        wish = PACKS[name]
        pack, edge = made_deposit(wish, folder) if "intact" in wish else made_grains(name)
        write_pack(folder / f"{name}.csv", pack, edge, f"seed {wish['seed']}")
        porosity = measure_porosity(pack, periodic=(True,) * 3)
        print(
            f"{name}: {len(pack)} spheres, edge {edge:.6f} mm, porosity {porosity.mean:.4f}"
            f" +- {porosity.standard_error:.1g} (plain sum {porosity.sum:.4f})",
            flush=True,
        )


def solve(path: Path, wanted: Solve) -> None:
    """Solves one pack on all wanted grids that are not finished yet; each is a row when done."""
    for cells in wanted.cells:
        rows = _rows(wanted.grids)
        if any(
            (row["case"], row["axis"], row["cells"]) == (path.stem, wanted.axis, str(cells))
            for row in rows
        ):
            continue
        pack, edge = read_pack(path)
        flow = solve_stokes(
            pack, cells=cells, axis="xyz".index(wanted.axis), tolerance=wanted.tolerance
        )
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        values = (
            path.stem,
            path.name,
            f"{edge:.9g}",
            wanted.axis,
            cells,
            f"{flow.k / MM**2:.7e}",
            flow.iterations,
            f"{flow.residual:.2e}",
            flow.unknowns,
            f"{flow.seconds:.1f}",
            f"{memory:.0f}",
            wanted.command,
        )
        print(*values[:-1], flush=True)
        new = dict(zip(GRIDS, map(str, values), strict=True))
        write_named(wanted.grids, [*rows, new], columns=GRIDS)
        write_named(wanted.table, tabulated(_rows(wanted.grids)), columns=TABLE)


def _rows(path: Path) -> list[dict[str, str]]:
    return read_named(path) if path.exists() else []


def tabulated(rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """Extrapolated rows of all cases with two grids or more, from the two finest."""
    table: dict[tuple[str, str], dict[str, str]] = {}
    rows = sorted(rows, key=lambda row: (row["case"], row["axis"], int(row["cells"])))
    for (case, axis), group in groupby(rows, key=lambda row: (row["case"], row["axis"])):
        grids = list(group)[-2:]
        if len(grids) < 2:
            continue
        end = extrapolate(*map(flow_of, grids))
        intact = table.get((PACKS.get(case, {}).get("intact", ""), axis))
        table[case, axis] = {
            **{name: grids[0][name] for name in ("case", "file", "edge_mm", "axis")},
            "k_mm2": f"{end.k:.6g}",
            "k_over_k0": f"{end.k / float(intact['k_mm2']):.4f}" if intact else "",
            "relative_error": f"{100 * end.error:.2g}%",
            "source": "own Stokes extrapolated (2nd order) from N="
            + "+".join(row["cells"] for row in grids),
        }
    return list(table.values())


def flow_of(row: dict[str, str]) -> StokesFlow:
    """A row of the grids as a result, k in mm2."""
    return StokesFlow(
        k=float(row["k_mm2"]),
        iterations=int(row["iterations"]),
        residual=float(row["slip"]),
        seconds=float(row["seconds"]),
        cells=int(row["cells"]),
        unknowns=int(row["unknowns"]),
    )
