"""Streamlines of velocities whose lines are known, and of the flow in a pack."""

import numpy as np
import pytest

import fdnet
from fdnet.errors import CaseError
from fdnet.network.field.field import streamlines


class Velocity:
    """Stands for a field: the velocity of a formula of x, y, z."""

    def __init__(self, formula):
        self.formula = formula

    def at(self, points):
        return np.column_stack([np.broadcast_to(v, len(points)) for v in self.formula(*points.T)])


def test_the_line_of_a_wave_is_the_integral_of_its_slope():
    """dy/dx = cos x, so y = sin x; the midpoint rule errs like the square of the step."""
    wave = Velocity(lambda x, y, z: (1.0, np.cos(x), 0.0))
    off = []
    for step in (0.1, 0.05):
        (line,) = streamlines(wave, np.zeros((1, 3)), step=step, until=6.0)
        assert line[-1, 0] >= 6.0
        assert np.linalg.norm(np.diff(line, axis=0), axis=1) == pytest.approx(step, rel=1e-9)
        off.append(np.abs(line[:, 1] - np.sin(line[:, 0])).max())
    assert off[1] < 0.3 * off[0] < 1e-3


def test_a_line_ends_where_the_fluid_stands_still_and_where_it_goes_in_circles():
    wall = Velocity(lambda x, y, z: (np.where(x < 1.0, 1.0, 0.0), 0.0, 0.0))
    stopped, beyond = streamlines(
        wall, np.array([[0.0] * 3, [1.5, 0.0, 0.0]]), step=0.3, until=2.0
    )
    assert 1.0 - 0.3 / 16 < stopped[-1, 0] < 1.0
    assert beyond == pytest.approx(np.array([[1.5, 0.0, 0.0]]))
    circle = Velocity(lambda x, y, z: (-y, x, 0.0))
    (round_and_round,) = streamlines(
        circle, np.array([[1.0, 0.0, 0.0]]), step=0.01, until=2.0, longest=7.0
    )
    assert np.linalg.norm(round_and_round, axis=1) == pytest.approx(1.0, abs=1e-3)
    assert len(round_and_round) == 701


def test_most_lines_find_their_way_through_a_lattice():
    """Simple cubic: the straight channel of the middle is a streamline by symmetry."""
    lattice = 1e-3 * (np.indices((2, 2, 2)).reshape(3, -1).T + 0.5)
    field = fdnet.velocity_field(
        fdnet.Snapshot.from_arrays(lattice, 0.5e-3), periodic="yz", cells=8
    )
    places = np.array([[-0.3e-3, 1e-3, 1e-3], [-0.3e-3, 0.85e-3, 1.1e-3]])
    middle, beside = streamlines(field, places, step=2e-5, until=2e-3)
    assert middle[:, 1:] == pytest.approx(1e-3, abs=2e-5)
    assert beside[-1, 0] >= 2e-3


@pytest.mark.parametrize(("step", "until"), [(0.0, 1.0), (0.1, -1.0)])
def test_no_step_and_no_way_are_refused(step, until):
    wave = Velocity(lambda x, y, z: (1.0, 0.0, 0.0))
    with pytest.raises(CaseError, match="expected both to be positive"):
        streamlines(wave, np.zeros((1, 3)), step=step, until=until)
