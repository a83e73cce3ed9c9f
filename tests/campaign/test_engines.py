"""What carries out the runs: a pool or Snakemake; stopped, killed, failing and on a full disk."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from builders import tiny

import fdnet
from fdnet.campaign import engine as engine_module
from fdnet.campaign.engine import SNAKEFILE, has_snakemake
from fdnet.cli import main
from fdnet.errors import CaseError

needs_snakemake = pytest.mark.skipif(not has_snakemake(), reason="Snakemake is not installed")
SNAKEMAKE = pytest.param("snakemake", signal.SIGINT, marks=needs_snakemake)
STAGES = ["--stages", "pack,invade,analyse"]
VERSION = 'echo "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)"\n[ "$1" = -h ] && exit 0\n'


def fake_liggghts(path: Path, text: str) -> str:
    """A program that says it is LIGGGHTS and then does `text`."""
    path.write_text(f"#!/bin/bash\n{VERSION}{text}\n")
    path.chmod(0o755)
    return str(path)


def words(folder: Path, engine: str, *more: str) -> list[str]:
    """The command line of an ensemble of two seeds in `folder`/out."""
    case = folder / "tiny.toml"
    case.write_text(tiny().toml())
    words = ["ensemble", str(case), "--seeds", "2", "--out", str(folder / "out")]
    return [*words, "--engine", engine, "--jobs", "2", *STAGES, *more]


def started(folder: Path, engine: str, *more: str) -> subprocess.Popen:
    """fdnet as a process of its own, once both runs have called LIGGGHTS, which then waits.

    It hears Ctrl-C also where the shell has switched it off for these tests, as with `&`.
    """
    mark = folder / "called"
    fake = fake_liggghts(folder / "lmp", f"echo $$ >> '{mark}'\nexec sleep 100")
    command = [sys.executable, "-m", "fdnet.cli", *words(folder, engine, "--liggghts", fake)]
    process = subprocess.Popen(
        [*command, *more],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    end = time.monotonic() + 60
    while time.monotonic() < end and not (mark.exists() and len(mark.read_text().split()) == 2):
        time.sleep(0.1)
    assert len(mark.read_text().split()) == 2
    return process


def alive(folder: Path) -> list[int]:
    """Processes of LIGGGHTS that are not ended yet, a little later."""
    numbers = [int(word) for word in (folder / "called").read_text().split()]
    end = time.monotonic() + 20
    while any(map(_lives, numbers)) and time.monotonic() < end:
        time.sleep(0.1)
    return [number for number in numbers if _lives(number)]


def _lives(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().split(") ")[1][0] != "Z"
    except OSError:
        return False


def by_hand(out: Path, *more: str) -> str:
    """What Snakemake says, called with the Snakefile in the folder of a plan."""
    call = [sys.executable, "-m", "snakemake", "--snakefile", SNAKEFILE, "--cores", "2", *more]
    done = subprocess.run(call, cwd=out, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.liggghts
@needs_snakemake
def test_one_call_of_snakemake_ends_by_itself_with_its_page(tmp_path, capsys):
    """Two seeds through the real binary; a second call does nothing, by fdnet or by hand."""
    out = tmp_path / "out"
    assert main(words(tmp_path, "snakemake")) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("tiny: permeability lost ")
    assert "2 of 2: tiny-seed-" in printed.err
    for seed in (1, 2):
        benchmark = (out / f"benchmarks/tiny-seed-{seed}.tsv").read_text().split()
        assert {"max_rss", "cpu_time"} <= set(benchmark)
    before = {p: p.stat().st_mtime_ns for p in out.glob("runs/*/manifest.json")}
    assert main(words(tmp_path, "snakemake")) == 0
    assert "to do" not in capsys.readouterr().err
    page = (out / "compare.html").read_bytes()
    (out / "compare.html").write_text("of another day")
    by_hand(out)
    assert (out / "compare.html").read_bytes() == page
    assert {p: p.stat().st_mtime_ns for p in out.glob("runs/*/manifest.json")} == before


@pytest.mark.parametrize(
    ("engine", "number"), [("local", signal.SIGTERM), ("local", signal.SIGKILL), SNAKEMAKE]
)
def test_a_stop_cancels_the_runs_and_ends_with_130(tmp_path, engine, number):
    """The pool dies with an fdnet that is killed."""
    process = started(tmp_path, engine)
    process.send_signal(number)
    _, error = process.communicate(timeout=60)
    killed = number == signal.SIGKILL
    assert process.returncode == (-number if killed else 130)
    assert killed or "stopped; what was written is kept" in error
    assert alive(tmp_path) == []


@needs_snakemake
def test_a_snakemake_that_outlives_fdnet_is_named_and_no_seed_has_failed(tmp_path, capsys):
    """fdnet is killed, then the Snakemake that it left behind; the next call takes over."""
    process = started(tmp_path, "snakemake")
    process.kill()
    process.communicate()
    assert main(words(tmp_path, "snakemake")) == 2
    error = capsys.readouterr().err
    said = r"Snakemake \(process (\d+) on .* still runs the jobs .*kill -INT -\1"
    match = re.search(said, error)
    assert match, error
    assert "failed" not in error
    os.killpg(int(match[1]), signal.SIGKILL)
    assert alive(tmp_path) == []
    assert list((tmp_path / "out/.snakemake/locks").iterdir())
    fake = fake_liggghts(tmp_path / "lmp", 'echo "ERROR: played"; exit 1')
    assert main(words(tmp_path, "snakemake", "--liggghts", fake)) == 5
    error = capsys.readouterr().err
    assert "an earlier Snakemake was killed here; its lock is removed" in error
    assert "tiny-seed-1 failed: " in error
    assert "ERROR: played" in error


@needs_snakemake
def test_the_lock_of_another_snakemake_is_respected(tmp_path, capsys):
    """One that fdnet did not start: its lock stands without a word in the lock of fdnet.

    By hand it does the runs of a plan, also where there is a page of nothing; they have the
    resource that keeps the executor for Slurm from a call of srun.
    """
    assert main([*words(tmp_path, "snakemake"), "--gather"]) == 5
    said = by_hand(tmp_path / "out", "--dry-run")
    assert re.search(r"run +2\n", said)
    assert len(re.findall(r"cpus_per_task=1, mpi=, nodes=1$", said, re.MULTILINE)) == 2
    locks = tmp_path / "out/.snakemake/locks"
    locks.mkdir(parents=True, exist_ok=True)
    (locks / "0.output.lock").write_text("runs/tiny-seed-1/manifest.json\n")
    capsys.readouterr()
    fake = fake_liggghts(tmp_path / "lmp", "exit 1")
    assert main(words(tmp_path, "snakemake", "--liggghts", fake)) == 2
    error = capsys.readouterr().err
    assert "Snakemake ended with exit code 1 before any run" in error
    assert "locked" in error


@pytest.mark.nightly
@needs_snakemake
def test_resources_reach_sbatch_as_they_are_and_its_reason_the_user(tmp_path, capsys, monkeypatch):
    """A stand-in for sbatch keeps its words and refuses; nothing that a user names is run.

    fdnet is itself in a job of Slurm, and keeps the variable that names Slurm's configuration.
    """
    pytest.importorskip("snakemake_executor_plugin_slurm")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/sbatch").write_text(
        f'#!/bin/bash\nprintf \'%s\\n\' "conf: $SLURM_CONF" "$@" >> {tmp_path}/words\n'
        "echo 'sbatch: error: invalid partition specified' >&2; exit 1\n"
    )
    for name in ("sacct", "squeue", "scontrol", "sinfo", "sacctmgr"):
        (tmp_path / "bin" / name).write_text("#!/bin/bash\nexit 1\n")
    for program in (tmp_path / "bin").iterdir():
        program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:{os.environ['PATH']}")
    monkeypatch.setenv("SLURM_JOB_ID", "1")
    monkeypatch.setenv("SLURM_CONF", "of this cluster")
    fake = fake_liggghts(tmp_path / "lmp", "exit 1")
    resources = "slurm_partition=all,runtime=10,mem_mb=500"
    arguments = words(tmp_path, "auto", "--liggghts", fake, "--slurm", resources)
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert "sbatch: error: invalid partition specified" in error
    given = (tmp_path / "words").read_text()
    assert given.startswith("conf: of this cluster\n")
    assert re.search(r"-p\s+all\b", given)
    assert re.search(r"--mem\s+500\b", given)


def test_resources_that_are_no_words_are_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(engine_module, "find_spec", lambda name: True)
    for bad in ("a\nb=1", "slurm_partition", "=3", "a b=1", "x=", "__import__('os')=1"):
        assert main(words(tmp_path, "auto", "--slurm", bad)) == 2, bad
        assert "--slurm: " in capsys.readouterr().err
    assert main(words(tmp_path, "local", "--slurm", "runtime=1")) == 2
    assert main(words(tmp_path, "local", "--jobs", "0")) == 2
    with pytest.raises(CaseError, match="'cluster', expected one of local"):
        fdnet.ensemble(tiny(), out=tmp_path / "no", engine="cluster")
    assert not (tmp_path / "no").exists()


def test_a_run_that_is_killed_says_so_and_stops_no_other(tmp_path, capsys):
    """LIGGGHTS of seed 1 kills the `fdnet run` that called it, that of seed 2 fails by itself."""
    text = '[[ $PWD = *seed-1* ]] && kill -9 $PPID; echo "ERROR: played"; exit 1'
    fake = fake_liggghts(tmp_path / "lmp", text)
    assert main(words(tmp_path, "local", "--liggghts", fake)) == 5
    error = capsys.readouterr().err
    assert "tiny-seed-1 failed: ended by signal 9 (SIGKILL), perhaps for want of memory" in error
    assert re.search(r"tiny-seed-2 failed: .*ERROR: played", error)


@pytest.mark.parametrize(("engine", "_"), [("local", 0), SNAKEMAKE])
def test_runs_whose_pack_failed_have_its_reason_and_the_others_go_on(tmp_path, capsys, engine, _):
    """Two muds share the pack of each seed; that of seed 1 fails in another way."""
    (tmp_path / "tiny.toml").write_text(tiny().toml())
    sweep = tmp_path / "sweep.toml"
    sweep.write_text('case = "tiny.toml"\nseeds = 2\n[grid]\nfines.count = [50, 60]\n')
    text = f'[[ $PWD = *{tiny("seed=1").digest("pack")}* ]] && echo "ERROR: first" && exit 1'
    fake = fake_liggghts(tmp_path / "lmp", f'{text}\necho "ERROR: second"; exit 1')
    out = str(tmp_path / "out")
    assert main(["sweep", str(sweep), "--out", out, "--engine", engine, "--liggghts", fake]) == 5
    error = capsys.readouterr().err
    for count in (50, 60):
        for seed, reason in ((1, "first"), (2, "second")):
            assert re.search(f"count={count}-seed-{seed} failed: .*ERROR: {reason}", error)
    assert len(list((tmp_path / "out/packs").iterdir())) == 2
    assert not (tmp_path / "out/runs").exists()


def test_a_full_disk_starts_nothing_more(tmp_path, monkeypatch):
    answers = iter([False, True])
    monkeypatch.setattr(engine_module, "disk_is_full", lambda folder: next(answers, True))
    fake = fake_liggghts(tmp_path / "lmp", "exit 1")
    with pytest.raises(CaseError, match="disk is full; 2 jobs were not started"):
        fdnet.ensemble(tiny(), seeds=3, out=tmp_path / "out", jobs=1, liggghts=fake)
    logs = [path.name for path in (tmp_path / "out/logs").glob("*.txt")]
    assert logs == ["tiny-seed-1.txt"]


def test_what_stops_every_run_stops_before_anything_is_written(tmp_path, capsys):
    for option, value, code, message in (
        ("--launcher", "mpirun -np 4", 2, "where the number of ranks goes"),
        ("--launcher", "no-such-launcher -n {ranks}", 3, "not on PATH"),
        ("--launcher", "mpirun 'a {ranks}", 2, "quote it"),
        ("--liggghts", str(tmp_path / "none"), 3, "none"),
    ):
        assert main(words(tmp_path, "local", option, value)) == code
        assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
