"""Drag in a crowd and the pressure drop of a bed, against closed forms and published numbers."""

import math

import numpy as np
import pytest

from fdnet.errors import CaseError
from fdnet.scales.drag import MOST_CROWD_REYNOLDS as MOST_REYNOLDS
from fdnet.scales.drag import Crowd, bed_factor, size_factor
from fdnet.scales.drag import crowd_drag_factor as drag_factor
from fdnet.scales.flow import Losses, ergun_inertia, straight


def test_the_bed_of_cfdem_by_ergun():
    """CFDEMcoupling's ErgunTestMPI, as its totalPressureDrop.m has it."""
    diameter, porosity, density = 1e-3, 0.451335, 10.0
    permeability = diameter**2 * porosity**3 / (150 * (1 - porosity) ** 2)
    inertial = ergun_inertia(permeability, porosity, diameter, density)
    bed = Losses(viscous=1.5e-3 / permeability, inertial=inertial)
    assert bed.gradient(0.02) * 0.0156 == pytest.approx(230.5, abs=0.05)
    assert bed.velocity(bed.gradient(0.02), straight(1.0)) == pytest.approx(0.02)
    weight = (1 - porosity) * (2000 - density) * 9.81
    lifted = bed.velocity(weight, straight(1.0))
    assert lifted == pytest.approx(0.01454, rel=3e-3), "the tutorial leaves the inertial term out"
    slow = Losses(viscous=1.5e3 / permeability, inertial=inertial)
    assert slow.velocity(weight, straight(1.0)) * 1e6 == pytest.approx(0.01454, abs=5e-6)


def test_a_lone_sphere_that_creeps_feels_stokes():
    assert drag_factor(Crowd(porosity=1.0)) == pytest.approx(1.0)
    crowd = Crowd(porosity=1 - 1e-10, size_ratio=np.ones(2))
    assert drag_factor(crowd) == pytest.approx(1.0, abs=1e-4)


def test_a_lone_sphere_that_moves_fast_feels_schiller_and_naumann():
    """The law's Reynolds part was fitted to beds; at one sphere it is within 16 % up to 100."""
    for reynolds in (1.0, 10.0, 100.0):
        assert bed_factor(1.0, reynolds) == pytest.approx(1 + 0.15 * reynolds**0.687, rel=0.16)


@pytest.mark.parametrize("porosity", [0.35, 0.40, 0.45])
def test_the_forces_on_a_bed_are_its_pressure_drop(porosity):
    """Per volume the forces are grad p, Carman and Kozeny's within 1.2 %."""
    diameter, viscosity, slip = 0.1e-3, 0.05, 0.3
    stokes = 3 * math.pi * viscosity * diameter * slip
    number = (1 - porosity) / (math.pi / 6 * diameter**3)
    crowd = Crowd(porosity=porosity)
    total = number * stokes * float(drag_factor(crowd))
    solid, speed = 1 - porosity, porosity * slip
    kozeny = 180 * viscosity * solid**2 * speed / (porosity**3 * diameter**2)
    extra = porosity**4 * (1 + 1.5 * math.sqrt(1 - porosity)) / (10 * (1 - porosity))
    assert total == pytest.approx(kozeny * (1 + extra), rel=1e-12)
    assert extra < 0.022


def test_a_bed_of_0_40_is_within_1_percent_of_carman_and_kozeny():
    extra = float(bed_factor(0.40)) / (10 * 0.6 / 0.4**2) - 1
    assert extra == pytest.approx(0.4**4 * (1 + 1.5 * math.sqrt(0.6)) / 6)
    assert extra < 0.01


def test_any_mixture_has_the_pressure_drop_of_its_sauter_diameter():
    """Sum of d_i Y(y_i) over n_i, over that of equal spheres of the Sauter mean: 1."""
    rng = np.random.default_rng(4)
    for porosity in (0.36, 0.6, 0.9):
        diameter = rng.uniform(0.1, 1.0, 500)
        mean = np.sum(diameter**3) / np.sum(diameter**2)
        factor = size_factor(porosity, diameter / mean)
        equal = np.sum(diameter**3) / mean**3
        assert np.sum(diameter * factor) == pytest.approx(mean * equal)
        published = factor + 0.064 * porosity * (diameter / mean) ** 3
        assert np.sum(diameter * published) > 1.02 * mean * equal
    assert size_factor(0.4, 1.0) == pytest.approx(1.0)


def test_the_law_at_numbers_worked_out_by_hand():
    """Solid fraction 0.5, Re 100: F0 = 20 + 0.25 (1 + 1.5 / sqrt 2), and the inertial part."""
    still = 20 + 0.25 * (1 + 1.5 * math.sqrt(0.5))
    assert bed_factor(0.5) == pytest.approx(still)
    shape = 2 + 0.75 + 8.4 * 100**-0.343
    moving = 0.413 * 100 / (24 * 0.25) * shape / (1 + 10**1.5 * 100**-1.5)
    assert bed_factor(0.5, 100.0) == pytest.approx(still + moving)
    assert bed_factor(np.array([0.5, 0.5]), np.array([0.0, 100.0])) == pytest.approx(
        [still, still + moving]
    )


@pytest.mark.parametrize(
    ("porosity", "reynolds", "message"),
    [
        (0.0, 0.0, "porosity 0, expected above 0 and at most 1"),
        (1.5, 0.0, "porosity 1.5"),
        (np.nan, 0.0, "porosity nan"),
        (0.4, -1.0, "Reynolds number -1"),
        (0.4, 2 * MOST_REYNOLDS, "Reynolds number 2000, expected 0 to 1000"),
    ],
)
def test_values_outside_of_the_law_are_refused(porosity, reynolds, message):
    with pytest.raises(CaseError, match=message):
        bed_factor(np.array([0.5, porosity]), np.array([1.0, reynolds]))
