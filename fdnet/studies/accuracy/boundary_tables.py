"""The tables of the accuracy page on walls, cut planes and size, from their CSV files."""

from collections.abc import Callable, Hashable
from pathlib import Path
from statistics import fmean

import numpy as np

from fdnet.studies.accuracy.goals import span
from fdnet.studies.engine.csv_rows import read_named
from fdnet.studies.engine.markdown import markdown_table

Line = dict[str, str]


def grouped(rows: list[Line], key: Callable[[Line], Hashable]) -> dict[Hashable, list[Line]]:
    """The rows by key, in the order in which the keys appear."""
    groups: dict[Hashable, list[Line]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def _numbers(rows: list[Line], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def tiled_table(path: Path) -> str:
    """k over periodic by size (range over packs), and c of 1 + c / W at the largest size."""
    rows = read_named(path)
    lines = []
    for of in grouped(rows, lambda row: (row["sides"], row["cut"])).values():
        sizes = list(grouped(of, lambda row: row["tiles"]).values())
        last = [
            (k - 1.0) * width
            for k, width in zip(
                _numbers(sizes[-1], "k_over_periodic"),
                _numbers(sizes[-1], "width_diameters"),
                strict=True,
            )
        ]
        spans = [span(_numbers(size, "k_over_periodic")) for size in sizes]
        name = f"{of[0]['sides']}; grains {of[0]['cut']}"
        lines.append([name, *spans, f"{min(last):+.2f} to {max(last):+.2f}", rate(of)])
    widths = [
        _numbers(of, "width_diameters") for of in grouped(rows, lambda row: row["tiles"]).values()
    ]
    header = [f"W = {min(w):.0f} to {max(w):.0f}" for w in widths]
    return markdown_table(["k over periodic", *header, "c in 1 + c/W", "falls as W to the"], lines)


def rate(rows: list[Line]) -> str:
    """Exponent of |k / periodic - 1| in the width, from the smallest to the largest size.

    It is the mean over packs, or a dash where the sign changes with the size.
    """
    exponents = []
    for of in grouped(rows, lambda row: row["pack"]).values():
        excess = [k - 1.0 for k in _numbers(of, "k_over_periodic")]
        if min(excess) < 0.0 < max(excess):
            return "-"
        width = _numbers(of, "width_diameters")
        exponents.append(np.log(abs(excess[-1] / excess[0])) / np.log(width[-1] / width[0]))
    return f"{fmean(exponents):.2f}"


def slab_table(path: Path) -> str:
    """Mean and extremes of k of cut-out slabs over the periodic k, by thickness."""
    lines = []
    for of in grouped(read_named(path), lambda row: row["thickness_diameters"]).values():
        single = [*_numbers(of, "least"), *_numbers(of, "most")]
        mean = span(_numbers(of, "mean_k_over_periodic"))
        lines.append([of[0]["thickness_diameters"], str(len(of)), mean, span(single)])
    header = ["slab, diameters", "packs", "mean k over periodic", "single slabs"]
    return markdown_table(header, lines)


def walled_table(path: Path) -> str:
    """Packs made between walls: the whole over the inner part, and over Carman-Kozeny."""
    columns = {
        "grains": "grains",
        "width_diameters": "W",
        "porosity": "porosity",
        "porosity_inner": "inside",
        "k_over_inner_slip": "k over inside, slip",
        "k_over_inner_no_slip": "no-slip",
        "inner_over_carman_kozeny": "inside over Carman-Kozeny",
        "k_over_carman_kozeny": "whole, no-slip, over Carman-Kozeny",
    }
    return _columns_of(path, columns)


def wall_truth_table(path: Path) -> str:
    """Packs between plane walls: k over truth with walls that slip and that hold the fluid."""
    columns = {
        "pack": "pack",
        "grains": "grains",
        "walls": "walls",
        "width_diameters": "W",
        "porosity": "porosity",
        "truth_error": "truth's relative error",
        "slip_over_truth": "slip",
        "no_slip_over_truth": "no-slip",
    }
    return _columns_of(path, columns)


def _columns_of(path: Path, columns: dict[str, str]) -> str:
    """A table of some columns of a CSV file, numbers to four digits."""
    rows = [[_shortened(row[name]) for name in columns] for row in read_named(path)]
    return markdown_table(list(columns.values()), rows)


def _shortened(text: str) -> str:
    try:
        return f"{float(text):.4g}" if "." in text else text
    except ValueError:
        return text
