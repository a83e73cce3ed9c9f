"""Every warning that the package raises has an entry with what follows and what to do."""

import ast
import copy
import pickle

from fdnet.errors import PAGE, Doubt, catalogue, explained


def test_every_kind_is_raised_and_has_an_entry(root):
    kinds = set()
    for path in (root / "fdnet").rglob("*.py"):
        for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(one, ast.Call) and getattr(one.func, "id", "") == "Doubt":
                assert isinstance(one.args[0], ast.Constant), f"{path}: {ast.unparse(one)}"
                kinds.add(one.args[0].value)
    assert kinds == catalogue().keys()


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
