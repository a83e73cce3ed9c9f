"""Engines: what fails stops nothing else, and what needs it waits."""

import sys

import pytest

from fdnet.campaign.engine import local
from fdnet.campaign.engine.local import run_local
from fdnet.campaign.engine.snakemake import has_snakemake, run_snakemake
from fdnet.campaign.engine.tasks import HowToRun, Task
from fdnet.dem.liggghts import Binary, find_binary
from fdnet.errors import CaseError, LiggghtsError


def tasks() -> list[Task]:
    """`second` needs what `first` makes; `bad` fails."""
    write = [
        sys.executable,
        "-c",
        "import sys; open(sys.argv[1], 'w').write(open(sys.argv[2]).read())",
    ]
    first = "import time; time.sleep(0.3); open('one', 'w').write('made')"
    return [
        Task(name="second", words=(*write, "two", "one"), makes="two", after="first"),
        Task(name="bad", words=(sys.executable, "-c", "raise SystemExit('no good')"), makes="x"),
        Task(name="first", words=(sys.executable, "-c", first), makes="one"),
    ]


@pytest.mark.parametrize("engine", ["local", "snakemake"])
def test_jobs_wait_for_what_they_need_and_one_that_fails_stops_nothing(tmp_path, engine):
    if engine == "snakemake" and not has_snakemake():
        pytest.skip("Snakemake is not installed (pip install 'fdnet[sweep]')")
    (tmp_path / "logs").mkdir()
    ended: dict[str, int] = {}
    if engine == "local":
        run_local(tmp_path, tasks(), jobs=2, ended=ended.__setitem__)
        assert ended.pop("bad") == 1
    else:
        how = HowToRun(jobs=2, engine="snakemake")
        run_snakemake(tmp_path, tasks(), how, ranks=1, ended=ended.__setitem__)
    assert ended == {"first": 0, "second": 0}
    assert (tmp_path / "two").read_text() == "made"
    assert "no good" in (tmp_path / "logs" / "bad.txt").read_text()


def test_a_full_disk_starts_nothing_more(tmp_path, monkeypatch):
    (tmp_path / "logs").mkdir()
    answers = iter([False, True])
    monkeypatch.setattr(local, "disk_is_full", lambda folder: next(answers, True))
    ended: dict[str, int] = {}
    with pytest.raises(CaseError, match="disk is full; 2 jobs were not started"):
        run_local(tmp_path, tasks()[::-1], jobs=1, ended=ended.__setitem__)
    assert ended == {"first": 0}


def test_a_job_that_is_killed_says_so(tmp_path):
    (tmp_path / "logs").mkdir()
    kill = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    task = Task(name="killed", words=(sys.executable, "-c", kill), makes="x")
    run_local(tmp_path, [task], jobs=1, ended=lambda name, code: None)
    assert "ended by signal 9 (SIGKILL)" in (tmp_path / "logs/killed.txt").read_text()


def test_a_launcher_takes_the_place_of_mpirun(tmp_path):
    binary = Binary(
        path=tmp_path / "lmp",
        version="3.8.0",
        launcher=None,
        template=("srun", "-n", "{ranks}", "--mpi=pmix"),
    )
    words = ["srun", "-n", "8", "--mpi=pmix", str(tmp_path / "lmp"), "-in", "in.x"]
    assert binary.command("in.x", 8)[: len(words)] == words
    assert "srun" not in binary.command("in.x", 1)


@pytest.mark.parametrize(
    ("launcher", "kind", "message"),
    [
        ("mpirun -np 4", CaseError, "where the number of ranks goes"),
        ("no-such-launcher -n {ranks}", LiggghtsError, "not on PATH"),
        ("mpirun 'a {ranks}", CaseError, "quote it"),
    ],
)
def test_a_bad_launcher_is_refused(launcher, kind, message):
    with pytest.raises(kind, match=message):
        find_binary(launcher=launcher)
