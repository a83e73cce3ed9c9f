"""The documentation site follows the code: import graph, case keys, options, links, run folder."""

import json
import re
import shlex
import sys
from argparse import _HelpAction, _SubParsersAction
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))

import import_graph  # noqa: E402
import reference_tables  # noqa: E402

PAGES = sorted(
    path
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    if "_build" not in path.parts
)


def test_the_import_graph_on_the_site_is_that_of_the_code(root):
    """After a change of imports: `python docs/_ext/import_graph.py` writes table and picture."""
    edges = import_graph.edges_of(root)
    assert import_graph.read_csv(root / "docs" / "import_graph.csv") == edges
    picture = (root / "docs" / "import_graph.svg").read_text()
    assert import_graph.digest_of(edges) in picture
    assert import_graph.counts_of(import_graph.nodes_of(root), edges) in picture


def test_the_import_graph_stays_small(root):
    nodes, edges = import_graph.nodes_of(root), import_graph.edges_of(root)
    layers = 1 + max(import_graph.layers_of(nodes, edges).values())
    assert len(nodes) <= 21
    assert layers <= 10
    assert len(edges) <= 90


def test_a_cycle_of_imports_is_refused():
    with pytest.raises(ValueError, match="cycle"):
        import_graph.layers_of({"a", "b", "c"}, {("a", "b"), ("b", "c"), ("c", "b")})


def test_layers_count_from_what_imports_nothing():
    edges = {("c", "b"), ("b", "a"), ("c", "a")}
    assert import_graph.layers_of({"a", "b", "c"}, edges) == {"a": 0, "b": 1, "c": 2}


def test_every_key_of_a_case_has_a_meaning():
    from case_keys import meaning_of

    from fdnet.case.case import InvasionCase

    def check(model, path):
        for name, field in model.model_fields.items():
            kinds = (field.annotation, *getattr(field.annotation, "__args__", ()))
            parts = [kind for kind in kinds if hasattr(kind, "model_fields")]
            for part in parts:
                assert part.__doc__
                check(part, [*path, name])
            if not parts:
                meaning = meaning_of(model, name)
                assert len(meaning) > 10, ".".join([*path, name])
                assert meaning.endswith("."), ".".join([*path, name])

    check(InvasionCase, [])


def test_the_case_reference_shows_every_table(root):
    from fdnet.case.file import known_keys

    page = (root / "docs" / "reference" / "case.md").read_text()
    tables = {key.split(".")[0] for key in known_keys() if "." in key}
    assert set(re.findall(r"^<!-- case-keys (\w+)", page, re.M)) == tables


@pytest.mark.parametrize("page", reference_tables.PAGES)
def test_the_tables_of_the_reference_are_those_of_the_code(root, page):
    """After a change of a key or option: `python docs/_ext/reference_tables.py --write`."""
    text = (root / page).read_text(encoding="utf-8")
    assert "| Meaning |" in text
    assert reference_tables.filled(text) == text


def test_every_command_and_option_is_explained(root):
    from fdnet.cli import _parser

    parser = _parser()
    commands = next(a for a in parser._actions if isinstance(a, _SubParsersAction)).choices
    page = (root / "docs" / "reference" / "commands.md").read_text()
    assert set(re.findall(r"^<!-- command-options (\w+)", page, re.M)) == set(commands)
    for name, command in commands.items():
        for action in command._actions:
            assert action.help or isinstance(action, _HelpAction), f"fdnet {name} {action.dest}"


def anchors_of(path: Path) -> set[str]:
    """Anchors of a Markdown file's headings, as the repository's browser and MyST make them."""
    text = re.sub(r"^```.*?^```", "", path.read_text("utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ +(.+?) *$", text, re.M)
    plain = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading) for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_of_a_page_lead_somewhere_in_the_repository(page):
    """Pages are read there as plain Markdown too; the built site is checked by scripts/docs.sh."""
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", page.read_text("utf-8"), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        assert file.exists(), f"{page.relative_to(ROOT)}: {target}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors_of(file), f"{page.relative_to(ROOT)}: {target}"


def fences(page: Path, language: str) -> list[str]:
    """Code blocks of a page in this language; cells that start with `%%bash` are shell."""
    blocks = re.findall(r"^```([^\n`]*)\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)
    chosen = []
    for name, text in blocks:
        cell = name.startswith("{code-cell}")
        kind = "python" if cell else name
        if cell and text.startswith("%%bash\n"):
            kind = "bash"
        if kind == language:
            chosen.append(text)
    return chosen


def fdnet_commands(page: Path) -> list[list[str]]:
    """Arguments of every `fdnet ...` on a page, up to a pipe or redirection."""
    text = "\n".join([*fences(page, "bash"), *fences(page, "")])
    lines = re.sub(r"\bSEED\b|\$[a-z]+", "1", text.replace("\\\n", " ")).splitlines()
    plain = [re.sub(r"(^|\s)#.*", "", line) for line in lines]
    matches = [re.search(r"(?:^|[\s/])fdnet (.*?)(?:[|>;]|$)", line) for line in plain]
    return [shlex.split(match[1]) for match in matches if match]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_command_on_a_page_is_one_that_fdnet_takes(page):
    from fdnet.cli import _parser

    for arguments in fdnet_commands(page):
        try:
            _parser().parse_args(arguments)
        except SystemExit as error:
            pytest.fail(f"fdnet {shlex.join(arguments)}: exit {error.code}")


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_name_of_fdnet_in_python_on_a_page_is_public(page):
    import fdnet

    for text in fences(page, "python"):
        for name in re.findall(r"\bfdnet\.(\w+)\b(?!\.toml)", re.sub(r"from fdnet\S+", "", text)):
            assert name in fdnet.__all__, f"{page.relative_to(ROOT)}: fdnet.{name}"


def test_every_public_name_has_its_place_in_the_reference_of_the_api(root):
    import fdnet

    text = "".join(path.read_text() for path in (root / "docs" / "api").glob("*.md"))
    for name in fdnet.__all__:
        assert name == "__version__" or re.search(rf"fdnet\.{name}\b", text), name


def test_broken_links_of_a_site_are_named(tmp_path):
    import check_links

    (tmp_path / "a.html").write_text('<p id="here"></p><a href="b.html#there">b</a>')
    (tmp_path / "b.html").write_text('<a href="a.html#here">a</a><img src="gone.png">')
    problems = sorted(check_links.broken_links(tmp_path))
    assert len(problems) == 2
    assert problems[0].startswith("a.html: b.html#there")
    assert problems[1].startswith("b.html: gone.png")


RUN_PAGE = ROOT / "docs" / "reference" / "run_folder.md"


def names_under(heading: str, *, table: int = 0) -> list[str]:
    """First cells of a table of the run-folder page, counted from its heading."""
    section = RUN_PAGE.read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]
    blocks = re.findall(r"^\|.*?(?=\n\n|\Z)", section, re.M | re.S)
    return [
        name for row in blocks[table].splitlines()[2:] for name in re.findall(r"^\| `(.*?)`", row)
    ]


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A finished run of the tiny case."""
    from builders import tiny

    from fdnet.run.pipeline import run_stages
    from fdnet.run.records import RunOptions

    folder = tmp_path_factory.mktemp("docs") / "run"
    run_stages(tiny("run.cap_ms=0.35"), RunOptions(out=folder, show_progress=False))
    return folder


def header_of(path: Path) -> list[str]:
    return path.read_text().split("\n", 1)[0].split(",")


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "table",
    ["sections", "profile", "pores", "throats", "spheres_initial", "cake", "invade/history"],
)
def test_every_column_of_a_run_is_explained(run_folder, table):
    assert header_of(run_folder / f"{table}.csv") == names_under(f"{table}.csv")


@pytest.mark.liggghts
def test_both_tables_of_spheres_have_the_same_columns(run_folder):
    initial, damaged = (run_folder / f"spheres_{name}.csv" for name in ("initial", "damaged"))
    assert header_of(initial) == header_of(damaged)


@pytest.mark.liggghts
def test_every_key_of_the_summary_is_explained(run_folder):
    summary = json.loads((run_folder / "summary.json").read_text())
    only_sometimes = {
        "k_moved_m2",
        "sizes",
        "skin",
        "skin_flow_lost",
        "skin_well_radius_m",
        "drag_updates",
        "drag_last_update",
        "rate_over_initial",
        "filtrate_m3",
        "cake_resistance_share",
        "momentum_defect_most",
        "spurt_m3_m2",
        "volume_30min_m3_m2",
        "filtrate_fit",
        "cake_by_depth",
        "return_k_over_k0",
        "k_returned_m2",
        "clean_up",
    }
    assert set(summary) | only_sometimes == set(names_under("summary.json"))
    counts = set(names_under("summary.json", table=1))
    assert set(summary["network_counts"]) <= counts


@pytest.mark.liggghts
def test_every_file_of_a_run_is_explained(run_folder):
    patterns = names_under("Files")
    files = [path.relative_to(run_folder) for path in run_folder.rglob("*") if path.is_file()]
    for file in files:
        assert file.name == ".lock" or any(file.match(name) for name in patterns), file
    for pattern in patterns:
        assert any(file.match(pattern) for file in files), pattern


@pytest.mark.liggghts
def test_everything_in_the_paraview_files_is_explained(run_folder):
    import pyvista as pv

    network = pv.read(run_folder / "network.vtp")
    stored = {*network.point_data.keys(), *network.cell_data.keys()}
    assert stored == set(names_under("ParaView files"))
    spheres = pv.read(run_folder / "spheres_damaged.vtp")
    assert set(spheres.point_data.keys()) == set(names_under("ParaView files", table=1))
