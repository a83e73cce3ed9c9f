"""Sections of throats that a fine bounds, and what they add up to."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from fdnet.network.laws import deposit_resistances as fine
from fdnet.network.laws.deposit_resistances import (
    deposit_resistances,
    node_resistances,
    point_room,
    set_near,
    solids_of,
)
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.wedges import OPEN_WIDENING, WIDENING
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from fdnet.network.states import cut_out
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Kind
from tests.network.networks import network_of
from tests.network.one_section import from_python
from tests.network.packs import random_pack, with_fines
from tests.network.section_flux import resolved_flux

EQUAL_SIDES = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])


flux_among = from_python(fine.points_flux)


def points_flux(base, discs, divisions=fine.DIVISIONS):
    discs = np.column_stack([np.array(discs, float), np.full(len(discs), -np.inf)])
    return flux_among(base, discs, len(discs), np.empty((0, 3)), 0, point_room(divisions))


def lattice(radii):
    """Discs on a triangular lattice, of three radii in turn, that surround `EQUAL_SIDES`."""
    steps = np.array([(i, j) for i in range(-4, 6) for j in range(-4, 6)])
    place = steps @ EQUAL_SIDES[1:]
    near = np.linalg.norm(place - EQUAL_SIDES.mean(axis=0), axis=1) < 2.2
    return np.column_stack([place, np.array(radii)[(steps[:, 0] - steps[:, 1]) % 3]])[near]


@pytest.mark.parametrize(
    ("radii", "ratio"),
    [
        ((0.4, 0.4, 0.4), 0.99),
        ((0.3, 0.3, 0.3), 0.96),
        ((0.5, 0.5, 0.1), 0.91),
        ((0.45, 0.3, 0.1), 0.96),
        ((0.45, 0.45, 0.02), 0.96),
        ((0.45, 0.1, 0.1), 0.92),
    ],
)
def test_sections_against_finite_elements(radii, ratio):
    """A lattice has no flow of shear across the sides of its triangles."""
    exact = resolved_flux(EQUAL_SIDES, np.array([radii[0], radii[1], radii[2]]))
    assert points_flux(EQUAL_SIDES, lattice(radii)) / exact == pytest.approx(ratio, abs=0.01)


def test_a_disc_beyond_the_triangle_holds_the_fluid():
    open_side = np.array([[0.0, 0.0, 0.3], [1.0, 0.0, 0.3]])
    flux = [
        points_flux(EQUAL_SIDES, np.vstack([open_side, [0.5, y, 0.3]])) for y in (0.9, 1.2, 9.0)
    ]
    assert flux == sorted(flux)
    assert flux[2] == pytest.approx(points_flux(EQUAL_SIDES, open_side))
    assert points_flux(EQUAL_SIDES, [[0.5, 0.3, 2.0]]) == 0.0


def test_the_order_of_corners_and_discs_does_not_matter():
    base, discs = np.array([[0.0, 0.0], [1.3, 0.0], [0.4, 0.8]]), lattice((0.4, 0.3, 0.1))
    mirrored = base * [1.0, -1.0], discs * [1.0, -1.0, 1.0]
    flux = points_flux(base, discs)
    assert points_flux(base[[1, 2, 0]], discs[::-1]) == pytest.approx(flux, rel=1e-12)
    assert points_flux(*mirrored) == pytest.approx(flux, rel=1e-12)
    assert points_flux(3 * base, 3 * discs) == pytest.approx(81 * flux, rel=1e-12)


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40, aspect=2.0), 60, 0.2)


@pytest.fixture(scope="module")
def network(pack):
    return build_network(pack, periodic="yz")


def test_the_spheres_near_a_place_are_those_of_the_pack(pack):
    """Of a slab with caps at its planes: all images within reach, and none twice."""
    low, high = pack.box[0]
    pack = cut_out(pack, (0.8 * low + 0.2 * high, 0.2 * low + 0.8 * high), (False, True, True))
    network = build_network(pack, periodic="yz")
    assert np.count_nonzero(network.image_outward) > 10
    rng = np.random.default_rng(4)
    place = network.box[:, 0] + rng.random((60, 3)) * np.ptp(network.box, axis=1)
    reach = rng.uniform(0.2, 1.5, 60) * pack.radius.max()
    solids = solids_of(network, place, reach)
    images = make_images(
        pack.position,
        network.box,
        periodic=(False, True, True),
        margin=np.full(3, 3.0 * pack.radius.max()),
        tolerance=0.0,
    )
    radius = pack.radius[images.owner]
    near, near_place = np.empty(500, np.int64), from_python(set_near)
    for one, far in zip(place, reach, strict=True):
        count = near_place(*one, far, solids, near)
        body = solids.body[near[:count]]
        within = np.linalg.norm(images.position - one, axis=1) < far + radius
        expected = np.column_stack([images.position, radius])[within]
        assert count == len(expected)
        order = [np.lexsort(np.round(a / far, 3).T) for a in (body, expected)]
        assert body[order[0]] == pytest.approx(expected[order[1]], abs=3e-4 * far)


def test_grains_alone_keep_the_law_of_grains(pack):
    grains = build_network(pack.grains(), periodic="yz")
    assert not fine.bounded_by_fines(grains).any()
    assert np.array_equal(deposit_resistances(grains), half_resistances(grains, fourth=True))


def test_throats_without_a_fine_and_narrow_ones_keep_theirs(network):
    halves, before = deposit_resistances(network), half_resistances(network, fourth=True)
    bounded = fine.bounded_by_fines(network)
    other = ~bounded & ~fine.mixed_pores(network)[network.pore_group[network.throat_pores]].any(
        axis=1
    )
    assert 0.2 < bounded.mean() < 0.9
    assert other.any()
    assert np.array_equal(halves[other], before[other])
    assert np.all(halves[bounded].sum(axis=1) > 0)
    # the two laws describe the same throats
    both = bounded & np.isfinite((halves + before).sum(axis=1))
    ratio = np.log(halves[both].sum(axis=1) / before[both].sum(axis=1))
    assert abs(np.median(ratio)) < 0.3


def test_more_steps_and_points_change_little(network, monkeypatch):
    throats = np.flatnonzero(fine.bounded_by_fines(network))
    whole, heights = np.ones(len(throats), bool), nodes_of(network).heights[throats]
    coarse = fine.bounded_resistances(network, throats, whole, heights)[0].sum(axis=1)
    monkeypatch.setattr(fine, "DIVISIONS", 24)
    more = fine.bounded_resistances(network, throats, whole, heights)[0].sum(axis=1)
    open_ = np.isfinite(coarse) & np.isfinite(more)
    assert open_.mean() > 0.9
    ratio = np.log(coarse[open_] / more[open_])
    assert abs(np.median(ratio)) < 0.02
    assert np.quantile(np.abs(ratio), 0.9) < 0.2


def test_what_spreading_behind_a_node_adds():
    """Four throats of one mixed pore with 1/a of 1, 2, 4 and 4.

    Their corners are three, two, no and three grains, and the first has half of the resistance.
    """
    pairs = np.array([[0, 1], [0, 2], [0, 3], [0, 4]])
    images = np.array([[0, 1, 2], [0, 1, 3], [3, 4, 5], [0, 1, 2]])
    network = replace(
        network_of(np.zeros((5, 3)), pairs, [[0, 1]] * 4),
        throat_images=images,
        image_fine=np.array([False, False, False, True, True, True]),
    )
    ends = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [4.0, np.nan, 4.0], [4.0, 4.0, 4.0]])
    halves = np.array([[2.0, 3.0], [5.0, 5.0], [4.0, 6.0], [5.0, 5.0]])
    mixed = np.array([True, False, False, False, False])
    added = node_resistances(network, np.arange(4), halves, ends, mixed)
    wide = 5.0 / (2.0 + 1.0 / 8.0 + 2.0 / 64.0)
    each = 0.6 * 8.0 / (3.0 * np.pi) * np.sqrt(8.0 / 3.0)
    by_hand = [0.0, 2.0 * each * (8.0 - wide), 0.0, 3.0 * each * (64.0 - wide)]
    assert added[:, 0] == pytest.approx(by_hand)
    assert not added[:, 1].any()


@pytest.mark.parametrize(
    ("narrow", "share"),
    [(0.2, 0.58), (0.3, 0.64), (0.4, 0.65), (0.5, 0.63), (0.6, 0.59), (0.7, 0.52)],
)
def test_widening_of_an_open_section(narrow, share):
    """Fluid in the cell of a cylinder whose radius varies along it, without shear at its edge.

    The velocity along the cell is that of Happel (1959). What flows sideways makes up for its
    change, and its dissipation is what the resistance has more, to second order.
    """
    assert sideways(narrow) == pytest.approx(share * WIDENING / 2.0, rel=0.01)
    assert sideways(narrow) == pytest.approx(OPEN_WIDENING / 2.0, rel=0.13)


def sideways(rho, step=1e-4):
    """What the resistance has more, over (da/dz)^2 and that of a straight cell of radius 1."""
    r = np.linspace(rho, 1.0, 4001)

    def along(radius):
        """Velocity over the flux, at r."""
        fine = np.linspace(radius, 1.0, 8001)
        return speed(r, radius) / np.trapezoid(speed(fine, radius) * 2.0 * np.pi * fine, fine)

    def speed(at, radius):
        return np.where(at > radius, 0.5 * np.log(at / radius) - (at**2 - radius**2) / 4.0, 0.0)

    def width(radius):
        """Radius a of the tube that carries as much as the half of a cell, a triangle's share."""
        fine = np.linspace(radius, 1.0, 8001)
        half = 0.5 * np.trapezoid(speed(fine, radius) * 2.0 * np.pi * fine, fine)
        return (8.0 * half / np.pi) ** 0.25

    # what the flow along the cell gains between the rim and r comes in sideways through r
    here = along(rho)
    change = (along(rho + step) - here) / step
    inward = -cumulative_trapezoid(change * r, r, initial=0.0) / r
    sheared = np.trapezoid(2.0 * (np.gradient(inward, r) ** 2 + (inward / r) ** 2) * r, r)
    straight = np.trapezoid(np.gradient(here, r) ** 2 * r, r)
    slope = (width(rho + step) - width(rho - step)) / (2.0 * step)
    return sheared / straight / slope**2


def test_kinds_mark_the_images(pack, network):
    fines = (pack.kind == Kind.FINE)[network.image_grain]
    assert np.array_equal(network.image_fine, fines)
    assert not build_network(pack.grains(), periodic="yz").image_fine.any()
