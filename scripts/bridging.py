"""Which ratio of fine to throat blocks, at which concentration: several runs added up.

    python scripts/bridging.py runs/* --csv bridging.csv
"""

import argparse
import csv
import sys
from pathlib import Path

from fdnet.errors import CaseError
from fdnet.report.tables import write_rows
from fdnet.run.bridging import pooled


def main() -> int:
    """Read the bridging.csv of each run, write the pooled table, and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path, help="run folders")
    parser.add_argument("--csv", type=Path, required=True, help="the pooled table")
    options = parser.parse_args()
    try:
        rows = pooled([read_classes(run / "bridging.csv") for run in options.runs])
    except CaseError as error:
        print(f"bridging.py: {error}", file=sys.stderr)
        return 2
    write_rows(options.csv, rows)
    print(options.csv.read_text(encoding="utf-8"), end="")
    return 0


def read_classes(path: Path) -> list[dict[str, str]]:
    """The rows of one table. Raises CaseError where it is missing."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be read ({error.strerror}); give folders of runs in which fines "
            "invaded, or write it anew with --stages analyse,report --force"
        ) from error


if __name__ == "__main__":
    raise SystemExit(main())
