"""Conductances of throats: laws on paper, Stokes flow in lattices and slabs, walls, fines."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws import deposit_resistances as deposit
from fdnet.network.laws.cross_section import wall_cuts
from fdnet.network.laws.deposit_resistances import (
    bounded_by_fines,
    bounded_resistances,
    deposit_resistances,
)
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.named import LAWS
from fdnet.network.laws.reaching_grains import cut_corners
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from fdnet.network.permeability import analyse
from fdnet.network.states import cut_out
from fdnet.network.stokes import extrapolate, solve_slab
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.networks import network_of
from tests.network.packs import body_centred, random_pack, simple_cubic, snapshot, with_fines
from tests.network.sections import uneven_flux, wall_flux

ALL, NONE, SIDES = (True,) * 3, (False,) * 3, (False, True, True)
PACKS = {
    "next to walls": lambda: random_pack(100, 0.5, periodic=False),
    "cut by walls": lambda: random_pack(100),
    "radii 1:2": lambda: random_pack(100, spread=0.33),
    "simple cubic": lambda: simple_cubic(4),
}


def permeability(pack, law="lubrication", *, periodic=NONE, walls="slip"):
    network = build_network(pack, periodic=periodic, walls=walls)
    return whole_permeability(network, LAWS[law](network))[0]


def test_touching_body_centred_spheres_against_stokes():
    """k = 2 / (9 c K) with K = 162.9 (Zick and Homsy 1982); the law of the thesis has 0.27."""
    exact = 2 / (9 * np.pi * np.sqrt(3) / 8 * 162.9)
    for law, ratio in [("thesis", 0.27), ("effective", 1.04)]:
        k = permeability(body_centred(), law, periodic=ALL)
        assert k / exact == pytest.approx(ratio, abs=0.015), law


def test_a_body_centred_throat_by_the_formulas_on_paper():
    """Every facet of the BCC tetrahedra has sides 2, 2, 4/sqrt(3) in units of the radius."""
    network, long = build_network(body_centred(), periodic=ALL), 4 / np.sqrt(3)
    area = long * np.sqrt(4 - long**2 / 4) / 2
    circle = 4 * long / (4 * area)
    assert network.throat_radius == pytest.approx(circle - 1, rel=1e-6)
    assert network.throat_area == pytest.approx(area - np.pi / 2, rel=1e-6)
    assert network.throat_length == pytest.approx(np.sqrt(2 / 3), rel=1e-5)
    for law, radius in [
        ("thesis", circle - 1),
        ("effective", np.sqrt((area - np.pi / 2) / np.pi)),
    ]:
        by_hand = np.pi * radius**4 / (8 * np.sqrt(2 / 3))
        assert LAWS[law](network) == pytest.approx(by_hand, rel=1e-4), law


def test_thin_slabs_against_resolved_stokes_flow():
    """Between pressure planes that cut caps off grains, on two grids each; nothing is fitted."""
    for count, more, share, error in [
        (30, {}, (0.2, 0.8), 0.03),
        (30, {"spread": 0.3}, (0.2, 0.8), 0.03),
        (30, {"spread": 0.3}, (0.35, 0.65), 0.055),
        (60, {"aspect": 2.0}, (0.35, 0.65), 0.03),
    ]:
        pack = random_pack(count, **more)
        span = tuple(part * pack.box[0, 1] for part in share)
        exact = extrapolate(*(solve_slab(pack, span, cells=cells) for cells in (32, 48))).k
        network = build_network(cut_out(pack, span, SIDES), periodic=SIDES)
        k = whole_permeability(network, 1.0 / half_resistances(network).sum(axis=1))[0]
        assert k == pytest.approx(exact, rel=error), (count, more, share)


def test_the_cap_of_a_grain_that_a_face_cuts():
    """A grain of radius 5 centred 3 beyond the face x = 0, another 1 beyond x = 10.

    The cap shows the sections of its half ellipsoid: base 4, height 2; volume 52 pi / 3.
    """
    grains = [[-3.0, 5.0, 5.0], [4, 2, 2], [4, 8, 2], [4, 5, 8], [11, 5, 5]]
    spheres = Snapshot.from_arrays(grains, [5.0, 2, 2, 2, 3], box=[0, 10, 0, 10, 0, 10])
    network = build_network(spheres)
    cap = network.image_grain == 0
    h = 2.0 * (3.0 * 16.0 + 4.0) / (4.0 * 16.0)
    assert network.image_height[cap] == pytest.approx(h, rel=1e-6)
    assert 2.0 / 3.0 * network.image_radius[cap] ** 3 == pytest.approx(52.0 / 3.0, rel=1e-3)
    assert network.image_radius[cap] ** 3 / h == pytest.approx(16.0, rel=1e-3)
    facet = network.image_position[network.throat_images]
    cut, grain = cut_corners(network, slice(0, len(facet)), facet), network.throat_grains
    for which, away, radius in ((0, 3.0, 5.0), (4, 1.0, 3.0)):
        ways = cut[grain == which]
        assert len(ways)
        assert np.linalg.norm(ways[:, :3], axis=1) == pytest.approx(away, rel=1e-9)
        assert ways[:, 3] == pytest.approx(radius, rel=1e-3)
    assert not cut[(grain != 0) & (grain != 4)].any()


# ------------------------------------------------------------------------------------------------
# Side walls that hold the fluid.


def test_walls_that_hold_the_fluid_leave_less_of_it():
    for name, made in PACKS.items():
        held, slips = (permeability(made(), walls=walls) for walls in ("no-slip", "slip"))
        assert 0.2 < held / slips < 0.8, name
    pack = PACKS["next to walls"]()
    for law, periodic in (("effective", NONE), ("lubrication", SIDES)):  # these know no walls
        held, slips = (
            permeability(pack, law, periodic=periodic, walls=w) for w in ("no-slip", "slip")
        )
        assert held == slips, law
    network = build_network(pack, periodic=NONE, walls="no-slip")
    halves = half_resistances(network).sum(axis=1)
    assert LAWS["lubrication"](network) == pytest.approx(1.0 / halves)


def test_a_throat_cut_by_a_wall_carries_less_than_half_of_one_that_slips():
    network = build_network(PACKS["next to walls"](), periodic=NONE, walls="no-slip")
    order, place, _ = wall_cuts(network)
    cut = np.flatnonzero((order[:, 0] >= 0) & (network.throat_share == 0.5))
    assert len(cut) > 100
    for t in cut:
        (h, g, apart), (r, s) = place[t], network.throat_corner_radius[t][order[t]]
        lower = np.array([[0.0, 0.0], [2 * h, 0.0], [h + g, apart]])
        upper = np.array([[0.0, 0.0], [2 * g, 0.0], [h + g, apart]])
        slips = uneven_flux(lower, np.array([r, r, s])) + uneven_flux(upper, np.array([s, s, r]))
        assert wall_flux(place[t], r, s) < 0.5 * slips


def test_a_grain_centred_on_a_wall_has_one_triangle_for_the_whole_section():
    """A row of grains on the wall and others above: a small lift splits each triangle in two."""
    pack, measured = random_pack(60, 0.45, periodic=False), []
    for lift in (0.0, 1e-4):
        position = pack.position.copy()
        position[np.argsort(position[:, 1])[:4], 1] = lift
        network = build_network(
            snapshot(position, 1.0, pack.box), periodic=(True, False, True), walls="no-slip"
        )
        measured.append(whole_permeability(network, LAWS["lubrication"](network))[0])
        assert np.any(wall_cuts(network).part == 2.0) == (lift == 0.0)
    assert measured[0] == pytest.approx(measured[1], rel=2e-2)


def test_an_analysis_holds_the_fluid_at_the_walls_unless_told_otherwise():
    pack = PACKS["next to walls"]()
    for given, walls in (({}, "no-slip"), ({"walls": "slip"}, "slip")):
        k = analyse(pack, None, periodic=NONE, options=AnalysisChoices.of_pack(**given)).k_initial
        assert k == pytest.approx(permeability(pack, walls=walls), rel=1e-9), walls
    with pytest.raises(CaseError, match=r"analysis.walls: 'sticky'.*slip"):
        analyse(pack, None, periodic=NONE, options=AnalysisChoices.of_pack(walls="sticky"))


# ------------------------------------------------------------------------------------------------
# Throats that fines bound, in the network of all spheres.


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40, aspect=2.0), 60, 0.2)


@pytest.fixture(scope="module")
def network(pack):
    return build_network(pack, periodic="yz")


def halves_of(network, throats):
    """Resistances (K,) of throats as ones that fines bound."""
    every, heights = np.ones(len(throats), bool), nodes_of(network).heights[throats]
    return bounded_resistances(network, throats, every, heights)[0].sum(axis=1)


def test_grains_alone_keep_the_law_of_grains_and_fines_are_marked(pack, network):
    grains = build_network(pack.grains(), periodic="yz")
    assert not grains.image_fine.any()
    assert not bounded_by_fines(grains).any()
    assert np.array_equal(deposit_resistances(grains), half_resistances(grains, fourth=True))
    assert np.array_equal(network.image_fine, (pack.kind == Kind.FINE)[network.image_grain])
    # in a pack with fines those that no fine bounds keep it
    halves, before = deposit_resistances(network), half_resistances(network, fourth=True)
    bounded = bounded_by_fines(network)
    mixed = deposit.mixed_pores(network)[network.pore_group[network.throat_pores]].any(axis=1)
    assert 0.2 < bounded.mean() < 0.9
    assert np.any(~bounded & ~mixed)
    assert np.array_equal(halves[~bounded & ~mixed], before[~bounded & ~mixed])
    assert np.all(halves[bounded].sum(axis=1) > 0)
    # the two laws describe the same throats
    both = bounded & np.isfinite((halves + before).sum(axis=1))
    ratio = np.log(halves[both].sum(axis=1) / before[both].sum(axis=1))
    assert abs(np.median(ratio)) < 0.3


def test_a_mirrored_periodic_pack_has_the_same_throats(pack):
    """The rays of a section start from no edge of it."""
    place = pack.position.copy()
    place[:, 1] = pack.box[1].sum() - place[:, 1]
    one, other = (
        np.sort(deposit_resistances(build_network(spheres, periodic="xyz")), None)
        for spheres in (pack, replace(pack, position=place))
    )
    assert other == pytest.approx(one, rel=1e-9)


def test_what_spreading_behind_a_node_adds():
    """Four throats of one mixed pore with 1/a of 1, 2, 4 and 4.

    Their corners are three, two, no and three grains, and the first has half of the resistance.
    """
    pairs = np.array([[0, 1], [0, 2], [0, 3], [0, 4]])
    network = replace(
        network_of(np.zeros((5, 3)), pairs, [[0, 1]] * 4),
        throat_images=np.array([[0, 1, 2], [0, 1, 3], [3, 4, 5], [0, 1, 2]]),
        image_fine=np.array([False, False, False, True, True, True]),
    )
    ends = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [4.0, np.nan, 4.0], [4.0, 4.0, 4.0]])
    halves = np.array([[2.0, 3.0], [5.0, 5.0], [4.0, 6.0], [5.0, 5.0]])
    mixed = np.array([True, False, False, False, False])
    added = deposit.node_resistances(network, np.arange(4), halves, ends, mixed)
    wide = 5.0 / (2.0 + 1.0 / 8.0 + 2.0 / 64.0)
    each = 0.6 * 8.0 / (3.0 * np.pi) * np.sqrt(8.0 / 3.0)
    by_hand = [0.0, 2.0 * each * (8.0 - wide), 0.0, 3.0 * each * (64.0 - wide)]
    assert added[:, 0] == pytest.approx(by_hand)
    assert not added[:, 1].any()


def test_throats_with_fines_next_to_walls_carry_less_than_where_walls_slip():
    """Those that a wall cuts among them; between grains alone these keep their trapezoid."""
    pack = with_fines(random_pack(60, 0.5, periodic=False), 150, 0.2)
    free, held = (build_network(pack, periodic=NONE, walls=one) for one in ("slip", "no-slip"))
    assert np.array_equal(bounded_by_fines(held), bounded_by_fines(free))
    ends = held.pore_group[held.throat_pores]
    throats = np.flatnonzero(bounded_by_fines(held) & (ends[:, 0] != ends[:, 1]))
    slips, holds = halves_of(free, throats), halves_of(held, throats)
    both = np.isfinite(slips) & np.isfinite(holds)
    for part, least, most in ((1, 0.0, 1.1), (0.5, 2.0, np.inf)):
        some = both & (held.throat_share[throats] == part)
        more = holds[some] / slips[some]
        assert len(more) > 500
        assert more.min() > 0.8
        assert least < np.median(more) < most
    grains = (held.throat_share == 0.5) & ~held.image_fine[held.throat_images].any(axis=1)
    assert grains.any()
    own = half_resistances(held, fourth=True)[grains]
    assert np.all(deposit_resistances(held)[grains] >= own)
