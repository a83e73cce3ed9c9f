"""The study of the time step in its quick form, on the real binary: orders of convergence."""

import numpy as np
import pytest

from validation.command import run_study
from validation.dem.time_step import COLLISION, DRAG, ENERGY, INVASION, STUDY
from validation.engine.levels import levels, order
from validation.engine.table import read_rows

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("time-step")
    run_study(STUDY, out, quick=True)
    return read_rows(out / "time-step.csv")


def test_a_damped_collision_converges_in_first_order(rows):
    result = levels(rows, COLLISION, "restitution_error")
    slope = np.polyfit(
        np.log([level.value for level in result]), np.log([level.size for level in result]), 1
    )[0]
    assert slope == pytest.approx(1.1, abs=0.3)
    assert next(level.size for level in result if level.value == 0.1) < 0.03


def test_energy_of_an_undamped_pack_converges_in_second_order(rows):
    result = levels(rows, ENERGY, "energy_drift", cost="steps")
    assert order(result) == pytest.approx(2.0, abs=0.3)
    assert next(level.size for level in result if level.value == 0.1) < 1e-4


def test_explicit_drag_converges_in_first_order(rows):
    result = levels(rows, DRAG, "relaxation_error", cost="steps")
    assert [level.value for level in result] == [0.2, 0.1, 0.05, 0.025]
    assert result[-1].size < 0.55 * result[-2].size < 0.4 * result[-3].size
    assert result[-1].size < 0.01


def test_the_invasion_is_held_against_its_smallest_step(rows):
    result = levels(rows, INVASION, "invaded")
    assert [level.value for level in result] == [0.2, 0.1, 0.05]
    assert result[-1].error == 0.0
    assert all(level.size < 0.1 for level in result)
