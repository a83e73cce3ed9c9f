"""The options of `fdnet permeability` and how each is read."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from fdnet.case.names import (
    ALL_SPHERES,
    AUTO,
    DAMAGE_LAW_NAMES,
    DEFAULT_LAW,
    LAW_NAMES,
    MOST_SECTIONS,
    MOST_SPHERES,
    SECTION_ARCHIE,
    WALL_NAMES,
)
from fdnet.errors import CaseError
from fdnet.files.paths import path_option

UNITS = ("m", "cm", "mm", "um")
ALL_AXES = "all"
_LAWS_START = b"law,damage_law,"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument(
        "spheres",
        type=path_option,
        metavar="SPHERES",
        help="text (columns x,y,z,radius[,kind] or x_m,...,radius_m[,kind]), LIGGGHTS or LAMMPS "
        "text dump (its last whole frame), .vtp, .vtu or .vtk with point data radius or "
        "diameter; each also as .gz",
    )
    _add_file_choices(parser)
    parser.add_argument(
        "--axis",
        choices=("x", "y", "z", ALL_AXES),
        default="x",
        help="flow direction; all: the three one after another (default x)",
    )
    parser.add_argument(
        "--periodic",
        metavar="DIRS",
        help="periodic directions of the file, any of x, y, z together; others are walls "
        "(default: those of the dump's BOX BOUNDS, else none; '' for none)",
    )
    parser.add_argument(
        "--walls",
        choices=WALL_NAMES,
        default="no-slip",
        help="side walls hold the fluid, or it slips along them: slip for spheres cut out of a "
        "larger pack (default no-slip; known to lubrication and its damage laws)",
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
        metavar="NAME",
        help=f"damage law: {', '.join(DAMAGE_LAW_NAMES)} (default {AUTO}: up to {MOST_SPHERES} "
        f"spheres {ALL_SPHERES}, above {SECTION_ARCHIE})",
    )
    parser.add_argument(
        "--compare-laws", action="store_true", help="all laws with all damage laws as a table"
    )
    parser.add_argument(
        "--csv", type=path_option, metavar="FILE", help="write the laws, one row each, as CSV"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def joined_box(arguments: Sequence[str]) -> list[str]:
    """The arguments with `--box -1,1,...` as `--box=-1,1,...`.

    argparse takes a separate value that begins with a minus sign for an option.
    """
    result: list[str] = []
    for argument in arguments:
        if result and result[-1] == "--box" and argument[:1] == "-" and "," in argument:
            result[-1] = f"--box={argument}"
        else:
            result.append(argument)
    return result


def _add_file_choices(parser: argparse.ArgumentParser) -> None:
    """How the file is to be read."""
    parser.add_argument(
        "--units",
        choices=UNITS,
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
    if not text.isdecimal() or len(text) > 18 or not 1 <= int(text) <= MOST_SECTIONS:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}, expected 1 to {MOST_SECTIONS}")
    return int(text)


def table_file(path: Path, spheres: Path) -> Path:
    """The file that the table of laws is written to, without links.

    Raises CaseError where that would replace the file of spheres, or anything but such a table.
    """
    target = path.resolve()
    if not target.parent.is_dir():
        raise CaseError(f"--csv: {path.parent} is not a folder; make it first")
    if not target.exists():
        return target
    if not target.is_file():
        raise CaseError(
            f"--csv: {path} is no ordinary file (a folder, a device or a pipe); give the name of "
            "a file, or print with --json"
        )
    if spheres.exists() and target.samefile(spheres):
        raise CaseError(f"--csv: {path} is the file of spheres itself; give another name")
    with target.open("rb") as file:
        start = file.read(len(_LAWS_START))
    if start not in (b"", _LAWS_START):
        raise CaseError(
            f"--csv: {path} is there already and is no table of laws; give another name (nothing "
            "was changed)"
        )
    return target


def directions_of(text: str) -> tuple[bool, bool, bool]:
    from fdnet.spheres.directions import periodic_axes

    try:
        return periodic_axes(text)
    except CaseError as error:
        raise CaseError(f"--{error}") from error


def box_of(text: str) -> list[float]:
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


def types_of(text: str) -> dict[int, str]:
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(
        number.strip().isdecimal() and len(number) < 10 and name.strip()
        for number, _, name in pairs
    ):
        raise CaseError(f"--types: {text!r}, expected TYPE=KIND,..., for example 1=grain,2=fine")
    if len({int(number) for number, _, _ in pairs}) < len(pairs):
        raise CaseError(f"--types: {text!r} names a type twice")
    return {int(number): name.strip() for number, _, name in pairs}
