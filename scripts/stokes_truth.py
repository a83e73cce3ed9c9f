#!/usr/bin/env python3
"""Stokes truth: make periodic packs and compute their permeability on two grids, extrapolated.

    .venv/bin/python scripts/stokes_truth.py make
    .venv/bin/python scripts/stokes_truth.py solve tests/data/truth/packE_80_eps30.csv --cells 128 192 --axis x

`make [NAME ...]` writes the packs of truth_packs.PACKS (seeds stated there) to --packs. `solve` runs pack files (x, y,
z, radius, kind in mm, the periodic edge in the comment line) grid by grid: every finished grid is one row of --grids
and is not run again; each time --csv is written anew from all rows: case, file, edge_mm, axis, k_mm2, k_over_k0,
relative_error, source. Progress is printed. Method and checks: docs/stokes.md.
"""

import argparse
import csv
import logging
import resource
import shlex
import sys
from itertools import groupby
from pathlib import Path

from truth_packs import PACKS, made_deposit, made_grains, write_pack

from fdnet.spheres.porosity import measure_porosity
from fdnet.studies.stokes.stokes import StokesFlow, extrapolate, solve_stokes
from fdnet.studies.truth.packs import MM, read_pack

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


def make(names: list[str], folder: Path) -> None:
    """Make packs, in the order of PACKS."""
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


def solve(path: Path, options: argparse.Namespace) -> None:
    """All wanted grids of one pack, each a row as soon as it is done."""
    for cells in options.cells:
        rows = read_rows(options.grids)
        if any(
            (row["case"], row["axis"], row["cells"]) == (path.stem, options.axis, str(cells))
            for row in rows
        ):
            continue
        pack, edge = read_pack(path)
        flow = solve_stokes(
            pack, cells=cells, axis="xyz".index(options.axis), tolerance=options.tolerance
        )
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        values = (
            path.stem,
            path.name,
            f"{edge:.9g}",
            options.axis,
            cells,
            f"{flow.k / MM**2:.7e}",
            flow.iterations,
            f"{flow.residual:.2e}",
            flow.unknowns,
            f"{flow.seconds:.1f}",
            f"{memory:.0f}",
            shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
        )
        print(*values[:-1], flush=True)
        write_rows(options.grids, GRIDS, [*rows, dict(zip(GRIDS, map(str, values), strict=True))])
        write_rows(options.csv, TABLE, tabulated(read_rows(options.grids)))


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
            "relative_error": f"{100 * end.relative_error:.2g}%",
            "source": "own Stokes extrapolated (2nd order) from N="
            + "+".join(row["cells"] for row in grids),
        }
    return list(table.values())


def flow_of(row: dict[str, str]) -> StokesFlow:
    """A row of --grids as a result, k in mm2."""
    return StokesFlow(
        k=float(row["k_mm2"]),
        iterations=int(row["iterations"]),
        residual=float(row["slip"]),
        seconds=float(row["seconds"]),
        cells=int(row["cells"]),
        unknowns=int(row["unknowns"]),
    )


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file, none when there is no such file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write_rows(path: Path, columns: tuple[str, ...], rows: list[dict[str, str]]) -> None:
    """Write a CSV file anew."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    maker = verbs.add_parser("make", help="write the packs")
    maker.add_argument("names", nargs="*", choices=[[], *PACKS], metavar="NAME")
    maker.add_argument("--packs", type=Path, default=Path("tests/data/truth"))
    solver = verbs.add_parser("solve", help="permeability of pack files")
    solver.add_argument("files", nargs="+", type=Path, metavar="FILE.csv")
    solver.add_argument("--cells", nargs="+", type=int, default=[128, 192])
    solver.add_argument("--axis", choices="xyz", default="x")
    solver.add_argument("--tolerance", type=float, default=1e-4)
    solver.add_argument("--grids", type=Path, default=Path("docs/validation/truth_own_grids.csv"))
    solver.add_argument("--csv", type=Path, default=Path("docs/validation/truth_own.csv"))
    options = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="  %(message)s")
    if options.verb == "make":
        make(options.names, options.packs)
    else:
        for path in options.files:
            solve(path, options)


if __name__ == "__main__":
    main()
