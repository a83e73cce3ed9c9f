"""Drag, pressure gradient and Reynolds number of one fine, in closed form."""

import math
from dataclasses import replace

import pytest
from builders import tiny

from fdnet.case.file import read_case
from fdnet.errors import CaseError
from fdnet.scales.drag import (
    MOST_REYNOLDS,
    arrival_velocity,
    balanced_slip,
    drag_factor,
    pore_width,
    push_of,
    slope_factor,
)
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

ON = "drag.pressure_gradient=true"
NAUMANN = "drag.inertia=schiller-naumann"


@pytest.mark.parametrize(
    ("specimen", "ratio"), [(1, 5.6), (2, 2.2), (3, 0.54), (4, 2.3), (5, 0.90), (6, 0.225)]
)
def test_the_gradient_over_the_drag_of_the_thesis_specimens(root, specimen, ratio):
    """(2/9) r^2 phi / k, worked out in the review of the invasion half."""
    case = read_case(root / f"cases/specimen{specimen}.toml")
    scales = scales_of(case)
    assert scales.gradient_over_drag == pytest.approx(ratio, rel=0.02)
    assert scales.drift_velocity == scales.interstitial_velocity, "it does not act in the thesis"
    rows = {row.name: row.value for row in scale_rows(case, scales)}
    assert rows["pressure gradient over drag"] == scales.gradient_over_drag
    assert rows["pressure gradient in the pack"] == pytest.approx(3.5e6 / 8e-3)


def test_the_gradient_is_the_overbalance_over_its_length_or_follows_from_the_velocity():
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


def test_a_fine_gains_speed_across_a_pore_and_never_more_than_its_drift():
    scales = scales_of(tiny(ON))
    case = tiny(ON)
    push = push_of(case, scales.interstitial_velocity, scales.pressure_gradient)
    width = pore_width(scales.porosity, case.grains.sauter_diameter_m)
    gained = math.sqrt(push.velocity**2 + 2 * push.gradient / 2146 * width)
    assert arrival_velocity(push, 0.05e-3, 2146, width) == pytest.approx(gained)
    assert arrival_velocity(push, 0.05e-3, 2146, 1.0) == pytest.approx(scales.drift_velocity)
    still = replace(push, gradient=0.0)
    assert arrival_velocity(still, 0.05e-3, 2146, width) == push.velocity
    rest = scales_of(tiny()).impact_overlap
    assert scales.impact_overlap / rest == pytest.approx(gained / push.velocity)


def test_pore_width_of_a_cubic_packing():
    """One sphere of diameter d a cube d: 4 (d^3 - V) / (pi d^2)."""
    porosity = 1 - math.pi / 6
    assert pore_width(porosity, 2.0) == pytest.approx(4 * porosity * 8 / (math.pi * 4))


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


@pytest.mark.parametrize("reynolds", [0.0, 0.1, 10.0, 1000.0])
def test_the_slip_that_balances_a_stokes_drag(reynolds):
    slip = balanced_slip(3.0, reynolds)
    assert slip * drag_factor(min(reynolds * slip / 3.0, 800.0)) == pytest.approx(3.0)
    assert slip <= 3.0


def test_inertia_is_in_push_drift_and_steps():
    """Explicit drag is bounded by the relaxation time at the largest slip."""
    plain, fast = scales_of(tiny()), scales_of(tiny(NAUMANN))
    factor = 1 + 0.15 * plain.reynolds**0.687
    assert fast.drag_overlap == pytest.approx(factor * plain.drag_overlap)
    slope = 1 + 0.15 * 1.687 * plain.reynolds**0.687
    assert fast.hold_steps == pytest.approx(plain.hold_steps / slope, abs=1)
    drifting = scales_of(tiny(ON, NAUMANN))
    slip = drifting.drift_velocity - drifting.interstitial_velocity
    stokes = scales_of(tiny(ON)).drift_velocity - plain.interstitial_velocity
    reynolds = plain.reynolds * slip / plain.interstitial_velocity
    assert slip * (1 + 0.15 * reynolds**0.687) == pytest.approx(stokes)


def warned(*assignments: str) -> list[str]:
    return [one for one in scales_of(tiny(*assignments)).warnings if "Reynolds" in one]


def test_the_reynolds_warning_says_by_how_much_and_what_to_set():
    (text,) = warned("fluid.velocity_m_s=2.0")
    reynolds = 1095 * 2.0 * 1e-4 / 0.05
    assert f"is {1 + 0.15 * reynolds**0.687:.3g} times as large" in text
    assert text.endswith('set drag.inertia = "schiller-naumann"')
    (text,) = warned("fluid.velocity_m_s=2.0", "drag.scheme=viscous")
    assert text.endswith('set drag.inertia = "schiller-naumann" with drag.scheme = "held"')
    assert not warned("fluid.velocity_m_s=0.4")
    assert not warned("fluid.velocity_m_s=2.0", NAUMANN)


def test_beyond_schiller_and_naumann_a_fine_at_rest_is_refused_and_a_free_one_warned_of():
    thin = "fluid={velocity_m_s=2.0, viscosity_cP=0.2}"
    (text,) = warned(thin)
    assert text.endswith(
        "is outside the range of Stokes drag (below 1) and of Schiller and Naumann's (below 800)"
    )
    with pytest.raises(CaseError, match="particle Reynolds number 1095: the drag of Schiller"):
        scales_of(tiny(thin, NAUMANN))
    dense = ("grains.count=80", "fines.radius_mm=0.2", "fines.count=20")
    (text,) = warned("fluid={velocity_m_s=3.6, viscosity_cP=2.0}", ON, NAUMANN, *dense)
    assert "of a fine that drifts freely is outside" in text


def test_a_driven_fluid_has_the_same_ratios_of_forces_and_its_own_reynolds_number():
    """Twice as fast as the fluid: every force is twice as large, and so is the drift."""
    slow = ("fluid.velocity_m_s=0.05", ON, NAUMANN)
    own, driven = scales_of(tiny(*slow)), scales_of(tiny(*slow, "drag.drive_velocity_m_s=0.1"))
    assert driven.force_factor == pytest.approx(2.0)
    assert driven.push.force(5e-5) == pytest.approx(2 * own.push.force(5e-5))
    assert driven.drift_velocity == pytest.approx(2 * own.drift_velocity)
    assert driven.push.relaxation_share(5e-5) == pytest.approx(own.push.relaxation_share(5e-5))
    assert driven.gradient_over_drag == pytest.approx(own.gradient_over_drag)
