"""Every warning that the package raises has an entry that says what follows and what to do."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fdnet.scales.check import GAP, PAGE, catalogue, entry_of, explained, page

sys.path.insert(0, str(Path(__file__).parents[1] / "docs/_ext"))

ADDED = ("append", "extend")
SHORT = {
    "no-picture": "no 3-D picture: no display",
    "drawing": "the drawing process left no complete PNG",
    "no-open-path": "k_damaged = 0: no open path",
    "grains-overlap": "grains overlap by up to 4.7 % of a diameter: the pack is denser than rigid "
    "spheres get",
    "no-box": "no --box given: the box around all grains was used",
}
"""Warnings whose text is not written where it is raised."""


def functions(root: Path) -> dict[str, list[ast.FunctionDef]]:
    """All functions of the package without its studies, by name."""
    result: dict[str, list[ast.FunctionDef]] = {}
    for path in sorted((root / "fdnet").rglob("*.py")):
        if not {"studies", "spheres"} & set(path.parts):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef):
                    result.setdefault(node.name, []).append(node)
    return result


def names_warnings(node: ast.expr) -> bool:
    return getattr(node, "attr", getattr(node, "id", "")) in ("warnings", "refused", "notes")


def raised(node: ast.FunctionDef, whole: bool) -> Iterator[ast.expr]:
    """What a function adds to warnings; with `whole` all that it returns or yields too."""
    for one in ast.walk(node):
        value, added = getattr(one, "value", None), False
        if isinstance(one, ast.Call):
            value = one.args[-1] if one.args else None
            added = getattr(one.func, "attr", "") in ADDED and names_warnings(one.func.value)
            added |= getattr(one.func, "id", "") == "keep_doubts"
        elif isinstance(one, ast.AugAssign):
            added = names_warnings(one.target)
        elif isinstance(one, ast.keyword):
            added = one.arg == "warnings"
        elif isinstance(one, ast.Assign):
            added = any(map(names_warnings, one.targets))
        elif isinstance(one, ast.Return | ast.Yield | ast.YieldFrom):
            added = whole
        if added and value is not None:
            yield value


def called(values: list[ast.expr]) -> set[str]:
    nodes = [node for value in values for node in ast.walk(value) if isinstance(node, ast.Call)]
    return {getattr(node.func, "id", getattr(node.func, "attr", "")) for node in nodes}


def is_text(node: ast.FunctionDef) -> bool:
    return isinstance(node.returns, ast.Name) and node.returns.id == "str"


def template(node: ast.expr, names: dict[str, str]) -> str:
    """A text with `GAP` for every value in it; `names` are texts of variables and functions."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return names.get(node.func.id, GAP)
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.Name):
        return names.get(node.id, GAP)
    if isinstance(node, ast.JoinedStr):
        return "".join(template(part, names) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return template(node.value, names)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return template(node.left, names) + template(node.right, names)
    return GAP


def last(node: ast.FunctionDef) -> ast.expr:
    """What a function returns at its end."""
    end = node.body[-1]
    value = end.value if isinstance(end, ast.Return) else None
    return ast.Constant("") if value is None else value


def texts(value: ast.expr, names: dict[str, str]) -> Iterator[str]:
    """The sentences in what is returned or added."""
    if isinstance(value, ast.IfExp):
        yield from texts(value.body, names)
        yield from texts(value.orelse, names)
    elif isinstance(value, ast.List | ast.Tuple):
        for one in value.elts:
            yield from texts(one.value if isinstance(one, ast.Starred) else one, names)
    elif isinstance(value, ast.ListComp):
        yield from texts(value.elt, names)
    elif isinstance(value, ast.BinOp) and not isinstance(value.left, ast.JoinedStr):
        yield from texts(value.left, names)
        yield from texts(value.right, names)
    elif isinstance(value, ast.JoinedStr | ast.Constant | ast.BinOp):
        text = template(value, names)
        if " " in text and len(text) > 20:
            yield text


def all_templates(root: Path) -> dict[str, str]:
    """Every text that becomes a warning, with the function that raises it."""
    known = functions(root)
    said = {
        name: text
        for name, nodes in known.items()
        if is_text(nodes[0])
        for text in [template(last(nodes[0]), {})]
    }
    sources = {
        name for name in known if name.endswith(("_warnings", "_warning", "_doubts", "doubts"))
    }
    waiting, result = list(known), dict[str, str]()
    while waiting:
        name = waiting.pop()
        for node in known.get(name, []):
            values = list(raised(node, whole=name in sources))
            more = {n for n in called(values) & known.keys() if not is_text(known[n][0])} - sources
            sources |= more
            waiting += sorted(more)
            names = said | {
                target.id: template(one.value, {})
                for one in ast.walk(node)
                if isinstance(one, ast.Assign)
                for target in one.targets
                if isinstance(target, ast.Name) and isinstance(one.value, ast.JoinedStr)
            }
            result |= {text: name for value in values for text in texts(value, names)}
    return result


@pytest.fixture(scope="module")
def templates(root) -> dict[str, str]:
    return all_templates(root)


def test_every_warning_of_the_package_is_in_the_catalogue(templates):
    assert len(templates) > 35
    missing = [f"{name}: {text}" for text, name in templates.items() if entry_of(text) is None]
    assert not missing, "\n".join(missing)


def test_no_entry_is_left_over(templates):
    used = {entry.key for text in templates if (entry := entry_of(text))}
    assert {entry.key for entry in catalogue()} - used == SHORT.keys()
    assert all(entry_of(text).key == key for key, text in SHORT.items())
    assert len({entry.key for entry in catalogue()}) == len(catalogue())


def test_every_entry_leads_to_a_page(root):
    for entry in catalogue():
        assert (root / "docs" / entry.read).exists(), entry.key
        assert entry.follows
        assert entry.do


def test_the_page_is_that_of_the_catalogue(root):
    """After a change: `python docs/_ext/reference_tables.py --write`."""
    assert (root / PAGE).read_text(encoding="utf-8") == page()


def test_a_warning_is_explained_once_with_what_it_does_not_say_itself():
    said = explained("12 fines bounced out upstream and were removed")
    assert said.startswith("12 fines bounced out upstream and were removed; what follows: ")
    assert "what to do: " in said
    assert said.endswith(f"(see {PAGE}#bounced-out)")
    assert explained(said) == said
    assert "what to do" not in explained("sections [1] are thinner than the mean grain diameter")
    assert explained("of another program") == "of another program"
