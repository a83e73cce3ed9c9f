"""Attacks on small real runs end with the result of the uncut run, or with one refusal.

    python -m pytest -m nightly tests/robustness/test_attacks.py

FDNET_ATTACKS (60) is their number, FDNET_SEED (1) chooses them; attack [INDEX] of a seed is
always the same. FDNET_RUNS (10) is the number of runs of the soak.
"""

import contextlib
import io
import os
import signal
import time
from pathlib import Path
from random import Random

import pytest

from fdnet.cli import main
from robustness import runs
from robustness.attacks import ATTACKS
from robustness.runs import Ended, FaultError, Prepared, differs, judge, prepare

pytestmark = pytest.mark.liggghts
SEED = os.environ.get("FDNET_SEED", "1")
KINDS = tuple(ATTACKS)


@pytest.fixture(scope="module")
def prepared(binary, tmp_path_factory) -> Prepared:
    """The runs that are attacked."""
    return prepare(tmp_path_factory.mktemp("chaos"))


def attack(index: int, prepared: Prepared, place: Path) -> str:
    return ATTACKS[KINDS[index % len(KINDS)]](Random(f"{SEED}:{index}"), place, prepared)


@pytest.mark.parametrize("index", range(3))
def test_some_attacks_end_well_or_in_one_refusal(index, prepared, tmp_path):
    assert attack(index, prepared, tmp_path) in ("ok", "refused")


@pytest.mark.nightly
@pytest.mark.parametrize("index", range(int(os.environ.get("FDNET_ATTACKS", "60"))))
def test_attacks_end_well_or_in_one_refusal(index, prepared, tmp_path, record_property):
    record_property("kind", KINDS[index % len(KINDS)])
    record_property("outcome", attack(index, prepared, tmp_path))


@pytest.mark.nightly
def test_a_soak_of_killed_runs_leaves_nothing(prepared, tmp_path, monkeypatch):
    """No process, open file, temporary file, and no memory; each run ends in this process."""
    rng, of, handles, memory = Random(SEED), prepared, [], []
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    for number in range(int(os.environ.get("FDNET_RUNS", "10"))):
        out = tmp_path / f"run_{number}" / "run"
        out.parent.mkdir()
        for _ in range(rng.randrange(1, 5)):
            child = of.start(out, *runs.to_go_on(out), fresh=True)
            files = rng.randrange(len(runs.contents(of.root / "finished")))
            child.let_run(60.0, lambda out=out, files=files: len(list(out.rglob("*"))) > files)
            child.send(rng.choice((signal.SIGKILL, signal.SIGTERM)))
            child.wait()
        words = ["run", str(of.root / "case.toml"), "--out", str(out), "--quiet", *runs.STAGES]
        before = signal.getsignal(signal.SIGTERM)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            assert main([*words, *runs.to_go_on(out)]) == 0
        signal.signal(signal.SIGTERM, before)
        assert differs(of, out) == ""
        handles.append(len(os.listdir("/proc/self/fd")))
        memory.append(int(Path("/proc/self/statm").read_text().split()[1]))
    time.sleep(1.0)
    assert list(tmp_path.rglob(".*.part*")) == []
    assert [path for path in (tmp_path / "temporary").rglob("*") if path.is_file()] == []
    assert handles[-1] <= handles[min(1, len(handles) - 1)]
    assert memory[-1] - memory[min(1, len(memory) - 1)] < (40 << 20) // os.sysconf("SC_PAGE_SIZE")
    mine = f"TMPDIR={tmp_path / 'temporary'}".encode()
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            inherited = mine in (place / "environ").read_bytes()
            assert not inherited or place.name == str(os.getpid()), place


def test_the_judge_knows_a_fault_when_it_meets_one(prepared, tmp_path, monkeypatch):
    """Deliberate breaks: a traceback, two lines, a wrong code, a changed value, a hang."""
    of = prepared
    out = of.copy("finished", tmp_path)
    assert judge(of, out, Ended(0, "")) == "ok"
    assert judge(of, out, Ended(2, "fdnet: no\n")) == "refused"
    for bad in (
        Ended(1, "Traceback (most recent call last)\nKeyError: 1"),
        Ended(1, "fdnet: no\n"),
        Ended(2, "fdnet: no\nmore\n"),
        Ended(-11, ""),
        Ended(130, "fdnet: stopped\n"),
    ):
        with pytest.raises(FaultError):
            judge(of, out, bad)
    table = out / "sections.csv"
    table.write_text(table.read_text().replace("0.4", "0.5", 1))
    with pytest.raises(FaultError, match=r"silent: sections.csv differs"):
        judge(of, out, Ended(0, ""))
    monkeypatch.setattr(runs, "LIMIT_S", 0.05)
    with pytest.raises(FaultError, match="hang"):
        of.call(tmp_path / "slow")
