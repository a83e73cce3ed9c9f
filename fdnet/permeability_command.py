"""`fdnet permeability`: the permeability of spheres in a file, without LIGGGHTS."""

import argparse
import math
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.case.names import (
    DAMAGE_LAW_NAMES,
    DEFAULT_DAMAGE_LAW,
    DEFAULT_LAW,
    LAW_NAMES,
    MOST_SECTIONS,
    WALL_NAMES,
)
from fdnet.errors import CaseError

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis
    from fdnet.spheres.readers import SphereFile
    from fdnet.spheres.snapshot import Snapshot

PROFILE_BINS = 32
_UNITS = ("m", "cm", "mm", "um")
_ALL = "all"
_BOX_MISSING = "no --box given: the box around all grains was used"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument(
        "spheres",
        type=Path,
        metavar="SPHERES",
        help="CSV (columns x,y,z,radius[,kind] or x_m,...,radius_m[,kind]), LIGGGHTS or LAMMPS "
        "text dump (its last frame), .vtp or .vtu with point data radius or diameter",
    )
    _add_file_choices(parser)
    parser.add_argument(
        "--axis",
        choices=("x", "y", "z", _ALL),
        default="x",
        help="flow direction; all: the three one after another (default x)",
    )
    parser.add_argument(
        "--periodic",
        default="",
        metavar="DIRS",
        help="periodic directions of the file, any of x, y, z together; others are walls",
    )
    parser.add_argument(
        "--walls",
        choices=WALL_NAMES,
        default="no-slip",
        help="side walls hold the fluid, or it slips along them: slip for spheres cut out of a "
        "larger pack (default no-slip; known to the lubrication and side-kozeny laws)",
    )
    parser.add_argument(
        "--sections", type=_count, default=1, metavar="N", help="slabs along the flow (default 1)"
    )
    parser.add_argument(
        "--law", choices=LAW_NAMES, help=f"conductance law (default {DEFAULT_LAW})"
    )
    parser.add_argument(
        "--damage-law",
        choices=DAMAGE_LAW_NAMES,
        help=f"damage law (default {DEFAULT_DAMAGE_LAW})",
    )
    parser.add_argument(
        "--compare-laws", action="store_true", help="all laws with all damage laws as a table"
    )
    parser.add_argument(
        "--csv", type=Path, metavar="FILE", help="write the laws, one row each, as CSV"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def _add_file_choices(parser: argparse.ArgumentParser) -> None:
    """How the file is to be read."""
    parser.add_argument(
        "--units",
        choices=_UNITS,
        help="unit of length of the file, of --box and of --fines-below (not with x_m columns; "
        "default for a dump or VTK file: m)",
    )
    parser.add_argument(
        "--box",
        metavar="x0,x1,y0,y1,z0,z1",
        help="the specimen, in the unit of the file (default: the box of the dump, else the box "
        "around all grains)",
    )
    parser.add_argument(
        "--fines-below",
        type=float,
        metavar="RADIUS",
        help="spheres of a smaller radius are fines, in the unit of the file",
    )
    parser.add_argument(
        "--types",
        metavar="TYPE=KIND,...",
        help="which types of a dump are grains and which fines (default 1=grain,2=fine)",
    )


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= MOST_SECTIONS:
        raise argparse.ArgumentTypeError(f"{text!r}, expected 1 to {MOST_SECTIONS}")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Analyse the file and print the result.

    Raises CaseError for bad input; nothing is written then.
    """
    from fdnet.network.tessellation.placed_grains import check_lengths

    periodic = _directions(options.periodic)
    if options.csv and not options.csv.parent.is_dir():
        raise CaseError(f"--csv: {options.csv.parent} is not a folder; make it first")
    given = _read(options, periodic)
    check_lengths(given.spheres, periodic)
    axes = "xyz" if options.axis == _ALL else options.axis
    by_axis = {axis: _along(axis, given, periodic, options) for axis in axes}
    results = by_axis[axes[0]]
    if options.axis == _ALL:
        results = [row | _by_axis(by_axis, number) for number, row in enumerate(results)]
    if options.csv:
        from fdnet.report.tables import write_laws

        write_laws(options.csv, results)
    _print(results, options)
    return 0


def _directions(text: str) -> tuple[bool, bool, bool]:
    from fdnet.spheres.directions import periodic_axes

    try:
        return periodic_axes(text)
    except CaseError as error:
        raise CaseError(f"--{error}") from error


def _read(options: argparse.Namespace, periodic: tuple[bool, bool, bool]) -> "SphereFile":
    """The spheres of the file. Raises CaseError for bad input."""
    from fdnet.spheres.readers import read_sphere_file

    given = read_sphere_file(
        options.spheres,
        units=options.units,
        box=None if options.box is None else _box(options.box),
        fines_below=options.fines_below,
        types=None if options.types is None else _types(options.types),
    )
    grains = len(given.spheres.grains())
    if grains < 4:
        raise CaseError(
            f"{options.spheres}: {grains} grains, expected at least 4 for a tetrahedron; if "
            "grains and fines were taken for each other, use --fines-below or --types"
        )
    if given.around_grains and any(periodic):
        raise CaseError(
            "--box: missing, a periodic direction needs its length; give --box x0,x1,y0,y1,z0,z1"
        )
    return given


def _box(text: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if (
        len(values) != 6
        or not all(map(math.isfinite, values))
        or any(values[i] >= values[i + 1] for i in (0, 2, 4))
    ):
        raise CaseError(
            f"--box: {text!r}, expected six numbers x0,x1,y0,y1,z0,z1 with each lower bound below "
            "the upper"
        )
    return values


def _types(text: str) -> dict[int, str]:
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(number.strip().isdecimal() and name.strip() for number, _, name in pairs):
        raise CaseError(f"--types: {text!r}, expected TYPE=KIND,..., for example 1=grain,2=fine")
    if len({int(number) for number, _, _ in pairs}) < len(pairs):
        raise CaseError(f"--types: {text!r} names a type twice")
    return {int(number): name.strip() for number, _, name in pairs}


def _along(
    axis: str,
    given: "SphereFile",
    periodic: tuple[bool, bool, bool],
    options: argparse.Namespace,
) -> list[dict[str, Any]]:
    """What each pair of laws gives for flow along `axis`, the chosen pair first."""
    spheres, first = given.spheres.turned(axis), "xyz".index(axis)
    around = (periodic[first], periodic[(first + 1) % 3], periodic[(first + 2) % 3])
    notes = [_BOX_MISSING] if given.around_grains else []
    facts = [*given.assumptions, *_assumptions(spheres, periodic, options)]
    return [
        _row(result, seconds) | {"warnings": [*notes, *result.warnings], "assumptions": facts}
        for result, seconds in _measure(spheres, around, options)
    ]


def _measure(
    spheres: "Snapshot", periodic: tuple[bool, bool, bool], given: argparse.Namespace
) -> Iterator[tuple["Analysis", float]]:
    """Each result with its seconds; those of the first hold what all of them share."""
    from fdnet.network.permeability import compare

    chosen = (given.law or DEFAULT_LAW, given.damage_law or DEFAULT_DAMAGE_LAW)
    others = product(LAW_NAMES, DAMAGE_LAW_NAMES) if given.compare_laws else ()
    start = time.perf_counter()
    for result in compare(
        spheres,
        periodic=periodic,
        laws=[chosen, *(pair for pair in others if pair != chosen)],
        sections=given.sections,
        walls=given.walls,
        profile_bin_mm=1e3 * (spheres.box[0, 1] - spheres.box[0, 0]) / PROFILE_BINS,
    ):
        now = time.perf_counter()
        yield result, now - start
        start = now


def _assumptions(
    spheres: "Snapshot", periodic: tuple[bool, bool, bool], given: argparse.Namespace
) -> Iterator[str]:
    """What the answer rests on, one sentence each."""
    yield "The fluid creeps (Stokes flow): permeability depends on the geometry alone."
    walls = [
        axis
        for axis, repeats in zip("xyz", periodic, strict=True)
        if not repeats and axis != given.axis
    ]
    if walls:
        what = "hold the fluid" if given.walls == "no-slip" else "let the fluid slip"
        yield f"Sides across {', '.join(walls)} are walls that {what}."
    if given.law is None:
        yield f"The conductance law is fdnet's default, {DEFAULT_LAW}."
    if len(spheres.fines()):
        yield "Fines and grains stay where they are."
        if given.damage_law is None:
            yield f"The damage law is fdnet's default, {DEFAULT_DAMAGE_LAW}."


def _row(result: "Analysis", seconds: float) -> dict[str, Any]:
    from fdnet.report.tables import section_rows

    return {
        "k_initial_m2": result.k_initial,
        "k_damaged_m2": result.k_damaged,
        "k_reduction": result.k_reduction,
        "porosity_initial": result.porosity_initial,
        "porosity_damaged": result.porosity_damaged,
        "pores": len(result.network.pore_radius),
        "throats": len(result.network.throat_radius),
        "solver": result.solver,
        "law": result.law,
        "damage_law": result.damage_law,
        "damage_law_used": result.damage_law,
        "sections": section_rows(result),
        "network_counts": result.counts,
        "seconds": seconds,
    }


def _by_axis(by_axis: dict[str, list[dict[str, Any]]], number: int) -> dict[str, Any]:
    """The permeabilities of one pair of laws along the three axes, and all warnings."""
    rows = {axis: results[number] for axis, results in by_axis.items()}
    warnings = [f"{axis}: {text}" for axis, row in rows.items() for text in row["warnings"]]
    return (
        {f"k_{axis}_m2": row["k_initial_m2"] for axis, row in rows.items()}
        | {f"k_{axis}_damaged_m2": row["k_damaged_m2"] for axis, row in rows.items()}
        | {"warnings": warnings, "seconds": sum(row["seconds"] for row in rows.values())}
    )


def _print(results: list[dict[str, Any]], options: argparse.Namespace) -> None:
    if options.json:
        from fdnet.report.tables import plain_json

        first = results[0]
        print(plain_json({**first, "laws": results} if options.compare_laws else first)[1])
        return
    from fdnet.report.permeability_text import answer_lines

    for line in answer_lines(results, sections=options.sections > 1):
        print(line)
