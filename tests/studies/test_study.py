"""The study command: rows, errors, knees, and going on where a session was cut."""

import fcntl
import json
import math

import pytest
import toy_study
from toy_study import toy

from fdnet.errors import CaseError, LiggghtsError
from validation.command import STUDIES, run_study, study_named
from validation.engine.levels import levels, order
from validation.engine.runner import POINTS, run_points
from validation.engine.study import DONE, Panel, Row
from validation.engine.table import read_rows

NAN = float("nan")


def test_a_study_writes_its_table_figure_and_text(tmp_path):
    text = run_study(toy(), tmp_path / "out", quick=False)
    rows = read_rows(tmp_path / "out" / "toy.csv")
    assert [row.value for row in rows] == [4.0, 8.0, 16.0, 32.0]
    # the midpoint rule integrates x^2 with error -1/(12 n^2)
    assert [row.error for row in rows] == pytest.approx([-1 / (4 * n**2) for n in (4, 8, 16, 32)])
    assert order(levels(rows, "midpoint", "integral")) == pytest.approx(2.0)
    assert "the error falls as the cost to the power of -2" in " ".join(text.split())
    assert "the default is 8 (" in " ".join(text.split())
    assert (tmp_path / "out" / "toy.png").stat().st_size > 5000
    assert (tmp_path / "out" / "toy.md").read_text() == text


def test_a_cut_study_goes_on_and_runs_no_point_twice(tmp_path):
    out = tmp_path / "out"
    run_points(toy(), out, quick=True)
    record = out / POINTS
    lines = record.read_text().splitlines(keepends=True)
    record.write_text("".join(lines[:2]) + lines[2][:20])
    seen = []
    result = run_points(toy(measure=toy_study.measure), out, quick=True, report=seen.append)
    assert [run.point.value for run in result] == [4.0, 8.0, 16.0]
    assert seen[0] == "1 of 3 points are there already"
    assert len(seen) == 3
    assert len(record.read_text().splitlines()) == 4


def test_quick_and_full_are_not_mixed(tmp_path):
    run_points(toy(), tmp_path / "out", quick=True)
    with pytest.raises(CaseError, match=r"'form': 'quick'.*expected.*full"):
        run_points(toy(), tmp_path / "out", quick=False)


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(CaseError, match="holds no study"):
        run_points(toy(), tmp_path, quick=True)
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_points_that_fail_are_rows_with_their_status(tmp_path):
    study = toy(measure=toy_study.failing, isolated=True, seconds=2.0)
    text = run_study(study, tmp_path / "out", quick=False)
    status = {row.value: row.status for row in read_rows(tmp_path / "out" / "toy.csv")}
    assert status == {
        4.0: DONE,
        8.0: "refused: no path at 8",
        16.0: "over time",
        32.0: "over memory",
    }
    assert "seed 0: over time" in text


def test_a_study_that_needs_liggghts_says_so_before_its_first_point(tmp_path, monkeypatch):
    monkeypatch.setenv("FDNET_LIGGGHTS", "/nowhere/liggghts")
    with pytest.raises(LiggghtsError, match="not found"):
        run_study(toy(needs_liggghts=True), tmp_path / "out", quick=True)
    assert not (tmp_path / "out").exists()


def test_failed_points_are_run_again_and_refused_ones_are_not(tmp_path):
    out = tmp_path / "out"
    run_points(toy(), out, quick=True)
    record = out / POINTS
    lines = [json.loads(line) for line in record.read_text().splitlines()]
    lines[1] |= {"status": "failed: disk full", "observed": {}}
    lines[2] |= {"status": "refused: no", "observed": {}}
    record.write_text("".join(json.dumps(line) + "\n" for line in lines))
    result = run_points(toy(), out, quick=True)
    assert [run.status for run in result] == [DONE, "refused: no", DONE]
    assert [run.status for run in run_points(toy(), out, quick=True)] == [
        DONE,
        "refused: no",
        DONE,
    ]


def test_a_record_of_other_inputs_or_of_a_session_under_way_is_refused(tmp_path):
    out = tmp_path / "out"
    run_points(toy(), out, quick=True)
    with pytest.raises(CaseError, match="belongs to"):
        run_points(toy(inputs=lambda: "another base case"), out, quick=True)
    with (out / POINTS).open("r+") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(CaseError, match="another session"):
            run_points(toy(), out, quick=True)
    with (out / POINTS).open("a") as file:
        file.write("{broken\n")
    with pytest.raises(CaseError, match=r"points\.jsonl:5: is no record"):
        run_points(toy(), out, quick=True)


def test_rows_survive_the_table(tmp_path):
    from validation.engine.table import write_rows

    row = Row(
        series="a, b", knob="k", value="held", seed=3, quantity="q", observed=1.5, error=NAN,
        error_uncertainty=NAN, reference_band=0.0, wall_s=1.0, core_s=2.0, steps=NAN,
        peak_memory_mb=3.0, status="over time", role="", run="x",
    )  # fmt: skip
    write_rows([row], tmp_path / "rows.csv")
    (again,) = read_rows(tmp_path / "rows.csv")
    assert (again.series, again.value, again.status) == ("a, b", "held", "over time")
    assert math.isnan(again.error)


@pytest.mark.parametrize("name", list(STUDIES))
def test_every_study_has_quick_points_and_unique_keys(name):
    study = study_named(name)
    assert study.name == name
    for quick in (True, False):
        keys = [point.key for point in study.points(quick)]
        assert len(set(keys)) == len(keys) > 0


def test_the_record_says_whose_it_is(tmp_path):
    run_points(toy(), tmp_path / "out", quick=True)
    first = (tmp_path / "out" / POINTS).read_text().splitlines()[0]
    assert json.loads(first) == {"study": "toy", "form": "quick", "inputs": "e3b0c44298fc1c14"}


def test_memory_is_that_of_the_point_and_not_of_who_started_it(tmp_path):
    """A process starts as a copy of its parent, whose memory getrusage goes on counting."""
    held = b"x" * 800_000_000
    study = toy(
        points=lambda _: toy_study.points(True)[:1], isolated=lambda point: point.value == 4.0
    )
    (run,) = run_points(study, tmp_path / "out", quick=False)
    assert 1e7 < run.peak_memory_bytes < len(held)


def test_a_panel_over_the_knob_has_a_table_of_its_own(tmp_path):
    panel = Panel(
        quantity="integral",
        title="by cells",
        label="error",
        cost="value",
        knob="cells",
        common="point",
    )
    text = run_study(toy(panels=(panel,)), tmp_path / "out", quick=True)
    assert "| cells | error |\n| --- | --- |\n| 4 | 0.328 |" in text
    assert "knee" not in text
