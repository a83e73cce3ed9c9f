"""docs/validation.md says what its tables say."""

import pytest

from validation.command import STUDIES, study_named
from validation.engine.table import read_rows, study_text
from validation.pages.validation import document, evidence


def test_the_page_is_written_from_the_committed_tables(root):
    assert (root / "docs/validation.md").read_text(encoding="utf-8") == document(root / "docs")


@pytest.mark.parametrize("name", list(STUDIES))
def test_every_study_has_its_table_text_and_figure(root, name):
    folder = root / "docs/validation"
    text = (folder / f"{name}.md").read_text(encoding="utf-8")
    assert text == study_text(study_named(name), read_rows(folder / f"{name}.csv"))
    assert (folder / f"{name}.png").stat().st_size > 50_000


def test_evidence_becomes_links():
    result = evidence("as told tests/dem/test_a.py::test_it_holds; tests/test_b.py::test_c")
    assert result == "as told ([it_holds](../tests/dem/test_a.py)); ([c](../tests/test_b.py))"
