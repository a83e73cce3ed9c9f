"""Pages and docstrings are plain English, and the README is short and true."""

import ast
import csv
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.run.finished import FinishedRun

README_WORDS = 900
LONGEST_LINE = 99

PRIVATE_WORDS = re.compile(
    r"\b(told|hair|eaten|speck|specks|beside|square way|way of the fluid)\b", re.IGNORECASE
)
"""Words that were used with a meaning of their own; a reader of the field does not know it."""

PRIVATE_NAMES = frozenset({"found", "told", "hair"})
"""Names of variables that say nothing of what they hold."""


def pages(root: Path) -> Iterator[Path]:
    """Every page that people read: Markdown and its sources, and the shipped cases."""
    yield from (root / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"))
    yield root / ".github/pull_request_template.md"
    for pattern in ("docs/**/*.md", "docs/**/*.md.in", "cases/**/*.toml"):
        for path in sorted(root.glob(pattern)):
            if root / "docs/_build" not in path.parents:
                yield path


def docstrings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every string that stands alone in a module, on whatever it follows."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            text = node.value.value
            yield node.lineno, text if isinstance(text, str) else ""


def too_long(line: str) -> bool:
    """Longer than allowed, and neither the row of a table nor a lone link or picture."""
    row = line.lstrip().startswith("|")
    link = re.fullmatch(r"\s*(- )?!?\[[^\]]*\]\([^)]*\)[.,;]?", line)
    return len(line) > LONGEST_LINE and not row and not link


def test_what_counts_as_a_long_line_or_a_private_word():
    assert too_long("x" * 100)
    assert not too_long("x" * 99)
    assert not too_long("| " + "x" * 100 + " |")
    assert not too_long("![" + "x" * 100 + "](a.png)")
    assert too_long("See [this](a.md) " + "x" * 100)
    assert PRIVATE_WORDS.search("it is taken, and told; above, refused")
    assert PRIVATE_WORDS.search("a hair of 1e-7")
    assert not PRIVATE_WORDS.search("a hairpin; besides, it unfolded")


def test_files_named_on_pages_exist(root):
    """A name with a folder is that of one file; `name.py` alone may lie anywhere.

    Files under runs/ are those of a run folder.
    """
    folders = ("fdnet", "liggghts_templates", "scripts", "tests", "docs/_ext")
    names = [path.name for folder in folders for path in (root / folder).rglob("*.*")]
    files = {name.removesuffix(".txt") for name in names}
    missing = [
        f"{page.relative_to(root)}: {name}"
        for page in pages(root)
        for name in re.findall(r"\b([\w./-]+\.(?:py|sh|j2))\b", page.read_text(encoding="utf-8"))
        if not name.startswith("runs/")
        and not ((root / name).exists() if "/" in name else name in files)
    ]
    assert not missing, "\n".join(missing)


def test_tests_named_on_pages_exist(root):
    """`test_name` is a function of some test, or the beginning of its name before "..."."""
    texts = [path.read_text(encoding="utf-8") for path in (root / "tests").rglob("test_*.py")]
    functions = re.findall(r"def (test_\w+)", "\n".join(texts))
    missing = [
        f"{page.relative_to(root)}: {name}"
        for page in pages(root)
        for name in re.findall(
            r"`(?:test_\w+\.py::)?(test_\w+?)(?:\.\.\.)?`", page.read_text(encoding="utf-8")
        )
        if not any(function.startswith(name) for function in functions)
        and not list((root / "tests").rglob(f"{name}.py"))
    ]
    assert not missing, "\n".join(missing)


def test_the_architecture_page_counts_the_imports(root):
    sys.path.insert(0, str(root / "docs/_ext"))
    import import_graph

    nodes, edges = import_graph.nodes_of(root), import_graph.edges_of(root)
    layers = 1 + max(import_graph.layers_of(nodes, edges).values())
    page = (root / "docs/architecture.md").read_text(encoding="utf-8")
    assert f"| now | {len(nodes)} | {layers} | {len(edges)} |" in page


def test_the_readme_is_short(root):
    words = len((root / "README.md").read_text(encoding="utf-8").split())
    assert words <= README_WORDS, f"README.md has {words} words"


@pytest.mark.parametrize(
    "page",
    [
        "README.md",
        "docs/evidence/accuracy.md",
    ],
)
def test_the_accuracy_of_intact_packs_is_that_of_its_table(root, page):
    """The worst error of the default law, and on how many packs and lattices, stand the same."""
    with (root / "docs/validation/accuracy_packs.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["fines"] == "0"]
    packs = [row for row in rows if row["group"].startswith("random")]
    lattices = [row for row in rows if row["group"] == "touching lattices"]
    worst = max(abs(float(row["lubrication: k0"]) - 1) for row in [*packs, *lattices])
    text = " ".join((root / page).read_text(encoding="utf-8").replace("*", "").split())
    counted = (
        rf"{len(packs)} cases of random packs and (on the )?{len(lattices)} touching lattices"
    )
    assert re.search(rf"within {100 * worst:.1f} %[^;]{{0,60}} on (all )?{counted}", text)


def sources(root: Path) -> Iterator[Path]:
    """Every file of code or settings: Python, shell, TOML, the citation and the templates."""
    for pattern in ("*.py", "*.toml", "*.cff", "docs/*.py"):
        yield from sorted(root.glob(pattern))
    for folder in ("fdnet", "liggghts_templates", "scripts", "tests", "docs/_ext"):
        for pattern in ("*.py", "*.toml", "*.sh", "*.j2"):
            yield from sorted((root / folder).rglob(pattern))


def one_command(path: Path, line: str) -> bool:
    """A command of a LIGGGHTS deck: LIGGGHTS reads one line as one command, so it stays whole."""
    return path.name.endswith(".in.j2") and not line.lstrip().startswith(("#", "{#"))


def test_lines_fit_a_screen(root):
    long = [
        f"{path.relative_to(root)}:{number}: {len(line)} characters"
        for path in (*pages(root), *sources(root))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if too_long(line) and not one_command(path, line)
    ]
    assert not long, "\n".join(long)


def test_no_line_of_a_page_is_a_comment(root):
    """MyST leaves out lines that begin with a percent sign; "%%bash" begins a cell."""
    unseen = [
        f"{path.relative_to(root)}:{number}: {line}"
        for path in pages(root)
        if ".md" in path.suffixes
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if line.lstrip().startswith("%") and not line.startswith("%%")
    ]
    assert not unseen, "\n".join(unseen)


def test_pages_have_no_private_words(root):
    private = [
        f"{path.relative_to(root)}:{number}: {line.strip()}"
        for path in pages(root)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if PRIVATE_WORDS.search(line)
    ]
    assert not private, "\n".join(private)


def test_docstrings_have_no_private_words(root):
    private = [
        f"{path.relative_to(root)}:{line}: {match[0]}"
        for path in sorted((root / "fdnet").rglob("*.py"))
        for line, text in docstrings(path)
        for match in PRIVATE_WORDS.finditer(text)
    ]
    assert not private, "\n".join(private)


def private_names(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of every variable and argument of a module that is a private name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Name) and node.id in PRIVATE_NAMES:
            yield node.lineno, node.id
        if isinstance(node, ast.arg | ast.keyword) and node.arg in PRIVATE_NAMES:
            yield node.lineno, node.arg


def test_variables_have_no_private_names(root, tmp_path):
    bad = tmp_path / "bad.py"
    bad.write_text("def f(hair):\n    found = g(told=hair)\n    return found\n", encoding="utf-8")
    assert {name for _, name in private_names(bad)} == PRIVATE_NAMES
    private = [
        f"{path.relative_to(root)}:{line}: {name}"
        for folder in ("fdnet", "scripts", "tests")
        for path in sorted((root / folder).rglob("*.py"))
        for line, name in private_names(path)
    ]
    assert not private, "\n".join(private)


@pytest.fixture(scope="module")
def readme_case(root):
    text = (root / "README.md").read_text(encoding="utf-8")
    block = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    assert block, "README.md shows no case"
    return tomllib.loads(block[1])


def test_the_case_of_the_readme_is_valid(readme_case):
    assert case_from(readme_case).name == "my-sand"


@pytest.mark.parametrize(
    "key",
    [
        "name",
        "box.size_mm",
        "grains.radius_mm",
        "grains.porosity",
        "fines.radius_mm",
        "fines.count",
    ],
)
def test_the_readme_names_the_keys_that_must_be_given(readme_case, key):
    """Each of them is refused when missing; without all the others the case is still valid."""
    *section, last = key.split(".")
    case = {
        name: dict(part) if isinstance(part, dict) else part for name, part in readme_case.items()
    }
    del (case[section[0]] if section else case)[last]
    with pytest.raises(CaseError, match=last):
        case_from(case)


def test_every_other_key_of_the_readme_has_a_default(readme_case):
    case = {
        "name": readme_case["name"],
        "box": {"size_mm": readme_case["box"]["size_mm"]},
        "grains": {name: readme_case["grains"][name] for name in ("radius_mm", "porosity")},
        "fines": {name: readme_case["fines"][name] for name in ("radius_mm", "count")},
    }
    assert case_from(case)


def test_the_python_of_the_readme_has_these_names(root):
    import fdnet

    text = (root / "README.md").read_text(encoding="utf-8")
    attributes = set(re.findall(r"\brun\.([a-z_]+)\b(?!\.mm|\.py)", text))
    assert {"sections", "summary", "spheres"} <= attributes
    assert all(hasattr(FinishedRun, name) for name in attributes), attributes
    assert all(hasattr(fdnet, name) for name in re.findall(r"\bfdnet\.([a-z_]+)\(", text))


def test_the_commands_of_the_readme_are_understood(root):
    from fdnet.cli import _parser

    text = (root / "README.md").read_text(encoding="utf-8")
    commands = re.findall(r"^fdnet (.+?)(?:\s+#.*)?$", text, re.MULTILINE)
    assert len(commands) == 6
    for command in commands:
        assert _parser().parse_args(command.split())


def test_the_citation_has_the_version_of_the_package(root):
    package = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    assert (
        re.search(r"^version: (.+)$", citation, re.MULTILINE)[1] == (package["project"]["version"])
    )
