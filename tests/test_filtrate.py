"""Filtrate: a growing cake at constant pressure in closed form, and when nothing may be said."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fdnet.run.cake import fit_filtration

PRESSURE, VISCOSITY, PACK = 3.5e6, 0.05, 4e7
"""Pa, Pa s, and the resistance of the pack in 1/m."""


def grown(times):
    """Filtrate per area of a Carman-Kozeny cake that grows on a pack, integrated step by step.

    It holds the solids of a suspension of 5 % at a porosity of 0.4, of spheres of 20 um.
    """
    solids, porosity, diameter = 0.05, 0.4, 20e-6
    k = porosity**3 * diameter**2 / (180 * (1 - porosity) ** 2)
    growth = solids / (1 - porosity - solids)
    result = solve_ivp(
        lambda _, v: PRESSURE / (VISCOSITY * (PACK + growth * v / k)),
        (0.0, times[-1]),
        [0.0],
        t_eval=times,
        rtol=1e-10,
        atol=1e-14,
    )
    return result.y[0], growth / k


def test_a_growing_cake_makes_time_quadratic_in_the_filtrate():
    times = np.linspace(0.0, 20.0, 60)
    volume, alpha = grown(times)
    fit = fit_filtration(times, volume)
    assert fit.unsupported == ""
    assert fit.a == pytest.approx(VISCOSITY * alpha / (2 * PRESSURE), rel=1e-5)
    assert fit.b == pytest.approx(VISCOSITY * PACK / PRESSURE, rel=1e-4)
    late, _ = grown(np.array([0.0, 450.0, 1800.0]))
    assert fit.half_hour == pytest.approx(late[2], rel=1e-4)
    assert fit.intercept == pytest.approx(2 * late[1] - late[2], rel=1e-2)
    assert fit.intercept < 0
    assert fit.spurt == 0.0


def test_a_spurt_is_found_again():
    """V = S + C sqrt(t) after the spurt S."""
    times = np.linspace(1.0, 100.0, 80)
    fit = fit_filtration(times, 2e-3 + 1e-3 * np.sqrt(times))
    assert fit.spurt == pytest.approx(2e-3, rel=1e-6)
    assert fit.half_hour == pytest.approx(2e-3 + 1e-3 * np.sqrt(1800.0), rel=1e-6)


@pytest.mark.parametrize(
    ("volume", "why"),
    [
        (lambda t: 1e-3 * t, "the rate only fell to 1.00"),
        (lambda t: 1e-3 * (1 - np.exp(-3 * t)), "t is not quadratic in V"),
    ],
)
def test_a_history_that_is_no_growing_cake_supports_nothing(volume, why):
    times = np.linspace(0.0, 1.0, 40)
    assert why in fit_filtration(times, volume(times)).unsupported


def test_a_history_that_the_pack_shapes_supports_nothing():
    times = np.linspace(0.0, 20.0, 60)
    fit = fit_filtration(times, grown(times)[0], cake_share=0.28)
    assert "the cake has 28 % of the resistance" in fit.unsupported


def test_few_points_support_nothing():
    times = np.linspace(0.0, 1.0, 6)
    assert "6 points" in fit_filtration(times, np.sqrt(times)).unsupported
    assert fit_filtration(times[:3], times[:3]) is None
