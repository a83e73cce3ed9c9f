"""Every warning that the package raises has an entry that says what follows and what to do.

That the page of warnings is that of the entries, and its links lead somewhere, is in test_docs.py.
"""

import ast
import copy
import pickle
from collections.abc import Iterator
from pathlib import Path

from fdnet.errors import GAP, PAGE, Doubt, catalogue, explained


def raised(root: Path) -> Iterator[tuple[str, str]]:
    """Kind and text of each `Doubt` in the package, with `GAP` for every value in the text.

    The text of a variable is what it is set to before in its function.
    """
    for path in sorted((root / "fdnet").rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            texts = [one for one in ast.walk(function) if isinstance(one, ast.Assign)]
            for one in ast.walk(function):
                if isinstance(one, ast.Call) and getattr(one.func, "id", "") == "Doubt":
                    kind, text = one.args
                    assert isinstance(kind, ast.Constant), f"{path}: {ast.unparse(kind)}"
                    names = {
                        target.id: template(set_to.value, {})
                        for set_to in sorted(texts, key=lambda node: node.lineno)
                        for target in set_to.targets
                        if isinstance(target, ast.Name) and set_to.lineno < one.lineno
                    }
                    yield str(kind.value), template(text, names)


def template(node: ast.expr, names: dict[str, str]) -> str:
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


def test_every_kind_is_raised(root):
    assert {kind for kind, _ in raised(root)} == catalogue().keys()


def test_every_text_begins_as_its_entry_has_it(root):
    for kind, text in raised(root):
        first, *_ = catalogue()[kind].text.removeprefix(GAP).split(GAP)
        known = first.strip() in text or first.startswith(text.split(GAP)[0])
        assert known, f"{kind}: {text}"


def test_a_warning_is_explained_once_with_what_it_does_not_say_itself():
    doubt = Doubt("bounced-out", "12 fines bounced out upstream and were removed")
    said = explained(doubt)
    assert said.startswith(f"{doubt}; what follows: ")
    assert "what to do: " in said
    assert said.endswith(f"(see {PAGE}#bounced-out)")
    assert explained(said) == said
    thin = Doubt("thin-sections", "sections [1] are thinner than the mean grain diameter")
    assert "what to do" not in explained(thin)
    assert explained("of another program") == "of another program"


def test_a_copy_of_a_warning_keeps_its_kind():
    doubt = Doubt("clumps", "of about their size")
    for again in (pickle.loads(pickle.dumps(doubt)), copy.deepcopy(doubt)):
        assert (again, again.kind) == (doubt, "clumps")
