"""The study of run-time settings in its quick form, on the real binary: only the time differs."""

import re

import pytest

from fdnet.studies.command import run_study
from fdnet.studies.dem.speed import (
    BIN,
    FEW,
    FIXED,
    MANY,
    MOBILE,
    MOTION,
    ONE_RANK,
    OWN_BIN,
    OWN_SKIN,
    RANKS,
    SKIN,
    STILL,
    STUDY,
    measure,
    window_of,
)
from fdnet.studies.engine.levels import levels
from fdnet.studies.engine.study import Point
from fdnet.studies.engine.table import read_rows

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("speed")
    run_study(STUDY, out, quick=True)
    return read_rows(out / "speed.csv")


@pytest.mark.parametrize(
    ("setting", "values"),
    [(SKIN, [0.25, OWN_SKIN, 4.0]), (BIN, [OWN_BIN, 4.0]), (RANKS, [ONE_RANK, "1 x 2 x 1"])],
)
def test_run_time_settings_change_the_answer_by_rounding_alone(rows, setting, values):
    series = window_of(setting, 200)
    result = levels(rows, series, "mean_depth")
    assert [level.value for level in result] == values
    assert all(level.size < 1e-6 for level in result)
    assert all(
        row.error == 0.0 for row in rows if row.series == series and row.quantity == "invaded"
    )
    assert len({row.steps for row in rows if row.series == series}) == 1


def test_a_pack_at_rest_stays_where_it_is_and_fines_move_it(rows):
    shift = {
        series: [
            row.observed for row in rows if row.series == series and row.quantity == "grain_shift"
        ]
        for series in (STILL, MOTION)
    }
    assert all(0 < way < 1e-3 for way in shift[STILL])
    assert all(1e-3 < way < 0.2 for way in shift[MOTION])


def test_mobile_grains_are_held_against_fixed_ones(rows):
    for quantity in ("invaded", "mean_depth", "porosity_loss", "k_ratio_first"):
        result = {level.value: level for level in levels(rows, MOTION, quantity)}
        assert set(result) == {FIXED, MOBILE}
        assert abs(result[FIXED].error) < 1e-12
        assert result[MOBILE].size < 0.3
    steps = {(row.seed, row.value): row.steps for row in rows if row.series == MOTION}
    assert len(set(steps.values())) == 1


def test_skin_bin_and_grid_reach_the_deck(tmp_path):
    wanted = {
        (SKIN, 0.25): "neighbor 1.25e-05 bin",
        (BIN, 4.0): "neigh_modify binsize 0.001",
        (RANKS, "2 x 1 x 1"): "processors 2 1 1",
    }
    for (knob, value), line in wanted.items():
        point = Point(series=knob, knob=knob, value=value, seed=1, settings={"fines": 200.0})
        result = measure(point, tmp_path)
        deck = (tmp_path / point.slug / "in.invade").read_text()
        assert re.findall(rf"(?m)^{re.escape(line)}$", deck) == [line], knob
        assert result["core_s"] > 0


def test_the_full_form_compares_fdnets_own_value_in_every_series():
    series = {point.series for point in STUDY.points(False)}
    values = {(point.series, point.value) for point in STUDY.points(False)}
    own = {(name, STUDY.defaults[name]) for name in series if name in STUDY.defaults}
    assert own <= values
    assert series - set(STUDY.defaults) == {STILL}
    assert {window_of(SKIN, FEW), window_of(BIN, MANY), window_of(RANKS, MANY)} <= series
