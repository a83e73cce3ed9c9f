"""Local Kozeny factors by the side of a throat: closed forms, exact splits, limits."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.network.fines.deposit import (
    deposit_in_pores,
    deposit_on_sides,
    size_classes,
    wall_distance,
)
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.laws.kozeny_damage import _kept
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.laws.pyramids import side_voids
from fdnet.network.network import build_network
from fdnet.spheres.snapshot import Kind
from tests.network.packs import random_pack, snapshot, with_fines

ALL = (True, True, True)


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40), 150, 0.2)


@pytest.fixture(scope="module")
def network(pack):
    return build_network(pack.grains(), periodic=ALL)


def even_state(network, *, volume, surface, layer=1e3, fine=0.0):
    """Fines that take the same share of every pore and every side."""
    void, wall = side_voids(network)
    pores = len(network.pore_volume)
    return SimpleNamespace(
        pore_solid_volume=volume * network.pore_volume,
        pore_solid_surface=surface * network.pore_wall_surface,
        pore_fine_volume=np.full(pores, fine),
        pore_layer=np.full(pores, layer),
        side_solid_volume=volume * void,
        side_solid_surface=surface * wall,
    )


def factor(network, state):
    clean = LAWS["lubrication"](network)
    damage = DAMAGE_LAWS["side-kozeny"](network, state, clean)
    return damage, damage.conductance / clean


def test_no_fines_leave_everything_as_it_is(network):
    damage, kept = factor(network, even_state(network, volume=0.0, surface=0.0))
    assert kept == pytest.approx(1.0, abs=1e-14)
    assert set(damage.law_used) == {"clean"}


def test_an_even_bed_gives_the_kozeny_factor_everywhere(network):
    _, kept = factor(network, even_state(network, volume=0.3, surface=2.0))
    assert kept == pytest.approx(0.7**3 / 9.0, rel=1e-9)


def test_a_thin_film_takes_the_share_of_its_ring(network):
    """Layer of 2/10 of the tube radius, that is 4/10 of the hydraulic radius: share 1 - 0.8^2."""
    hydraulic = network.pore_volume.sum() / network.pore_wall_surface.sum()
    _, kept = factor(network, even_state(network, volume=0.1, surface=1.0, layer=0.4 * hydraulic))
    assert kept == pytest.approx((1 - 0.36 * 0.1) ** 3 / 4.0, rel=1e-9)


@pytest.mark.parametrize("law", DAMAGE_LAWS)
def test_fines_inside_grains_never_raise_a_conductance(network, pack, law):
    """Their layer would be negative; counted instead."""
    grains = pack.grains()
    fines = snapshot(grains.position, 0.1, pack.box, Kind.FINE)
    clean = LAWS["lubrication"](network)
    damage = DAMAGE_LAWS[law](network, measure_occupancy(network, fines), clean)
    assert np.all(damage.conductance <= clean * (1.0 + 1e-12))
    assert law != "side-kozeny" or damage.counts["layers_within_grains"] > 100


def test_fines_larger_than_a_pore_count_by_the_whole_pore(network):
    state = even_state(network, volume=0.2, surface=0.5, fine=1e6)
    state.side_solid_volume = np.zeros_like(state.side_solid_volume)
    state.side_solid_surface = np.zeros_like(state.side_solid_surface)
    assert factor(network, state)[1] == pytest.approx(0.8**3 / 1.5**2, rel=1e-6)


def test_filled_pores_are_closed_and_counted(network):
    damage, kept = factor(network, even_state(network, volume=1.0, surface=1.0))
    assert not kept.any()
    assert damage.counts["pores_filled"] == len(network.pore_volume)
    assert set(damage.law_used) == {"blocked"}


def test_resistances_in_series_are_raised_side_by_side():
    resistance = np.array([[1.0, 3.0], [1.0, 3.0], [0.0, 2.0], [0.0, 1.0]])
    factor = np.array([[0.5, 0.25], [1.0, 0.0], [0.0, 0.5], [1.0, 1.0]])
    assert _kept(resistance, factor) == pytest.approx([4.0 / 14.0, 0.0, 0.5, 1.0])


def whole_pores(network):
    """Pores with their power centre inside, and their throats' sides as a sum over these pores."""
    behind = np.zeros(len(network.pore_volume), bool)
    for side in (0, 1):
        np.logical_or.at(
            behind, network.throat_pores[:, side], network.throat_heights[:, side] <= 1e-6
        )
    return ~behind


def summed(network, by_side):
    total = np.zeros(len(network.pore_volume))
    for side in (0, 1):
        np.add.at(total, network.throat_pores[:, side], by_side[:, side])
    return total


def test_sides_add_up_to_their_pore(network, pack):
    whole = whole_pores(network)
    assert whole.sum() > 50
    void, wall = side_voids(network)
    assert summed(network, void)[whole] == pytest.approx(network.pore_volume[whole], rel=1e-5)
    assert summed(network, wall)[whole] == pytest.approx(
        network.pore_wall_surface[whole], rel=1e-5
    )
    volume, surface, _, _ = deposit_in_pores(network, pack.fines())
    side_volume, side_surface = deposit_on_sides(network, pack.fines())
    assert summed(network, side_volume)[whole] == pytest.approx(volume[whole], rel=1e-5, abs=1e-9)
    assert summed(network, side_surface)[whole] == pytest.approx(
        surface[whole], rel=1e-5, abs=1e-9
    )


def test_signed_voids_add_up_to_the_pore_of_any_shape(network):
    void, wall = side_voids(network)
    assert summed(network, void) == pytest.approx(network.pore_volume, rel=1e-5, abs=1e-7)
    assert summed(network, wall) == pytest.approx(network.pore_wall_surface, rel=1e-5, abs=1e-7)


def test_layer_of_fines_on_grains_is_a_diameter_thick(network, pack):
    grain = pack.grains().position[0]
    fine = snapshot([grain + np.array([1.2, 0.0, 0.0])], 0.2, pack.box, Kind.FINE)
    near = wall_distance(network, fine.position)
    volume, _, whole, layer = deposit_in_pores(network, fine)
    held = volume > 0
    assert layer[held] == pytest.approx(near[0] + 0.2)
    assert whole[held] == pytest.approx(4 / 3 * np.pi * 0.2**3)
    assert volume.sum() == pytest.approx(4 / 3 * np.pi * 0.2**3)


@pytest.mark.parametrize("spread", [0.0, 0.3, 0.8])
def test_distance_to_the_nearest_of_unequal_grains(spread):
    """The nearest surface, whichever centres are nearer; by a search of all grains."""
    pack = random_pack(120, spread=spread)
    network = build_network(pack, periodic=ALL)
    place = np.random.default_rng(7).random((2000, 3)) * pack.box[:, 1]
    away = pack.position - place[:, None]
    away -= pack.box[:, 1] * np.round(away / pack.box[:, 1])
    nearest = np.min(np.linalg.norm(away, axis=2) - pack.radius, axis=1)
    assert wall_distance(network, place) == pytest.approx(nearest, abs=1e-12)


def test_layer_of_fines_at_two_distances_spreads(network, pack):
    """Same pore filled from two balls of radius r at y1 and y2: mean + sqrt(5 variance + r^2)."""
    centre = network.pore_power_centre[np.argmax(network.pore_radius)]
    places = centre + np.array([[0.0, 0.0, 0.0], [0.05, 0.02, -0.03]])
    y = wall_distance(network, places)
    fines = snapshot(places, 0.01, pack.box, Kind.FINE)
    _, _, _, layer = deposit_in_pores(network, replace(fines))
    assert layer.max() == pytest.approx(y.mean() + np.sqrt(5 * y.var() + 0.01**2), rel=1e-9)


def test_size_classes_hold_every_fine_once_within_a_factor_of_two():
    radius = np.array([0.1, 0.19, 0.2, 1.0, 0.4, 0.1])
    classes = size_classes(radius)
    assert sorted(np.concatenate(classes)) == list(range(6))
    assert all(radius[one].max() < 2 * radius[one].min() for one in classes)


def test_fines_of_many_sizes_fill_as_each_alone(network, pack):
    places = network.pore_power_centre[:12] + 0.1
    radius = np.geomspace(0.02, 0.6, 12)
    together = deposit_in_pores(network, snapshot(places, radius, pack.box, Kind.FINE))[0]
    alone = [
        deposit_in_pores(network, snapshot(places[[i]], radius[i], pack.box, Kind.FINE))[0]
        for i in range(12)
    ]
    assert together == pytest.approx(np.sum(alone, axis=0), rel=1e-12, abs=1e-15)


def test_resistance_lies_on_the_side_of_the_centres_and_closed_throats_have_none(network):
    resistance = half_resistances(network, heights=network.throat_heights)
    for side in (0, 1):
        behind = network.throat_heights[:, side] < 0
        assert behind.any()
        assert np.all(resistance[behind, side] == 0)
        assert np.all(resistance[behind, 1 - side] > 0)
    shut = half_resistances(replace(network, throat_radius=np.zeros(len(network.throat_radius))))
    assert np.all(np.isinf(shut))


def test_distance_from_the_nearest_grain_is_the_same_in_every_period(network, pack):
    places = network.pore_power_centre[:5]
    period = pack.box[:, 1] - pack.box[:, 0]
    moved = wall_distance(network, places + period * [[2, 0, -1]])
    assert moved == pytest.approx(wall_distance(network, places), abs=1e-9)


def test_a_side_filled_by_its_fines_closes_the_throat_though_its_pore_is_open(network):
    state = even_state(network, volume=0.3, surface=1.0)
    throat = int(np.argmax(network.throat_heights.min(axis=1)))
    state.side_solid_volume[throat, 0] = 1.01 * side_voids(network)[0][throat, 0]
    damage, kept = factor(network, state)
    assert kept[throat] == 0
    assert np.sum(kept == 0) == 1
    assert (damage.counts["pores_filled"], damage.counts["sides_filled"]) == (0, 1)
