"""The page of promises names a test in every row."""

import re


def test_every_promise_names_its_test(root):
    """That the tests exist is checked for all pages (test_tests_named_on_pages_exist)."""
    page = (root / "docs" / "reference" / "promises.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    tables = page.split("## The same pack")[0]
    promises = [row for row in rows if row in tables and "| Test |" not in row]
    assert len(promises) > 25
    assert [row for row in promises if not re.search(r"`test_\w+`", row)] == []
