"""docs/thesis.md, made of its source docs/thesis.md.in and the tables of the study."""

import re
from pathlib import Path
from string import Template

from fdnet.errors import CaseError
from validation.engine.markdown import wrapped
from validation.thesis.collection import RESULTS
from validation.thesis.compare.tables import thesis_tables
from validation.thesis.compare.trend_table import caveats, flows_table, trends_table
from validation.thesis.compare.trends import compare_trends
from validation.thesis.numbers.results import read_results
from validation.thesis.outputs import CAPTIONS, DEPOSITION, STATISTICS, TETRAHEDRA
from validation.thesis.page import csv_tables, run_tables

PAGE, SOURCE, TABLES = "thesis.md", "thesis.md.in", "thesis"
FOLLOWED, FOLLOWED_TRENDS = "followed.csv", "followed_trends.csv"
"""The tables of the specimens and of the quick forms in the flow that follows, made once."""


def write_page(docs: Path) -> Path:
    """Write thesis.md in the folder `docs` and return its path; nothing is run or drawn."""
    text = document(docs)
    (docs / PAGE).write_text(text, encoding="utf-8")
    return docs / PAGE


def document(docs: Path) -> str:
    """The text of thesis.md from its source and the tables in the folder `docs`.

    Raises FileNotFoundError when a table is missing, CaseError when the source asks for a part
    that does not exist.
    """
    template = Template((docs / SOURCE).read_text(encoding="utf-8"))
    parts = page_parts(docs / TABLES)
    unknown = set(template.get_identifiers()) - set(parts)
    if unknown or re.search(r"(?m)^[A-Z]{5,}$", template.template):
        raise CaseError(
            f"{docs / SOURCE}: {sorted(unknown) or 'a part in capitals'} is not a part of the "
            f"page; expected some of {', '.join(parts)}"
        )
    return template.substitute(parts)


def page_parts(folder: Path) -> dict[str, str]:
    """The parts of the page by name, from the study's tables in `folder`."""
    rows = read_results(folder / RESULTS)
    comparisons = compare_trends(rows)
    return {
        "overview": run_tables.overview(rows),
        "costs": run_tables.costs(rows),
        "tables": thesis_tables(rows),
        "trends": trends_table(comparisons),
        "caveats": "\n".join(_item(line) for line in caveats(comparisons)),
        "friction": run_tables.scan(rows, "friction"),
        "drag": run_tables.scan(rows, "drag"),
        "supply": run_tables.scan(rows, "supply"),
        "reasons": run_tables.reasons(rows),
        "quick": run_tables.quick_forms(rows),
        "statistics": csv_tables.statistics_table(folder / STATISTICS),
        "deposition": csv_tables.deposition_table(folder / DEPOSITION),
        "tetrahedra": csv_tables.tetrahedra_table(folder / TETRAHEDRA),
        "followed": csv_tables.followed_table(folder / FOLLOWED),
        "followed_trends": flows_table(
            comparisons, compare_trends(read_results(folder / FOLLOWED_TRENDS))
        ),
        "figures": csv_tables.figures(folder / CAPTIONS),
    }


def _item(line: str) -> str:
    return wrapped(f"- {line}")
