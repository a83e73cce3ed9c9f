"""Which ratio of fine to throat closes, at which concentration: several runs added up.

python scripts/validation.py bridging runs/b5-* --csv bridging.csv [--png bridging.png]
"""

import argparse
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from fdnet.errors import CaseError
from fdnet.files import path_option
from fdnet.report.figures import draw
from fdnet.report.tables import write_rows
from fdnet.run.bridging import COUNTS, class_row

NO_CLOG, FLICKERING = 1.0 / 3.0, (1.0 / 5.26, 1.0 / 3.03)
"""Ratios below which Marin and others (2018, Phys. Rev. E 97, 021102) saw no clog up to 60 % of
solids, and between which Souzy and Marin (2022, J. Fluid Mech. 953, A40) saw clogs come and go."""


def read_classes(path: Path) -> pd.DataFrame:
    """A run's `bridging.csv`. Raises CaseError where it is missing or of an older version."""
    again = "write it anew with --stages analyse,report --force"
    if not path.is_file():
        raise CaseError(f"{path}: is missing; give folders of runs with fines, or {again}")
    rows = pd.read_csv(path)
    if "closed" not in rows:
        raise CaseError(f"{path}: has no column closed; {again}")
    return rows


def pooled_classes(tables: Sequence[pd.DataFrame]) -> list[dict[str, Any]]:
    """The rows of several runs added up by concentration and class, in that order."""
    every = pd.concat(tables).fillna({"ratio_hi": math.inf})
    every["came"] = every["arrived_mean"] * every["throats"]
    keys = ["concentration", "ratio_lo", "ratio_hi"]
    sums = every.groupby(keys)[[*COUNTS, "came"]].sum()
    return [
        class_row(one, low, high, [int(row[name]) for name in COUNTS], float(row["came"]))
        for (one, low, high), (_, row) in zip(sums.index, sums.iterrows(), strict=True)
    ]


def fill(figure: Any, *, rows: Sequence[dict[str, Any]]) -> None:
    """Share of throats that are closed, with Wilson's 95 % band, at the middle of each class."""
    axes = figure.subplots()
    for concentration in sorted({row["concentration"] for row in rows}):
        own = [row for row in rows if row["concentration"] == concentration]
        ratio = [0.5 * (row["ratio_lo"] + min(row["ratio_hi"] or 2.0, 2.0)) for row in own]
        share = [row["share_closed"] for row in own]
        ends = zip(own, share, strict=True)
        off = [(one - row["share_low"], row["share_high"] - one) for row, one in ends]
        label = f"{100 * concentration:.3g} % by volume"
        axes.errorbar(ratio, share, yerr=list(zip(*off, strict=True)), fmt="o-", label=label)
    axes.axvspan(*FLICKERING, color="0.88", label="clogs come and go (Souzy and Marin 2022)")
    axes.axvline(NO_CLOG, color="0.3", ls="--", label="left of it no clog (Marin and others 2018)")
    axes.set(xlim=(0, 2), ylim=(0, 1), xlabel="fine over throat (–)", ylabel="closed (–)")
    axes.legend(fontsize=8)


def main(arguments: list[str]) -> int:
    """The command `validation.py bridging`."""
    parser = argparse.ArgumentParser(prog="validation.py bridging")
    parser.add_argument("runs", nargs="+", type=path_option, metavar="RUN_DIR")
    parser.add_argument("--csv", type=path_option, required=True, help="write the table here")
    parser.add_argument("--png", type=path_option, help="draw the figure here")
    given = parser.parse_args(arguments)
    rows = pooled_classes([read_classes(run / "bridging.csv") for run in given.runs])
    write_rows(given.csv, rows)
    if given.png:
        draw(given.png, partial(fill, rows=rows))
    print(pd.DataFrame(rows).round(3).to_string(index=False))
    return 0
