"""`fdnet permeability`: the network half alone, on a CSV of spheres."""

import argparse
import math
import time
from itertools import product
from pathlib import Path
from typing import Any

from fdnet.case.names import DAMAGE_LAW_NAMES, LAW_NAMES, MOST_SECTIONS, WALL_NAMES
from fdnet.errors import CaseError

PROFILE_BINS = 32
_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument(
        "spheres",
        type=Path,
        metavar="SPHERES.csv",
        help="columns x,y,z,radius[,kind] or x_m,...,radius_m[,kind]",
    )
    parser.add_argument(
        "--units",
        choices=tuple(_METRES),
        help="unit of the columns and of --box (not with x_m columns)",
    )
    parser.add_argument(
        "--axis", choices=("x", "y", "z"), default="x", help="flow direction (default x)"
    )
    parser.add_argument(
        "--box", metavar="x0,x1,y0,y1,z0,z1", help="the specimen, in the unit of the columns"
    )
    parser.add_argument(
        "--periodic",
        default="",
        metavar="DIRS",
        help="periodic directions, any of x, y, z together; others are walls",
    )
    parser.add_argument(
        "--walls",
        choices=WALL_NAMES,
        default="no-slip",
        help="side walls hold the fluid, or it slips along them: slip for spheres cut out of a larger pack (default "
        "no-slip; known to the lubrication and side-kozeny laws)",
    )
    parser.add_argument(
        "--sections", type=_count, default=1, metavar="N", help="slabs along the flow (default 1)"
    )
    parser.add_argument("--law", choices=LAW_NAMES, help="conductance law (default: fdnet's own)")
    parser.add_argument(
        "--damage-law", choices=DAMAGE_LAW_NAMES, help="damage law (default: fdnet's own)"
    )
    parser.add_argument(
        "--compare-laws", action="store_true", help="all laws with all damage laws as a table"
    )
    parser.add_argument(
        "--csv", type=Path, metavar="FILE", help="write the laws, one row each, as CSV"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= MOST_SECTIONS:
        raise argparse.ArgumentTypeError(f"{text!r}, expected 1 to {MOST_SECTIONS}")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Analyse the file and print the result. Raises CaseError for bad input (nothing is written)."""
    from fdnet.network.laws.named import DEFAULT_DAMAGE_LAW, DEFAULT_LAW
    from fdnet.network.tessellation.placed_grains import check_lengths

    periodic = _directions(options.periodic)
    if options.csv and not options.csv.parent.is_dir():
        raise CaseError(f"--csv: {options.csv.parent} is not a folder; make it first")
    spheres, notes = read_snapshot(options, periodic)
    check_lengths(spheres, periodic)
    turn = [("xyz".index(options.axis) + k) % 3 for k in range(3)]
    spheres = turned(spheres, turn)
    around = (periodic[turn[0]], periodic[turn[1]], periodic[turn[2]])
    chosen = (options.law or DEFAULT_LAW, options.damage_law or DEFAULT_DAMAGE_LAW)
    laws = [chosen]
    if options.compare_laws:
        laws += [pair for pair in product(LAW_NAMES, DAMAGE_LAW_NAMES) if pair != chosen]
    results = _measure(spheres, around, options, laws, notes)
    if options.csv:
        from fdnet.report.tables import write_laws

        write_laws(options.csv, results)
    _print(results, options)
    return 0


def _directions(text: str) -> tuple[bool, bool, bool]:
    if not set(text) <= set("xyz") or len(set(text)) != len(text):
        raise CaseError(f"--periodic: {text!r}, expected any of x, y, z together, e.g. yz")
    return "x" in text, "y" in text, "z" in text


def read_snapshot(
    options: argparse.Namespace, periodic: tuple[bool, bool, bool]
) -> tuple[Any, list[str]]:
    """The spheres of the file as a Snapshot in SI, and notes. Raises CaseError for bad input."""
    import numpy as np

    from fdnet.spheres.readers import read_spheres
    from fdnet.spheres.snapshot import Kind, resting

    given = read_spheres(options.spheres, units=options.units)
    position, radius, kind = given.position, given.radius, given.kind
    grains = kind == Kind.GRAIN
    if np.count_nonzero(grains) < 4:
        raise CaseError(
            f"{options.spheres}: {np.count_nonzero(grains)} grains, expected at least 4 for a tetrahedron"
        )
    box, notes = _box(options, position[grains], radius[grains], periodic)
    snapshot = resting(position, radius, box, kind)
    return snapshot, notes


def _box(
    options: argparse.Namespace, position: Any, radius: Any, periodic: tuple[bool, bool, bool]
) -> tuple[Any, list[str]]:
    import numpy as np

    if options.box is None:
        if any(periodic):
            raise CaseError(
                "--box: missing, a periodic direction needs its length; give --box x0,x1,y0,y1,z0,z1"
            )
        low, high = (
            np.min(position - radius[:, None], axis=0),
            np.max(position + radius[:, None], axis=0),
        )
        return np.column_stack([low, high]), ["no --box given: the box around all grains was used"]
    try:
        values = [float(part) for part in options.box.split(",")]
    except ValueError:
        values = []
    if (
        len(values) != 6
        or not all(map(math.isfinite, values))
        or any(values[i] >= values[i + 1] for i in (0, 2, 4))
    ):
        raise CaseError(
            f"--box: {options.box!r}, expected six numbers x0,x1,y0,y1,z0,z1 with each lower bound below the upper"
        )
    return np.array(values).reshape(3, 2) * _METRES[options.units or "m"], []


def turned(spheres: Any, turn: list[int]) -> Any:
    """The same spheres with axes in the order `turn`, moved so that the box starts at x = 0."""
    import numpy as np

    from fdnet.spheres.snapshot import Snapshot

    start = np.array([spheres.box[turn[0], 0], 0.0, 0.0])
    return Snapshot(
        step=spheres.step,
        time_s=spheres.time_s,
        box=spheres.box[turn] - start[:, None],
        id=spheres.id,
        kind=spheres.kind,
        position=spheres.position[:, turn] - start,
        radius=spheres.radius,
        velocity=spheres.velocity[:, turn],
    )


def _measure(
    spheres: Any,
    periodic: tuple[bool, bool, bool],
    given: argparse.Namespace,
    laws: list[tuple[str, str]],
    notes: list[str],
) -> list[dict[str, Any]]:
    """What each pair of laws gives; the seconds of the first hold what all of them share."""
    from fdnet.case.analysis import AnalysisChoices
    from fdnet.network.permeability import compare

    damaged = spheres if len(spheres.fines()) else None
    options = AnalysisChoices.of_pack(
        sections=given.sections,
        walls=given.walls,
        profile_bin_mm=1e3 * (spheres.box[0, 1] - spheres.box[0, 0]) / PROFILE_BINS,
    )
    results, start = [], time.perf_counter()
    for result in compare(
        spheres.grains(), damaged, periodic=periodic, options=options, laws=laws
    ):
        now = time.perf_counter()
        results.append(_row(result, now - start, notes))
        start = now
    return results


def _row(result: Any, seconds: float, notes: list[str]) -> dict[str, Any]:
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
        "sections": section_rows(result),
        "network_counts": result.counts,
        "seconds": seconds,
        "warnings": [*notes, *result.warnings],
    }


def _print(results: list[dict[str, Any]], options: argparse.Namespace) -> None:
    from fdnet.report.tables import plain_json

    first = results[0]
    if options.json:
        print(plain_json({**first, "laws": results} if options.compare_laws else first)[1])
        return
    print(
        f"porosity {first['porosity_initial']:.5f} -> {first['porosity_damaged']:.5f}, {first['pores']} pores, "
        f"{first['throats']} throats"
    )
    print(f"{'law':<11} {'damage law':<11} {'k m2':>12} {'k damaged m2':>13} {'k/k0':>8}")
    for row in results:
        print(
            f"{row['law']:<11} {row['damage_law']:<11} {row['k_initial_m2']:>12.5g} "
            f"{row['k_damaged_m2']:>13.5g} {_ratio(row):>8}"
        )
    if options.sections > 1:
        _print_sections(first)
    for warning in first["warnings"]:
        print(f"warning: {warning}")


def _print_sections(result: dict[str, Any]) -> None:
    print(f"sections cut out, {result['law']} and {result['damage_law']}:")
    print(
        f"{'from m':>10} {'to m':>10} {'porosity':>9} {'damaged':>9} {'k m2':>12} {'k damaged m2':>13} {'k/k0':>8}"
    )
    for row in result["sections"]:
        print(
            f"{row['x_lo_m']:>10.4g} {row['x_hi_m']:>10.4g} {row['porosity_initial']:>9.5f} "
            f"{row['porosity_damaged']:>9.5f} {row['k_initial_m2']:>12.5g} {row['k_damaged_m2']:>13.5g} "
            f"{_ratio(row):>8}"
        )


def _ratio(row: dict[str, Any]) -> str:
    return "-" if row["k_reduction"] is None else f"{1 - row['k_reduction']:.4f}"
