"""The study of economies in its quick form, on the real binary: only the costs differ."""

import math
import re
from dataclasses import replace

import pytest

from fdnet.studies.command import run_study
from fdnet.studies.dem.economies import (
    ALL,
    BATCHES,
    EQUAL,
    HELD,
    IMPLICIT,
    LONG,
    PLAIN,
    SERIES,
    SOFT,
    SOFTER,
    STEP,
    STUDY,
    UNEQUAL,
    VISCOUS,
    case_of,
    judge,
    speed_ups,
    summary,
)
from fdnet.studies.dem.runs import OBSERVED
from fdnet.studies.engine.levels import levels
from fdnet.studies.engine.study import DONE, Measured, Point
from fdnet.studies.engine.table import read_rows


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    out = tmp_path_factory.mktemp("economies")
    text = run_study(STUDY, out, quick=True)
    return read_rows(out / "economies.csv"), text


def observed(rows, quantity, value, series=EQUAL) -> list[float]:
    return [
        row.observed
        for row in rows
        if (row.series, row.value, row.quantity) == (series, value, quantity)
    ]


def measured(value, seed, invaded, core_s) -> Measured:
    point = Point(series=EQUAL, knob="economy", value=value, seed=seed)
    return Measured(
        point=point, status=DONE, observed=dict.fromkeys(OBSERVED, invaded), wall_s=1.0,
        core_s=core_s,
        steps=math.nan, peak_memory_bytes=math.nan,
    )  # fmt: skip


def toy_rows():
    """Two seeds: plain invades 100 and 110 in 40 and 60 s; "all" 105 and 115 in 20 and 15 s."""
    runs = [measured(PLAIN, 1, 100.0, 40.0), measured(PLAIN, 2, 110.0, 60.0)]
    runs += [measured(ALL, 1, 105.0, 20.0), measured(ALL, 2, 115.0, 15.0)]
    return judge(
        [
            replace(run, point=replace(run.point, series=series))
            for series in SERIES
            for run in runs
        ]
    )


def test_errors_are_taken_from_the_plain_mean_and_not_seed_by_seed():
    errors = [
        row.error
        for row in toy_rows()
        if (row.series, row.value, row.quantity) == (EQUAL, ALL, "invaded")
    ]
    assert errors == pytest.approx([0.0, 10 / 105])
    assert all(row.reference_band > 0 for row in toy_rows() if row.value == ALL)
    assert {row.role for row in toy_rows() if row.value == PLAIN} == {"reference"}


def test_a_speed_up_is_the_ratio_of_core_seconds_seed_by_seed():
    assert speed_ups(toy_rows(), EQUAL) == {PLAIN: [1.0, 1.0], ALL: [2.0, 4.0]}
    lines = summary(toy_rows()).splitlines()
    assert len(lines) == 2 + 2 * len(SERIES)
    assert lines[2].startswith("| equal fines, plain | 2 | 50 | 1 | reference ± ")
    assert lines[3].startswith("| equal fines, all | 2 | 17.5 | 3.00 ± 1.41 | +4.76 ± ")


def test_a_seed_whose_plain_run_is_missing_has_no_speed_up():
    rows = [row for row in toy_rows() if not (row.value == PLAIN and row.seed == 2)]
    assert speed_ups(rows, EQUAL) == {PLAIN: [1.0], ALL: [2.0]}


def test_an_economy_changes_its_own_keys_alone():
    plain = {
        series: point
        for point in STUDY.points(False)
        if point.value == PLAIN
        for series in [point.series]
    }
    own = {
        BATCHES: {("fines", "supply", "batches")},
        STEP: {("run", "time_step_factor", 0.2)},
        SOFT: {("run", "stiffness_N_m", 3e3)},
        SOFTER: {("run", "stiffness_N_m", 1e3)},
        HELD: set(),  # held for as long as the time of the drag allows, which the case works out
        **{scheme: {("drag", "scheme", scheme)} for scheme in (VISCOUS, IMPLICIT)},
    }
    together = dict.fromkeys((EQUAL, LONG), own[BATCHES] | own[STEP] | own[VISCOUS])
    together[UNEQUAL] = own[BATCHES] | own[STEP] | own[HELD]
    for point in {(point.series, point.value): point for point in STUDY.points(False)}.values():
        before = case_of(replace(plain[point.series], seed=point.seed)).data()
        result = {
            (part, key, value)
            for part, keys in case_of(point).data().items()
            if isinstance(keys, dict)
            for key, value in keys.items()
            if before[part].get(key) != value
        }
        expected = (
            together[point.series] if point.value == ALL else own.get(str(point.value), set())
        )
        assert result == expected, point.key


def test_the_thesis_cases_use_what_all_stands_for(root):
    from fdnet.case.file import read_case

    for number in range(1, 9):
        case = read_case(root / "cases" / f"specimen{number}.toml")
        series = UNEQUAL if number > 6 else EQUAL
        mine = case_of(
            Point(series=series, knob="economy", value=ALL, seed=1, settings={"size": "whole"})
        )
        own = (case.fines.supply, case.run.time_step_factor, case.drag.scheme)
        assert own == (mine.fines.supply, mine.run.time_step_factor, mine.drag.scheme)


@pytest.mark.liggghts
def test_economies_stay_within_the_bands_of_the_seeds(quick):
    rows, _ = quick
    for series in SERIES:
        for quantity in OBSERVED:
            result = levels(rows, series, quantity)
            assert len(result) > 1
            assert all(level.size <= level.half_width for level in result), (series, quantity)


@pytest.mark.liggghts
def test_batches_hold_what_the_slab_holds_to_a_twentieth(quick):
    """Seeds alone scatter by 1 % of the fines inside, by a tenth of their depth."""
    rows, _ = quick
    for value in (BATCHES, ALL):
        assert sum(observed(rows, "invaded", value)) == pytest.approx(
            sum(observed(rows, "invaded", PLAIN)), rel=0.05
        )
    few, many = (sum(observed(rows, "invaded", value, LONG)) for value in (BATCHES, PLAIN))
    assert few == pytest.approx(many, rel=0.1)


@pytest.mark.liggghts
def test_viscous_drag_is_drag_at_every_step(quick):
    rows, _ = quick
    for quantity in OBSERVED:
        assert observed(rows, quantity, VISCOUS) == pytest.approx(
            observed(rows, quantity, PLAIN), rel=1e-6
        ), quantity
    assert observed(rows, "invaded", PLAIN)[0] > 20


@pytest.mark.liggghts
def test_a_step_twice_as_long_takes_half_the_steps(quick):
    rows, _ = quick
    steps = {(row.series, row.value): row.steps for row in rows}
    assert steps[EQUAL, STEP] == pytest.approx(steps[EQUAL, PLAIN] / 2, rel=0.02)
    assert steps[EQUAL, VISCOUS] == steps[EQUAL, PLAIN]
    assert steps[UNEQUAL, ALL] == pytest.approx(steps[UNEQUAL, PLAIN] / 2, rel=0.02)


@pytest.mark.liggghts
def test_the_text_names_speed_up_and_error_of_every_economy(quick):
    _, text = quick
    assert "knee" not in text
    for point in STUDY.points(True):
        speed = "1" if point.value == PLAIN else r"\d+\.\d\d ± \d+\.\d\d"
        assert re.search(
            rf"(?m)^\| {point.series}, {point.value} \| 2 \| \S+ \| {speed} \| .* %", text
        ), point.key
