"""The study of drag in its quick form, on the real binary: orders, bounds, equal physics."""

import math

import numpy as np
import pytest

from validation.command import run_study
from validation.dem.drag import EVERY, HELD, HOLDING, IMPLICIT, OTHER, STUDY, VISCOUS
from validation.engine.levels import levels
from validation.engine.table import read_rows

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("drag")
    run_study(STUDY, out, quick=True)
    return read_rows(out / "drag.csv")


def errors(rows, scheme) -> dict[float, float]:
    return {
        level.value: level.error
        for level in levels(rows, scheme, "relaxation_error", cost="steps")
    }


def order_in_interval(rows, scheme) -> float:
    result = {value: error for value, error in errors(rows, scheme).items() if value <= 0.2}
    assert list(result) == [0.2, 0.1, 0.05]
    return float(np.polyfit(np.log(list(result)), np.log(list(result.values())), 1)[0])


def test_explicit_schemes_converge_in_first_order_and_implicit_in_second(rows):
    for scheme, expected in ((EVERY, 1.0), (VISCOUS, 1.0), (HELD, 1.0), (IMPLICIT, 2.0)):
        assert order_in_interval(rows, scheme) == pytest.approx(expected, abs=0.1), scheme


def test_errors_at_one_tau_are_those_of_the_schemes_closed_forms(rows):
    """After n = tau/h intervals h: ((2-h)/(2+h))^n implicit, (1-h)^n else, against exp(-1)."""
    for interval in (0.2, 0.1, 0.05):
        n = round(1 / interval)
        implicit, explicit = ((2 - interval) / (2 + interval)) ** n, (1 - interval) ** n
        assert errors(rows, IMPLICIT)[interval] == pytest.approx(math.exp(-1) - implicit, rel=0.05)
        for scheme in (EVERY, HELD, VISCOUS):
            assert errors(rows, scheme)[interval] == pytest.approx(
                math.exp(-1) - explicit, rel=0.12
            ), scheme


def test_viscous_is_drag_at_every_step_to_rounding(rows):
    assert errors(rows, VISCOUS) == pytest.approx(errors(rows, EVERY), rel=1e-3)
    for quantity in ("invaded", "mean_depth", "porosity_loss", "k_ratio_first"):
        (result,) = [row.error for row in levels(rows, OTHER, quantity) if row.value == VISCOUS]
        assert abs(result) < 1e-6, quantity


def test_implicit_drag_stays_bounded_at_ten_tau_where_explicit_is_refused(rows):
    assert errors(rows, IMPLICIT)[10.0] == pytest.approx(8 / 12, rel=0.01)
    (refused,) = [row for row in rows if row.series == EVERY and row.value == 2.0]
    assert refused.status.startswith("refused: run.time_step_s")
    assert math.isnan(refused.error)


def test_invasions_are_held_against_drag_at_every_step(rows):
    result = {level.value: level.error for level in levels(rows, HOLDING, "invaded")}
    assert result[EVERY] == 0.0
    assert abs(result[0.05]) < 0.1
    assert {row.quantity for row in rows if row.series == OTHER} == {
        "invaded", "mean_depth", "porosity_loss", "k_ratio_first", "profile",
    }  # fmt: skip
