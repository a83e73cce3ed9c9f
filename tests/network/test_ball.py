"""Pieces of balls in tetrahedra: closed forms, and elsewhere the `overlap` package.

That package uses another decomposition.
"""

import numpy as np
import pytest
from overlap import Sphere, Tetrahedron, overlap_area, overlap_volume

from fdnet.network.fines.deposit import pieces

BALL, SPHERE = 4 / 3 * np.pi, 4 * np.pi
CORNER = np.array([[0, 0, 0], [50, 0, 0], [0, 50, 0], [0, 0, 50.0]])


def piece(corner, centre, radius=1.0):
    one = np.zeros(1, np.intp)
    places = np.array([corner], float), (one, one), np.array([centre], float)
    return tuple(pieces(*places, np.array([float(radius)]))[0])


def oriented(corner):
    return corner if np.linalg.det(corner[1:] - corner[0]) > 0 else corner[[1, 0, 2, 3]]


@pytest.mark.parametrize(
    ("centre", "share"),
    [([5, 5, 5], 1), ([0, 5, 5], 1 / 2), ([0, 0, 5], 1 / 4), ([0, 0, 0], 1 / 8), ([-1, 5, 5], 0)],
)
def test_whole_half_quarter_and_eighth_of_a_ball(centre, share):
    assert piece(CORNER, centre) == pytest.approx(
        (share * BALL, share * SPHERE), rel=1e-14, abs=1e-14
    )


def test_cap_beyond_one_facet():
    height = 0.4
    expected = np.pi * height**2 * (3 - height) / 3, 2 * np.pi * height
    assert piece(CORNER, [-0.6, 5, 5]) == pytest.approx(expected, rel=1e-14)


def test_wedge_of_any_angle_through_the_centre():
    """Share of the ball is the dihedral angle over 2 pi."""
    for angle in (1e-6, 0.3, 1.2, 3.0):
        corner = [[0, 0, -50], [0, 0, 50], [50, 0, 0], [50 * np.cos(angle), 50 * np.sin(angle), 0]]
        share = angle / (2 * np.pi)
        assert piece(corner, [0, 0, 0]) == pytest.approx((share * BALL, share * SPHERE), rel=1e-9)


def cases():
    rng = np.random.default_rng(4)
    for k in range(4000):
        corner, centre, radius = (
            rng.normal(size=(4, 3)),
            0.7 * rng.normal(size=3),
            rng.uniform(0.1, 1.5),
        )
        share = rng.uniform(-1, 2)
        match k % 8:
            case 1:  # flat
                corner[3] = (
                    0.4 * corner[0] + 0.3 * corner[1] + 0.3 * corner[2] + 1e-7 * rng.normal(size=3)
                )
            case 2:  # sliver: four corners of a quadrilateral
                corner[3] = corner[0] + corner[1] - corner[2] + 1e-7 * rng.normal(size=3)
            case 3:  # an edge's line through the centre
                centre = share * corner[0] + (1 - share) * corner[1]
            case 4:  # a facet's plane through the centre
                centre = rng.dirichlet(np.ones(3)) @ corner[:3]
            case 5:  # a corner in the centre
                centre = corner[0]
            case 6:  # a tiny ball at an edge
                centre, radius = (
                    0.3 * corner[0] + 0.7 * corner[1] + 1e-3 * rng.normal(size=3),
                    2e-3,
                )
        yield oriented(corner), centre, radius


def test_random_and_degenerate_cases_against_the_other_decomposition():
    for corner, centre, radius in cases():
        tetrahedron, ball = Tetrahedron((corner - centre) / radius), Sphere(np.zeros(3), 1.0)
        volume, surface = piece(corner, centre, radius)
        assert volume / radius**3 == pytest.approx(overlap_volume(ball, tetrahedron), abs=1e-10)
        assert surface / radius**2 == pytest.approx(overlap_area(ball, tetrahedron)[0], abs=1e-9)


def test_order_of_corners_does_not_matter():
    rng = np.random.default_rng(8)
    corner = rng.normal(size=(4, 3))
    expected = piece(corner, [0.1, 0, 0], 0.7)
    for order in ([1, 0, 2, 3], [3, 2, 1, 0], [2, 3, 1, 0]):
        assert piece(corner[order], [0.1, 0, 0], 0.7) == pytest.approx(expected, rel=1e-13)


def test_a_flat_tetrahedron_holds_nothing():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    for height in (0.0, 0.3, -1e-12):
        assert piece(square, [0.4, 0.5, height], 0.5) == (0.0, 0.0)
