"""Short forms of scripts/chaos.py: attacks on small real runs, and runs under random kills."""

import json
from pathlib import Path

import pytest

from fdnet.cli import main
from validation.chaos import chaos as suite
from validation.chaos import commands
from validation.chaos.attacks import ATTACKS, ORDER, SELDOM
from validation.chaos.chaos import chaos, one_attack, prepared_runs
from validation.chaos.commands import Ended, FaultError
from validation.chaos.judge import check_report, differs, judge
from validation.chaos.soak import soak

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def runs(binary, tmp_path_factory):
    """The small runs that are attacked, on one rank."""
    with prepared_runs(tmp_path_factory.mktemp("chaos"), ranks=[1]) as prepared:
        yield prepared


def test_some_attacks_end_well_or_in_one_refusal(runs, tmp_path):
    """The short form of scripts/chaos.py, whose long record is docs/validation/chaos.json."""
    kinds = tuple(kind for kind in ATTACKS if kind not in SELDOM)
    progress = tmp_path / "progress.jsonl"
    record = chaos(runs, seed=3, indices=range(len(kinds)), kinds=kinds, progress=progress)
    assert record["faults"] == []
    assert record["attacks"] == len(kinds)
    assert set(record["kinds"]) == set(kinds)
    again = chaos({}, seed=3, indices=range(len(kinds)), kinds=kinds, progress=progress)
    assert again == record


@pytest.mark.nightly
def test_attacks_on_reports_and_on_two_ranks_end_well(binary, tmp_path):
    with prepared_runs(tmp_path) as runs:
        record = chaos(runs, seed=3, indices=range(4), kinds=SELDOM)
    assert record["faults"] == []
    assert record["attacks"] == 4


def test_a_soak_of_two_runs_leaves_nothing(binary, tmp_path):
    record = soak(tmp_path, main, runs=2, seed=1)
    assert record["faults"] == []
    assert record["kills"] >= 1


def test_the_suite_knows_a_fault_when_it_meets_one(runs, tmp_path, monkeypatch):
    """Deliberate breaks: a changed value, a lost table, a traceback, two lines, a wrong code."""
    prepared = runs[1]
    out = prepared.copy("finished", tmp_path)
    good = Ended(code=0, error="")
    assert judge(prepared, out, good) == "ok"
    assert judge(prepared, out, Ended(code=2, error="fdnet: no\n")) == "refused"
    for bad in (
        Ended(code=1, error="Traceback (most recent call last)\nKeyError: 1"),
        Ended(code=1, error="fdnet: no\n"),
        Ended(code=2, error="fdnet: no\nmore\n"),
        Ended(code=-11, error=""),
        Ended(code=130, error="fdnet: stopped\n"),
    ):
        with pytest.raises(FaultError):
            judge(prepared, out, bad)
    table = out / "sections.csv"
    table.write_text(table.read_text().replace("0.4", "0.5", 1))
    assert differs(prepared, out).startswith("sections.csv row")
    with pytest.raises(FaultError, match="silent"):
        judge(prepared, out, good)
    table.unlink()
    assert differs(prepared, out) == "sections.csv is missing"

    def lost(*_: object) -> str:
        raise FaultError("lost: notes.txt")

    monkeypatch.setitem(suite.ATTACKS, "cut", lost)
    outcome = one_attack(runs, 1, 0, ["cut"])
    assert (outcome.kind, outcome.what, outcome.words) == ("cut", "fault", "lost: notes.txt")
    with pytest.raises(FaultError, match="missing or cut"):
        check_report(out)


def test_a_command_that_hangs_is_a_fault_and_is_ended(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(commands, "LIMIT_S", 0.05)
    for fresh in (False, True):
        child = runs[1].start(tmp_path / f"run_{fresh}", fresh=fresh)
        with pytest.raises(FaultError, match="hang"):
            commands.wait_for(child)
        assert child.poll() is not None


def test_an_attack_of_a_seed_is_always_the_same(runs, monkeypatch):
    drawn = []

    def attack(rng, place: Path, _) -> str:
        drawn.append(rng.random())
        return "ok"

    monkeypatch.setitem(suite.ATTACKS, "cut", attack)
    for seed, index in ((1, 5), (1, 6), (2, 5), (1, 5)):
        one_attack(runs, seed, index, ["cut"])
    assert drawn[0] == drawn[3]
    assert len(set(drawn)) == 3


def test_the_committed_record_is_of_a_thousand_attacks_without_fault(root):
    record = json.loads((root / "docs" / "validation" / "chaos.json").read_text())
    assert record["command"].startswith("python scripts/chaos.py --attacks 1000 --seed ")
    assert record["attacks"] == sum(sum(kind.values()) for kind in record["kinds"].values())
    assert record["attacks"] >= 1000
    assert record["faults"] == []
    assert set(record["kinds"]) == set(ATTACKS) == set(ORDER)


def test_the_committed_soak_is_of_a_hundred_runs_without_fault(root):
    record = json.loads((root / "docs" / "validation" / "soak.json").read_text())
    assert record["command"].startswith("python scripts/chaos.py --soak 100")
    assert record["runs"] >= 100
    assert record["kills"] >= 100
    assert record["faults"] == []
    assert record["handles"][0] == record["handles"][1]
