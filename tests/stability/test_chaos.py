"""Short forms of scripts/chaos.py: attacks on small real runs, and runs under random kills."""

import json
from pathlib import Path

import pytest

from fdnet.cli import main
from fdnet.studies.chaos import chaos as suite
from fdnet.studies.chaos.attacks import ATTACKS
from fdnet.studies.chaos.chaos import chaos, one_attack
from fdnet.studies.chaos.runs import Ended, FaultError, Prepared, differs, judge, prepare
from fdnet.studies.chaos.soak import soak

pytestmark = pytest.mark.liggghts


def test_some_attacks_end_well_or_in_one_refusal(binary, tmp_path):
    """The short form of scripts/chaos.py, whose long record is docs/validation/chaos.json."""
    record = chaos(tmp_path / "chaos", seed=3, indices=range(20), jobs=2)
    assert record["faults"] == []
    assert record["attacks"] == 20
    assert set(record["kinds"]) == set(ATTACKS)


def test_a_soak_of_two_runs_leaves_nothing(binary, tmp_path):
    record = soak(tmp_path, main, runs=2, seed=1)
    assert record["faults"] == []
    assert record["kills"] >= 1


@pytest.fixture(scope="module")
def prepared(binary, tmp_path_factory):
    return prepare(tmp_path_factory.mktemp("chaos") / "prepared")


def test_the_suite_knows_a_fault_when_it_meets_one(prepared, tmp_path, monkeypatch):
    """Deliberate breaks: a changed value, a lost table, a traceback, two lines, a wrong code."""
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
    assert one_attack(prepared, 1, 0, ["cut"]) == ("cut", "fault: lost: notes.txt")


def test_an_attack_of_a_seed_is_always_the_same(prepared: Prepared, monkeypatch):
    drawn = []

    def attack(rng, place: Path, _: Prepared) -> str:
        drawn.append(rng.random())
        return "ok"

    monkeypatch.setitem(suite.ATTACKS, "cut", attack)
    for seed, index in ((1, 5), (1, 6), (2, 5), (1, 5)):
        one_attack(prepared, seed, index, ["cut"])
    assert drawn[0] == drawn[3]
    assert len(set(drawn)) == 3


def test_the_committed_record_names_its_command(root):
    record = json.loads((root / "docs" / "validation" / "chaos.json").read_text())
    assert record["command"].startswith("python scripts/chaos.py --attacks 1000 --seed ")
    assert record["attacks"] == sum(sum(kind.values()) for kind in record["kinds"].values())
    assert record["attacks"] >= 12
    assert set(record["kinds"]) == set(ATTACKS)
