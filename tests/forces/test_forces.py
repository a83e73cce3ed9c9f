"""Forces of the fluid on fines: alone, in a crowd, in a throat; closed forms, Stokes flow."""

import math

import numpy as np
import pytest
from builders import tiny
from scipy.special import eval_legendre, ive

from fdnet.case.file import read_case
from fdnet.errors import CaseError
from fdnet.scales.drag import (
    MOST_CROWD_REYNOLDS,
    MOST_REYNOLDS,
    SOLVED,
    balanced_slip,
    bed_factor,
    crowd_drag_factor,
    drag_factor,
    held_factor,
    push_of,
    size_factor,
    slope_factor,
)
from fdnet.scales.flow import Losses, ergun_inertia, straight
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

ON = "drag.pressure_gradient=true"


# ---- One fine: drag, pressure gradient and Reynolds number.
def test_the_gradient_over_the_drag_of_the_thesis_specimens(root):
    """(2/9) r^2 phi / k, worked out in the review of the invasion half."""
    for specimen, ratio in enumerate((5.6, 2.2, 0.54, 2.3, 0.90, 0.225), start=1):
        case = read_case(root / f"cases/specimen{specimen}.toml")
        scales = scales_of(case)
        rows = {row.name: row.value for row in scale_rows(case, scales)}
        assert scales.gradient_over_drag == pytest.approx(ratio, rel=0.02), specimen
        assert scales.drift_velocity == scales.interstitial_velocity, "not in the thesis"
        assert rows["pressure gradient over drag"] == scales.gradient_over_drag
        assert rows["pressure gradient in the pack"] == pytest.approx(3.5e6 / 8e-3)
    lost = scales_of(tiny("fluid.overbalance_MPa=2.0", "fluid.darcy_length_mm=5.0"))
    assert lost.pressure_gradient == pytest.approx(2e6 / 5e-3)
    given = scales_of(tiny("fluid.velocity_m_s=0.5"))
    expected = 0.05 * 0.5 * given.porosity / given.permeability
    assert given.pressure_gradient == pytest.approx(expected)


def test_the_push_is_drag_and_gradient_and_each_estimate_has_it():
    """At rest 6 pi mu M r u + V G; in contact it presses, in a groove it pushes."""
    off, on = scales_of(tiny("drag.multiplier=2")), scales_of(tiny("drag.multiplier=2", ON))
    ratio = on.gradient_over_drag
    assert ratio == pytest.approx(off.gradient_over_drag)
    stokes = 6 * math.pi * 0.05 * 2 * 0.05e-3 * on.interstitial_velocity
    force = 4 / 3 * math.pi * 0.05e-3**3 * on.pressure_gradient
    assert force / stokes == pytest.approx(ratio)
    push = push_of(tiny("drag.multiplier=2", ON), on.interstitial_velocity, on.pressure_gradient)
    assert push.force(0.05e-3) == pytest.approx(stokes + force)
    assert on.drag_overlap == pytest.approx((1 + ratio) * off.drag_overlap)
    assert on.sticking.push == pytest.approx((1 + ratio) * off.sticking.push)
    assert on.drift_velocity == pytest.approx((1 + ratio) * off.drift_velocity)
    assert on.time_step == off.time_step


def test_schiller_and_naumann_by_hand_and_within_their_range():
    """At Re 1 the drag is 15 % above Stokes's; at 800 the coefficient is 0.47 (Newton: 0.44)."""
    assert drag_factor(0.0) == 1.0
    assert drag_factor(1.0) == pytest.approx(1.15)
    assert 24 / 800 * drag_factor(800.0) == pytest.approx(0.474, abs=1e-3)
    for bad in (-1.0, 1.001 * MOST_REYNOLDS, math.nan):
        with pytest.raises(CaseError, match="holds from 0 to 800"):
            drag_factor(bad)
    slope = (drag_factor(10.01) * 10.01 - drag_factor(9.99) * 9.99) / 0.02
    assert slope_factor(10.0) == pytest.approx(slope, rel=1e-6)
    for reynolds in (0.0, 0.1, 10.0, 1000.0):
        slip = balanced_slip(3.0, reynolds)
        assert slip * drag_factor(min(reynolds * slip / 3.0, 800.0)) == pytest.approx(3.0)
        assert slip <= 3.0


# ---- A crowd, and the pressure drop of a bed.
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


def test_the_forces_on_a_bed_are_its_pressure_drop():
    """Per volume the forces are grad p, Carman and Kozeny's within 2.2 %, within 1 % at 0.40."""
    diameter, viscosity, slip = 0.1e-3, 0.05, 0.3
    stokes = 3 * math.pi * viscosity * diameter * slip
    for porosity, most in ((0.35, 0.022), (0.40, 0.01), (0.45, 0.022)):
        solid = 1 - porosity
        number = solid / (math.pi / 6 * diameter**3)
        total = number * stokes * float(crowd_drag_factor(porosity))
        kozeny = 180 * viscosity * solid**2 * porosity * slip / (porosity**3 * diameter**2)
        extra = porosity**4 * (1 + 1.5 * math.sqrt(solid)) / (10 * solid)
        assert total == pytest.approx(kozeny * (1 + extra), rel=1e-12), porosity
        assert extra < most
        assert float(bed_factor(porosity)) / (10 * solid / porosity**2) == pytest.approx(1 + extra)


def test_any_mixture_has_the_pressure_drop_of_its_sauter_diameter():
    """Sum of d_i Y(y_i) over n_i, over that of equal spheres of the Sauter mean: 1."""
    rng = np.random.default_rng(4)
    for porosity in (0.36, 0.6, 0.9):
        diameter = rng.uniform(0.1, 1.0, 500)
        mean = np.sum(diameter**3) / np.sum(diameter**2)
        factor, equal = size_factor(porosity, diameter / mean), np.sum(diameter**3) / mean**3
        assert np.sum(diameter * factor) == pytest.approx(mean * equal)
        published = factor + 0.064 * porosity * (diameter / mean) ** 3
        assert np.sum(diameter * published) > 1.02 * mean * equal
    assert size_factor(0.4, 1.0) == pytest.approx(1.0)


def test_the_law_of_beds_at_numbers_worked_out_by_hand_and_outside_of_its_range():
    """Solid fraction 0.5, Re 100: F0 = 20 + 0.25 (1 + 1.5 / sqrt 2), and the inertial part."""
    still = 20 + 0.25 * (1 + 1.5 * math.sqrt(0.5))
    shape = 2 + 0.75 + 8.4 * 100**-0.343
    moving = 0.413 * 100 / (24 * 0.25) * shape / (1 + 10**1.5 * 100**-1.5)
    assert bed_factor(0.5) == pytest.approx(still)
    both = bed_factor(np.array([0.5, 0.5]), np.array([0.0, 100.0]))
    assert both == pytest.approx([still, still + moving])
    for porosity, reynolds, message in [
        (0.0, 0.0, "porosity 0, expected above 0 and at most 1"),
        (1.5, 0.0, "porosity 1.5"),
        (np.nan, 0.0, "porosity nan"),
        (0.4, -1.0, "Reynolds number -1"),
        (0.4, 2 * MOST_CROWD_REYNOLDS, "Reynolds number 2000, expected 0 to 1000"),
    ]:
        with pytest.raises(CaseError, match=message):
            bed_factor(np.array([0.5, porosity]), np.array([1.0, reynolds]))


# ---- A sphere on the axis of a tube, against Stokes's equations solved by boundary collocation.
END, PERIOD, WAVES, POLES = 5.0, 7.0, 90, 20
"""Half length of the closed tube and half period of its waves, radii of the tube; terms."""


def multipoles(z, rho, a):
    """Axisymmetric Stokes flows of poles at the origin: Gegenbauer's r^(1-n) and r^(3-n)."""
    r = np.hypot(z, rho)
    cosine, sine = z / r, rho / r
    for n in range(2, 2 * POLES + 2, 2):
        bend = (eval_legendre(n - 2, cosine) - eval_legendre(n, cosine)) / (2 * n - 1)
        bend = bend / np.maximum(sine, 1e-12) * (sine > 1e-7)
        for power in (-n - 1, -n + 1):
            out = -((r / a) ** power) * eval_legendre(n - 1, cosine)
            along = (power + 2) * (r / a) ** power * bend
            yield out * cosine - along * sine, out * sine + along * cosine


def waves(z, rho):
    """Flows regular in the tube, by Happel and Brenner: grad P + rho d/drho grad F + F_z e_z."""
    for m in range(WAVES):
        k = (m + 0.5) * np.pi / PERIOD
        scale = np.exp(k * (rho - 1)) / ive(0, k)
        i0, i1 = ive(0, k * rho) * scale, ive(1, k * rho) * scale
        yield i0 * np.cos(k * z), i1 * np.sin(k * z)
        along, across = k * rho * i1 + i0, k * rho * i0 - i1
        yield along * np.cos(k * z) / (1 + k), across * np.sin(k * z) / (1 + k)


def solved(ratio):
    """Force at rest in Poiseuille's flow over 6 pi mu a V.

    No slip on the sphere, the wall and at the far end; the force is that of the Stokeslet.
    """
    angle, far = np.linspace(1e-9, np.pi / 2, 60), np.linspace(0, END, 260)
    z = np.concatenate([ratio * np.cos(angle), far, np.full(40, END)])
    rho = np.concatenate([ratio * np.sin(angle), np.ones(260), np.linspace(1e-6, 1, 40)])
    flows = [*multipoles(z, rho, ratio), *waves(z, rho)]
    matrix, wanted = np.array([np.concatenate(flow) for flow in flows]).T, np.zeros(2 * len(z))
    wanted[:60] = 1 - rho[:60] ** 2
    strength = np.linalg.lstsq(matrix, wanted, rcond=1e-13)[0]
    assert np.abs(matrix @ strength - wanted).max() < 1e-5
    return -2 / 3 * strength[1]


def test_the_drag_in_a_tube_is_that_of_stokes_equations():
    """At half a tube 5.0 times Stokes's (Haberman and Sayre); their polynomials up to 0.4."""
    for ratio in (0.2, 0.5, 0.55, 0.8):
        assert held_factor(ratio) == pytest.approx(solved(ratio), rel=1e-4), ratio
    assert held_factor(0.5) == pytest.approx(5.0, rel=2e-3)
    for x in np.linspace(0, 0.4, 9):
        below = 1 - 2.105 * x + 2.0865 * x**3 - 1.7068 * x**5 + 0.72603 * x**6
        above = 1 - 2 / 3 * x**2 - 0.20217 * x**5
        assert held_factor(x) == pytest.approx(above / below, rel=3e-3)
    assert np.all(np.diff([held_factor(x) for x in np.linspace(0, max(SOLVED), 91)]) > 0)
    assert held_factor(0.0) == 1.0
    for bad in (-0.1, 0.91, float("nan")):
        with pytest.raises(CaseError, match="a wider one closes the throat"):
            held_factor(bad)
