"""The table of evidence names tests that exist."""

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
