#!/usr/bin/env python3
"""docs/validation.md from docs/validation.md.in, the committed tables of the studies and the table of hard cases.

    .venv/bin/python scripts/validation.py [--docs docs] [--redraw]

Reads docs/validation/NAME.csv of every study and docs/validation/stability.csv; runs nothing, so it takes a second.
`fdnet study NAME --out DIR` makes NAME.csv, .png and .md, which are then copied to docs/validation; --redraw makes the
last two anew from the first.
"""

import argparse
import csv
import re
import sys
from pathlib import Path
from string import Template

from fdnet.atomic import write_text
from fdnet.studies.command import STUDIES, study_named
from fdnet.studies.engine.draw import draw_study
from fdnet.studies.engine.table import knee_lines, missing_lines, read_rows, study_text

ROOT = Path(__file__).resolve().parents[1]


def study_part(name: str, validation: Path) -> str:
    """Summary, remarks, knees and what was not done of one study, as Markdown."""
    study, rows = study_named(name), read_rows(validation / f"{name}.csv")
    parts = [study.summary(rows)] if study.summary else []
    parts += [study.remarks.strip()] if study.remarks else []
    if knees := knee_lines(study, rows):
        parts.append("In numbers:\n\n" + "\n".join(f"- {line}" for line in knees))
    missing = missing_lines(rows)
    if missing:
        parts.append("Not done:\n\n" + "\n".join(f"- {line}" for line in missing))
    seconds = {row.run: row.wall_s for row in rows}
    tables = f"Tables: [{name}.md](validation/{name}.md), rows: `validation/{name}.csv`."
    parts.append(f"{len(seconds)} runs, {sum(seconds.values()) / 3600:.2g} h. {tables}")
    return "\n\n".join(parts)


def stability_table(path: Path) -> str:
    """The hard cases, one row each, as Markdown."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lines = ["| case | what happened | evidence |", "|---|---|---|"]
    return "\n".join(
        lines
        + [
            f"| {row['case']} | {row['what_happened']} | {evidence(row['evidence'])} |"
            for row in rows
        ]
    )


def evidence(text: str) -> str:
    """Words and tests: a test as a link to its file with its name for a text."""
    return re.sub(
        r"tests/(\S+\.py)::(\w+)",
        lambda m: f"([{m[2].removeprefix('test_')}](../tests/{m[1]}))",
        text,
    )


def document(docs: Path) -> str:
    """The text of docs/validation.md. Raises FileNotFoundError where a study's table is missing."""
    validation = docs / "validation"
    parts = {name.replace("-", "_"): study_part(name, validation) for name in STUDIES}
    parts["stability_table"] = stability_table(validation / "stability.csv")
    return Template((docs / "validation.md.in").read_text(encoding="utf-8")).substitute(parts)


def redraw(validation: Path) -> None:
    """Figure and text of every study from its committed table."""
    for name in STUDIES:
        study, rows = study_named(name), read_rows(validation / f"{name}.csv")
        draw_study(study, rows, validation / f"{name}.png")
        write_text(validation / f"{name}.md", study_text(study, rows))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="where to read and write")
    parser.add_argument(
        "--redraw",
        action="store_true",
        help="figures and texts of the studies from their tables too",
    )
    given = parser.parse_args()
    if given.redraw:
        redraw(given.docs / "validation")
    (given.docs / "validation.md").write_text(document(given.docs), encoding="utf-8")
    print(given.docs / "validation.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
