"""The network of a pack: exact porosities, unique pores, matching facets, errors."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.errors import NetworkError
from fdnet.network.network import build_network
from fdnet.spheres.geometry import measure_porosity
from tests.network.packs import body_centred, face_centred, random_pack, simple_cubic, snapshot

ALL, NONE, SIDES = (True,) * 3, (False,) * 3, (False, True, True)


@pytest.mark.parametrize(
    ("pack", "expected"),
    [
        (simple_cubic(), 1 - np.pi / 6),
        (face_centred(), 0.259520),
        (body_centred(), 1 - np.pi * np.sqrt(3) / 8),
    ],
)
@pytest.mark.parametrize("periodic", [ALL, SIDES])
def test_void_of_the_pores_is_the_known_porosity(pack, expected, periodic):
    network = build_network(pack, periodic=periodic, walls="slip")
    void = np.sum(network.pore_share * network.pore_volume) / np.prod(pack.box[:, 1])
    if periodic == SIDES:
        # the mirrored faces cut the lattice, so the porosity comes from chords, a second method
        chords = measure_porosity(pack, periodic=SIDES, lines=20_000)
        assert chords.mean > expected + 0.03
        expected, tolerance = chords.mean, 5 * chords.standard_error
    else:
        tolerance = 1e-6
    assert void == pytest.approx(expected, abs=tolerance)
    assert network.area == pytest.approx(pack.box[1, 1] ** 2)


def test_pores_of_overlapping_grains_hold_the_same_void_as_chords():
    pack = random_pack(80, 0.66, spread=0.2)
    network = build_network(pack, periodic=ALL)
    porosity = measure_porosity(pack, periodic=ALL, lines=20_000)
    assert porosity.mean > porosity.sum + 1e-4  # they do overlap
    void = np.sum(network.pore_volume) / np.prod(pack.box[:, 1])
    assert void == pytest.approx(porosity.mean, abs=5 * porosity.standard_error + 1e-5)


def test_wall_surface_of_touching_grains_is_their_whole_surface():
    pack = face_centred()
    network = build_network(pack, periodic=ALL)
    assert np.sum(network.pore_wall_surface) == pytest.approx(4 * np.pi * len(pack))


def test_wall_surface_hides_the_caps_of_overlapping_pairs():
    pack = random_pack(80, 0.66)
    apart = pack.position[:, None] - pack.position[None]
    apart -= pack.box[:, 1] * np.round(apart / pack.box[:, 1])
    height = np.maximum(1 - 0.5 * np.linalg.norm(apart, axis=2), 0)[~np.eye(80, dtype=bool)]
    assert height.sum() > 0.5
    surface = np.sum(build_network(pack, periodic=ALL).pore_wall_surface)
    assert surface == pytest.approx(4 * np.pi * 80 - 2 * np.pi * height.sum(), rel=1e-9)


@pytest.mark.parametrize("periodic", [ALL, SIDES, (True, False, True), NONE])
def test_tetrahedra_tile_and_facets_pair(periodic):
    pack = random_pack(120, 0.5, periodic=False)
    network = build_network(pack, periodic=periodic, walls="slip")
    assert network.counts["throats_unmatched"] == 0
    assert (
        network.throat_heights.sum(axis=1).min() > -1e-9
    )  # Delaunay: centres in order along the normal
    places = len(np.unique(network.pore_position, axis=0))  # one for all parts of a polyhedron
    assert 0.99 * (network.pore_group.max() + 1) < places <= network.pore_group.max() + 1
    filled = np.sum(network.pore_share * network.pore_tetra_volume)
    assert filled == pytest.approx(network.area * pack.box[0, 1], rel=1e-12)
    assert filled == pytest.approx(np.prod(pack.box[:, 1]), rel=1e-12)
    if periodic == ALL:
        assert len(network.throat_pores) == 2 * len(network.pore_position)


def test_throat_ends_are_its_pores_up_to_whole_periods():
    pack = random_pack(60)
    network = build_network(pack, periodic=ALL)
    size = pack.box[:, 1]
    place = (
        network.pore_position[network.throat_pores]
        + np.stack([0 * network.throat_shift, network.throat_shift], axis=1) * size
    )
    assert network.throat_ends == pytest.approx(place, abs=1e-9)
    assert np.all(network.pore_position >= 0)
    assert np.all(network.pore_position < size)
    # the two places are those next to the facet, not an image of them elsewhere
    away = np.linalg.norm(
        network.throat_ends - network.throat_corner.mean(axis=1)[:, None], axis=2
    )
    assert away.max() < 2.5
    # both pores hold the throat's three grains
    for side in (0, 1):
        grains = network.pore_grains[network.throat_pores[:, side]]
        assert np.all(np.any(grains[:, :, None] == network.throat_grains[:, None], axis=1))


def test_pores_on_the_x_faces_lie_on_them():
    pack = random_pack(100, 0.5, periodic=False)
    network = build_network(pack, periodic=SIDES, walls="slip")
    on_face = network.pore_share < 1
    assert np.all(network.pore_share[on_face] == 0.5)
    assert set(network.pore_position[on_face, 0]) == {0.0, pack.box[0, 1]}
    inner = network.pore_position[~on_face, 0]
    assert inner.min() > 0
    assert inner.max() < pack.box[0, 1]


def test_of_two_grains_at_one_place_one_is_left_out():
    pack = random_pack(30)
    double = np.vstack(
        [pack.position, pack.position[7] + [0, pack.box[1, 1], 0]]
    )  # the image across the period
    plain = build_network(pack, periodic=ALL)
    network = build_network(snapshot(double, 1.0, pack.box), periodic=ALL)
    assert network.counts["grains_inside_others"] == 1
    assert network.pore_volume.sum() == pytest.approx(plain.pore_volume.sum(), rel=1e-9)


def test_three_grains_are_refused():
    with pytest.raises(NetworkError, match="at least 4"):
        build_network(snapshot(np.zeros((3, 3)), 0.1, [[0, 10]] * 3), periodic=NONE, walls="slip")


def test_one_layer_between_walls_is_a_stack_of_its_mirror_images():
    position = np.random.default_rng(0).random((9, 3)) * [8, 8, 0] + 1
    network = build_network(snapshot(position, 0.1, [[0, 10]] * 3), periodic=NONE, walls="slip")
    assert np.sum(network.pore_share * network.pore_tetra_volume) == pytest.approx(1000, rel=1e-12)


def test_grains_out_of_reach_are_left_out_and_counted():
    pack = random_pack(60, 0.5, periodic=False)
    position = np.vstack([[[-3.0, 1, 1]], pack.position])
    network = build_network(
        snapshot(position, np.append(1.0, pack.radius), pack.box), periodic=NONE, walls="slip"
    )
    alone = build_network(pack, periodic=NONE, walls="slip")
    assert network.counts["grains_outside_box"] == 1
    assert np.array_equal(network.pore_grains, alone.pore_grains + 1)
    assert np.array_equal(network.throat_grains, alone.throat_grains + 1)


def test_heavily_overlapping_grains_close_throats():
    pack = random_pack(60)
    network = build_network(replace(pack, radius=pack.radius * 1.25), periodic=ALL)
    assert network.counts["throats_closed"] == np.sum(network.throat_radius == 0) > 0
    assert np.all(network.throat_radius >= 0)
