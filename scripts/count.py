#!/usr/bin/env python
"""What the project weighs: lines, files, files that a step takes, names defined twice, words.

    python scripts/count.py

The core is `fdnet` without `campaign`. A step takes a file of its folder when it
imports it, itself or through others.
"""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STEPS = {
    "conductance of a throat": "network/laws/lubrication",
    "conductance between spheres of any size": "network/laws/deposit_resistances",
    "scales of a case": "scales/scales",
    "reading a case": "case/file",
    "invasion": "dem/invasion",
    "whole run": "run/pipeline",
}
"""Steps, and the module of `fdnet` at which each begins."""


def core(root: Path) -> list[Path]:
    """The files of the core."""
    paths = sorted((root / "fdnet").rglob("*.py"))
    return [one for one in paths if "campaign" not in one.parts]


def names_twice(root: Path) -> list[str]:
    """Public names that two modules of the core define."""
    names = Counter(
        node.name
        for path in core(root)
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    )
    return sorted(name for name, count in names.items() if count > 1)


def files_of(root: Path, start: str) -> set[Path]:
    """The files of its folder that the module `start` takes, itself among them."""
    first = root / "fdnet" / f"{start}.py"
    taken, waiting = {first}, [first]
    while waiting:
        for path in _imported(root, waiting.pop()):
            if path.parent == first.parent and path not in taken:
                taken.add(path)
                waiting.append(path)
    return taken


def _imported(root: Path, path: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            module = root / f"{node.module.replace('.', '/')}.py"
            if module.exists():
                yield module


def lines(paths: list[Path]) -> int:
    """Lines of these files."""
    return sum(len(path.read_text("utf-8").splitlines()) for path in paths)


def main() -> None:
    """Print the counts as a table."""
    folders = {"campaign": "fdnet/campaign", "evidence": "scripts/validation", "tests": "tests"}
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "docs").rglob("*.md.in")]
    pages = [page for page in pages if page.name != "CHANGELOG.md" and "_build" not in page.parts]
    words = sum(len(page.read_text("utf-8").split()) for page in pages)
    files = [path for path in core(ROOT) if path.name != "__init__.py"]
    rows = [
        ("core", f"{lines(core(ROOT)):,} lines in {len(files)} files"),
        *(
            (name, f"{lines(sorted((ROOT / folder).rglob('*.py'))):,} lines")
            for name, folder in folders.items()
        ),
        ("public names of the core defined twice", f"{len(names_twice(ROOT))}"),
        ("words of pages", f"{words:,}"),
    ]
    rows += [(f"files: {name}", f"{len(files_of(ROOT, start))}") for name, start in STEPS.items()]
    print("| | |\n|---|---|")
    for name, value in rows:
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
