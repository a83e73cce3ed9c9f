"""The bridging statistics of several runs, added up."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.report.tables import write_rows
from fdnet.run.bridging import COUNTS, class_row


def pooled_runs(runs: Sequence[Path], path: Path) -> list[dict[str, Any]]:
    """The rows of `bridging.csv` of all run folders added up, also written to `path`.

    Raises CaseError where a run has no such table.
    """
    rows = pooled_classes([_classes(run / "bridging.csv") for run in runs])
    write_rows(path, rows)
    return rows


def pooled_classes(tables: Iterable[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """The rows of several runs added up by concentration and class, in that order."""
    sums: dict[tuple[float, float, float], np.ndarray] = {}
    for row in (row for table in tables for row in table):
        upper = math.inf if row["ratio_hi"] in (None, "") else float(row["ratio_hi"])
        key = float(row["concentration"]), float(row["ratio_lo"]), upper
        counts = [float(row[name]) for name in COUNTS]
        came = float(row["arrived_mean"]) * counts[0]
        sums[key] = sums.get(key, 0.0) + np.array([*counts, came])
    return [
        class_row(*key, [round(count) for count in counts[:-1]], counts[-1])
        for key, counts in sorted(sums.items(), key=lambda item: item[0])
    ]


def _classes(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be read ({error.strerror}); give folders of runs in which fines "
            "invaded, or write it anew with --stages analyse,report --force"
        ) from error
    if not all("closed" in row for row in rows):
        raise CaseError(
            f"{path}: has no column closed; write it anew with --stages analyse,report --force"
        )
    return rows
