"""The bridging statistics of several runs, added up."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fdnet.errors import CaseError
from fdnet.report.tables import write_rows
from fdnet.run.bridging import pooled


def pooled_runs(runs: Sequence[Path], path: Path) -> list[dict[str, Any]]:
    """The rows of `bridging.csv` of all run folders added up, also written to `path`.

    Raises CaseError where a run has no such table.
    """
    rows = pooled([_classes(run / "bridging.csv") for run in runs])
    write_rows(path, rows)
    return rows


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
