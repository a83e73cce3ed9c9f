"""One bond under tension, shear, bending and torsion, by the theory of beams."""

import numpy as np
import pytest

from fdnet.mechanics.springs import (
    Cement,
    PackMaterial,
    bond_springs,
    bond_stress,
    direct_solver,
    disc_radius,
    find_joints,
    kinematics,
    stiffness_matrix,
)
from fdnet.spheres.snapshot import resting

R1, R2 = 0.3e-3, 0.2e-3
CEMENT = Cement(radius_ratio=0.5, normal=9e13, shear=4e13)
MATERIAL = PackMaterial(normal=1.0, shear=1.0, cement=CEMENT)
RADIUS = 0.5 * R2
AREA, BENDING, TWIST = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4, np.pi * RADIUS**4 / 2
FORCE, MOMENT = 0.7, 2e-5


def bonded(axis):
    """Two bonded grains along a unit vector; the first is held, loads act on the second."""
    place = 1e-3 + np.array([np.zeros(3), (R1 + R2) * np.asarray(axis)])
    pair = resting(place, np.array([R1, R2]), np.array([[0, 2e-3]] * 3))
    joints = find_joints(pair, (True,) * 3, gap=0.01)
    return joints, kinematics(joints, 2, length=R1)


def loaded(axis, force, moment):
    """Displacement and rotation of the second grain, and the stresses in the bond."""
    joints, maps = bonded(axis)
    springs = bond_springs(joints, MATERIAL)
    free = maps.of_grains[:, 6:]
    motion = direct_solver(stiffness_matrix(free, springs))(
        np.concatenate([force, np.array(moment) / R1])
    )
    inner = (springs.ravel() * (free @ motion)).reshape(-1, 6)
    tension, shear = bond_stress(inner, disc_radius(joints, MATERIAL))
    return motion[:3], motion[3:] / R1, float(tension[0]), float(shear[0])


X, Y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
SKEW = np.array([2.0, 3.0, 6.0]) / 7


def test_tension():
    moved, turned, tension, shear = loaded(SKEW, FORCE * SKEW, np.zeros(3))
    assert moved == pytest.approx(FORCE / (CEMENT.normal * AREA) * SKEW, rel=1e-7)
    assert np.abs(turned).max() < 1e-9
    assert tension == pytest.approx(FORCE / AREA, rel=1e-7)
    assert shear == pytest.approx(0.0, abs=1e-6 * tension)


def test_shear_bends_the_bond_as_well():
    """A force at the centre of the grain has the lever R2 about the bond."""
    moved, turned, tension, shear = loaded(X, FORCE * Y, np.zeros(3))
    angle = FORCE * R2 / (CEMENT.normal * BENDING)
    assert moved[1] == pytest.approx(FORCE / (CEMENT.shear * AREA) + angle * R2, rel=1e-7)
    assert turned[2] == pytest.approx(angle, rel=1e-7)
    assert tension == pytest.approx(FORCE * R2 * RADIUS / BENDING, rel=1e-7)
    assert shear == pytest.approx(FORCE / AREA, rel=1e-7)


def test_bending():
    moved, turned, tension, shear = loaded(X, np.zeros(3), MOMENT * Y)
    assert turned[1] == pytest.approx(MOMENT / (CEMENT.normal * BENDING), rel=1e-7)
    assert moved[2] == pytest.approx(-turned[1] * R2, rel=1e-7)
    assert tension == pytest.approx(MOMENT * RADIUS / BENDING, rel=1e-7)
    assert shear == pytest.approx(0.0, abs=1e-6 * tension)


def test_torsion():
    _, turned, tension, shear = loaded(SKEW, np.zeros(3), MOMENT * SKEW)
    assert turned == pytest.approx(MOMENT / (CEMENT.shear * TWIST) * SKEW, rel=1e-7)
    assert shear == pytest.approx(MOMENT * RADIUS / TWIST, rel=1e-7)
    assert tension == pytest.approx(0.0, abs=1e-6 * shear)


def test_compression_breaks_no_bond():
    _, _, tension, _ = loaded(X, -FORCE * X, np.zeros(3))
    assert tension == pytest.approx(-FORCE / AREA, rel=1e-7)
