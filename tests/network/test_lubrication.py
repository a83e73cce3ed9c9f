"""Resistance by lubrication theory: exact hyperboloids, symmetry, lattices and packs."""

import numpy as np
import pytest

from fdnet.network.laws import wedges as tube
from fdnet.network.laws.wedges import ratio_table
from tests.network.one_section import even_flux, touching_flux, uneven_flux
from tests.network.wedge_table import exact_flux


@pytest.mark.parametrize(
    ("opening", "bound"), [(0.99, 1e-3), (0.9, 2e-3), (0.7, 0.015), (0.3, 0.05), (0.03, 0.08)]
)
def test_tube_rule_against_the_exact_hyperboloid(opening: float, bound: float) -> None:
    """Exact: 3 / (c^3 (1 - q)^2 (1 + 2 q)) with the focal distance c = 1.

    q is the cosine of the angle between the asymptote and the plane.
    """
    neck = np.sqrt(1.0 - opening**2)
    z = np.sinh(np.linspace(0.0, 12.0, 6001)) * opening
    narrow = 1.0 / (neck * np.sqrt(1.0 + (z / opening) ** 2))
    total = 0.0
    for a, b, step in zip(narrow, narrow[1:], np.diff(z), strict=False):
        total += tube.summed(np.array([a, b]), step, 1, tube.WIDENING)
    exact = 3.0 / ((1.0 - opening) ** 2 * (1.0 + 2.0 * opening))
    assert 2.0 * total == pytest.approx(exact, rel=bound)


def triangle(*side: float) -> np.ndarray:
    a, b, c = side
    x = (a * a + b * b - c * c) / (2.0 * a)
    return np.array([[0.0, 0.0], [a, 0.0], [x, np.sqrt(b * b - x * x)]])


def test_equilateral_section_is_six_exact_wedges() -> None:
    base = triangle(2.0, 2.0, 2.0)
    exact = 6.0 * exact_flux(np.pi / 6.0, 0.9)
    assert even_flux(base, 0.9, ratio_table()) == pytest.approx(exact, rel=1e-4)


def test_half_a_square_is_four_exact_wedges() -> None:
    base = triangle(2.0, 2.0, np.sqrt(8.0))
    exact = 4.0 * exact_flux(np.pi / 4.0, 0.95)
    assert even_flux(base, 0.95, ratio_table()) == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("side", [(2.0, 2.1, 2.3), (2.0, 2.0, 2.7), (2.0, 2.0, 2.82)])
def test_unequal_rule_with_equal_discs_is_the_equal_rule(side: tuple[float, float, float]) -> None:
    base, disc = triangle(*side), 0.93
    even = even_flux(base, disc, ratio_table())
    assert uneven_flux(base, np.full(3, disc), ratio_table()) == pytest.approx(even, rel=1e-4)


def test_a_disc_in_the_shadow_of_two_still_leaves_a_flux() -> None:
    """A small disc near the line between two large ones: the signed wedges add up to below 0."""
    base, disc = (
        np.array([[0.0, 0.0], [3.0, 0.0], [1.608, 0.2306]]),
        np.array([1.2458, 1.2458, 0.1584]),
    )
    assert touching_flux(base, disc, ratio_table()) <= 0.0
    assert 0.0 < uneven_flux(base, disc, ratio_table()) < 1e-2


def test_a_very_obtuse_facet_of_equal_discs_still_leaves_a_flux() -> None:
    base = triangle(2.0, 2.0, 3.2)
    assert even_flux(base, 0.93, ratio_table()) < 0.0
    assert 0.0 < uneven_flux(base, np.full(3, 0.93), ratio_table()) < 2e-2


def test_closed_section_carries_nothing() -> None:
    assert uneven_flux(triangle(2.0, 2.0, 2.0), np.full(3, 1.2), ratio_table()) == 0.0
