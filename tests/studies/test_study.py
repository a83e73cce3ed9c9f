"""The study command: rows, errors, knees, and going on where a session was cut."""

import json
import math

import pytest
import toy_study
from toy_study import toy

from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.studies.command import STUDIES, run_study, study_named
from fdnet.studies.judge import Level, against_reference, knee, knee_sentence, levels, order
from fdnet.studies.runner import POINTS, run_points
from fdnet.studies.study import DONE, Measured, Panel, Point, Row
from fdnet.studies.table import read_rows

NAN = float("nan")


def level(value, cost, error, half=0.0) -> Level:
    return Level(value=value, runs=1, cost=cost, error=error, half_width=half)


def measured(value, seed, **observed) -> Measured:
    point = Point(series="s", knob="k", value=value, seed=seed)
    return Measured(
        point=point, status=DONE, observed=observed, wall_s=1.0, core_s=1.0, steps=NAN, peak_memory_bytes=NAN
    )


def test_a_study_writes_its_table_figure_and_text(tmp_path):
    text = run_study(toy(), tmp_path / "out", quick=False)
    rows = read_rows(tmp_path / "out" / "toy.csv")
    assert [row.value for row in rows] == [4.0, 8.0, 16.0, 32.0]
    # the midpoint rule integrates x^2 with error -1/(12 n^2)
    assert [row.error for row in rows] == pytest.approx([-1 / (4 * n**2) for n in (4, 8, 16, 32)])
    assert order(levels(rows, "midpoint", "integral")) == pytest.approx(2.0)
    assert "error falls as cost^-2" in text
    assert "default 8" in text
    assert (tmp_path / "out" / "toy.png").stat().st_size > 5000
    assert (tmp_path / "out" / "toy.md").read_text() == text


def test_a_cut_study_goes_on_and_runs_no_point_twice(tmp_path):
    out = tmp_path / "out"
    run_points(toy(), out, quick=True)
    record = out / POINTS
    lines = record.read_text().splitlines(keepends=True)
    record.write_text("".join(lines[:2]) + lines[2][:20])
    seen = []
    found = run_points(toy(measure=toy_study.measure), out, quick=True, tell=seen.append)
    assert [run.point.value for run in found] == [4.0, 8.0, 16.0]
    assert seen[0] == "1 of 3 points are there already"
    assert len(seen) == 3
    assert len(record.read_text().splitlines()) == 4


def test_quick_and_full_are_not_mixed(tmp_path):
    run_points(toy(), tmp_path / "out", quick=True)
    with pytest.raises(CaseError, match=r"'form': 'quick'.*expected.*full"):
        run_points(toy(), tmp_path / "out", quick=False)


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(CaseError, match="holds no fdnet study"):
        run_points(toy(), tmp_path, quick=True)
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_points_that_fail_are_rows_with_their_status(tmp_path):
    study = toy(measure=toy_study.failing, isolated=True, seconds=2.0)
    text = run_study(study, tmp_path / "out", quick=False)
    status = {row.value: row.status for row in read_rows(tmp_path / "out" / "toy.csv")}
    assert status == {4.0: DONE, 8.0: "refused: no path at 8", 16.0: "over time", 32.0: "over memory"}
    assert "seed 0: over time" in text


def test_errors_against_a_reference_are_taken_seed_by_seed():
    # the seed adds 10 or 20, the setting 1: the scatter of seeds cancels
    runs = [measured("good", 1, q=10.0), measured("good", 2, q=20.0)]
    runs += [measured("poor", 1, q=11.0), measured("poor", 2, q=21.2), measured("poor", 3, q=16.0)]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    assert [row.error for row in rows] == pytest.approx([-5 / 15, 5 / 15, 1 / 15, 1.2 / 15, 1 / 15])
    assert rows[2].error_uncertainty == pytest.approx(0.1155 / 15, rel=1e-3)


def test_rounding_of_a_sum_is_no_error():
    runs = [measured("good", 0, q=0.3), measured("same", 0, q=0.1 + 0.2), measured("near", 0, q=0.3 * (1 + 1e-9))]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    assert rows[1].error == 0.0 != 0.1 + 0.2 - 0.3
    assert rows[2].error == pytest.approx(1e-9, rel=1e-6)


def test_a_level_has_the_confidence_band_of_its_seeds():
    runs = [measured("good", 0, q=1.0), *(measured("poor", seed, q=q) for seed, q in enumerate((1.1, 1.2, 1.3)))]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    (band,) = [found for found in levels(rows, "s", "q") if found.value == "poor"]
    # mean 0.2, s = 0.1, t(0.975, 2) = 4.3027
    assert band.error == pytest.approx(0.2)
    assert band.half_width == pytest.approx(4.302653 * 0.1 / math.sqrt(3), rel=1e-6)


def test_the_knee_is_the_cheapest_that_cannot_be_told_from_the_best():
    noisy = [level(1, 1.0, 0.5, 0.1), level(2, 2.0, 0.028, 0.02), level(3, 4.0, 0.01, 0.02), level(4, 8.0, 0.012, 0.02)]
    found = knee(noisy)
    assert found is not None
    assert found.value == 2
    exact = [level(1, 1.0, 0.5), level(2, 2.0, 0.25), level(3, 4.0, 0.125)]
    assert knee(exact) == exact[2]
    assert "cost^-1" in knee_sentence(exact, default=2)
    assert knee([]) is None


def test_rows_survive_the_table(tmp_path):
    from fdnet.studies.table import write_rows

    row = Row(
        series="a, b", knob="k", value="held", seed=3, quantity="q", observed=1.5, error=NAN, error_uncertainty=NAN,
        wall_s=1.0, core_s=2.0, steps=NAN, peak_memory_mb=3.0, status="over time",
    )  # fmt: skip
    write_rows([row], tmp_path / "rows.csv")
    (again,) = read_rows(tmp_path / "rows.csv")
    assert (again.series, again.value, again.status) == ("a, b", "held", "over time")
    assert math.isnan(again.error)


def test_unknown_studies_are_refused_and_the_known_ones_listed(capsys):
    assert main(["study", "nonsense"]) == 2
    assert "'nonsense' is not known, expected one of" in capsys.readouterr().err
    assert main(["study", "list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in STUDIES)


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
    assert json.loads(first) == {"study": "toy", "form": "quick"}


def test_memory_is_that_of_the_point_and_not_of_who_started_it(tmp_path):
    """A process starts as a copy of its parent, whose memory getrusage goes on counting."""
    held = b"x" * 800_000_000
    study = toy(points=lambda _: toy_study.points(True)[:1], isolated=lambda point: point.value == 4.0)
    (run,) = run_points(study, tmp_path / "out", quick=False)
    assert 1e7 < run.peak_memory_bytes < len(held)


def test_a_panel_over_the_knob_has_a_table_of_its_own(tmp_path):
    panel = Panel(quantity="integral", title="by cells", label="error", cost="value", knob="cells", common="point")
    text = run_study(toy(panels=(panel,)), tmp_path / "out", quick=True)
    assert "| cells | error |\n|---|---|\n| 4 | -0.0156 |" in text
    assert "knee" not in text


def test_costs_within_a_factor_of_two_have_no_order():
    near, far = ([level(n, cost, 0.1**n) for n, cost in enumerate(costs)] for costs in ((1, 1.3, 1.9), (1, 2, 4)))
    assert math.isnan(order(near))
    assert order(far) == pytest.approx(math.log(10) / math.log(2))
