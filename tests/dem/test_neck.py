"""Fines in the groove of two grains: LAMMPS's three spheres, on the real binary."""

import math

import pytest

from fdnet.case.spheres import SHEAR_RATIO
from fdnet.scales import contacts
from fdnet.scales.contacts import MOST_FALSE_FORCE
from validation.outside import leaving_time

pytestmark = pytest.mark.liggghts
MASS = contacts.sphere_mass(2.5e-4, 2500.0)


def false_force(stiffness: float, shear: float, step: float) -> float:
    """Force that the integrator adds in a quarter turn, over the pull."""
    distance = contacts.groove_slope(0.05) * 5e-3
    rolling = contacts.fall_velocity(MASS * 9.81, MASS, distance)
    return contacts.false_force(shear * stiffness, rolling, step) / (MASS * 9.81)


def test_fdnets_contacts_let_the_fine_leave_the_neck_in_time(tmp_path):
    """The default shear ratio, on a spring so soft that the false force is in its bound."""
    stiffness = 12.5
    for factor in (0.1, 0.05):
        step = factor * math.sqrt(MASS / stiffness)
        assert false_force(stiffness, SHEAR_RATIO, step) <= MOST_FALSE_FORCE
        time = leaving_time(stiffness, SHEAR_RATIO, step, tmp_path / f"{factor}")
        assert time == pytest.approx(0.145, rel=0.2)


def test_lammps_own_contacts_hold_the_fine_for_ever_on_this_binary(tmp_path):
    """What the warning is for: 1e4 N/m, 8235 N/m, a step of 1e-6 s, a false force of 700."""
    assert false_force(1e4, 0.8235, 1e-6) > 100 * MOST_FALSE_FORCE
    assert leaving_time(1e4, 0.8235, 1e-6, tmp_path) == math.inf
