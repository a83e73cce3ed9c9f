"""The runs of the study of the thesis.

States are kept whole, a cut run is continued, a wrong state is refused, every quick form ends.
"""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from fdnet.cli import main
from fdnet.dem.liggghts import Launch
from fdnet.errors import CaseError
from validation.thesis import command as command_module
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR, examine
from validation.thesis.numbers.results import read_results
from validation.thesis.runs import carry_out as runs
from validation.thesis.runs import plan as plans
from validation.thesis.runs.growth import grow, read_growth, write_growth
from validation.thesis.runs.plan import (
    CHEAP,
    QUICK_SEEDS,
    SCAN_SEEDS,
    SPECIMENS,
    VARIANTS,
    Planned,
    planned,
)
from validation.thesis.runs.state import read_state, state_of_run, write_state

LONGEST = (
    *("specimen2", "specimen3", "specimen6", "specimen7", "specimen8"),
    *("specimen5-5to6", "table3"),
)
"""Quick forms that take the longest; the test of all forms runs them too."""
SMALL = ("box.size_mm=[2.0,1.2,1.2]", "grains.count=26", "fines.count=60", "run.cap_ms=0.1")


def small(name="quick-specimen5", *settings, seed=1):
    return Planned(case=name, group="quick", seed=seed, settings=(*SMALL, *settings))


@pytest.fixture(scope="module")
def finished(binary, tmp_path_factory):
    """A run folder with a finished invasion."""
    folder = tmp_path_factory.mktemp("thesis") / "run"
    assert (
        main(
            [
                "run",
                str(plans.case_path("quick-specimen5")),
                "--out",
                str(folder),
                *_sets(),
                "--quiet",
                "--stages",
                "pack,invade,analyse",
            ]
        )
        == 0
    )
    return folder


def _sets():
    return [word for setting in SMALL for word in ("--set", setting)]


def test_a_state_keeps_spheres_to_a_nanometre_and_the_ending(finished, tmp_path):
    whole = state_of_run(finished)
    write_state(tmp_path / "a.npz", whole)
    kept = read_state(tmp_path / "a.npz")
    assert kept.case == whole.case
    assert kept.ending == whole.ending
    assert np.array_equal(kept.history, whole.history)
    for name in ("grains", "damaged"):
        one, other = getattr(kept, name), getattr(whole, name)
        assert np.array_equal(one.id, other.id)
        assert np.array_equal(one.kind, other.kind)
        assert np.array_equal(one.radius, other.radius)
        assert np.abs(one.position - other.position).max() < 1e-9
    summary = json.loads((finished / "summary.json").read_text())
    ending = kept.ending
    assert ending["supplied"] == summary["invaded_count"] + ending["passed"] + ending["upstream"]
    assert ending["stop_reason"] == summary["stop_reason"]


def test_a_state_is_examined_as_the_run_was(finished, tmp_path):
    write_state(tmp_path / "a.npz", state_of_run(finished))
    run = examine("quick-specimen5", read_state(tmp_path / "a.npz"))
    summary = json.loads((finished / "summary.json").read_text())
    assert (
        (run.thesis.law, run.thesis.damage_law)
        == THESIS_PAIR
        == (summary["law"], summary["damage_law"])
    )
    assert (run.default.law, run.default.damage_law) == DEFAULT_PAIR
    assert run.thesis.k_damaged == pytest.approx(summary["k_damaged_m2"], rel=1e-5)
    assert run.thesis.invaded_count == summary["invaded_count"]


def test_a_broken_state_is_refused(finished, tmp_path):
    path = tmp_path / "a.npz"
    write_state(path, state_of_run(finished))
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(CaseError, match=r"a\.npz: is no state of an invasion"):
        read_state(path)
    with pytest.raises(CaseError, match=r"b\.npz: is no state"):
        read_state(tmp_path / "b.npz")


def test_a_folder_without_a_finished_invasion_has_no_state(finished, tmp_path):
    shutil.copytree(finished, tmp_path / "run")
    (tmp_path / "run" / "invade" / "stage.json").unlink()
    with pytest.raises(CaseError, match="holds no finished invasion"):
        state_of_run(tmp_path / "run")


@pytest.mark.liggghts
@pytest.mark.parametrize("name", ["pack/post/pack.dump", "invade/history.csv", "last dump"])
def test_a_run_with_a_changed_file_has_no_state(finished, tmp_path, name):
    shutil.copytree(finished, tmp_path / "run")
    path = tmp_path / "run" / name
    if name == "last dump":
        dumps = (tmp_path / "run" / "invade" / "post").glob("*.dump")
        path = max(dumps, key=lambda dump: int(dump.stem.split("_")[1]))
    text = path.read_text()
    path.write_text(text[:-2] + ("1" if text[-2] != "1" else "2") + "\n")
    with pytest.raises(CaseError, match=f"{path.name}: is not the file that the run wrote"):
        state_of_run(tmp_path / "run")


def test_runs_are_done_once_twins_shared_and_failures_told(binary, tmp_path, monkeypatch):
    lines: list[str] = []
    same = small("quick-table3", "fines.radius_mm=[0.025,0.05]"), small("quick-specimen7")
    bad = small("quick-specimen5", "fines.concentration=0.29", "run.max_hours=1e-9")
    failed = runs.carry_out(
        [*same, bad], tmp_path / "out", tmp_path / "runs", jobs=1, report=lines.append
    )
    assert list(failed) == [bad]
    assert "run.max_hours" in failed[bad]
    assert len(lines) == 2
    states = [read_state(runs.state_path(tmp_path / "out", item)) for item in same]
    assert [state.case.name for state in states] == ["quick-table3", "quick-specimen7"]
    assert np.array_equal(states[0].damaged.position, states[1].damaged.position)
    assert not list((tmp_path / "runs").glob("quick-table3*"))
    monkeypatch.setattr(runs, "_run_all", lambda todo, *_, **__: dict.fromkeys(todo, "ran"))
    runs.state_path(tmp_path / "out", same[0]).unlink()
    assert (
        runs.carry_out(same, tmp_path / "out", tmp_path / "runs", jobs=1, report=lines.append)
        == {}
    )
    assert read_state(runs.state_path(tmp_path / "out", same[0])).case.name == "quick-table3"


@pytest.mark.liggghts
def test_a_state_of_another_case_is_refused(finished, tmp_path):
    item = small()
    write_state(
        runs.state_path(tmp_path, item), replace(state_of_run(finished), case=small(seed=2).load())
    )
    with pytest.raises(CaseError, match="is the state of another case"):
        runs.carry_out([item], tmp_path, tmp_path / "runs", jobs=1, report=print)


@pytest.mark.liggghts
def test_a_cut_run_is_continued(binary, tmp_path):
    item = small()
    folder = tmp_path / "runs" / item.slug
    sets = [word for setting in item.settings for word in ("--set", setting)]
    run = ["run", str(plans.case_path(item.case)), "--out", str(folder), *sets, "--quiet"]
    assert main([*run, "--stages", "pack"]) == 0
    (folder / ".unfinished").touch()
    made = (folder / "pack" / "stage.json").stat().st_mtime_ns
    assert runs.run_one(item, tmp_path, tmp_path / "runs") == ""
    assert not folder.exists()
    assert runs.state_path(tmp_path, item).stat().st_mtime_ns > made


def test_nothing_to_redraw_is_told(tmp_path, capsys):
    assert main(["study", "thesis", "--redraw", "--out", str(tmp_path / "none")]) == 2
    assert "holds no state and no results" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    assert main(["study", "thesis", "--jobs", "0", "--out", str(tmp_path / "none")]) == 2
    assert "--jobs: 0" in capsys.readouterr().err


def test_the_plan_names_every_run_once_with_its_seeds():
    plan = planned(quick=False)
    slugs = [item.slug for item in plan]
    assert len(set(slugs)) == len(slugs)
    for name in (*SPECIMENS, *VARIANTS):
        assert sum(item.id == name for item in plan) == (3 if name in CHEAP else 1)
        assert sum(item.id == f"quick-{name}" for item in plan) == QUICK_SEEDS
    assert {item.group for item in plan} == {
        "specimen",
        "variant",
        "quick",
        "reason",
        "friction",
        "drag",
        "supply",
    }
    assert sum(item.id == "specimen5 fines.friction=0" for item in plan) == SCAN_SEEDS
    assert {item.id for item in planned(quick=True)} == {
        f"quick-{name}" for name in (*SPECIMENS, *VARIANTS)
    }
    for item in plan:
        assert item.load().seed == item.seed


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "left_out",
    [
        pytest.param(
            tuple(f"quick-{name}" for name in LONGEST),
            id="without the seven longest",
        ),
        pytest.param((), id="all", marks=pytest.mark.nightly),
    ],
)
def test_the_quick_study_runs_every_form_to_its_end(
    binary, tmp_path, capsys, monkeypatch, left_out
):
    """The command runs the quick forms and writes tables and figures; redrawing runs nothing."""
    plan = [item for item in planned(quick=True) if item.id not in left_out]
    monkeypatch.setattr(command_module, "planned", lambda quick: plan)
    out, runs_folder = tmp_path / "out", tmp_path / "runs"
    command = [
        "study",
        "thesis",
        "--quick",
        "--out",
        str(out),
        "--runs",
        str(runs_folder),
        "--silent",
    ]
    assert main(command) == 0
    rows = read_results(out / "results.csv")
    assert [(row.id, row.law) for row in rows[::2]] == [(item.id, "thesis") for item in plan]
    assert len(rows) == 2 * (12 - len(left_out))
    for row in rows:
        assert row.stop_reason in {"plugged", "supply_exhausted", "cap"}
        assert 0 < row.invaded_count <= row.supplied_count - row.passed_count
        assert 0 < row.k_reduction < 1
        assert 0 < row.porosity_loss_first_mm < row.porosity_initial
        assert row.max_overlap < 0.15
    drawn = {path.name for path in out.glob("*.png")}
    assert "figure_15_invaded_fraction_specimen1.png" in drawn
    if not left_out:
        assert {"figure_72_permeability.png", "figure_67_total_reduction.png"} <= drawn
    assert len(drawn) > (20 if left_out else 35)
    assert not list(runs_folder.glob("*"))
    before = (out / "results.csv").read_bytes()
    (out / "states" / "quick-specimen1-seed1.npz").unlink()
    capsys.readouterr()
    assert main([*command, "--redraw"]) == 0
    assert "higher initial porosity" in capsys.readouterr().out
    assert (out / "results.csv").read_bytes() == before


@pytest.mark.liggghts
def test_the_growth_of_a_pack_is_kept(binary, tmp_path):
    """Radii rise from 0.6 to 1 in 30 equal stages; velocities are lowest at rest."""
    case = small().load()
    stages = grow(case, tmp_path / "grown", Launch(binary=binary), count=26)
    write_growth(tmp_path / "growth.npz", stages)
    kept = read_growth(tmp_path / "growth.npz", case)
    assert [np.unique(np.round(one.radius / 2.5e-4, 6)).tolist() for one in kept] == [
        [0.613333],
        [1.0],
        [1.0],
    ]
    speeds = [np.abs(one.velocity).max() for one in kept]
    assert speeds[2] < 1e-3 * min(speeds[:2])
    for one, other in zip(stages, kept, strict=True):
        assert np.abs(one.position - other.position).max() < 1e-9
    (tmp_path / "growth.npz").write_bytes(b"no")
    with pytest.raises(CaseError, match="holds no growth of a pack"):
        read_growth(tmp_path / "growth.npz", case)
