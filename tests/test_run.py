"""Whole runs by command line and real binary: output contract, killing, resuming, refusals."""

import contextlib
import errno
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

import numpy as np
import pytest
from builders import tiny

from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.run.pipeline import RunOptions, run_stages

pytestmark = pytest.mark.liggghts
SHORT = ("run.cap_ms=0.35",)
MORE_HOURS = "run.max_hours=99"
TOO_DENSE = "grains.count=110"
"""Refused only after packing, when the folder holds something already."""


def fdnet(*arguments: str | Path, **options) -> subprocess.CompletedProcess[str]:
    """One command: in this process, which saves the imports, unless `options` name another."""
    words = [*map(str, arguments)]
    if options:
        command = [sys.executable, "-m", "fdnet.cli", *words]
        return subprocess.run(command, capture_output=True, text=True, check=False, **options)
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
    path.write_text(tiny(*SHORT, *assignments).toml())
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished run of the tiny case: its folder and the case file."""
    folder = tmp_path_factory.mktemp("finished")
    case = write_case(folder)
    done = fdnet("run", case, "--out", folder / "run", "--json")
    assert done.returncode == 0, done.stderr
    return folder / "run", case, json.loads(done.stdout)


def test_the_outside_checker_says_that_the_contract_holds(finished, root):
    checker = root.parent / "shared" / "checks" / "contract.py"
    if not checker.exists():
        pytest.skip(f"the contract checker is not on this machine: {checker}")
    checked = subprocess.run(
        [sys.executable, str(checker), str(finished[0])],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.stdout.strip() == "contract holds", checked.stdout


def test_the_folder_keeps_the_output_contract(finished):
    run, _, summary = finished
    assert summary["supplied_count"] == 300
    assert summary["invaded_count"] > 0
    assert 0 < summary["k_damaged_m2"] < summary["k_initial_m2"]
    manifest = json.loads((run / "manifest.json").read_text())
    for stage, deck in (("pack", "in.pack"), ("invade", "in.invade")):
        digest = hashlib.sha256((run / stage / deck).read_bytes()).hexdigest()
        assert manifest[stage]["runs"][0]["deck_sha256"] == {deck: digest}
    assert {"pack", "invade", "analyse", "report"} <= set(summary["seconds"])
    cpu, memory = summary["cpu_seconds"], summary["peak_memory_bytes"]
    assert 0 < cpu["liggghts"] <= 1.1 * summary["seconds"]["liggghts"]
    assert cpu["python"] > 0
    assert 1e7 < memory["liggghts"] < memory["python"] < 1e10
    for name in (
        "pack/in.pack",
        "pack/log.liggghts",
        "invade/in.invade",
        "invade/log.liggghts",
        "report.html",
        "network.vtp",
    ):
        assert (run / name).stat().st_size > 0


def test_a_finished_run_is_not_repeated(finished):
    run, case, summary = finished
    before = (run / "manifest.json").stat().st_mtime_ns
    for extra in ([], ["--resume"]):
        again = fdnet("run", case, "--out", run, "--json", *extra)
        assert again.returncode == 0
        assert json.loads(again.stdout) == summary
    assert (run / "manifest.json").stat().st_mtime_ns == before


def test_a_finished_run_keeps_its_case_when_a_policy_differs(finished):
    run, case, _ = finished
    before = (run / "case.toml").read_text()
    for stages in ("pack,invade,analyse,report", "pack"):
        again = fdnet("run", case, "--out", run, "--set", MORE_HOURS, "--stages", stages)
        assert again.returncode == 0, again.stderr
        assert (run / "case.toml").read_text() == before


def test_stages_still_to_run_take_the_new_policy(finished, tmp_path):
    _, case, _ = finished
    assert fdnet("run", case, "--out", tmp_path / "run", "--stages", "pack").returncode == 0
    before = (tmp_path / "run" / "case.toml").read_text()
    assert (
        fdnet(
            "run", case, "--out", tmp_path / "run", "--stages", "pack", "--set", MORE_HOURS
        ).returncode
        == 0
    )
    assert (tmp_path / "run" / "case.toml").read_text() == before
    rest = ("--set", MORE_HOURS, "--stages", "invade")
    assert fdnet("run", case, "--out", tmp_path / "run", *rest).returncode == 0
    assert "max_hours = 99" in (tmp_path / "run" / "case.toml").read_text()


def test_its_spheres_feed_the_permeability_command(finished):
    run, _, summary = finished
    answer = fdnet(
        "permeability",
        run / "spheres_damaged.csv",
        "--axis",
        "x",
        "--box",
        "0,0.003,0,0.0016,0,0.0016",
        "--sections",
        "3",
        "--json",
    )
    assert answer.returncode == 0, answer.stderr
    result = json.loads(answer.stdout)
    assert result["k_initial_m2"] == pytest.approx(summary["k_initial_m2"], rel=1e-9, abs=0)
    assert result["k_damaged_m2"] == pytest.approx(summary["k_damaged_m2"], rel=1e-9, abs=0)
    assert result["porosity_damaged"] == pytest.approx(summary["porosity_damaged"], abs=1e-9)


def test_another_case_and_foreign_folders_are_refused(finished, tmp_path):
    run, _, _ = finished
    other = write_case(tmp_path, "fines.count=200")
    refused = fdnet("run", other, "--out", run)
    assert refused.returncode == 2
    assert "holds a run of another case" in refused.stderr
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.doc").write_text("precious")
    shutil.copy(other, tmp_path / "mine" / "case.toml")
    for extra in ([], ["--force"], ["--resume"]):
        refused = fdnet("run", other, "--out", tmp_path / "mine", *extra)
        assert refused.returncode == 2
        assert "holds no fdnet run" in refused.stderr
    assert sorted(p.name for p in (tmp_path / "mine").iterdir()) == ["case.toml", "thesis.doc"]


def test_force_with_another_law_keeps_pack_and_invasion(finished, tmp_path):
    run, case, summary = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    again = fdnet(
        "run",
        case,
        "--out",
        copy,
        "--set",
        "analysis.law=thesis",
        "--stages",
        "analyse,report",
        "--force",
        "--json",
    )
    assert again.returncode == 0, again.stderr
    result = json.loads(again.stdout)
    assert result["law"] == "thesis"
    assert result["invaded_count"] == summary["invaded_count"]
    assert result["k_initial_m2"] != summary["k_initial_m2"]
    assert (copy / "invade" / "stage.json").stat().st_mtime_ns == (
        run / "invade" / "stage.json"
    ).stat().st_mtime_ns


def test_force_that_would_need_an_unasked_stage_changes_nothing(finished, tmp_path):
    run, case, _ = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    refused = fdnet(
        "run",
        case,
        "--out",
        copy,
        "--set",
        "fines.friction=0.3",
        "--stages",
        "analyse,report",
        "--force",
    )
    assert refused.returncode == 2
    assert "add invade to --stages" in refused.stderr
    refused = fdnet("run", case, "--out", copy, "--force", "--liggghts", "/nowhere")
    assert refused.returncode == 3
    assert sorted(p.name for p in copy.iterdir()) == sorted(p.name for p in run.iterdir())
    assert fdnet("run", case, "--out", copy).returncode == 0


@pytest.mark.parametrize("name", ["pack/stage.json", "manifest.json", "case.toml"])
@pytest.mark.parametrize("content", [b"{", b"{}", b"\xff\xfe", b"[]"])
def test_damaged_records_are_named_and_force_mends_them(finished, tmp_path, name, content):
    run, case, _ = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    (copy / name).write_bytes(content)
    if name != "manifest.json":
        (copy / "manifest.json").unlink()
    refused = fdnet("run", case, "--out", copy, "--resume", "--stages", "pack,invade,analyse")
    assert refused.returncode == 2, refused.stderr
    assert "--force" in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    mended = fdnet("run", case, "--out", copy, "--force", "--stages", "pack")
    assert mended.returncode == 0, mended.stderr


def test_a_complete_folder_that_lost_a_table_is_refused(finished, tmp_path):
    run, case, _ = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    (copy / "sections.csv").unlink()
    refused = fdnet("run", case, "--out", copy)
    assert refused.returncode == 2
    assert "sections.csv is missing" in refused.stderr


def test_a_broken_dump_in_mid_history_is_counted_not_fatal(finished, tmp_path):
    run, case, summary = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    (copy / "manifest.json").unlink()
    (copy / "invade" / "stage.json").unlink()
    steps = [
        line.split(",")[1]
        for line in (copy / "invade" / "history.csv").read_text().splitlines()[1:]
    ]
    (copy / "invade" / "post" / f"invade_{steps[0]}.dump").write_bytes(b"")
    done = fdnet("run", case, "--out", copy, "--resume", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert any("1 of" in warning and "cannot be read" in warning for warning in result["warnings"])


def test_counts_are_checked_at_every_checkpoint(finished, tmp_path):
    run, case, _ = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    (copy / "manifest.json").unlink()
    (copy / "invade" / "stage.json").unlink()
    history = copy / "invade" / "history.csv"
    rows = history.read_text().splitlines()
    parts = rows[2].split(",")
    rows[2] = ",".join([*parts[:2], "25", "9999", *parts[4:]])
    history.write_text("\n".join(rows) + "\n")
    refused = fdnet("run", case, "--out", copy, "--resume")
    assert refused.returncode == 3
    assert "9999" in refused.stderr


def test_the_time_limit_holds_for_packing_too(finished, tmp_path):
    _, case, _ = finished
    fake = tmp_path / "liggghts"
    fake.write_text(
        '#!/bin/sh\necho "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)"\n[ "$1" = -h ] || sleep 100\n'
    )
    fake.chmod(0o755)
    start = time.monotonic()
    stopped = fdnet("run", case, "--out", tmp_path / "run", "--liggghts", fake, "--timeout", "1")
    assert stopped.returncode == 3
    assert "time limit" in stopped.stderr
    assert time.monotonic() - start < 30


def test_an_overlap_past_its_limit_stops_the_run_when_asked_and_is_reported(finished, tmp_path):
    """Tiny's fines overlap by some 5 %: exit 3, state kept; --resume with a policy ends it."""
    _, case, summary = finished
    out = tmp_path / "run"
    lines = [
        warning
        for warning in summary["warnings"]
        if "run.max_overlap" in warning and "at step" in warning
    ]
    assert len(lines) == 1
    command = ["run", case, "--out", out, "--stages", "pack,invade,analyse", "--json"]
    for extra in ([], ["--resume"]):
        stopped = fdnet(*command, "--set", "run.on_overlap=stop", *extra)
        assert stopped.returncode == 3
        assert "--resume --set run.on_overlap=warn" in stopped.stderr
    done = fdnet(
        *command, "--resume", "--set", "run.max_overlap=0.2", "--set", "run.on_overlap=stop"
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["max_overlap_fraction"] == summary["max_overlap_fraction"] > 0.03
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert not any("run.max_overlap" in warning for warning in result["warnings"])


def test_stages_one_after_the_other_equal_all_at_once(finished, tmp_path):
    run, case, summary = finished
    for stage in ("pack", "invade", "analyse,report"):
        done = fdnet("run", case, "--out", tmp_path / "run", "--stages", stage)
        assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert np.array_equal(
        *(Path(p, "spheres_damaged.csv").read_text() for p in (run, tmp_path / "run"))
    )


def test_a_stage_without_its_forerunner_is_refused(tmp_path):
    case = write_case(tmp_path)
    for stage, message in (("invade", "no finished pack"), ("analyse", "no finished pack")):
        refused = fdnet("run", case, "--out", tmp_path / stage, "--stages", stage)
        assert refused.returncode == 2
        assert message in refused.stderr
    refused = fdnet("run", case, "--out", tmp_path / "x", "--stages", "bake")
    assert refused.returncode == 2
    assert not (tmp_path / "x").exists()


def kill_when(command: list[str], ready, sign: int) -> int:
    """Start a run, send `sign` as soon as `ready()` is true; returns the exit code.

    A shell that runs the tests in the background makes its children ignore SIGINT, so its default
    is set again.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "fdnet.cli", *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
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
        ("pack/attempt_1/screen.txt", signal.SIGKILL),
        ("pack/stage.json", signal.SIGKILL),
        ("invade/history.csv rows", signal.SIGKILL),
        ("sections.csv", signal.SIGKILL),
        ("figures", signal.SIGKILL),
        ("pack/attempt_1/screen.txt", signal.SIGTERM),
        ("invade/history.csv rows", signal.SIGINT),
    ],
)
def test_a_run_killed_at_any_moment_is_completed_by_resume(finished, tmp_path, moment, sign):
    run, case, summary = finished
    out = tmp_path / "run"
    stages = ["--stages", "pack,invade,analyse" + ",report" * (moment == "figures")]
    name, _, rows = moment.partition(" ")

    def ready() -> bool:
        path = out / name
        return path.exists() and (not rows or path.read_text().count("\n") > 2)

    code = kill_when(["run", str(case), "--out", str(out), *stages], ready, sign)
    assert code == (-signal.SIGKILL if sign == signal.SIGKILL else 130)
    assert not (out / "manifest.json").exists()
    unfinished = fdnet("run", case, "--out", out, *stages)
    assert unfinished.returncode == 2
    assert "--resume" in unfinished.stderr
    resumed = fdnet("run", case, "--out", out, "--resume", "--json", *stages)
    assert resumed.returncode == 0, resumed.stderr
    result = json.loads(resumed.stdout)
    assert result["invaded_count"] == summary["invaded_count"]
    assert result["k_damaged_m2"] == summary["k_damaged_m2"]
    assert (out / "spheres_damaged.csv").read_text() == (run / "spheres_damaged.csv").read_text()
    assert (out / "report.html").exists() == (moment == "figures")


def test_two_runs_cannot_write_the_same_folder(tmp_path):
    import fcntl

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
    case = write_case(tmp_path)
    out = tmp_path / "run"
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


def test_bad_input_leaves_an_empty_folder_behind_a_link_as_it_was(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("empty")
    refused = fdnet("run", write_case(tmp_path), "--set", TOO_DENSE, "--out", tmp_path / "link")
    assert refused.returncode == 2
    assert "grains.count: 110 needs grains that overlap" in refused.stderr
    assert (tmp_path / "link").is_symlink()
    assert not any((tmp_path / "empty").iterdir())


@pytest.mark.parametrize("kept", ["", "a", "a/b"])
def test_bad_input_removes_the_parents_it_made_and_no_others(tmp_path, kept):
    (tmp_path / "runs" / kept).mkdir(parents=True)
    case = write_case(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert (
        fdnet(
            "run", case, "--set", TOO_DENSE, "--out", tmp_path / "runs" / "a" / "b" / "c"
        ).returncode
        == 2
    )
    assert sorted(tmp_path.rglob("*")) == before


def test_a_folder_that_cannot_be_cleared_does_not_hide_the_refusal(tmp_path, monkeypatch):
    def stuck(path):
        raise OSError(errno.EBUSY, "Device or resource busy", str(path))

    monkeypatch.setattr(shutil, "rmtree", stuck)
    with pytest.raises(
        CaseError,
        match=r"needs grains that overlap .*; .*run could not be cleared \(Device or res",
    ):
        run_stages(tiny(TOO_DENSE), RunOptions(out=tmp_path / "run", show_progress=False))


def test_a_missing_binary_ends_with_3_before_anything_is_written(tmp_path):
    refused = fdnet(
        "run", write_case(tmp_path), "--out", tmp_path / "run", "--liggghts", "/nowhere/liggghts"
    )
    assert refused.returncode == 3
    assert "LIGGGHTS not found" in refused.stderr
    assert not (tmp_path / "run").exists()


def test_a_failing_binary_ends_with_3_and_keeps_what_was_written(finished, tmp_path):
    _, case, _ = finished
    fake = tmp_path / "liggghts"
    fake.write_text(
        '#!/bin/sh\necho "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)"\n'
        'echo "ERROR: played"\nexit 1\n'
    )
    fake.chmod(0o755)
    failed = fdnet("run", case, "--out", tmp_path / "run", "--liggghts", fake)
    assert failed.returncode == 3
    assert "ERROR: played" in failed.stderr
    assert "Traceback" not in failed.stderr
    stages = ("--stages", "pack,invade,analyse")
    mended = fdnet("run", case, "--out", tmp_path / "run", "--resume", *stages)
    assert mended.returncode == 0, mended.stderr


@pytest.fixture(params=[300, 600])
def small_disk(tmp_path, request):
    """A file system of some hundred kB: it fills up early, or when restarts are there already."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={request.param}k", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small file system needs root")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_is_named_and_room_completes_the_run(finished, small_disk):
    _, case, summary = finished
    command = [
        "run",
        case,
        "--out",
        small_disk / "run",
        "--stages",
        "pack,invade,analyse",
        "--json",
    ]
    full = fdnet(*command)
    words = {3: "the disk is full", 2: "No space left on device; free space"}  # LIGGGHTS, or fdnet
    assert words[full.returncode] in full.stderr
    subprocess.run(["mount", "-o", "remount,size=50m", str(small_disk)], check=True)
    resumed = fdnet(*command, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert json.loads(resumed.stdout)["k_damaged_m2"] == summary["k_damaged_m2"]


def test_two_ranks_complete_a_run(finished, tmp_path, binary):
    if binary.launcher is None:
        pytest.skip("no mpirun on this machine")
    _, case, summary = finished
    done = fdnet(
        "run",
        case,
        "--out",
        tmp_path / "run",
        "--np",
        "2",
        "--stages",
        "pack,invade,analyse",
        "--json",
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert abs(result["invaded_count"] - summary["invaded_count"]) < 0.2 * summary["invaded_count"]
    assert "processors 1 * *" in (tmp_path / "run" / "invade" / "in.invade").read_text()


def test_a_cut_dump_of_a_finished_stage_is_named(finished, tmp_path):
    run, case, _ = finished
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    (copy / "manifest.json").unlink()
    dump = copy / "pack" / "post" / "pack.dump"
    dump.write_bytes(dump.read_bytes()[:-50])
    failed = fdnet("run", case, "--out", copy, "--resume")
    assert failed.returncode == 3
    assert "pack.dump" in failed.stderr
    assert "rows, then the file ends" in failed.stderr


def test_an_intact_pack_needs_no_fines(tmp_path):
    case = tmp_path / "case.toml"
    text = tiny("grains.count=70").toml()
    start = text.index("[fines]")
    case.write_text(text[:start] + text[text.index("[fluid]") :])
    done = fdnet("run", case, "--out", tmp_path / "run", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["stop_reason"] is None
    assert summary["supplied_count"] == 0
    assert summary["k_damaged_m2"] == summary["k_initial_m2"]
    assert any("no fines" in item for item in summary["left_out"])


def test_mobile_grains_give_a_moved_permeability(tmp_path):
    done = fdnet(
        "run", write_case(tmp_path, "grains.motion=mobile"), "--out", tmp_path / "run", "--json"
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["k_damaged_m2"] <= summary["k_moved_m2"]


def test_render_writes_decks_and_scales_without_a_binary(tmp_path, monkeypatch):
    monkeypatch.setenv("FDNET_LIGGGHTS", "/nowhere")
    case = write_case(tmp_path)
    done = fdnet("render", case, "--out", tmp_path / "decks")
    assert done.returncode == 0, done.stderr
    assert "Carman-Kozeny permeability" in done.stdout
    assert (tmp_path / "decks" / "pack" / "pack.data").exists()
    again = fdnet("render", case, "--out", tmp_path / "decks")
    assert again.returncode == 2
    assert "is there already" in again.stderr


def test_run_case_script_equals_fdnet_run(finished, root):
    run, case, summary = finished
    done = subprocess.run(
        [sys.executable, root / "scripts" / "run_case.py", case, "--out", run, "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert json.loads(done.stdout) == summary


def test_help_is_quick_to_import():
    """The heavy libraries are imported only by the commands that need them."""
    heavy = ("numpy", "pandas", "pyvista", "scipy")
    code = (
        "import sys, fdnet.cli; fdnet.cli._parser(); "
        f"print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "[]"
