"""Fines in the groove of two grains: LAMMPS's three spheres, on the real binary."""

import math

import pytest

from fdnet.case.spheres import SHEAR_RATIO
from fdnet.scales.contacts import MOST_FALSE_FORCE
from validation.dem.neck import LEAVES_AFTER, Neck, factor_step, leaving_time

pytestmark = pytest.mark.liggghts
LAMMPS_SHEAR = 0.8235


def test_fdnets_contacts_let_the_fine_leave_the_neck_in_time(tmp_path):
    """The default shear ratio, on a spring so soft that the false force is in its bound."""
    stiffness = 12.5
    for factor in (0.1, 0.05):
        neck = Neck(
            stiffness=stiffness, shear_ratio=SHEAR_RATIO, step=factor_step(stiffness, factor)
        )
        assert neck.false_force <= MOST_FALSE_FORCE
        time = leaving_time(neck, tmp_path / f"{factor}")
        assert time == pytest.approx(LEAVES_AFTER, rel=0.2)


def test_lammps_own_contacts_hold_the_fine_for_ever_on_this_binary(tmp_path):
    """What the warning is for: 1e4 N/m, 8235 N/m, a step of 1e-6 s, a false force of 700."""
    neck = Neck(stiffness=1e4, shear_ratio=LAMMPS_SHEAR, step=1e-6)
    assert neck.false_force > 100 * MOST_FALSE_FORCE
    assert leaving_time(neck, tmp_path) == math.inf
