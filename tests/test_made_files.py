"""Files of a finished stage that were changed afterwards are refused by name, not taken."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from builders import tiny

import fdnet
from fdnet.errors import CaseError, FdnetError
from fdnet.run.folder import TABLES
from fdnet.run.pipeline import run_stages
from fdnet.run.records import RunOptions

pytestmark = pytest.mark.liggghts
CASE = tiny("run.cap_ms=0.2")
STAGES = ("pack", "invade", "analyse")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "run"
    run_stages(CASE, RunOptions(out=folder, show_progress=False, stages=STAGES))
    return folder


@pytest.fixture
def copied(run, tmp_path):
    shutil.copytree(run, tmp_path / "run")
    return tmp_path / "run"


def options(folder: Path, **changes) -> RunOptions:
    return replace(RunOptions(out=folder, show_progress=False, stages=STAGES), **changes)


def last_dump(folder: Path) -> Path:
    step = (folder / "invade" / "history.csv").read_text().splitlines()[-1].split(",")[1]
    return folder / "invade" / "post" / f"invade_{step}.dump"


def dump_without_a_row(path: Path) -> None:
    lines = path.read_text().splitlines(keepends=True)
    lines[3] = f"{int(lines[3]) - 1}\n"
    path.write_text("".join(lines[:-1]))


def dump_with_another_radius(path: Path) -> None:
    """A dump that can be read; LIGGGHTS ends each row with a space."""
    lines = path.read_text().splitlines(keepends=True)
    words = lines[-1].split()
    lines[-1] = " ".join([*words[:-1], repr(1.01 * float(words[-1]))]) + " \n"
    path.write_text("".join(lines))


def dump_with_a_moved_sphere(path: Path) -> None:
    lines = path.read_text().splitlines(keepends=True)
    words = lines[-1].split()
    lines[-1] = " ".join([*words[:2], repr(float(words[2]) + 1e-6), *words[3:]]) + " \n"
    path.write_text("".join(lines))


def one_row_less(path: Path) -> None:
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0], *lines[2:]]))


SPOILT = {
    "a grain dropped": ("pack/post/pack.dump", dump_without_a_row),
    "a grain's radius": ("pack/post/pack.dump", dump_with_another_radius),
    "a grain moved": ("pack/post/pack.dump", dump_with_a_moved_sphere),
    "a fine dropped": ("last", dump_without_a_row),
    "a fine's radius": ("last", dump_with_another_radius),
    "a fine moved": ("last", dump_with_a_moved_sphere),
    "the dump gone": ("last", Path.unlink),
    "a row of the history": ("invade/history.csv", one_row_less),
    "a row of the overlap": ("invade/overlap.csv", one_row_less),
    "the overlap gone": ("invade/overlap.csv", Path.unlink),
}


@pytest.mark.parametrize("what", SPOILT)
@pytest.mark.parametrize("how", ["finished", "again", "resumed"])
def test_a_changed_file_of_a_stage_is_refused(copied, what, how):
    name, spoil = SPOILT[what]
    path = last_dump(copied) if name == "last" else copied / name
    spoil(path)
    if how == "resumed":
        (copied / "manifest.json").unlink()
    again = {"stages": ("analyse",), "force": True}
    changes = {"finished": {}, "again": again, "resumed": {"resume": True}}[how]
    if what == "the dump gone" and how == "finished":
        assert run_stages(CASE, options(copied)), "dumps may be removed from a finished run"
        return
    with pytest.raises(FdnetError, match=path.name):
        run_stages(CASE, options(copied, **changes))


@pytest.mark.parametrize("name", [*TABLES, "pack/stage.json", "invade/stage.json"])
def test_a_changed_table_of_a_finished_run_is_refused(copied, name):
    path = copied / name
    path.write_text(path.read_text().replace("1", "2", 1))
    with pytest.raises(CaseError, match=rf"{path.name}: is not the file that the run wrote"):
        run_stages(CASE, options(copied))


@pytest.mark.parametrize("name", ["sections", "profile", "pores", "throats"])
def test_an_opened_run_refuses_a_changed_table(copied, name):
    path = copied / f"{name}.csv"
    rows = path.read_text().splitlines(keepends=True)
    rows[1] = rows[1].replace("1", "2")
    path.write_text("".join(rows))
    with pytest.raises(CaseError, match=rf"{name}\.csv: "):
        getattr(fdnet.open_run(copied), name)


def test_an_opened_run_refuses_changed_spheres(copied):
    path = copied / "spheres_damaged.csv"
    path.write_text(path.read_text().replace("1", "2", 1))
    with pytest.raises(CaseError, match=r"spheres_damaged\.csv"):
        fdnet.open_run(copied).spheres()


@pytest.mark.parametrize("files", [[], "x", {"history.csv": 1}])
def test_digests_of_the_wrong_shape_are_refused(copied, files):
    (copied / "manifest.json").unlink()
    path = copied / "invade" / "stage.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"files": files}))
    with pytest.raises(CaseError, match="cannot be understood"):
        run_stages(CASE, options(copied, resume=True))


@pytest.mark.parametrize("key", ["files", "ranks"])
def test_a_record_without_its_digests_or_ranks_is_refused(copied, key):
    (copied / "manifest.json").unlink()
    path = copied / "pack" / "stage.json"
    record = json.loads(path.read_text())
    del record[key]
    path.write_text(json.dumps(record))
    with pytest.raises(CaseError, match=rf"pack/stage\.json: .*the key {key} is missing"):
        run_stages(CASE, options(copied, resume=True))


@pytest.mark.parametrize("spoil", [lambda manifest: manifest.pop("files"), dict.clear])
def test_an_opened_run_refuses_a_manifest_without_digests(copied, spoil):
    path = copied / "manifest.json"
    manifest = json.loads(path.read_text())
    spoil(manifest if spoil is not dict.clear else manifest["files"])
    path.write_text(json.dumps(manifest))
    with pytest.raises(CaseError, match=r"manifest\.json: .*files"):
        fdnet.open_run(copied)


def test_a_run_that_was_cut_after_its_pack_goes_on_with_any_ranks(copied):
    (copied / "manifest.json").unlink()
    shutil.rmtree(copied / "invade")
    summary = run_stages(CASE, options(copied, resume=True, ranks=2))
    assert summary["ranks"] == {"pack": 1, "invade": 2}


def test_a_run_ends_well_though_the_reader_of_its_answer_has_gone(copied):
    """`fdnet run ... | less`, closed with q: figures, report and manifest are still written."""
    stages = "--stages analyse,report --force --quiet"
    line = (
        f"'{sys.executable}' -m fdnet.cli run {copied}/case.toml --out {copied} {stages} | true; "
    )
    ended = ["bash", "-c", line + 'echo "${PIPESTATUS[0]}"']
    done = subprocess.run(ended, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "0", done.stderr
    assert not (copied / ".unfinished").exists()
    assert (copied / "manifest.json").exists()
    assert (copied / "report.html").exists()
