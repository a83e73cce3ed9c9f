"""A sphere on the axis of a tube, against Stokes's equations solved by boundary collocation."""

import numpy as np
import pytest
from builders import tiny
from scipy.special import eval_legendre, ive

from fdnet.errors import CaseError
from fdnet.scales.drag import (
    SOLVED,
    held_factor,
    throat_width,
)
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

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


def solved(ratio: float) -> tuple[float, float]:
    """Force at rest in Poiseuille's flow and of motion in a liquid at rest, over 6 pi mu a V.

    No slip on the sphere, the wall and at the far end; the force is that of the Stokeslet.
    """
    angle, far = np.linspace(1e-9, np.pi / 2, 60), np.linspace(0, END, 260)
    across = np.linspace(1e-6, 1, 40)
    z = np.concatenate([ratio * np.cos(angle), far, np.full(40, END)])
    rho = np.concatenate([ratio * np.sin(angle), np.ones(260), across])
    flows = [*multipoles(z, rho, ratio), *waves(z, rho)]
    matrix = np.array([np.concatenate(flow) for flow in flows]).T
    wanted = np.zeros((2 * len(z), 2))
    wanted[:60] = np.column_stack([1 - rho[:60] ** 2, np.ones(60)])
    strength = np.linalg.lstsq(matrix, wanted, rcond=1e-13)[0]
    assert np.abs(matrix @ strength - wanted).max() < 1e-5
    return tuple(-2 / 3 * strength[1])


@pytest.mark.parametrize("ratio", [0.2, 0.5, 0.55, 0.8])
def test_the_factors_are_those_of_stokes_equations(ratio):
    held, _ = solved(ratio)
    assert held_factor(ratio) == pytest.approx(held, rel=1e-4)


def test_half_a_tube_is_as_haberman_and_sayre_have_it():
    """Force 5.0 times Stokes's."""
    assert held_factor(0.5) == pytest.approx(5.0, rel=2e-3)


def test_the_approximate_formula_where_it_is_good():
    """Haberman and Sayre's polynomials, within 0.3 % up to a ratio of 0.4."""
    for x in np.linspace(0, 0.4, 9):
        below = 1 - 2.105 * x + 2.0865 * x**3 - 1.7068 * x**5 + 0.72603 * x**6
        assert held_factor(x) == pytest.approx(
            (1 - 2 / 3 * x**2 - 0.20217 * x**5) / below, rel=3e-3
        )


def test_the_factor_rises():
    ratio = np.linspace(0, max(SOLVED), 91)
    assert np.all(np.diff([held_factor(x) for x in ratio]) > 0)
    assert held_factor(0.0) == 1.0
    for bad in (-0.1, 0.91, float("nan")):
        with pytest.raises(CaseError, match="a wider one closes the throat"):
            held_factor(bad)


def test_tubes_of_the_packs_permeability():
    """phi D^2 / 32 is the permeability of straight tubes (Poiseuille)."""
    assert 0.4 * throat_width(0.4, 2.5e-10) ** 2 / 32 == pytest.approx(2.5e-10)


def test_the_walls_of_a_throat_are_a_row_and_a_warning():
    case = tiny("fines.radius_mm=0.03", "fines.count=100")
    scales = scales_of(case)
    width = throat_width(scales.porosity, scales.permeability)
    factor = held_factor(0.06e-3 / width)
    rows = {row.name: row.value for row in scale_rows(case, scales)}
    assert rows["largest fine over throat"] == pytest.approx(0.06e-3 / width)
    assert rows["drag in a throat over a lone sphere's"] == pytest.approx(factor)
    (text,) = [one for one in scales.warnings if "throat" in one]
    assert f"feels {factor:.2g} times" in text


def test_a_fine_as_wide_as_the_throats_is_said_to_be():
    case = tiny("fines.radius_mm=0.08", "fines.count=20")
    (text,) = [one for one in scales_of(case).warnings if "throat" in one]
    assert "closes" in text
    assert "drag in a throat over a lone sphere's" not in {
        row.name for row in scale_rows(case, scales_of(case))
    }
    small = scales_of(tiny("fines.radius_mm=0.01"))
    assert not [one for one in small.warnings if "throat" in one]
