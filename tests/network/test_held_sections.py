"""Sections next to side walls and planes of pressure that hold the fluid."""

import numpy as np
import pytest

from fdnet.network.laws.deposit_resistances import (
    DIVISIONS,
    MOST_PLANES,
    bounded_by_fines,
    bounded_resistances,
    deposit_resistances,
    held_flux,
    planes_of,
    point_room,
)
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from tests.network.one_section import from_python
from tests.network.packs import random_pack, with_fines
from tests.network.walled_section import resolved_flux

held = from_python(held_flux)
EQUAL_SIDES = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""The sections lie across x: their first axis is z, their second y."""


def flux_of(base, discs, planes, axes=AXES, divisions=DIVISIONS):
    """Flux m4; `planes` are (axis, sense, place m)."""
    given = np.array([[0.0, 1.0, -np.inf]] * MOST_PLANES)
    for axis, sense, place in planes:
        given[2 * axis + (sense < 0)] = axis, sense, place
    room = np.zeros((len(discs) + MOST_PLANES, 4))
    room[: len(discs), :3], room[: len(discs), 3] = discs, -np.inf
    lines, origin = np.empty((MOST_PLANES, 3)), np.zeros(3)
    base, axes, points = np.array(base, float), np.array(axes), point_room(divisions)
    return held(base, room, len(discs), given, origin, axes, 0.0, lines, points)


@pytest.mark.parametrize("disc", [(0.5, 0.5), (0.8, 0.3), (0.2, 0.6)])
def test_a_triangle_that_a_wall_halves_against_finite_differences(disc):
    """Both halves are the half-section: a disc above the wall, and one on it."""
    base, discs = [[0, 1], [0, -1], [1.7, 0]], [[0, 1, disc[0]], [1.7, 0, disc[1]]]
    exact = 2.0 * resolved_flux((1.0, 0.0, 1.7), disc)
    assert flux_of(base, discs, [(1, 1.0, 0.0)]) == pytest.approx(exact, rel=0.1)


@pytest.mark.parametrize("disc", [0.8, 0.5, 0.2])
def test_a_triangle_along_an_edge_against_finite_differences(disc):
    """It is twice the quarter of the rectangle that lies in the box."""
    base, discs = [[1, 1.3], [-1, 1.3], [1, -1.3]], [[1, 1.3, disc]]
    exact = 2.0 * resolved_flux((1.3, 1.3, 1.0), (disc, 0.0), edge=True)
    flux = flux_of(base, discs, [(1, 1.0, 0.0), (2, 1.0, 0.0)])
    assert flux == pytest.approx(exact, rel=0.1)


def test_a_wall_counts_from_where_it_is_near():
    discs = np.column_stack([EQUAL_SIDES, [0.1, 0.1, 0.1]])
    flux = [flux_of(EQUAL_SIDES, discs, [(1, 1.0, -gap)]) for gap in (0.0, 0.1, 0.3, 9.0)]
    assert flux == sorted(flux)
    assert flux[0] < 0.7 * flux[3]
    assert flux[3] == flux_of(EQUAL_SIDES, discs, [])


def test_a_wall_and_a_plane_of_pressure_along_the_flow_are_the_same():
    turned = AXES[:, [1, 0, 2]]
    discs = np.column_stack([EQUAL_SIDES, [0.1, 0.2, 0.1]])
    wall = flux_of(EQUAL_SIDES, discs, [(1, 1.0, -0.1)])
    assert flux_of(EQUAL_SIDES, discs, [(0, 1.0, -0.1)], turned) == pytest.approx(wall, rel=1e-12)


def test_a_plane_of_pressure_holds_the_fluid_along_it():
    """As walls do, but for the part of the flow that is square to it."""
    discs = np.column_stack([EQUAL_SIDES, [0.05, 0.05, 0.05]])

    def flux(uy, uz, below):
        axes = np.array([[0.0, 1.0, 0.0], [uy, 0.0, uz], [uz, 0.0, -uy]])
        return flux_of(EQUAL_SIDES, discs, [(0, 1.0, -below)], axes)

    open_flux = flux_of(EQUAL_SIDES, discs, [])
    assert flux(0.0, 1.0, 0.1) == open_flux
    assert flux(1.0, 0.0, 99.0) == open_flux
    along = flux(1.0, 0.0, 0.0)
    assert 0.1 < along / open_flux < 0.8
    slope = np.sqrt(0.5)
    assert flux(slope, slope, 0.0) == pytest.approx(0.5 * (open_flux + along), rel=0.02)


@pytest.fixture(scope="module")
def walled():
    pack = with_fines(random_pack(60, 0.5, periodic=False), 150, 0.2)
    return {
        walls: build_network(pack, periodic=(False,) * 3, walls=walls)
        for walls in ("slip", "no-slip")
    }


def test_only_sides_that_hold_the_fluid_are_planes(walled):
    box = walled["slip"].box
    assert np.isinf(planes_of(walled["slip"])[2:, 2]).all()
    assert planes_of(walled["no-slip"])[:, 2] == pytest.approx(box.ravel())
    assert np.isinf(planes_of(build_network(random_pack(40), periodic="xyz"))).any(axis=1).all()


def test_throats_with_fines_next_to_walls_carry_less_than_where_walls_slip(walled):
    """Those that a wall cuts among them."""
    open_, held = (walled[walls] for walls in ("slip", "no-slip"))
    assert np.array_equal(bounded_by_fines(held), bounded_by_fines(open_))
    ends = held.pore_group[held.throat_pores]
    throats = np.flatnonzero(bounded_by_fines(held) & (ends[:, 0] != ends[:, 1]))
    some, heights = np.ones(len(throats), bool), nodes_of(held).heights[throats]
    slips, holds = (
        bounded_resistances(network, throats, some, heights)[0].sum(axis=1)
        for network in (open_, held)
    )
    share, both = held.throat_share[throats], np.isfinite(slips) & np.isfinite(holds)
    more = [holds[both & (share == part)] / slips[both & (share == part)] for part in (1, 0.5)]
    assert min(len(part) for part in more) > 500
    assert min(part.min() for part in more) > 0.8
    assert np.median(more[0]) < 1.1
    assert np.median(more[1]) > 2.0


def test_throats_that_a_wall_cuts_between_grains_keep_the_trapezoid(walled):
    held = walled["no-slip"]
    grains = (held.throat_share == 0.5) & ~held.image_fine[held.throat_images].any(axis=1)
    assert grains.any()
    own = half_resistances(held, fourth=True)[grains]
    assert np.all(deposit_resistances(held)[grains] >= own)
