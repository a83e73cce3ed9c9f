"""Whole runs by command line and real binary: output contract, killing, resuming, refusals."""

import contextlib
import csv
import fcntl
import hashlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from builders import disk_of, naming, tiny

from fdnet import run_case
from fdnet.cli import main

pytestmark = pytest.mark.liggghts

MORE_HOURS = "run.max_hours=99"

TOO_DENSE = "grains.count=110"
"""Refused only after packing, when the folder holds something already."""

NUMBERS = ("--stages", "pack,invade,analyse")
"""The stages that make the numbers."""


def fdnet(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """One command in this process, which saves the imports."""
    words = [*map(str, arguments)]
    out, err, handler = io.StringIO(), io.StringIO(), signal.getsignal(signal.SIGTERM)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(words)
        except SystemExit as stop:
            code = int(stop.code or 0)
        finally:
            signal.signal(signal.SIGTERM, handler)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def write_case(folder: Path, *assignments: str) -> Path:
    path = folder / "case.toml"
    path.write_text(tiny("run.cap_ms=0.35", *assignments).toml())
    return path


@pytest.fixture(scope="module")
def whole(finished):
    """The finished run of the tiny case: its folder, its case file and what it says."""
    return finished.path, finished.path / "case.toml", finished.summary


@pytest.fixture
def copy(whole, tmp_path) -> Path:
    return Path(shutil.copytree(whole[0], tmp_path / "run"))


def cut(folder: Path, *stages: str) -> Path:
    """The folder as a session left it that was killed before these `stages` were done."""
    (folder / "manifest.json").unlink()
    for stage in stages:
        (folder / stage / "stage.json").unlink()
    return folder


def test_the_folder_keeps_the_output_contract(whole):
    run, _, summary = whole
    assert summary["supplied_count"] == 300
    assert summary["invaded_count"] > 0
    assert 0 < summary["k_damaged_m2"] < summary["k_initial_m2"]
    manifest = json.loads((run / "manifest.json").read_text())
    names = ["report.html", "network.vtp"]
    for stage, deck in (("pack", "in.pack"), ("invade", "in.invade")):
        digest = hashlib.sha256((run / stage / deck).read_bytes()).hexdigest()
        assert manifest[stage]["runs"][0]["deck_sha256"] == {deck: digest}
        names += [f"{stage}/{deck}", f"{stage}/log.liggghts"]
    assert {"pack", "invade", "analyse", "report"} <= set(summary["seconds"])
    cpu, memory = summary["cpu_seconds"], summary["peak_memory_bytes"]
    assert 0 < cpu["liggghts"] <= 1.1 * summary["seconds"]["liggghts"]
    assert cpu["python"] > 0
    assert 1e7 < memory["liggghts"] < memory["python"] < 1e10
    assert all((run / name).stat().st_size > 0 for name in names)


def test_a_finished_run_is_not_repeated(whole, root):
    """By the command, with --resume, and by the script; a policy leaves its case as it is."""
    run, case, summary = whole
    before = [(run / name).read_bytes() for name in ("manifest.json", "case.toml")]
    stamp = (run / "manifest.json").stat().st_mtime_ns
    for extra in ([], ["--resume"], ["--set", MORE_HOURS]):
        again = fdnet("run", case, "--out", run, "--json", *extra)
        assert again.returncode == 0, again.stderr
        assert json.loads(again.stdout) == summary
    pack = ("--set", MORE_HOURS, "--stages", "pack")
    assert fdnet("run", case, "--out", run, *pack).returncode == 0
    script = [sys.executable, root / "scripts" / "run_case.py", case, "--out", run, "--json"]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    assert json.loads(done.stdout) == summary
    assert before == [(run / name).read_bytes() for name in ("manifest.json", "case.toml")]
    assert (run / "manifest.json").stat().st_mtime_ns == stamp


def test_stages_one_after_the_other_equal_all_at_once_and_take_a_new_policy(whole, tmp_path):
    """The policy is that of the stages which are still to run."""
    run, case, summary = whole
    out, policy, text = tmp_path / "run", ("--set", MORE_HOURS), []
    for words in (["pack"], ["pack", *policy], ["invade", *policy], ["analyse", *policy]):
        done = fdnet("run", case, "--out", out, "--stages", *words)
        assert done.returncode == 0, done.stderr
        text.append((out / "case.toml").read_text())
    assert text[0] == text[1]
    assert "max_hours = 99" in text[2]
    result = json.loads((out / "summary.json").read_text())
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert (out / "spheres_damaged.csv").read_text() == (run / "spheres_damaged.csv").read_text()


def test_force_with_another_law_keeps_pack_and_invasion_and_needs_no_unasked_stage(whole, copy):
    run, case, summary = whole
    for words, code, said in (
        (["--set", "fines.friction=0.3", "--stages", "analyse,report"], 2, "add invade to --st"),
        (["--liggghts", "/nowhere"], 3, "LIGGGHTS not found"),
    ):
        refused = fdnet("run", case, "--out", copy, "--force", *words)
        assert refused.returncode == code
        assert said in refused.stderr
    assert sorted(p.name for p in copy.iterdir()) == sorted(p.name for p in run.iterdir())
    assert fdnet("run", case, "--out", copy).returncode == 0
    law = ("--set", "analysis.law=thesis", "--stages", "analyse", "--force", "--json")
    again = fdnet("run", case, "--out", copy, *law)
    assert again.returncode == 0, again.stderr
    result = json.loads(again.stdout)
    assert result["law"] == "thesis"
    assert result["invaded_count"] == summary["invaded_count"]
    assert result["k_initial_m2"] != summary["k_initial_m2"]
    record = "invade/stage.json"
    assert (copy / record).stat().st_mtime_ns == (run / record).stat().st_mtime_ns


def test_damaged_records_are_named_and_force_mends_them(whole, tmp_path):
    run, case, _ = whole
    for name in ("pack/stage.json", "manifest.json", "case.toml"):
        folder = Path(shutil.copytree(run, tmp_path / name.replace("/", "-")))
        if name != "manifest.json":
            cut(folder)
        for content in (b"{}", b"\xff\xfe", b"[]", b"{"):
            with naming(name, content):
                (folder / name).write_bytes(content)
                refused = fdnet("run", case, "--out", folder, "--resume", *NUMBERS)
                assert refused.returncode == 2, refused.stderr
                assert "--force" in refused.stderr
                assert len(refused.stderr.strip().splitlines()) == 1
        mended = fdnet("run", case, "--out", folder, "--force", "--stages", "pack")
        assert mended.returncode == 0, mended.stderr


def test_a_failing_or_hanging_binary_ends_with_3_and_keeps_what_was_written(whole, tmp_path):
    """The time limit holds for packing too; --resume goes on with a sound one."""
    _, case, _ = whole
    fake, out = tmp_path / "liggghts", tmp_path / "run"
    for end, said in (
        ('[ "$1" = -h ] || sleep 100', "time limit"),
        ('echo "ERROR: played"\nexit 1', "ERROR: played"),
    ):
        fake.write_text(f'#!/bin/sh\necho "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)"\n{end}\n')
        fake.chmod(0o755)
        start = time.monotonic()
        words = ["--liggghts", fake, "--timeout", "1", "--resume"]
        failed = fdnet("run", case, "--out", out, *words)
        assert failed.returncode == 3
        assert said in failed.stderr
        assert "Traceback" not in failed.stderr
        assert time.monotonic() - start < 30
    mended = fdnet("run", case, "--out", out, "--resume", *NUMBERS)
    assert mended.returncode == 0, mended.stderr


def test_an_overlap_past_its_limit_is_reported_and_the_limit_may_change(whole, tmp_path):
    """Tiny's fines overlap by some 5 %; the record that is resumed names the old `on_overlap`."""
    run, case, summary = whole
    found = [w for w in summary["warnings"] if "run.max_overlap" in w and "at step" in w]
    assert len(found) == 1
    out = tmp_path / "run"
    shutil.copytree(run, out)
    text = (out / "case.toml").read_text()
    (out / "case.toml").write_text(text.replace("max_hours", 'on_overlap = "warn"\nmax_hours'))
    command = ("run", case, "--out", out, "--stages", "pack,invade,analyse", "--json", "--resume")
    done = fdnet(*command, "--set", "run.max_overlap=0.2")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["k_damaged_m2"] == summary["k_damaged_m2"]


def test_a_stage_without_its_forerunner_and_one_of_no_name_are_refused(tmp_path):
    case = write_case(tmp_path)
    no_pack = "no finished pack"
    for stage, said in (("invade", no_pack), ("analyse", no_pack), ("bake", "bake")):
        refused = fdnet("run", case, "--out", tmp_path / "run", "--stages", stage)
        assert refused.returncode == 2
        assert said in refused.stderr
    assert not (tmp_path / "run").exists()


def kill_when(command: list[str], ready, sign: int) -> int:
    """Start a run, send `sign` as soon as `ready()` is true; returns the exit code."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fdnet.cli", *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        # a shell that runs the tests in the background makes its children ignore SIGINT
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60
    while process.poll() is None and not ready() and time.monotonic() < deadline:
        time.sleep(0.005)
    process.send_signal(sign)
    return process.wait(30)


@pytest.mark.parametrize(
    ("moment", "sign"),
    [
        ("invade/history.csv rows", signal.SIGKILL),
        *(
            pytest.param(name, signal.SIGKILL, marks=pytest.mark.nightly)
            for name in ("pack/attempt_1/screen.txt", "pack/stage.json", "sections.csv", "figures")
        ),
        ("pack/attempt_1/screen.txt", signal.SIGTERM),
        ("invade/history.csv rows", signal.SIGINT),
    ],
)
def test_a_run_killed_at_any_moment_is_completed_by_resume(whole, tmp_path, moment, sign):
    run, case, summary = whole
    out = tmp_path / "run"
    stages = ["--stages", "pack,invade,analyse" + ",report" * (moment == "figures")]
    name, _, rows = moment.partition(" ")

    def ready() -> bool:
        path = out / name
        return path.exists() and (not rows or path.read_text().count("\n") > 2)

    code = kill_when(["run", str(case), "--out", str(out), *stages], ready, sign)
    assert code == (-signal.SIGKILL if sign == signal.SIGKILL else 130)
    assert not (out / "manifest.json").exists()
    unwhole = fdnet("run", case, "--out", out, *stages)
    assert unwhole.returncode == 2
    assert "--resume" in unwhole.stderr
    resumed = fdnet("run", case, "--out", out, "--resume", "--json", *stages)
    assert resumed.returncode == 0, resumed.stderr
    result = json.loads(resumed.stdout)
    assert result["invaded_count"] == summary["invaded_count"]
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert (out / "spheres_damaged.csv").read_text() == (run / "spheres_damaged.csv").read_text()
    assert (out / "report.html").exists() == (moment == "figures")


def test_a_cut_run_has_a_provisional_answer_until_it_goes_on(whole, tmp_path):
    """It says how far the invasion is and changes nothing of it; --resume ends as an uncut run."""
    run, case, summary = whole
    out, words = tmp_path / "run", ["--stages", "pack,invade,analyse"]
    rows = out / "invade/history.csv"
    early = ["run", case, "--out", out, "--resume", "--json", "--stages", "analyse,report"]
    assert fdnet(*early[:4], "--stages", "pack").returncode == 0
    assert "no finished invasion here" in fdnet(*early).stderr

    def ready() -> bool:
        return rows.exists() and rows.read_text().count("\n") > 4

    kill_when([*map(str, early[:5]), *words], ready, signal.SIGINT)

    def left() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in (out / "invade").rglob("*") if path.is_file()}

    before = left()
    made = fdnet(*early)
    assert made.returncode == 0, made.stderr
    said = json.loads(made.stdout)
    assert (said["stop_reason"], said["final"]) == ("unfinished", False)
    assert 0 < said["share_done"] < 1
    assert said["invaded_count"] < summary["supplied_count"]
    whole_ones = [int(path.stem.split("_")[1]) for path in out.glob("invade/post/*.record")]
    read = list(csv.DictReader((out / "history.csv").open()))
    assert int(read[-1]["step"]) == max(whole_ones)
    start = f"Provisional, at {100 * said['share_done']:.1f} % of the invasion: so far"
    assert said["answer"].startswith(start)
    assert start in (out / "report.html").read_text().replace("&nbsp;", " ")
    from_python = run_case(case, out, resume=True, stages=["analyse"])
    assert (from_python.final, from_python.answer) == (False, said["answer"])
    assert from_python.k_damaged_m2 == said["k_damaged_m2"]
    assert len(from_python.history) == len(read)
    assert from_python.sections["fines_count"].sum() == said["invaded_count"]
    assert left() == before
    assert not (out / "manifest.json").exists()
    assert fdnet("run", case, "--out", out, *words).returncode == 2
    resumed = fdnet("run", case, "--out", out, "--resume", "--json", *words)
    assert resumed.returncode == 0, resumed.stderr
    result = json.loads(resumed.stdout)
    assert result["stop_reason"] == summary["stop_reason"]
    assert "share_done" not in result
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert not (out / "report.html").exists()
    for name in ("spheres_damaged.csv", "history.csv", "invade/history.csv"):
        assert (out / name).read_bytes() == (run / name).read_bytes(), name


def test_two_runs_cannot_write_the_same_folder(tmp_path):
    case = write_case(tmp_path)
    out = tmp_path / "run"
    out.mkdir()
    lock = os.open(out / ".lock", os.O_RDWR | os.O_CREAT)
    fcntl.flock(lock, fcntl.LOCK_EX)
    refused = fdnet("run", case, "--out", out)
    os.close(lock)
    assert refused.returncode == 2
    assert "another fdnet run, or fdnet stokes, is writing here" in refused.stderr


def test_bad_input_writes_nothing_and_ends_with_2(tmp_path):
    case, out = write_case(tmp_path), tmp_path / "run"
    for arguments in (
        [tmp_path / "none.toml"],
        [case, "--set", "fines.radius_mm=0.4"],
        [case, "--np", "0"],
        [case, "--set", "x"],
        [case, "--nonsense"],
        [case, "--set", "run.time_step_s=1e-6"],
    ):
        refused = fdnet("run", *arguments, "--out", out)
        assert refused.returncode == 2, arguments
        assert len(refused.stderr.strip().splitlines()) == 1, refused.stderr
        assert not out.exists()
    missing = fdnet("run", case, "--out", out, "--liggghts", "/nowhere/liggghts")
    assert (missing.returncode, out.exists()) == (3, False)


def test_bad_input_removes_the_parents_it_made_and_no_others(tmp_path):
    """An empty folder behind a link is left as it was, too."""
    case = write_case(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("empty")
    for kept, out in (("", "a/b/c"), ("a", "a/b/c"), ("a/b", "a/b/c"), ("", "../link")):
        (tmp_path / "runs" / kept).mkdir(parents=True, exist_ok=True)
        before = sorted(tmp_path.rglob("*"))
        refused = fdnet("run", case, "--set", TOO_DENSE, "--out", tmp_path / "runs" / out)
        assert refused.returncode == 2
        assert "grains.count: 110 needs grains that overlap" in refused.stderr
        assert sorted(tmp_path.rglob("*")) == before, kept
    assert (tmp_path / "link").is_symlink()


@pytest.fixture(params=["300k", "600k"])
def small_disk(tmp_path, request):
    """A file system of some hundred kB: it fills up early, or when restarts are there already."""
    with disk_of(request.param, tmp_path / "disk") as place:
        yield place


def test_a_full_disk_is_named_and_room_completes_the_run(whole, small_disk):
    _, case, summary = whole
    command = ["run", case, "--out", small_disk / "run", "--json", *NUMBERS]
    full = fdnet(*command)
    assert full.returncode in (2, 3)  # fdnet or LIGGGHTS met it first
    assert "the disk is full" in full.stderr or "No space left on device" in full.stderr
    subprocess.run(["mount", "-o", "remount,size=50m", str(small_disk)], check=True)
    resumed = fdnet(*command, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert json.loads(resumed.stdout)["k_damaged_m2"] == summary["k_damaged_m2"]


def test_a_run_cut_after_its_pack_goes_on_with_two_ranks(whole, copy, binary):
    if binary.launcher is None:
        pytest.skip("no mpirun on this machine")
    _, case, summary = whole
    shutil.rmtree(cut(copy) / "invade")
    done = fdnet("run", case, "--out", copy, "--resume", "--np", "2", "--json", *NUMBERS)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["ranks"] == {"pack": 1, "invade": 2}
    gap = abs(result["invaded_count"] - summary["invaded_count"])
    assert gap < 0.2 * summary["invaded_count"]
    assert "processors 1 * *" in (copy / "invade" / "in.invade").read_text()
