"""Flow through one section of a throat: closed forms, series, finite elements and differences."""

import numpy as np
import pytest

from fdnet.network.laws import wedges
from tests.network.sections import (
    disc_flux,
    edge_flux,
    polygon_flux,
    resolved_beside_walls,
    resolved_flux,
    wall_flux,
)
from tests.network.wedge_table import exact_flux, ray_flux

EQUAL_SIDES = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
RIGHT_ISOSCELES = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
ACUTE = np.array([[0.0, 0.0], [2.0, 0.0], [1.1175, 1.7808]])


# ---- Wedges and the rule of tubes.
def test_the_table_is_the_series_of_sparrow_and_loeffler():
    """Rays are an upper bound; between its points the table is good to a thousandth."""
    table = wedges.ratio_table()
    assert table.max() <= 1.0 + 1e-6
    assert np.all(table[0] == 1.0)
    for row, column in [(5, 4), (15, 20), (22, 10), (30, 18), (40, 1)]:
        angle, disc = wedges.ANGLES[row], wedges.DISCS[column]
        expected = exact_flux(angle, disc) / ray_flux(angle, disc)
        assert table[row, column] == pytest.approx(expected, abs=1e-6), (row, column)
    for degrees, disc in [(31, 0.52), (44.9, 0.77), (59.1, 0.93), (17.3, 0.4)]:
        angle = np.radians(degrees)
        exact = exact_flux(angle, disc) / ray_flux(angle, disc)
        assert wedges.shear_ratio(angle, disc, table) == pytest.approx(exact, rel=1e-3), degrees


def test_the_rule_of_tubes_against_the_exact_hyperboloid():
    """Exact: 3 / (c^3 (1 - q)^2 (1 + 2 q)) with the focal distance c = 1.

    q is the cosine of the angle between the asymptote and the plane.
    """
    for q, bound in [(0.99, 1e-3), (0.9, 2e-3), (0.7, 0.015), (0.3, 0.05), (0.03, 0.08)]:
        z = np.sinh(np.linspace(0.0, 12.0, 6001)) * q
        narrow = 1.0 / (np.sqrt(1.0 - q**2) * np.sqrt(1.0 + (z / q) ** 2))
        total = sum(
            wedges.summed(np.array([a, b]), step, 1, wedges.WIDENING)
            for a, b, step in zip(narrow, narrow[1:], np.diff(z), strict=False)
        )
        assert 2.0 * total == pytest.approx(3 / ((1 - q) ** 2 * (1 + 2 * q)), rel=bound), q


# ---- Sections between three grains.
def test_sections_of_equal_wedges():
    """Six of 30 degrees in an equilateral triangle, four of 45 in half a square."""
    exact = 6.0 * exact_flux(np.pi / 6.0, 0.9)
    assert disc_flux(2.0 * EQUAL_SIDES, np.full(3, 0.9)) == pytest.approx(exact, rel=1e-4)
    assert resolved_flux(2.0 * EQUAL_SIDES, np.full(3, 0.9)) == pytest.approx(exact, rel=1e-3)
    exact = 4.0 * exact_flux(np.pi / 4.0, 0.95)
    assert disc_flux(RIGHT_ISOSCELES, np.full(3, 0.95)) == pytest.approx(exact, rel=2e-3)
    assert resolved_flux(RIGHT_ISOSCELES, np.full(3, 0.95)) == pytest.approx(exact, rel=1e-3)


def test_equal_discs_against_finite_elements():
    for disc in (0.3, 0.7, 0.93):
        exact = resolved_flux(ACUTE, np.full(3, disc))
        assert disc_flux(ACUTE, np.full(3, disc)) == pytest.approx(exact, rel=0.01), disc


def test_equal_discs_in_an_obtuse_triangle_against_finite_elements():
    """Its circumcentre lies beyond the long edge."""
    for edge in (2.85, 2.9, 3.0, 3.1):
        base = np.array([[0.0, 0.0], [edge, 0.0], [edge / 2, np.sqrt(4.0 - edge**2 / 4)]])
        for disc in (0.6, 0.9, 0.98):
            discs = np.full(3, disc)
            ratio = disc_flux(base, discs) / resolved_flux(base, discs)
            assert ratio == pytest.approx(1.05, abs=0.07), (edge, disc)


def test_unequal_discs_against_finite_elements():
    """The law over finite elements (docs/physics_network.md)."""
    for edge, apex, disc, ratio in [
        (1.0, (0.5, 0.4), (0.5, 0.5, 0.1), 0.98),
        (1.2, (0.6, 0.2), (0.5, 0.5, 0.1), 0.93),
        (0.7, (0.35, 0.7), (0.1, 0.1, 0.5), 0.98),
        (1.0, (1.098, 0.706), (0.560, 0.374, 0.184), 1.0),
        (1.0, (1.000, 0.513), (0.601, 0.309, 0.058), 0.97),
        (1.0, (1.144, 0.308), (0.420, 0.141, 0.118), 1.05),
    ]:
        base, discs = np.array([[0.0, 0.0], [edge, 0.0], apex]), np.array(disc)
        exact = resolved_flux(base, discs)
        assert disc_flux(base, discs) / exact == pytest.approx(ratio, abs=0.015), (apex, disc)
    # a small disc near the line between two large ones, and a closed section
    base = np.array([[0.0, 0.0], [3.0, 0.0], [1.608, 0.2306]])
    assert 0.0 < disc_flux(base, np.array([1.2458, 1.2458, 0.1584])) < 1e-2
    assert disc_flux(2.0 * EQUAL_SIDES, np.full(3, 1.2)) == 0.0


# ---- Sections beside walls that hold the fluid.
def test_half_sections_of_a_wall_against_finite_differences():
    cases = {
        "touching all": ((1.0, 1.0, 2.0), (1.0, 1.0)),
        "both raised": ((1.5, 1.5, 2.0), (1.0, 1.0)),
        "steep": ((1.0, 2.2, 1.7), (1.0, 1.0)),
        "cut and unequal": ((0.6, 1.3, 2.2), (1.0, 0.7)),
        "its touching circle is centred outside": ((1.2, 2.8, 1.3), (1.0, 1.0)),
    }
    for name, (place, disc) in cases.items():
        exact = resolved_beside_walls(place, disc)
        assert wall_flux(place, *disc) == pytest.approx(exact, rel=0.05), name
    place, disc = (1.0, 0.0, 2.2), (1.0, 1.0)  # the second disc is centred on the wall
    exact = resolved_beside_walls(place, disc)
    assert exact < wall_flux(place, *disc) < 1.15 * exact


def test_quarter_sections_of_an_edge_against_finite_differences():
    for far in (1.0, 1.5, 2.0):
        for disc in (1.0, 0.8, 0.5, 0.2):
            exact = resolved_beside_walls((1.0, 1.0, far), (disc, 0.0), edge=True)
            assert edge_flux((1.0, far), disc) == pytest.approx(exact, rel=0.07), (far, disc)
    assert edge_flux((1.0, 1.0), 1.5) == 0.0, "a disc over the edge of the box leaves nothing"
    assert edge_flux((1.0, 1.0), 1.4) > 0.0


# ---- Sections among fines, of which some stand beyond the triangle.
def lattice(radii):
    """Discs on a triangular lattice, of three radii in turn, that surround `EQUAL_SIDES`."""
    steps = np.array([(i, j) for i in range(-4, 6) for j in range(-4, 6)])
    place = steps @ EQUAL_SIDES[1:]
    near = np.linalg.norm(place - EQUAL_SIDES.mean(axis=0), axis=1) < 2.2
    return np.column_stack([place, np.array(radii)[(steps[:, 0] - steps[:, 1]) % 3]])[near]


def test_sections_among_fines_against_finite_elements():
    """A lattice has no flow of shear across the sides of its triangles."""
    for radii, ratio in [
        ((0.4, 0.4, 0.4), 1.0),
        ((0.45, 0.3, 0.1), 1.06),
        ((0.45, 0.45, 0.02), 1.21),
        ((0.45, 0.1, 0.1), 1.0),
    ]:
        exact = resolved_flux(EQUAL_SIDES, np.array(radii))
        flux = polygon_flux(EQUAL_SIDES, lattice(radii))
        assert flux / exact == pytest.approx(ratio, abs=0.015), radii
