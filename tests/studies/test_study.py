"""The study command: rows, errors, knees, and going on where a session was cut."""

import fcntl
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import toy_study
from toy_study import toy

from fdnet.cli import main
from fdnet.errors import CaseError, LiggghtsError
from fdnet.studies.command import STUDIES, run_study, study_named
from fdnet.studies.engine.error_rows import against_reference, profile_distance
from fdnet.studies.engine.knee import knee, knee_sentence
from fdnet.studies.engine.levels import Level, levels, order
from fdnet.studies.engine.runner import POINTS, run_points
from fdnet.studies.engine.study import DONE, Measured, Panel, Point, Row
from fdnet.studies.engine.table import read_rows

NAN = float("nan")


def level(value, cost, error, half=0.0) -> Level:
    return Level(value=value, runs=1, cost=cost, error=error, half_width=half)


def measured(value, seed, **observed) -> Measured:
    point = Point(series="s", knob="k", value=value, seed=seed)
    return Measured(
        point=point,
        status=DONE,
        observed=observed,
        wall_s=1.0,
        core_s=1.0,
        steps=NAN,
        peak_memory_bytes=NAN,
    )


def test_a_study_writes_its_table_figure_and_text(tmp_path):
    text = run_study(toy(), tmp_path / "out", quick=False)
    rows = read_rows(tmp_path / "out" / "toy.csv")
    assert [row.value for row in rows] == [4.0, 8.0, 16.0, 32.0]
    # the midpoint rule integrates x^2 with error -1/(12 n^2)
    assert [row.error for row in rows] == pytest.approx([-1 / (4 * n**2) for n in (4, 8, 16, 32)])
    assert order(levels(rows, "midpoint", "integral")) == pytest.approx(2.0)
    assert "error falls as cost^-2" in " ".join(text.split())
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
    assert status == {
        4.0: DONE,
        8.0: "refused: no path at 8",
        16.0: "over time",
        32.0: "over memory",
    }
    assert "seed 0: over time" in text


def test_errors_against_a_reference_are_taken_seed_by_seed():
    # the seed adds 10 or 20, the setting 1: the scatter of seeds cancels
    runs = [measured("good", 1, q=10.0), measured("good", 2, q=20.0)]
    runs += [measured("poor", 1, q=11.0), measured("poor", 2, q=21.2), measured("poor", 3, q=16.0)]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    assert [row.error for row in rows] == pytest.approx(
        [-5 / 15, 5 / 15, 1 / 15, 1.2 / 15, 1 / 15]
    )
    assert rows[2].error_uncertainty == pytest.approx(0.1155 / 15, rel=1e-3)


def test_rounding_of_a_sum_is_no_error():
    runs = [
        measured("good", 0, q=0.3),
        measured("same", 0, q=0.1 + 0.2),
        measured("near", 0, q=0.3 * (1 + 1e-9)),
    ]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    assert rows[1].error == 0.0 != 0.1 + 0.2 - 0.3
    assert rows[2].error == pytest.approx(1e-9, rel=1e-6)


def test_a_level_has_the_confidence_band_of_its_seeds():
    runs = [
        measured("good", 0, q=1.0),
        *(measured("poor", seed, q=q) for seed, q in enumerate((1.1, 1.2, 1.3))),
    ]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    (band,) = [found for found in levels(rows, "s", "q") if found.value == "poor"]
    # mean 0.2, s = 0.1, t(0.975, 2) = 4.3027
    assert band.error == pytest.approx(0.2)
    assert band.half_width == pytest.approx(4.302653 * 0.1 / math.sqrt(3), rel=1e-6)


def test_the_knee_is_the_cheapest_within_twice_the_best_bound():
    noisy = [
        level(1, 1.0, 0.5, 0.1),
        level(2, 2.0, 0.028, 0.02),
        level(3, 4.0, 0.01, 0.02),
        level(4, 8.0, 0.012, 0.02),
    ]
    found = knee(noisy)
    assert found is not None
    assert found.value == 2
    assert knee([]) is None


def test_errors_that_go_on_falling_have_no_knee():
    exact = [level(1, 1.0, 0.5), level(2, 2.0, 0.25), level(3, 4.0, 0.125)]
    assert knee(exact) is None
    said = knee_sentence(exact, default=2)
    assert said.startswith("no knee: the costliest is the best, 3: +12.5 %")
    assert "cost^-1" in said


def test_neither_the_reference_nor_a_lucky_pair_of_seeds_is_a_knee():
    """Two seeds can cancel to an error of 0; the reference has none by construction."""
    found = [
        Level(value="lucky", runs=2, cost=1.0, error=0.0, half_width=0.5),
        Level(value="single", runs=1, cost=1.5, error=0.0, half_width=0.0),
        Level(value="fair", runs=5, cost=2.0, error=0.02, half_width=0.02),
        Level(value="good", runs=5, cost=4.0, error=0.01, half_width=0.02),
        Level(value="truth", runs=5, cost=9.0, error=0.0, half_width=0.01, reference=True),
    ]
    at = knee(found)
    assert at is not None
    assert at.value == "fair"
    assert "errors from truth, which costs 9 s" in knee_sentence(found, default="good")
    assert knee_sentence(found[:1], default=None) == "error lucky: +0 ± 50 % for 1 s"


def test_no_knee_is_told_from_levels_without_bands():
    pairs = [
        Level(value=n, runs=2, cost=float(n), error=1.0 / n, half_width=0.1) for n in (1, 2, 4)
    ]
    assert knee(pairs) is None
    assert knee_sentence(pairs, default=None).startswith(
        "too few seeds for a knee; the costliest 4: +25 ± 10 %"
    )
    mixed = [
        *pairs,
        level(8, 8.0, 0.0),
        Level(value=3, runs=5, cost=3.0, error=0.3, half_width=0.1),
    ]
    assert "only the costliest will do, 3:" in knee_sentence(mixed, default=None)


def test_unpaired_levels_carry_the_band_of_their_reference():
    """Both means of the same distribution: the band of their difference holds 0 in some 95 of 100 trials."""
    rng = np.random.default_rng(5)
    outside = 0
    for _ in range(200):
        runs = [measured("poor", seed, q=q) for seed, q in enumerate(rng.normal(1.0, 0.1, 10))]
        runs += [
            measured("good", 100 + seed, q=q) for seed, q in enumerate(rng.normal(1.0, 0.1, 5))
        ]
        rows = against_reference(runs, "q", lambda run: run.point.value == "good", paired=False)
        poor = next(found for found in levels(rows, "s", "q") if found.value == "poor")
        outside += poor.size > poor.half_width
    assert outside < 0.08 * 200


def test_a_setting_equal_to_the_reference_has_the_references_own_distance():
    rng = np.random.default_rng(3)
    profiles = rng.integers(1, 50, (4, 6)).astype(float)
    names = [f"bin_{n}" for n in range(6)]
    runs = [
        measured(value, seed, **dict(zip(names, profile, strict=True)))
        for value in ("same", "reference")
        for seed, profile in enumerate(profiles)
    ]
    rows = profile_distance(runs, names, lambda run: run.point.value == "reference")
    same, reference = levels(rows, "s", "profile")
    assert same.error == pytest.approx(reference.error)


def test_without_a_reference_the_refusal_says_why():
    lost = replace(measured("good", 1, q=1.0), status="failed: LIGGGHTS not found", observed={})
    with pytest.raises(
        CaseError, match=r"no reference run was done \(failed: LIGGGHTS not found\)"
    ):
        against_reference(
            [lost, measured("poor", 1, q=2.0)], "q", lambda run: run.point.value == "good"
        )


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
    found = run_points(toy(), out, quick=True)
    assert [run.status for run in found] == [DONE, "refused: no", DONE]
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
    from fdnet.studies.engine.table import write_rows

    row = Row(
        series="a, b", knob="k", value="held", seed=3, quantity="q", observed=1.5, error=NAN, error_uncertainty=NAN,
        reference_band=0.0, wall_s=1.0, core_s=2.0, steps=NAN, peak_memory_mb=3.0, status="over time", role="", run="x",
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


def test_costs_within_a_factor_of_two_have_no_order():
    near, far = (
        [level(n, cost, 0.1**n) for n, cost in enumerate(costs)]
        for costs in ((1, 1.3, 1.9), (1, 2, 4))
    )
    assert math.isnan(order(near))
    assert order(far) == pytest.approx(math.log(10) / math.log(2))
