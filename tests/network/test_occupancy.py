"""Fines in throats and pores: volumes against Monte Carlo, closed forms and sums."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial import cKDTree

from fdnet.errors import CaseError
from fdnet.network.fines.deposit import images_near
from fdnet.network.fines.occupancy import (
    Pairs,
    covers_section,
    exact_volume,
    measure_occupancy,
    two_plane_volume,
)
from fdnet.network.network import build_network
from fdnet.spheres.snapshot import Kind
from tests.network.closed_forms import disc_lens_area
from tests.network.networks import chain
from tests.network.packs import random_pack, snapshot, with_fines

ALL, NONE = (True,) * 3, (False,) * 3
CASES = np.array(
    [  # sphere, offset, depth, tube, length
        [0.5, 0.75, 1.0, 1.0, 3.0],
        [0.5, 1.2, 0.1, 1.0, 3.0],
        [2.0, 0.5, 1.0, 1.0, 3.0],
        [1.0, 0.0, -0.3, 1.0, 3.0],
        [0.3, 0.2, 1.0, 1.0, 3.0],
        [0.8, 0.6, 2.9, 1.0, 3.0],
        [1.5, 2.2, 0.5, 1.0, 1.0],
        [0.4, 0.1, 0.2, 1.0, 0.3],
    ]
)


def pairs_of(rows):
    return Pairs(
        **dict(
            zip(
                ("sphere", "offset", "depth", "tube", "length"), np.atleast_2d(rows).T, strict=True
            )
        )
    )


@pytest.mark.parametrize("row", CASES)
def test_sphere_in_cylinder_against_random_points(row):
    sphere, offset, depth, tube, length = row
    point = np.random.default_rng(11).uniform(-sphere, sphere, (1_000_000, 3))
    point = point[np.sum(point**2, axis=1) < sphere**2]
    inside = (point[:, 2] + depth > 0) & (point[:, 2] + depth < length)
    inside &= (point[:, 0] + offset) ** 2 + point[:, 1] ** 2 < tube**2
    ball = 4 / 3 * np.pi * sphere**3
    assert exact_volume(pairs_of(row))[0] / ball == pytest.approx(
        inside.mean(), abs=4 * 0.5 / np.sqrt(len(point))
    )


def test_centred_sphere_wider_than_the_tube_is_the_napkin_ring():
    """Tube through the centre: 4/3 pi (a^3 - (a^2 - r^2)^1.5)."""
    volume = exact_volume(pairs_of([2.0, 0.0, 5.0, 1.0, 10.0]))[0]
    assert volume == pytest.approx(4 / 3 * np.pi * (8 - 3**1.5), rel=1e-14)


def test_volume_within_a_millionth_of_adaptive_quadrature():
    rng = np.random.default_rng(6)
    for _ in range(150):
        sphere, length = 10 ** rng.uniform(-1.3, 0.5), rng.uniform(0.1, 4)
        offset = rng.choice([0.0, 1.0, rng.uniform(0, 1 + sphere), rng.uniform(0, 1 + sphere)])
        depth = rng.uniform(-0.9, 0.9) * sphere + rng.uniform(0, length)
        low, high = max(-sphere, -depth), min(sphere, length - depth)
        kinks = [
            sign * np.sqrt(max(sphere**2 - (1 + side * offset) ** 2, 0))
            for sign in (-1, 1)
            for side in (-1, 1)
        ]
        edges = sorted([low, high, *(z for z in kinks if low < z < high)])

        def section(z, sphere=sphere, offset=offset):
            return float(disc_lens_area(np.sqrt(max(sphere**2 - z**2, 0.0)), 1.0, offset))

        expected = sum(quad(section, *piece, epsabs=1e-12)[0] for piece in pairwise(edges))
        volume = exact_volume(pairs_of([sphere, offset, depth, 1.0, length]))[0]
        assert volume == pytest.approx(expected, abs=1e-6 * 4 / 3 * np.pi * sphere**3)


@pytest.mark.parametrize(
    ("sphere", "offset", "ratio"),
    [  # measured apart by quadrature of the same reading
        (0.1, 1.0, 0.981),
        (0.2, 0.9, 0.984),
        (0.5, 0.75, 0.942),
        (0.5, 1.25, 0.886),
        (0.8, 0.5, 0.877),
        (1.0, 0.5, 0.770),
        (1.0, 1.5, 0.850),
        (2.0, 0.5, 1.016),
        (2.0, 1.25, 0.859),
    ],
)
def test_two_plane_estimate_over_exact(sphere, offset, ratio):
    pair = pairs_of([sphere, offset, 50.0, 1.0, 100.0])
    assert two_plane_volume(pair)[0] / exact_volume(pair)[0] == pytest.approx(ratio, abs=1.5e-3)


def test_estimates_agree_where_no_plane_is_needed():
    whole, outside = pairs_of([0.3, 0.6, 1.0, 1.0, 3.0]), pairs_of([0.3, 1.4, 1.0, 1.0, 3.0])
    assert two_plane_volume(whole) == pytest.approx(4 / 3 * np.pi * 0.027)
    assert exact_volume(whole) == pytest.approx(4 / 3 * np.pi * 0.027)
    assert two_plane_volume(outside)[0] == exact_volume(outside)[0] == 0
    half = pairs_of([0.3, 0.2, 0.0, 1.0, 3.0])
    assert two_plane_volume(half) == pytest.approx(2 / 3 * np.pi * 0.027)


@pytest.mark.parametrize(
    ("row", "covers"),
    [
        ([1.01, 0.0, 1.0, 1.0, 3.0], True),
        ([0.99, 0.0, 1.0, 1.0, 3.0], False),
        ([1.5, 0.49, 1.0, 1.0, 3.0], True),
        ([1.5, 0.51, 1.0, 1.0, 3.0], False),
        ([1.25, 0.0, -0.74, 1.0, 3.0], True),
        ([1.25, 0.0, -0.76, 1.0, 3.0], False),
        ([1.25, 0.0, 3.74, 1.0, 3.0], True),
        ([1.0, 0.0, 1.0, 0.0, 3.0], False),
    ],
)
def test_blocking_needs_a_whole_section_covered(row, covers):
    assert covers_section(pairs_of(row))[0] == covers


def test_throat_porosity_of_one_fine_in_a_tube():
    network = chain(3)
    fine = snapshot([[1.5, 0.5, 0.5]], 0.05, network.box, Kind.FINE)
    occupancy = measure_occupancy(network, fine)
    assert occupancy.throat_porosity == pytest.approx([1, 1 - 4 / 3 * 0.05**3 / 0.1**2, 1])
    assert occupancy.throat_fines.tolist() == [0, 1, 0]
    assert occupancy.throat_fine_radius == pytest.approx([0, 0.05, 0])
    assert occupancy.pair_distance == pytest.approx([0])
    assert not occupancy.blocked.any()


def test_fine_before_the_face_blocks_the_throat_it_reaches_into():
    network = chain(3)
    fine = snapshot([[-0.05, 0.5, 0.5]], 0.12, network.box, Kind.FINE)
    assert measure_occupancy(network, fine).blocked.tolist() == [True, False, False]


def test_fines_fill_the_pores_with_their_whole_volume_and_surface():
    pack = with_fines(random_pack(60), 300, 0.2)
    network = build_network(pack.grains(), periodic=ALL)
    occupancy = measure_occupancy(network, pack.fines())
    assert occupancy.pore_solid_volume.sum() == pytest.approx(
        300 * 4 / 3 * np.pi * 0.2**3, rel=1e-9
    )
    assert occupancy.pore_solid_surface.sum() == pytest.approx(300 * 4 * np.pi * 0.2**2, rel=1e-7)


def test_fine_in_one_pore_against_random_points():
    pack = random_pack(40)
    network = build_network(pack, periodic=ALL)
    pore = int(np.argmax(network.pore_volume))
    corner = network.pore_corner[pore]
    place = corner.mean(axis=0) + np.array([0.3, 0.1, 0.0])
    volumes = measure_occupancy(
        network, snapshot([place], 0.7, pack.box, Kind.FINE)
    ).pore_solid_volume[pore]
    share = np.random.default_rng(1).dirichlet(np.ones(4), 500_000)
    inside = np.linalg.norm(share @ corner - place, axis=1) < 0.7
    expected = inside.mean() * network.pore_tetra_volume[pore]
    assert volumes == pytest.approx(expected, rel=4 / np.sqrt(inside.sum()))


def volume_inside(fines, periodic):
    """Volume of balls on this side of the walls, by 20,000 points in each that a wall may cut."""
    point = np.random.default_rng(2).normal(size=(20_000, 3))
    point *= (np.random.default_rng(3).random(20_000) ** (1 / 3) / np.linalg.norm(point, axis=1))[
        :, None
    ]
    walled = ~np.array(periodic)
    low, high = fines.box.T
    total = 0.0
    for centre, radius in zip(fines.position, fines.radius, strict=True):
        place = centre + radius * point
        inside = np.all(((place > low) & (place < high)) | ~walled, axis=1)
        total += inside.mean() * 4 / 3 * np.pi * radius**3
    return total


@pytest.mark.parametrize("periodic", [ALL, (False, True, True), (True, False, True), NONE])
def test_every_fine_in_the_box_counts_once(periodic):
    pack = with_fines(random_pack(60), 200, 0.2)
    fines = pack.fines()
    upstream = replace(fines, position=fines.position - [[0.5 * fines.position[:, 0].max(), 0, 0]])
    network = build_network(pack.grains(), periodic=periodic, walls="slip")
    for deposit in (fines, upstream):
        occupancy = measure_occupancy(network, deposit)
        by_pore = network.pore_share * occupancy.pore_solid_volume
        assert by_pore.sum() == pytest.approx(volume_inside(deposit, periodic), rel=1e-3)


def test_a_throat_between_pores_at_one_place_is_a_disc_across_x():
    network = replace(chain(1), pore_position=np.full((2, 3), 0.5), throat_length=np.array([1e-3]))
    occupancy = measure_occupancy(
        network, snapshot([[0.49, 0.52, 0.5]], 0.05, network.box, Kind.FINE)
    )
    assert occupancy.throat_solid_volume == pytest.approx(
        [np.pi * (0.05**2 - 0.01**2) * 1e-3], rel=0.02
    )
    assert occupancy.pair_distance == pytest.approx([0.2])


@pytest.mark.parametrize("walls", [[0], [1], [1, 2], [0, 1, 2]])
def test_walls_mirror_the_fines_as_a_doubled_periodic_pack_has_them(walls):
    rng = np.random.default_rng(9)
    box = np.array([[0.0, 5.0], [1.0, 5.0], [-2.0, 4.0]])
    position = box[:, 0] + rng.random((200, 3)) * (box[:, 1] - box[:, 0])
    network = replace(chain(1), box=box, periodic=tuple(axis not in walls for axis in range(3)))
    low, high = box[:, 0] - 1.5, box[:, 1] + 1.2
    images, owner = images_near(network, position, low, high, 0.3)
    doubled, period = position, box[:, 1] - box[:, 0]
    for axis in walls:
        flipped = np.where(np.arange(3) == axis, 2 * box[axis, 1] - doubled, doubled)
        doubled, period = (
            np.concatenate([doubled, flipped]),
            period * np.where(np.arange(3) == axis, 2.0, 1.0),
        )
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    expected = (doubled + steps * period).reshape(-1, 3)
    counted = [
        places[np.all((places >= low - 0.3) & (places <= high + 0.3), axis=1)]
        for places in (images, expected)
    ]
    assert len(counted[0]) == len(counted[1]) > 300
    assert cKDTree(counted[0]).query(counted[1])[0].max() < 1e-12
    assert np.array_equal(np.unique(owner), np.arange(200))


def test_fines_outside_the_walls_are_counted_and_not_mirrored():
    network = chain(3)
    fines = snapshot(
        [[1.5, -0.01, 0.5], [1.5, 0.5, 0.5], [-0.05, 0.5, 0.5]], 0.05, network.box, Kind.FINE
    )
    assert measure_occupancy(network, fines).counts["fines_outside_box"] == 2
    in_wall = replace(network, pore_position=network.pore_position - np.array([0, 0, 0.5]))
    for z, times in ((-0.01, 1), (0.01, 2)):
        fine = snapshot([[1.5, 0.5, z]], 0.05, network.box, Kind.FINE)
        assert measure_occupancy(in_wall, fine).throat_fines.tolist() == [0, times, 0]


def test_throat_volumes_are_those_of_every_pair_taken_alone():
    """All fines against all throats one by one, images across the period included."""
    pack = with_fines(random_pack(30), 40, 0.25)
    network = build_network(pack.grains(), periodic=ALL)
    fines, size = pack.fines(), pack.box[:, 1]
    expected = np.zeros(len(network.throat_radius))
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for throat, (start, end) in enumerate(network.throat_ends):
        axis = (end - start) / np.linalg.norm(end - start)
        image = (fines.position[:, None] + steps * size).reshape(-1, 3) - start
        depth = image @ axis
        offset = np.linalg.norm(image - depth[:, None] * axis, axis=1)
        rows = np.stack(
            [
                np.full(len(depth), 0.25),
                offset,
                depth,
                np.full(len(depth), network.throat_radius[throat]),
                np.full(len(depth), network.throat_length[throat]),
            ],
            axis=1,
        )
        expected[throat] = exact_volume(pairs_of(rows)).sum()
    volumes = measure_occupancy(network, fines).throat_solid_volume
    assert volumes == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert (volumes > 0).sum() > 20


def test_unknown_overlap_is_refused():
    with pytest.raises(CaseError, match="two-plane"):
        measure_occupancy(
            chain(2), snapshot(np.zeros((0, 3)), 1.0, [[0, 2], [0, 1], [0, 1]]), overlap="rough"
        )
