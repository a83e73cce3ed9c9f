"""docs/validation.md from docs/validation.md.in and the committed tables of the studies."""

import re
from collections.abc import Sequence
from pathlib import Path
from string import Template

from fdnet.files import write_text
from validation.command import STUDIES, study_named
from validation.engine.csv_rows import read_named
from validation.engine.draw import draw_study
from validation.engine.markdown import markdown_table, wrapped
from validation.engine.study import Row, Study
from validation.engine.table import read_rows, study_text
from validation.pages.invasion_numbers import invasion_numbers
from validation.pages.network_numbers import network_numbers


def document(docs: Path) -> str:
    """The text of the page.

    Raises:
        FileNotFoundError: the table of a study is missing.
    """
    validation = docs / "validation"
    parts = {
        name.replace("-", "_"): study_part(
            study_named(name), read_rows(validation / f"{name}.csv")
        )
        for name in STUDIES
    }
    parts |= invasion_numbers(validation) | network_numbers(validation)
    parts["stability_table"] = stability_table(validation / "stability.csv")
    template = Template((docs / "validation.md.in").read_text(encoding="utf-8"))
    return wrapped(template.substitute(parts))


def study_part(study: Study, rows: Sequence[Row]) -> str:
    """What a study cost, and where its numbers stand, as Markdown."""
    seconds = {row.run: row.wall_s for row in rows}
    hours = sum(seconds.values()) / 3600
    return (
        f"`python scripts/validation.py {study.name}`: {len(seconds)} runs, {hours:.2g} h. "
        f"All numbers: [{study.name}.md](validation/{study.name}.md), "
        f"rows: `validation/{study.name}.csv`."
    )


def stability_table(path: Path) -> str:
    """The hard cases, one row each, as Markdown."""
    return markdown_table(
        ["case", "what happened", "evidence"],
        [
            [row["case"], row["what_happened"], evidence(row["evidence"])]
            for row in read_named(path)
        ],
    )


def evidence(text: str) -> str:
    """The text with each test as a link to its file, which has the test's name."""
    return re.sub(
        r"tests/(\S+\.py)::(\w+)",
        lambda m: f"([{m[2].removeprefix('test_')}](../tests/{m[1]}))",
        text,
    )


def write_page(docs: Path) -> Path:
    """Writes the page and returns its path."""
    return write_text(docs / "validation.md", document(docs))


def redraw(validation: Path) -> None:
    """Figure and text of every study from its committed table."""
    for name in STUDIES:
        study, rows = study_named(name), read_rows(validation / f"{name}.csv")
        draw_study(study, rows, validation / f"{name}.png")
        write_text(validation / f"{name}.md", study_text(study, rows))
