"""`fdnet permeability`: the permeability of spheres in a file, without LIGGGHTS."""

import argparse
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from fdnet import names
from fdnet.commands.options import THE_FLOW, THE_SPHERES, new_command
from fdnet.errors import CaseError, Doubt, explained
from fdnet.files import path_option

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis
    from fdnet.spheres.readers import SphereFile

UNITS = ("m", "cm", "mm", "um")
ALL_AXES = "all"


def add_permeability(commands: Any) -> None:
    """Adds the command to the command line."""
    about = "compute the permeability of a file of spheres, without LIGGGHTS"
    example = "fdnet permeability spheres.csv --units mm --box 0,4,0,4,0,4 --periodic xyz"
    parser = new_command(commands, "permeability", run, about, example)
    parser._negative_number_matcher = re.compile(r"-[\d.][-+\d.,eE]*$")  # --box -1,1,... too
    spheres, flow = partial(parser.add, THE_SPHERES), partial(parser.add, THE_FLOW)
    spheres(
        "spheres SPHERES",
        "text (columns x,y,z,radius[,kind] or x_m,...,radius_m[,kind]), LIGGGHTS or LAMMPS text "
        "dump (its last whole frame), .vtp, .vtu or .vtk with point data radius or diameter; each "
        "also as .gz",
        path_option,
    )
    spheres(
        "--units",
        "unit of length of the file, of --box and of --fines-below (not with x_m columns; default "
        "for a dump or VTK file: m)",
        choices=UNITS,
    )
    spheres(
        "--box x0,x1,y0,y1,z0,z1",
        "the specimen, in the unit of the file (default: the box of the dump, else the box around "
        "all grains)",
        _box,
    )
    smaller = "spheres of a smaller radius are fines, in the unit of the file"
    spheres("--fines-below RADIUS", smaller, float)
    types = "which types of a dump are grains and which fines (default 1=grain,2=fine)"
    spheres("--types TYPE=KIND,...", types, _types)
    spheres(
        "--periodic DIRS",
        "periodic directions of the file, any of x, y, z together; others are walls (default: "
        "those of the dump's BOX BOUNDS, else none; '' for none)",
        _directions,
    )
    axes = "flow direction; all: the three one after another (default x)"
    flow("--axis", axes, default="x", choices=("x", "y", "z", ALL_AXES))
    flow(
        "--walls",
        "side walls hold the fluid, or it slips along them: slip for spheres cut out of a larger "
        "pack (default no-slip; known to lubrication and its damage laws)",
        default="no-slip",
        choices=names.WALL_NAMES,
    )
    flow("--sections N", "slabs along the flow (default 1)", int, 1)
    flow("--law", f"conductance law (default {names.DEFAULT_LAW})", choices=names.LAW_NAMES)
    flow(
        "--damage-law",
        f"damage law (default {names.AUTO}: up to {names.MOST_SPHERES} spheres "
        f"{names.ALL_SPHERES}, above {names.SECTION_ARCHIE})",
        choices=names.DAMAGE_LAW_NAMES,
    )
    flow("--compare-laws", "all laws with all damage laws as a table")
    parser.share("--json")


def _directions(text: str) -> tuple[bool, bool, bool]:
    from fdnet.spheres.snapshot import periodic_axes

    try:
        return periodic_axes(text)
    except CaseError as error:
        raise CaseError(f"--{error}") from error


def _box(text: str) -> list[float]:
    from fdnet.spheres.snapshot import checked_box

    try:
        return checked_box([float(part) for part in text.split(",")]).ravel().tolist()
    except (CaseError, ValueError) as error:
        raise CaseError(
            f"--box: {text!r}, expected six numbers x0,x1,y0,y1,z0,z1 with each lower bound below "
            "the upper"
        ) from error


def _types(text: str) -> dict[int, str]:
    pairs = [part.partition("=") for part in text.split(",")]
    with suppress(ValueError):
        types = {int(number): name.strip() for number, _, name in pairs}
        if len(types) == len(pairs) and all(types.values()):
            return types
    raise CaseError(
        f"--types: {text!r}, expected TYPE=KIND,..., each type once, for example 1=grain,2=fine"
    )


# ---- What the command does and prints.
PROFILE_BINS = 32
_LARGE_FINE = 0.5
"""Part of the smallest grain's radius up to which spheres of type 2 are fines unasked."""


def run(options: argparse.Namespace) -> int:
    """Analyse the file and print the result.

    Raises CaseError for bad input; nothing is written then.
    """
    from fdnet.network.tessellation.delaunay import check_lengths

    given = _read(options)
    check_lengths(given.spheres, given.periodic)
    axes = "xyz" if options.axis == ALL_AXES else options.axis
    by_axis = {axis: _along(axis, given, options) for axis in axes}
    results = by_axis[axes[0]]
    if options.axis == ALL_AXES:
        results = [row | _by_axis(by_axis, number) for number, row in enumerate(results)]
    if options.json:
        from fdnet.report.tables import plain_json

        first = results[0]
        print(plain_json({**first, "laws": results} if options.compare_laws else first)[1])
        return 0
    from fdnet.report.text import permeability_lines

    fines = len(given.spheres.fines()) > 0
    print(*permeability_lines(results, sections=options.sections > 1, fines=fines), sep="\n")
    return 0


def _read(options: argparse.Namespace) -> "SphereFile":
    """The spheres of the file. Raises CaseError for bad input, and on fines as large as grains.

    A type that was taken for that of the fines unasked must be clearly smaller.
    """
    from fdnet.network.specimen import wide_fines
    from fdnet.spheres.readers import read_sphere_file

    keys = ("units", "box", "fines_below", "types", "periodic")
    given = read_sphere_file(options.spheres, **{key: getattr(options, key) for key in keys})
    grains, fines = given.spheres.grains(), given.spheres.fines()
    if len(grains) < (1 if any(given.periodic) else 4):
        why = "a periodic cell of fewer needs --periodic"
        if not len(grains):
            why = "the dump of an invasion holds fines alone (give the run's spheres_damaged.csv)"
        raise CaseError(
            f"{options.spheres}: {len(grains)} grains, expected at least 4 for a tetrahedron; "
            f"{why}; if grains and fines were taken for each other, use --fines-below or --types"
        )
    why = wide_fines(grains, fines)
    unasked = any("type 2 a fine" in one for one in given.assumptions)
    share = float(fines.radius.max(initial=0.0) / grains.radius.min())
    if unasked and not why and share > _LARGE_FINE:
        why = (
            f"fines: the largest sphere of type 2 has {share:.2f} of the radius of the smallest "
            f"of type 1, expected at most {_LARGE_FINE:g} where nothing says that type 2 are fines"
        )
    if why:
        kinds = "; name them grains, or tell them apart with --types or --fines-below"
        if options.types is None and unasked:
            kinds = (
                "; --types 1=grain,2=grain takes both types as grains, --types 1=grain,2=fine "
                "says that type 2 are fines"
            )
        raise CaseError(f"{options.spheres}: {why}{kinds}")
    if given.around_grains and any(given.periodic):
        raise CaseError(
            "--box: missing, a periodic direction needs its length; give --box x0,x1,y0,y1,z0,z1"
        )
    return given


def _along(axis: str, given: "SphereFile", options: argparse.Namespace) -> list[dict[str, Any]]:
    """What each pair of laws gives for flow along `axis`, the chosen pair first.

    Where the chosen laws are off by factors, a warning has the numbers by the default ones.
    """
    from fdnet.network.permeability import compare
    from fdnet.network.specimen import pack_doubts
    from fdnet.report.text import thesis_law_warning

    spheres, along, periodic = given.spheres.turned(axis), "xyz".index(axis), given.periodic
    notes = list(given.warnings)
    if given.around_grains:
        walled = "".join(one for one, yes in zip("xyz", periodic, strict=True) if not yes)
        walls = ", with walls across the flow" if set(walled) - {axis} else ""
        notes.append(Doubt("no-box", f"no --box given: the box around all grains was used{walls}"))
    notes += pack_doubts(given.spheres, axis, options.walls)
    default = names.DEFAULT_LAW, names.AUTO
    chosen = options.law or default[0], options.damage_law or default[1]
    pairs = [chosen, *(names.law_pairs() if options.compare_laws else ())]
    if names.off_by_factors(*chosen, fines=len(spheres.fines()) > 0):
        pairs.append(default)
    results = compare(
        spheres,
        periodic=(periodic[along], periodic[(along + 1) % 3], periodic[(along + 2) % 3]),
        laws=list(dict.fromkeys(pairs)),
        sections=options.sections,
        walls=options.walls,
        profile_bin_mm=1e3 * (spheres.box[0, 1] - spheres.box[0, 0]) / PROFILE_BINS,
    )
    first = next(results)
    facts = [*given.assumptions, *_assumptions(first, axis, periodic, options)]
    more = {"warnings": [explained(one) for one in [*notes, *first.warnings]]}
    rows = [_row(first) | more | {"assumptions": facts}]
    for result in results:
        if (result.law, result.damage_law) == default:
            rows[0]["warnings"].insert(0, explained(thesis_law_warning(first, result)))
        else:
            said = [explained(one) for one in [*notes, *result.warnings]]
            rows.append(_row(result) | {"warnings": said, "assumptions": facts})
    return rows


def _assumptions(
    first: "Analysis", axis: str, periodic: tuple[bool, bool, bool], given: argparse.Namespace
) -> Iterator[str]:
    """What the answer rests on, one sentence each."""
    yield "The fluid creeps (Stokes flow): permeability depends on the geometry alone."
    if any(periodic):
        along = ", ".join(axis for axis, yes in zip("xyz", periodic, strict=True) if yes)
        yield f"The spheres repeat along {along}, with the sides of the box as periods."
    sides = [one for one, repeats in zip("xyz", periodic, strict=True) if not repeats]
    if walls := ", ".join(one for one in sides if one != given.axis):
        what = "hold the fluid" if given.walls == "no-slip" else "let the fluid slip"
        yield f"Sides across {walls} are walls that {what}; the flow has an inlet and an outlet."
    if given.law is None:
        yield f"The conductance law is fdnet's default, {names.DEFAULT_LAW}."
    if first.occupancy is not None:
        yield "Fines and grains stay where they are."
    if max(first.copies) > 1:
        times = " x ".join(
            str(first.copies[("xyz".index(k) - "xyz".index(axis)) % 3]) for k in "xyz"
        )
        yield (
            f"The cell was repeated {times} times, because it is too small for the "
            "tessellation; its permeability is the same."
        )
    if given.damage_law is None and first.damage_law_used is not None:
        yield f"The damage law is fdnet's default, here {first.damage_law_used}."


def _row(result: "Analysis") -> dict[str, Any]:
    from fdnet.report.tables import section_rows

    laws = ("law", "damage_law", "damage_law_used", "damage_law_other")
    same = ("k_reduction", "porosity_initial", "porosity_damaged", "solver", *laws)
    return {name: getattr(result, name) for name in same} | {
        "k_initial_m2": result.k_initial,
        "k_damaged_m2": result.k_damaged,
        "pores": len(result.network.pore_radius),
        "throats": len(result.network.throat_radius),
        "k_damaged_other_m2": result.k_damaged_other,
        "sections": section_rows(result),
        "network_counts": result.counts,
        "spheres_dropped": result.counts["spheres_dropped"],
        "seconds": sum(result.seconds.values()),
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
