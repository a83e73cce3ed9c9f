"""Pages: links, commands, Python, files and tables on them are those of the project."""

import json
import re
import shlex
import sys
import tomllib
from argparse import _HelpAction, _SubParsersAction
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))

import import_graph  # noqa: E402
import reference_tables  # noqa: E402
from case_keys import meaning_of, part_model  # noqa: E402

LONGEST_LINE = 99
RUN_PAGES = [ROOT / "docs" / "reference" / name for name in ("run_folder.md", "summary.md")]
WORKPLACE = re.compile(
    r"(?<![\w.$}])/(?:work|home|root|mnt|srv|Users)/|https?://(?:[\d.:]+|\w+|[\w.-]+\.(?:local|lan|corp|internal))/"
)
"""A path of one machine, or a host that only its owner reaches."""
NOW_AND_THEN = {
    *("method", "method_error", "classes", "mass_missing", "api_filtrate_mL"),  # the fast model
    "cake_of_classes_1_m",
    *("k_moved_m2", "sizes", "skin", "skin_flow_lost", "skin_well_radius_m", "drag_updates"),
    *("drag_last_update", "rate_over_initial", "filtrate_m3", "cake_resistance_share"),
    *("momentum_defect_most", "return_k_over_k0", "k_returned_m2", "clean_up"),
    *("cpu_seconds", "peak_memory_bytes", "share_done"),
}
"""Keys of summary.json that a tiny run does not have."""
SLOW = {"docs/evidence/accuracy.md"}
"""Pages whose Python takes minutes."""


def pages() -> Iterator[tuple[str, Path]]:
    """Name and path of every page that people read, and of the shipped cases."""
    found = [ROOT / ".github/pull_request_template.md", *ROOT.glob("*.md")]
    found += [*(ROOT / "docs").rglob("*.md"), *(ROOT / "cases").rglob("*.toml")]
    for path in sorted(path for path in found if "_build" not in path.parts):
        yield str(path.relative_to(ROOT)), path


def sources() -> Iterator[tuple[str, Path]]:
    """The same of every file of code or settings."""
    for pattern in ("*.toml", "*.cff", "docs/*.py", ".ci/*", "docs/_ext/*.py"):
        yield from ((str(path.relative_to(ROOT)), path) for path in ROOT.glob(pattern))
    for folder in ("fdnet", "liggghts_templates", "scripts", "tests"):
        for path in sorted((ROOT / folder).rglob("*.*")):
            if path.suffix in (".py", ".toml", ".sh", ".j2") and path != Path(__file__):
                yield str(path.relative_to(ROOT)), path


def fences(text: str, *languages: str) -> list[str]:
    """Code blocks in these languages; cells that start with `%%bash` are shell."""
    chosen = []
    for name, block in re.findall(r"^```([^\n`]*)\n(.*?)^```", text, re.M | re.S):
        cell = "bash" if block.startswith("%%bash\n") else "cell"
        if (cell if name.startswith("{code-cell}") else name) in languages:
            chosen.append(block)
    return chosen


def anchors_of(path: Path) -> set[str]:
    """Anchors of the headings, as the repository's browser and MyST make them."""
    text = re.sub(r"^```.*?^```", "", path.read_text("utf-8"), flags=re.M | re.S)
    plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)
    headings = re.findall(r"^#+ +(.+?) *$", plain, re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(path: Path, text: str) -> Iterator[str]:
    """Links of a page that lead nowhere in the repository."""
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        name, _, anchor = target.partition("#")
        file = path.parent / name if name else path
        inside = not anchor or file.suffix != ".md" or anchor in anchors_of(file)
        if not re.match(r"[a-z]+:", target) and not (file.exists() and inside):
            yield target


def test_links_of_pages_lead_somewhere():
    """The built site is checked by scripts/docs.sh; in the repository pages are plain Markdown."""
    bad = [f"{name}: {one}" for name, path in pages() for one in broken(path, path.read_text())]
    assert not bad, "\n".join(bad)


def test_commands_on_pages_are_ones_that_fdnet_takes():
    from fdnet.cli import _parser

    bad = []
    for name, path in pages():
        text = "\n".join(fences(path.read_text("utf-8"), "bash", ""))
        lines = re.sub(r"\bSEED\b|\$[a-z]+", "1", text.replace("\\\n", " ")).splitlines()
        for line in (re.sub(r"(^|\s)#.*", "", line) for line in lines):
            match = re.search(r"(?:^|[\s/])fdnet (.*?)(?:[|>;]|$)", line)
            try:
                _parser().parse_args(shlex.split(match[1]) if match else ["init"])
            except SystemExit as error:
                bad += [] if error.code == 0 else [f"{name}: {line}"]
    assert not bad, "\n".join(bad)


def test_files_named_on_pages_exist():
    """A name with a folder is that of one file; `name.py` alone may lie anywhere."""
    files = {Path(name).name for name, _ in sources()} | {Path(__file__).name, "paraview_view.py"}
    bad = [
        f"{name}: {file}"
        for name, path in pages()
        for file in re.findall(r"(?<![\w$*/])([\w./-]+\.(?:py|sh|j2))\b", path.read_text("utf-8"))
        if not file.startswith("runs/")
        and file not in files
        and not ((ROOT / file).exists() or (path.parent / file).exists())
    ]
    assert not bad, "\n".join(bad)


def test_lines_fit_a_screen_and_name_no_workplace():
    """Rows of tables, lone links and commands of a deck may be longer."""
    bad = []
    for name, path in (*pages(), *sources()):
        for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1):
            row = re.fullmatch(r"\s*(\|.*|(- )?!?\[.*\]\(\S+\)[.,;]?)", line)
            deck = name.endswith(".in.j2") and not line.lstrip().startswith(("#", "{#"))
            if len(line) > LONGEST_LINE and not row and not deck:
                bad.append(f"{name}:{number}: {len(line)} characters")
            if WORKPLACE.search(line):
                bad.append(f"{name}:{number}: {line.strip()}")
    assert not bad, "\n".join(bad)


@pytest.mark.liggghts
def test_python_on_pages_runs(finished, tmp_path, monkeypatch):
    """Each page by itself, in a folder with the case and the run that the pages speak of."""
    import matplotlib

    matplotlib.use("agg")
    (tmp_path / "cases").mkdir()
    (tmp_path / "cases" / "quick.toml").write_text(finished.case.toml())
    (tmp_path / "runs").mkdir()
    for name in ("quick", "mine"):
        (tmp_path / "runs" / name).symlink_to(finished.path)
    dumps = (finished.path / "invade" / "post").glob("invade_*.dump")
    last = max(dumps, key=lambda one: one.stat().st_mtime)
    monkeypatch.chdir(tmp_path)
    bad = []
    for name, path in (page for page in pages() if page[0] not in SLOW):
        text = "".join(fences(path.read_text("utf-8"), "python"))
        try:
            exec(re.sub(r"invade_\d+\.dump", last.name, text), {"__name__": name})
        except ModuleNotFoundError as error:
            bad += [] if error.name == "openpnm" else [f"{name}: {error}"]
        except Exception as error:
            bad.append(f"{name}: {error!r}")
    assert not bad, "\n".join(bad)


def test_the_pages_that_the_code_writes_are_up_to_date():
    """After a change: `python docs/_ext/reference_tables.py --write`; `... import_graph.py`."""
    for path, text in reference_tables.written(ROOT):
        assert path.read_text("utf-8") == text, path
    edges = import_graph.edges_of(ROOT)
    assert import_graph.read_csv(ROOT / "docs" / "import_graph.csv") == edges
    assert import_graph.digest_of(edges) in (ROOT / "docs" / "import_graph.svg").read_text()
    nodes = import_graph.nodes_of(ROOT)
    assert (len(nodes) <= 22, len(edges) <= 90) == (True, True)
    assert max(import_graph.layers_of(nodes, edges).values()) < 10


def test_every_key_command_and_name_is_explained():
    import fdnet
    from fdnet.case.case import InvasionCase
    from fdnet.case.file import known_keys
    from fdnet.cli import _parser

    def dumb(model, path):
        for name, field in model.model_fields.items():
            part = part_model(field.annotation)
            if part:
                yield from dumb(part, f"{path}{name}.")
            elif not re.match(r".{10,}\.$", meaning_of(model, name)):
                yield f"{path}{name}"

    assert not list(dumb(InvasionCase, ""))
    page = (ROOT / "docs/reference/case.md").read_text()
    tables = {key.split(".")[0] for key in known_keys() if "." in key}
    assert set(re.findall(r"^<!-- case-keys (\w+)", page, re.M)) == tables
    commands = next(a for a in _parser()._actions if isinstance(a, _SubParsersAction)).choices
    page = (ROOT / "docs/reference/commands.md").read_text()
    assert set(re.findall(r"^<!-- command-options (\w+)", page, re.M)) == set(commands)
    for name, command in commands.items():
        assert all(a.help or isinstance(a, _HelpAction) for a in command._actions), name
    text = "".join(path.read_text() for path in (ROOT / "docs/api").glob("*.md"))
    names = [name for name in fdnet.__all__ if name != "__version__"]
    assert [name for name in names if not re.search(rf"fdnet\.{name}\b", text)] == []


def test_the_citation_has_the_version_of_the_package():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()


def test_the_stability_table_names_tests_that_exist():
    table = (ROOT / "docs/validation/stability.csv").read_text("utf-8")
    nodes = re.findall(r"(tests/\S+\.py)::(\w+)", table)
    assert len(nodes) > 50
    bad = [one for one in nodes if f"def {one[1]}(" not in (ROOT / one[0]).read_text("utf-8")]
    assert not bad


def explained(heading: str, *, block: int = 0) -> list[str]:
    """Names that head the rows of a table or list of the pages on a run folder."""
    text = "\n## ".join(page.read_text() for page in RUN_PAGES)
    section = text.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^[|-] .*?(?=\n\n|\Z)", section, re.M | re.S)[block]
    return re.findall(r"`(.*?)`", " ".join(re.findall(r"^[|-] (`[^|:]*)", rows, re.M)))


@pytest.mark.liggghts
def test_everything_in_a_run_folder_is_explained(finished):
    import pyvista as pv

    run = finished.path
    tables = ["sections", "profile", "pores", "throats", "spheres_initial", "cake", "layers"]
    for name in (*tables, "bridging", "history", "invade/history"):
        header = (run / f"{name}.csv").read_text().split("\n", 1)[0].split(",")
        assert header == explained(f"{name}.csv"), name
    spheres = [(run / f"spheres_{one}.csv").open().readline() for one in ("initial", "damaged")]
    assert spheres[0] == spheres[1]
    summary = json.loads((run / "summary.json").read_text())
    assert set(summary) | NOW_AND_THEN == set(explained("Keys"))
    assert set(summary["network_counts"]) <= set(explained("Counts of the network"))
    patterns = explained("Files")
    files = [path.relative_to(run) for path in run.rglob("*") if path.is_file()]
    left = [one for one in files if not any(one.match(name) for name in (*patterns, ".lock"))]
    assert left == []
    unmatched = {one for one in patterns if not any(file.match(one) for file in files)}
    assert unmatched <= {"layers.csv", "invade/classes.npz"}
    network, spheres = (pv.read(run / f"{name}.vtp") for name in ("network", "spheres_damaged"))
    stored = {*network.point_data.keys(), *network.cell_data.keys()}
    assert stored == set(explained("ParaView files"))
    assert set(spheres.point_data.keys()) == set(explained("ParaView files", block=1))
