"""Fines in throats and pores: volumes against points, closed forms, sums, another package."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from overlap import Sphere, Tetrahedron, overlap_area, overlap_volume
from scipy.integrate import quad
from scipy.stats import qmc

from fdnet.errors import CaseError
from fdnet.network.fines.crowding import local_porosity, weighted_volume
from fdnet.network.fines.deposit import (
    clip_to_box,
    holders_of,
    measured_deposit,
    pieces,
    reaching_inside,
)
from fdnet.network.fines.occupancy import Pairs, exact_volume, measure_occupancy
from fdnet.network.network import build_network
from fdnet.network.specimen import measure_invaded
from fdnet.spheres.snapshot import Kind
from tests.network.closed_forms import disc_lens_area, signed_volume
from tests.network.networks import chain
from tests.network.packs import random_pack, snapshot, with_fines

ALL, NONE = (True,) * 3, (False,) * 3
BALL, SPHERE = 4 / 3 * np.pi, 4 * np.pi


# ---- Pieces of balls in tetrahedra, and parts of tetrahedra in a box.
def piece(corner, centre, radius=1.0):
    """Volume and surface of the ball in the tetrahedron."""
    one = np.zeros(1, np.intp)
    places = np.array([corner], float), one, one, np.array([centre], float)
    return tuple(pieces(*places, np.array([float(radius)]))[0])


def test_pieces_of_a_ball_in_closed_form():
    corner = np.array([[0, 0, 0], [50, 0, 0], [0, 50, 0], [0, 0, 50.0]])
    for centre, share in [
        ([5, 5, 5], 1),
        ([0, 5, 5], 1 / 2),
        ([0, 0, 5], 1 / 4),
        ([0, 0, 0], 1 / 8),
        ([-1, 5, 5], 0),
    ]:
        expected = share * BALL, share * SPHERE
        assert piece(corner, centre) == pytest.approx(expected, rel=1e-14, abs=1e-14), centre
    height = 0.4
    cap = np.pi * height**2 * (3 - height) / 3, 2 * np.pi * height
    assert piece(corner, [-0.6, 5, 5]) == pytest.approx(cap, rel=1e-14)
    for angle in (1e-6, 0.3, 1.2, 3.0):  # a wedge through the centre
        side = [50 * np.cos(angle), 50 * np.sin(angle), 0]
        share = angle / (2 * np.pi)
        got = piece([[0, 0, -50], [0, 0, 50], [50, 0, 0], side], [0, 0, 0])
        assert got == pytest.approx((share * BALL, share * SPHERE), rel=1e-9), angle
    for height in (0.0, 0.3, -1e-12):  # a flat tetrahedron holds nothing
        square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        assert piece(square, [0.4, 0.5, height], 0.5) == (0.0, 0.0)
    corner = np.random.default_rng(8).normal(size=(4, 3))
    expected = piece(corner, [0.1, 0, 0], 0.7)
    for order in ([1, 0, 2, 3], [3, 2, 1, 0], [2, 3, 1, 0]):
        assert piece(corner[order], [0.1, 0, 0], 0.7) == pytest.approx(expected, rel=1e-13)


def pairs_in_space():
    """Tetrahedra and balls, seven in eight of them degenerate."""
    rng = np.random.default_rng(4)
    for k in range(4000):
        corner, centre = rng.normal(size=(4, 3)), 0.7 * rng.normal(size=3)
        radius = rng.uniform(0.1, 1.5)
        share, noise = rng.uniform(-1, 2), 1e-7 * rng.normal(size=3)
        match k % 8:
            case 1:  # flat
                corner[3] = 0.4 * corner[0] + 0.3 * corner[1] + 0.3 * corner[2] + noise
            case 2:  # sliver: four corners of a quadrilateral
                corner[3] = corner[0] + corner[1] - corner[2] + noise
            case 3:  # an edge's line through the centre
                centre = share * corner[0] + (1 - share) * corner[1]
            case 4:  # a facet's plane through the centre
                centre = rng.dirichlet(np.ones(3)) @ corner[:3]
            case 5:  # a corner in the centre
                centre = corner[0]
            case 6:  # a tiny ball at an edge
                centre, radius = 0.3 * corner[0] + 0.7 * corner[1] + 1e4 * noise, 2e-3
        if np.linalg.det(corner[1:] - corner[0]) < 0:
            corner = corner[[1, 0, 2, 3]]
        yield corner, centre, radius


def test_pieces_against_the_other_decomposition_of_the_package_overlap():
    for corner, centre, radius in pairs_in_space():
        tetrahedron, ball = Tetrahedron((corner - centre) / radius), Sphere(np.zeros(3), 1.0)
        volume, surface = piece(corner, centre, radius)
        assert volume / radius**3 == pytest.approx(overlap_volume(ball, tetrahedron), abs=1e-10)
        assert surface / radius**2 == pytest.approx(overlap_area(ball, tetrahedron)[0], abs=1e-9)


def test_parts_of_tetrahedra_in_a_box():
    def volume(corner, box, periodic=NONE):
        parts, owner = clip_to_box(np.asarray(corner, float), np.asarray(box, float), periodic)
        return np.bincount(owner, np.abs(signed_volume(parts)), minlength=len(corner))

    many = np.random.default_rng(4).random((300, 4, 3))
    bounds = list(pairwise([-1.0, 0.3, 0.55, 2.0]))
    parts = [volume(many, [x, y, z]) for x in bounds for y in bounds for z in bounds]
    assert sum(parts) == pytest.approx(np.abs(signed_volume(many)), rel=1e-9)


# ---- Spheres in the tube of a throat.
def pairs_of(rows):
    names = ("sphere", "offset", "depth", "tube", "length")
    return Pairs(**dict(zip(names, np.atleast_2d(rows).T, strict=True)))


def test_a_sphere_in_a_tube_within_a_millionth_of_adaptive_quadrature():
    """The napkin ring, a tube through the centre: 4/3 pi (a^3 - (a^2 - r^2)^1.5)."""
    ring = exact_volume(pairs_of([2.0, 0.0, 5.0, 1.0, 10.0]))[0]
    assert ring == pytest.approx(BALL * (8 - 3**1.5), rel=1e-14)
    rng = np.random.default_rng(6)
    for _ in range(150):
        sphere, length = 10 ** rng.uniform(-1.3, 0.5), rng.uniform(0.1, 4)
        offset = rng.choice([0.0, 1.0, rng.uniform(0, 1 + sphere), rng.uniform(0, 1 + sphere)])
        depth = rng.uniform(-0.9, 0.9) * sphere + rng.uniform(0, length)
        low, high = max(-sphere, -depth), min(sphere, length - depth)
        reach = [np.sqrt(max(sphere**2 - (1 + side * offset) ** 2, 0)) for side in (-1, 1)]
        kinks = [z for far in reach for z in (-far, far) if low < z < high]

        def section(z, sphere=sphere, offset=offset):
            return float(disc_lens_area(np.sqrt(max(sphere**2 - z**2, 0.0)), 1.0, offset))

        between = pairwise(sorted([low, high, *kinks]))
        expected = sum(quad(section, *part, epsabs=1e-12)[0] for part in between)
        volume = exact_volume(pairs_of([sphere, offset, depth, 1.0, length]))[0]
        assert volume == pytest.approx(expected, abs=1e-6 * BALL * sphere**3)


def occupied(network, places, radius, **more):
    fines = snapshot(places, radius, network.box, Kind.FINE)
    return measure_occupancy(network, fines, **more)


def test_fines_in_a_row_of_tubes():
    network = chain(3)
    state = occupied(network, [[1.5, 0.5, 0.5]], 0.05)
    assert state.throat_porosity == pytest.approx([1, 1 - 4 / 3 * 0.05**3 / 0.1**2, 1])
    assert state.throat_fines.tolist() == [0, 1, 0]
    assert state.throat_fine_radius == pytest.approx([0, 0.05, 0])
    assert state.pair_distance == pytest.approx([0])
    assert not state.blocked.any()
    before = occupied(network, [[-0.05, 0.5, 0.5]], 0.12)
    assert before.blocked.tolist() == [True, False, False], "it reaches in from before the face"
    # a throat between pores at one place is a disc across x
    flat = replace(chain(1), pore_position=np.full((2, 3), 0.5), throat_length=np.array([1e-3]))
    state = occupied(flat, [[0.49, 0.52, 0.5]], 0.05)
    disc = np.pi * (0.05**2 - 0.01**2) * 1e-3
    assert state.throat_solid_volume == pytest.approx([disc], rel=0.02)
    assert state.pair_distance == pytest.approx([0.2])
    # fines outside the walls are counted and not mirrored
    state = occupied(network, [[1.5, -0.01, 0.5], [1.5, 0.5, 0.5], [-0.05, 0.5, 0.5]], 0.05)
    assert state.counts["fines_outside_box"] == 2
    in_wall = replace(network, pore_position=network.pore_position - np.array([0, 0, 0.5]))
    for z, times in ((-0.01, 1), (0.01, 2)):
        assert occupied(in_wall, [[1.5, 0.5, z]], 0.05).throat_fines.tolist() == [0, times, 0]
    with pytest.raises(CaseError, match="two-plane"):
        occupied(network, np.zeros((0, 3)), 1.0, overlap="rough")


def test_throat_volumes_are_those_of_every_pair_taken_alone():
    """All fines against all throats one by one, images across the period included."""
    pack = with_fines(random_pack(30), 40, 0.25)
    network = build_network(pack.grains(), periodic=ALL)
    steps = (np.indices((3, 3, 3)).reshape(3, -1).T - 1) * pack.box[:, 1]
    images = (pack.fines().position[:, None] + steps).reshape(-1, 3)
    expected = np.zeros(len(network.throat_radius))
    for throat, (start, end) in enumerate(network.throat_ends):
        axis = (end - start) / np.linalg.norm(end - start)
        depth = (images - start) @ axis
        offset = np.linalg.norm(images - start - depth[:, None] * axis, axis=1)
        tube = network.throat_radius[throat], network.throat_length[throat]
        rows = np.broadcast_arrays(0.25, offset, depth, *tube)
        expected[throat] = exact_volume(pairs_of(np.stack(rows, axis=1))).sum()
    volumes = measure_occupancy(network, pack.fines()).throat_solid_volume
    assert volumes == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert (volumes > 0).sum() > 20


# ---- Fines in pores.
def volume_inside(fines, periodic):
    """Volume of balls on this side of the walls, by 20,000 points in each that a wall may cut."""
    point = np.random.default_rng(2).normal(size=(20_000, 3))
    far = np.random.default_rng(3).random(20_000) ** (1 / 3) / np.linalg.norm(point, axis=1)
    place = fines.position[:, None] + fines.radius[:, None, None] * (point * far[:, None])
    low, high = fines.box.T
    inside = np.all(((place > low) & (place < high)) | np.array(periodic), axis=2)
    return np.sum(inside.mean(axis=1) * BALL * fines.radius**3)


def test_every_fine_in_the_box_counts_once():
    pack = with_fines(random_pack(60), 200, 0.2)
    fines = pack.fines()
    upstream = replace(fines, position=fines.position - [[0.5 * fines.position[:, 0].max(), 0, 0]])
    for periodic in (ALL, (False, True, True), (True, False, True), NONE):
        network = build_network(pack.grains(), periodic=periodic, walls="slip")
        for deposit in (fines, upstream):
            state = measure_occupancy(network, deposit)
            by_pore = np.sum(network.pore_share * state.pore_solid_volume)
            assert by_pore == pytest.approx(volume_inside(deposit, periodic), rel=1e-3), periodic
            inside = deposit.where(reaching_inside(network, deposit))
            by_piece = measured_deposit(holders_of(network), inside).in_pores
            assert by_piece == pytest.approx(state.pore_solid_volume, rel=1e-9)
            if periodic == ALL:
                assert by_pore == pytest.approx(200 * BALL * 0.2**3, rel=1e-9)
                surface = state.pore_solid_surface.sum()
                assert surface == pytest.approx(200 * SPHERE * 0.2**2, rel=1e-7)


# ---- The cake before the formation face.
def cake_thickness(fines, *, periodic=NONE):
    """Of fines of radius 0.1 before a grain of radius 1 whose front is at x = 0."""
    place = np.vstack([[[1.0, 2, 2]], np.array(fines, float).reshape(-1, 3)])
    radius, kind = np.full(len(place), 0.1), np.full(len(place), Kind.FINE)
    radius[0], kind[0] = 1.0, Kind.GRAIN
    box = np.array([[0, 10], [0, 4], [0, 4.0]])
    invaded = measure_invaded(snapshot(place, radius, box, kind), periodic=periodic)
    return invaded.cake_thickness


def test_the_cake_is_what_stands_on_the_pack():
    pair = [[-0.1, 2, 2], [-0.0818, 2.1992, 2]]  # on the grain, touching each other
    on_both = [-0.2634, 2.1153, 2.0]
    assert cake_thickness([*pair, on_both]) == pytest.approx(0.3634)
    falling = [[-0.4634, 2.1153, 2], [-0.6634, 2.1153, 2]]
    assert cake_thickness([*pair, on_both, *falling]) == pytest.approx(0.3634), "by one contact"
    assert cake_thickness([[-0.1, 2, 2], [-0.3, 2, 2]]) == cake_thickness([]) == 0.0
    sides = (False, True, True)
    across = [[0.05, 0.05, 2], [0.05, 3.8, 2], [-0.10, 3.92, 2]]  # 0.13 apart across the side y
    assert cake_thickness(across, periodic=sides) == pytest.approx(0.2)
    assert cake_thickness(across) == 0.0
    rounded = [[0.05, -1e-20, 2], [0.05, 0.26, 2], [-0.10, 0.13, 2]]
    assert cake_thickness(rounded, periodic=sides) == pytest.approx(0.2)


# ---- The porosity of the crowd around a fine.
BOX = np.array([[0.0, 1.0]] * 3)
CROSSWISE = (False, True, True)


def spheres(position, radius, kind=Kind.FINE):
    made = snapshot(position, radius, BOX, kind)
    return replace(made, id=made.id + 1000 * (kind == Kind.FINE))


def test_the_weighted_volume_of_a_sphere_is_that_of_many_points():
    """The weight (1 - (r / ball)^2)^2, by evenly spread points, a second method."""
    ball = 1.5
    turn, tilt, out = qmc.Sobol(3, seed=3).random(2**17).T
    cosine, far = 2 * tilt - 1, ball * np.cbrt(out)
    across, turn = far * np.sqrt(1 - cosine**2), 2 * np.pi * turn
    step = np.column_stack([far * cosine, across * np.cos(turn), across * np.sin(turn)])
    weight = BALL * ball**3 * (1 - (far / ball) ** 2) ** 2
    for distance in (0.0, 0.3, 0.8, 1.4, 2.2):
        for radius in (0.5, 1.0, 2.0):
            inside = np.sum((step - [distance, 0, 0]) ** 2, axis=1) < radius**2
            got = weighted_volume(radius, distance, ball)
            assert got == pytest.approx(np.mean(weight * inside), rel=2e-3, abs=1e-3)


def test_a_lone_fine_has_no_crowd():
    beside = spheres([[0.5, 0.5, 0.5]], 0.2, Kind.GRAIN).joined(spheres([[0.5, 0.5, 0.71]], 0.01))
    for pack, sides in [  # a lone fine in the mud, next to a grain and at a wall
        (spheres([[-3.0, 0.5, 0.5]], 0.01), CROSSWISE),
        (beside, CROSSWISE),
        (spheres([[0.5, 0.012, 0.013]], 0.01), NONE),
    ]:
        assert local_porosity(pack, sides).porosity == pytest.approx(1.0, rel=1e-12)
