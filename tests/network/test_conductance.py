"""Conductances of throats: laws on paper, Stokes flow in lattices and slabs, walls, fines."""

import numpy as np
import pytest

from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws import deposit_resistances as deposit
from fdnet.network.laws.deposit_resistances import bounded_by_fines, deposit_resistances
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.network.states import cut_out
from fdnet.network.stokes import extrapolate, solve_slab
from fdnet.spheres.snapshot import Kind
from tests.network.packs import body_centred, random_pack, with_fines

ALL, NONE, SIDES = (True,) * 3, (False,) * 3, (False, True, True)


def test_a_body_centred_throat_by_the_formulas_on_paper():
    """Every facet of the BCC tetrahedra has sides 2, 2, 4/sqrt(3) in units of the radius."""
    network, long = build_network(body_centred(), periodic=ALL), 4 / np.sqrt(3)
    area = long * np.sqrt(4 - long**2 / 4) / 2
    circle = 4 * long / (4 * area)
    assert network.throat_radius == pytest.approx(circle - 1, rel=1e-6)
    assert network.throat_area == pytest.approx(area - np.pi / 2, rel=1e-6)
    assert network.throat_length == pytest.approx(np.sqrt(2 / 3), rel=1e-5)
    effective = np.sqrt((area - np.pi / 2) / np.pi)
    for law, radius in (("thesis", circle - 1), ("effective", effective)):
        by_hand = np.pi * radius**4 / (8 * np.sqrt(2 / 3))
        assert LAWS[law](network) == pytest.approx(by_hand, rel=1e-4), law


def test_thin_slabs_against_resolved_stokes_flow():
    """Between pressure planes that cut caps off grains, on two grids each; nothing is fitted."""
    for count, more, share, error in [
        (30, {}, (0.2, 0.8), 0.035),
        (30, {"spread": 0.3}, (0.2, 0.8), 0.03),
        (30, {"spread": 0.3}, (0.35, 0.65), 0.06),
        (60, {"aspect": 2.0}, (0.35, 0.65), 0.03),
    ]:
        pack = random_pack(count, **more)
        span = tuple(part * pack.box[0, 1] for part in share)
        exact = extrapolate(*(solve_slab(pack, span, cells=cells) for cells in (32, 48))).k
        network = build_network(cut_out(pack, span, SIDES), periodic=SIDES)
        k = whole_permeability(network, 1.0 / half_resistances(network).sum(axis=1))[0]
        assert k == pytest.approx(exact, rel=error), (count, more, share)


# ---- Throats that fines bound, in the network of all spheres.
@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40, aspect=2.0), 60, 0.2)


@pytest.fixture(scope="module")
def network(pack):
    return build_network(pack, periodic="yz")


def test_grains_alone_keep_the_law_of_grains_and_fines_are_marked(pack, network):
    grains = build_network(pack.grains(), periodic="yz")
    assert not grains.image_fine.any()
    assert not bounded_by_fines(grains).any()
    assert np.array_equal(deposit_resistances(grains), half_resistances(grains, around=True))
    assert np.array_equal(network.image_fine, (pack.kind == Kind.FINE)[network.image_grain])
    # in a pack with fines those that no fine bounds keep it
    halves, before = deposit_resistances(network), half_resistances(network, around=True)
    bounded = bounded_by_fines(network)
    mixed = deposit.mixed_pores(network)[network.pore_group[network.throat_pores]].any(axis=1)
    assert 0.2 < bounded.mean() < 0.9
    assert np.any(~bounded & ~mixed)
    assert np.array_equal(halves[~bounded & ~mixed], before[~bounded & ~mixed])
    assert np.all(halves[bounded].sum(axis=1) > 0)
