"""The table of evidence, and the page of promises, name tests that exist."""

import ast
import csv
import re

NODE = re.compile(r"(tests/\S+\.py)::(\w+)")
HAPPENED = {"completed", "refused", "warned", "completed or refused", "refused or warned"}


def test_every_row_of_the_stability_table_names_tests_that_exist(root):
    with (root / "docs" / "validation" / "stability.csv").open(
        encoding="utf-8", newline=""
    ) as handle:
        rows = list(csv.DictReader(handle, strict=True))
    assert len(rows) > 50
    assert all(row["what_happened"] in HAPPENED for row in rows)
    assert len({row["case"] for row in rows}) == len(rows)
    for row in rows:
        assert set(row) == {"case", "what_happened", "evidence"}, row
        nodes = NODE.findall(row["evidence"])
        assert nodes, row
        for path, name in nodes:
            tree = ast.parse((root / path).read_text(encoding="utf-8"))
            assert name in {
                node.name for node in tree.body if isinstance(node, ast.FunctionDef)
            }, (path, name)


def test_every_promise_names_its_test(root):
    """That the tests exist is checked for all pages (test_tests_named_on_pages_exist)."""
    page = (root / "docs" / "reference" / "promises.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    tables = page.split("## The same pack")[0]
    promises = [row for row in rows if row in tables and "| Test |" not in row]
    assert len(promises) > 25
    assert [row for row in promises if not re.search(r"`test_\w+`", row)] == []
