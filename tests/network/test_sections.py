"""Flow through one section of a throat: closed forms, series, finite elements and differences."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from fdnet.network.laws import deposit_resistances as deposit
from fdnet.network.laws import wedges
from fdnet.network.laws.reaching_grains import ray_room, share_of_cut
from tests.network.sections import (
    edge_flux,
    even_flux,
    from_python,
    resolved_beside_walls,
    resolved_flux,
    uneven_flux,
    wall_flux,
)
from tests.network.wedge_table import exact_flux

EQUAL_SIDES = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
RIGHT_ISOSCELES = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
ACUTE = np.array([[0.0, 0.0], [2.0, 0.0], [1.1175, 1.7808]])


def triangle(a, b, c):
    x = (a * a + b * b - c * c) / (2.0 * a)
    return np.array([[0.0, 0.0], [a, 0.0], [x, np.sqrt(b * b - x * x)]])


# ------------------------------------------------------------------------------------------------
# Wedges and the rule of tubes.


def rays(angle, disc):
    """The flux on rays by quadrature, where each has Happel's flow in an annulus."""
    point, weight = np.polynomial.legendre.leggauss(64)
    first = np.arccos(1.0 / disc) if disc > 1.0 else 0.0
    d = 1.0 / np.cos(first + 0.5 * (angle - first) * (1.0 + point))
    flux = (4.0 * d**4 * np.log(d / disc) - 3.0 * d**4 + 4.0 * d**2 * disc**2 - disc**4) / 16.0
    return float(0.5 * (angle - first) * np.sum(weight * flux))


def test_the_closed_form_of_the_rays_is_their_integral():
    for degrees, disc in [(5, 0.3), (30, 1.0), (60, 0.9), (70, 0.1), (50, 1.2), (80, 1.05)]:
        angle = np.radians(degrees)
        flux = wedges.ray_flux(angle, np.tan(angle), disc)
        assert flux == pytest.approx(rays(angle, disc), rel=1e-9), (degrees, disc)
    angle = np.radians(30.0)
    assert wedges.ray_flux(angle, np.tan(angle), 1.16) == 0.0, "a disc that fills the wedge"


def test_the_table_is_the_series_of_sparrow_and_loeffler():
    """Rays are an upper bound; between its points the table is good to a thousandth."""
    table = wedges.ratio_table()
    assert table.max() <= 1.0 + 1e-6
    assert np.all(table[0] == 1.0)
    for row, column in [(5, 4), (15, 20), (22, 10), (30, 18), (40, 1)]:
        angle, disc = wedges.ANGLES[row], wedges.DISCS[column]
        expected = exact_flux(angle, disc) / wedges.ray_flux(angle, np.tan(angle), disc)
        assert table[row, column] == pytest.approx(expected, abs=1e-6), (row, column)
    for degrees, disc in [(31, 0.52), (44.9, 0.77), (59.1, 0.93), (17.3, 0.4)]:
        angle = np.radians(degrees)
        exact = exact_flux(angle, disc) / wedges.ray_flux(angle, np.tan(angle), disc)
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


def sideways(rho, step=1e-4):
    """What the resistance has more, over (da/dz)^2 and that of a straight cell of radius 1."""
    r = np.linspace(rho, 1.0, 4001)

    def speed(at, radius):
        return np.where(at > radius, 0.5 * np.log(at / radius) - (at**2 - radius**2) / 4.0, 0.0)

    def flux(radius):
        fine = np.linspace(radius, 1.0, 8001)
        return np.trapezoid(speed(fine, radius) * 2.0 * np.pi * fine, fine)

    def width(radius):
        """Radius a of the tube that carries as much as the half of a cell, a triangle's share."""
        return (4.0 * flux(radius) / np.pi) ** 0.25

    # what the flow along the cell gains between the rim and r comes in sideways through r
    here = speed(r, rho) / flux(rho)
    change = (speed(r, rho + step) / flux(rho + step) - here) / step
    inward = -cumulative_trapezoid(change * r, r, initial=0.0) / r
    sheared = np.trapezoid(2.0 * (np.gradient(inward, r) ** 2 + (inward / r) ** 2) * r, r)
    straight = np.trapezoid(np.gradient(here, r) ** 2 * r, r)
    slope = (width(rho + step) - width(rho - step)) / (2.0 * step)
    return sheared / straight / slope**2


def test_the_widening_of_an_open_section():
    """Fluid in the cell of a cylinder whose radius varies along it, without shear at its edge.

    The velocity along the cell is that of Happel (1959). What flows sideways makes up for its
    change, and its dissipation is what the resistance has more, to second order.
    """
    shares = {0.2: 0.58, 0.3: 0.64, 0.4: 0.65, 0.5: 0.63, 0.6: 0.59, 0.7: 0.52}
    for narrow, share in shares.items():
        got = sideways(narrow)
        assert got == pytest.approx(share * wedges.WIDENING / 2.0, rel=0.01), narrow
        assert got == pytest.approx(wedges.OPEN_WIDENING / 2.0, rel=0.13), narrow


# ------------------------------------------------------------------------------------------------
# Sections between three grains.


def test_sections_of_equal_wedges():
    """Six of 30 degrees in an equilateral triangle, four of 45 in half a square."""
    exact = 6.0 * exact_flux(np.pi / 6.0, 0.9)
    assert even_flux(2.0 * EQUAL_SIDES, 0.9) == pytest.approx(exact, rel=1e-4)
    assert resolved_flux(2.0 * EQUAL_SIDES, np.full(3, 0.9)) == pytest.approx(exact, rel=1e-3)
    exact = 4.0 * exact_flux(np.pi / 4.0, 0.95)
    assert even_flux(RIGHT_ISOSCELES, 0.95) == pytest.approx(exact, rel=2e-3)
    assert resolved_flux(RIGHT_ISOSCELES, np.full(3, 0.95)) == pytest.approx(exact, rel=1e-3)


def test_equal_discs_against_finite_elements():
    for disc in (0.3, 0.7, 0.93):
        exact = resolved_flux(ACUTE, np.full(3, disc))
        assert even_flux(ACUTE, disc) == pytest.approx(exact, rel=0.01), disc
    for side in [(2.0, 2.1, 2.3), (2.0, 2.0, 2.7), (2.0, 2.0, 2.82)]:
        base = triangle(*side)
        uneven = uneven_flux(base, np.full(3, 0.93))
        assert uneven == pytest.approx(even_flux(base, 0.93), rel=1e-4), side


def test_equal_discs_in_an_obtuse_triangle_against_finite_elements():
    """Its circumcentre lies beyond the long edge: signed shares alone give -97 to 97 %."""
    for edge in (2.85, 2.9, 3.0, 3.1):
        base = np.array([[0.0, 0.0], [edge, 0.0], [edge / 2, np.sqrt(4.0 - edge**2 / 4)]])
        for disc in (0.6, 0.9, 0.98):
            discs = np.full(3, disc)
            ratio = uneven_flux(base, discs) / resolved_flux(base, discs)
            assert ratio == pytest.approx(1.0, abs=0.13), (edge, disc)
    base = triangle(2.0, 2.0, 3.2)
    assert even_flux(base, 0.93) < 0.0 < uneven_flux(base, np.full(3, 0.93)) < 2e-2
    fluxes = []
    for angle in np.radians(np.arange(87.0, 97.0, 0.25)):  # no jump on the way
        base = np.array([[0.0, 0.0], [2.0, 0.0], [2.0 * np.cos(angle), 2.0 * np.sin(angle)]])
        fluxes.append(uneven_flux(base, np.full(3, 0.6)))
    assert np.all(np.abs(np.diff(np.log(fluxes))) < 0.02)


def test_unequal_discs_against_finite_elements():
    """The law over finite elements; rays give the last (docs/physics_network.md)."""
    for edge, apex, disc, ratio in [
        (1.0, (0.5, 0.4), (0.5, 0.5, 0.1), 0.98),
        (1.2, (0.6, 0.5), (0.5, 0.5, 0.1), 0.99),
        (1.2, (0.8, 0.5), (0.5, 0.5, 0.1), 1.03),
        (1.2, (0.6, 0.2), (0.5, 0.5, 0.1), 0.94),
        (0.7, (0.35, 0.7), (0.1, 0.1, 0.5), 1.12),
    ]:
        base, discs = np.array([[0.0, 0.0], [edge, 0.0], apex]), np.array(disc)
        exact = resolved_flux(base, discs)
        assert uneven_flux(base, discs) / exact == pytest.approx(ratio, abs=0.01), (apex, disc)


def test_sections_whose_signed_shares_cancel_are_summed_over_rays():
    """The law over finite elements, where the signed shares of three discs give 1 to 18 %."""
    for apex, disc, ratio in [
        ((1.098, 0.706), (0.560, 0.374, 0.184), 0.96),
        ((1.000, 0.513), (0.601, 0.309, 0.058), 0.98),
        ((1.172, 0.252), (0.463, 0.077, 0.079), 0.93),
        ((1.142, 0.305), (0.754, 0.182, 0.144), 0.94),
        ((1.144, 0.308), (0.420, 0.141, 0.118), 0.93),
    ]:
        base, discs = np.array([[0.0, 0.0], [1.0, 0.0], apex]), np.array(disc)
        exact = resolved_flux(base, discs, 400)
        assert uneven_flux(base, discs) / exact == pytest.approx(ratio, abs=0.02), apex
    # a small disc near the line between two large ones, and a closed section
    base = np.array([[0.0, 0.0], [3.0, 0.0], [1.608, 0.2306]])
    assert 0.0 < uneven_flux(base, np.array([1.2458, 1.2458, 0.1584])) < 1e-2
    assert uneven_flux(2.0 * EQUAL_SIDES, np.full(3, 1.2)) == 0.0


def test_a_grain_that_a_plane_cuts_against_finite_elements():
    """The disc on the corner is 3 to 38 % off, that of the grain itself at most 3 %."""
    room = np.empty((2, 3, 3)), ray_room(0), wedges.ratio_table()
    base, share = np.array([[0.0, 0.0], [1.0, 0.0], [0.45, 0.85]]), from_python(share_of_cut)
    for away, radius, stand_in in [
        ((-0.1, -0.05), 0.45, 0.4),
        ((-0.15, -0.1), 0.5, 0.4),
        ((0.0, -0.3), 0.5, 0.3),
    ]:
        corner, own = np.array([stand_in, 0.4, 0.35]), np.array([radius, 0.4, 0.35])
        cut = np.zeros((3, 4))
        cut[0] = *away, 0.0, radius
        exact = resolved_flux(base, own, centre=base + np.array([away, (0, 0), (0, 0)]))
        flux = uneven_flux(base, corner)
        assert abs(flux / exact - 1.0) > 0.025
        assert flux * share(base, corner, 0.0, cut, *room) == pytest.approx(exact, rel=0.03), away
    # centre 0.2 above the facet, radius 0.5: at the height 0.5 the disc has the radius 0.4
    corner, cut, flat = np.array([0.3, 0.4, 0.35]), np.zeros((3, 4)), np.zeros((3, 4))
    cut[0], flat[0] = (0.0, 0.0, 0.2, 0.5), (0.0, 0.0, 0.0, 0.4)
    there = share(base, corner, 0.5, cut, *room)
    assert there == pytest.approx(share(base, corner, 0.0, flat, *room), rel=1e-12)
    assert share(base, corner, 0.1, cut, *room) < there < 1.0


# ------------------------------------------------------------------------------------------------
# Sections beside walls that hold the fluid.


def test_half_sections_of_a_wall_against_finite_differences():
    cases = {
        "touching all": ((1.0, 1.0, 2.0), (1.0, 1.0)),
        "one raised": ((1.0, 1.5, 2.1), (1.0, 1.0)),
        "both raised": ((1.5, 1.5, 2.0), (1.0, 1.0)),
        "small discs": ((1.0, 1.0, 2.0), (0.5, 0.5)),
        "steep": ((1.0, 2.2, 1.7), (1.0, 1.0)),
        "cut and unequal": ((0.6, 1.3, 2.2), (1.0, 0.7)),
        "on the wall": ((0.0, 1.0, 2.2), (1.0, 1.0)),
    }
    for name, (place, disc) in cases.items():
        exact = resolved_beside_walls(place, disc)
        assert wall_flux(place, *disc) == pytest.approx(exact, rel=0.06), name
    place, disc = (1.2, 2.8, 1.3), (1.0, 1.0)  # the touching circle is centred outside
    exact = resolved_beside_walls(place, disc)
    assert 0.5 * exact < wall_flux(place, *disc) < exact


def test_quarter_sections_of_an_edge_against_finite_differences():
    for far in (1.0, 1.5, 2.0):
        for disc in (1.0, 0.8, 0.5, 0.2):
            exact = resolved_beside_walls((1.0, 1.0, far), (disc, 0.0), edge=True)
            assert edge_flux((1.0, far), disc) == pytest.approx(exact, rel=0.06), (far, disc)
    flux = edge_flux((1.0, 1.0), np.array([1.5, 1.4]))
    assert flux[0] == 0.0 < flux[1], "a disc over the edge of the box leaves nothing"


def test_limits_and_symmetry_beside_a_wall():
    """Between the wall and the free line of centres, L >> H: L H^3 / 3 except near the discs."""
    for along in (20.0, 30.0, 40.0):
        flux = wall_flux((1.0, 1.0, along), 0.01, 0.01)
        assert flux == pytest.approx((along - 1.0) / 3.0, rel=0.05), along
    one, other = wall_flux((1.0, 1.6, 2.1), 0.9, 0.7), wall_flux((1.6, 1.0, 2.1), 0.7, 0.9)
    assert one == pytest.approx(other, rel=1e-3)
    assert wall_flux((0.2, 0.2, 0.5), 1.0, 1.0) == 0.0
    discs = np.linspace(0.2, 1.0, 9), np.linspace(0.9, 0.1, 9)
    single = [wall_flux((1.0, 1.6, 2.1), *pair) for pair in zip(*discs, strict=True)]
    assert wall_flux((1.0, 1.6, 2.1), *discs) == pytest.approx(single, rel=1e-13)


# ------------------------------------------------------------------------------------------------
# Sections among fines, summed over points, with side walls and planes of pressure.


AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""The sections lie across x: their first axis is z, their second y."""


def points_flux(base, discs):
    """Flux m4 among `discs` (x, y, radius) m."""
    discs = np.column_stack([np.array(discs, float), np.full(len(discs), -np.inf)])
    room = deposit.point_room(deposit.DIVISIONS)
    given = np.array(base, float), discs, len(discs), np.empty((0, 3)), 0, room
    return from_python(deposit.points_flux)(*given)


def held_flux(base, discs, planes, axes=AXES):
    """Flux m4; `planes` are (axis, sense, place m)."""
    most, origin = deposit.MOST_PLANES, np.zeros(3)
    given = np.array([[0.0, 1.0, -np.inf]] * most)
    for axis, sense, place in planes:
        given[2 * axis + (sense < 0)] = axis, sense, place
    room = np.zeros((len(discs) + most, 4))
    room[: len(discs), :3], room[: len(discs), 3] = discs, -np.inf
    where = given, origin, np.array(axes), 0.0, np.empty((most, 3))
    points = deposit.point_room(deposit.DIVISIONS)
    held = from_python(deposit.held_flux)
    return held(np.array(base, float), room, len(discs), *where, points)


def lattice(radii):
    """Discs on a triangular lattice, of three radii in turn, that surround `EQUAL_SIDES`."""
    steps = np.array([(i, j) for i in range(-4, 6) for j in range(-4, 6)])
    place = steps @ EQUAL_SIDES[1:]
    near = np.linalg.norm(place - EQUAL_SIDES.mean(axis=0), axis=1) < 2.2
    return np.column_stack([place, np.array(radii)[(steps[:, 0] - steps[:, 1]) % 3]])[near]


def test_sections_among_fines_against_finite_elements():
    """A lattice has no flow of shear across the sides of its triangles."""
    for radii, ratio in [
        ((0.4, 0.4, 0.4), 0.99),
        ((0.3, 0.3, 0.3), 0.96),
        ((0.5, 0.5, 0.1), 0.91),
        ((0.45, 0.3, 0.1), 0.96),
        ((0.45, 0.45, 0.02), 0.96),
        ((0.45, 0.1, 0.1), 0.92),
    ]:
        exact = resolved_flux(EQUAL_SIDES, np.array(radii))
        flux = points_flux(EQUAL_SIDES, lattice(radii))
        assert flux / exact == pytest.approx(ratio, abs=0.01), radii


def test_the_order_of_corners_and_discs_mirror_and_scale_do_not_matter():
    """A disc beyond the triangle holds the fluid too; one over all of it leaves nothing."""
    two = np.array([[0.0, 0.0, 0.3], [1.0, 0.0, 0.3]])
    near, far = (points_flux(EQUAL_SIDES, np.vstack([two, [0.5, y, 0.3]])) for y in (1.2, 9.0))
    assert near < far == pytest.approx(points_flux(EQUAL_SIDES, two))
    assert points_flux(EQUAL_SIDES, [[0.5, 0.3, 2.0]]) == 0.0
    base, discs = np.array([[0.0, 0.0], [1.3, 0.0], [0.4, 0.8]]), lattice((0.4, 0.3, 0.1))
    flux = points_flux(base, discs)
    assert points_flux(base[[1, 2, 0]], discs[::-1]) == pytest.approx(flux, rel=1e-12)
    mirrored = points_flux(base * [1.0, -1.0], discs * [1.0, -1.0, 1.0])
    assert mirrored == pytest.approx(flux, rel=1e-12)
    assert points_flux(3 * base, 3 * discs) == pytest.approx(81 * flux, rel=1e-12)


def test_triangles_that_walls_halve_against_finite_differences():
    """Both halves are the half-section; along an edge it is twice the quarter of the rectangle."""
    for disc in [(0.5, 0.5), (0.8, 0.3), (0.2, 0.6)]:
        base, discs = [[0, 1], [0, -1], [1.7, 0]], [[0, 1, disc[0]], [1.7, 0, disc[1]]]
        exact = 2.0 * resolved_beside_walls((1.0, 0.0, 1.7), disc)
        assert held_flux(base, discs, [(1, 1.0, 0.0)]) == pytest.approx(exact, rel=0.1), disc
    for disc in (0.8, 0.5, 0.2):
        base = [[1, 1.3], [-1, 1.3], [1, -1.3]]
        exact = 2.0 * resolved_beside_walls((1.3, 1.3, 1.0), (disc, 0.0), edge=True)
        flux = held_flux(base, [[1, 1.3, disc]], [(1, 1.0, 0.0), (2, 1.0, 0.0)])
        assert flux == pytest.approx(exact, rel=0.1), disc


def test_walls_and_planes_of_pressure_count_from_where_they_are_near():
    """A plane holds the fluid along it as walls do, but for the part of the flow square to it."""
    discs = np.column_stack([EQUAL_SIDES, [0.1, 0.1, 0.1]])
    flux = [held_flux(EQUAL_SIDES, discs, [(1, 1.0, -gap)]) for gap in (0.0, 0.1, 0.3, 9.0)]
    assert flux == sorted(flux)
    assert flux[0] < 0.7 * flux[3]
    assert flux[3] == held_flux(EQUAL_SIDES, discs, [])
    discs[1, 2] = 0.2
    wall = held_flux(EQUAL_SIDES, discs, [(1, 1.0, -0.1)])
    plane = held_flux(EQUAL_SIDES, discs, [(0, 1.0, -0.1)], AXES[:, [1, 0, 2]])
    assert plane == pytest.approx(wall, rel=1e-12)
    discs[:, 2] = 0.05

    def at(uy, uz, below):
        axes = np.array([[0.0, 1.0, 0.0], [uy, 0.0, uz], [uz, 0.0, -uy]])
        return held_flux(EQUAL_SIDES, discs, [(0, 1.0, -below)], axes)

    free, along, slope = held_flux(EQUAL_SIDES, discs, []), at(1.0, 0.0, 0.0), np.sqrt(0.5)
    assert at(0.0, 1.0, 0.1) == at(1.0, 0.0, 99.0) == free
    assert 0.1 < along / free < 0.8
    assert at(slope, slope, 0.0) == pytest.approx(0.5 * (free + along), rel=0.02)
