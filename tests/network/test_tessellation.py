"""The network of a pack: exact measures, a tiling of the box, nodes, counts."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize

from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.geometry import measure_porosity
from tests.network import closed_forms
from tests.network.packs import body_centred, face_centred, random_pack, simple_cubic, snapshot

ALL, NONE, SIDES, ONE_WALL = (True,) * 3, (False,) * 3, (False, True, True), (True, False, True)
LATTICES = {
    "simple cubic": (simple_cubic(), 1 - np.pi / 6, 27),
    "face-centred": (face_centred(), 1 - np.pi * np.sqrt(2) / 6, 4 * 27),
    "body-centred": (body_centred(), 1 - np.pi * np.sqrt(3) / 8, 0),
}
"""Pack, porosity, and cells of more than four corners: a cube a grain of simple cubic, an
octahedron a grain of face-centred, none of body-centred."""


@cache
def built(count=60, solid=0.58, periodic=ALL, **more):
    return build_network(random_pack(count, solid, **more), periodic=periodic, walls="slip")


def void_of(network):
    box = np.prod(np.ptp(network.box, axis=1))
    return np.sum(network.pore_share * network.pore_volume) / box


def volume_of(network):
    return np.sum(network.pore_share * network.pore_tetra_volume)


def test_lattices_have_their_known_porosity_and_cells():
    for name, (pack, expected, groups) in LATTICES.items():
        network = build_network(pack, periodic=ALL)
        assert void_of(network) == pytest.approx(expected, abs=1e-9), name
        assert network.area == pytest.approx(pack.box[1, 1] ** 2)
        assert np.sum(network.pore_wall_surface) == pytest.approx(4 * np.pi * len(pack))
        assert network.counts["cospherical_groups"] == groups
        assert network.counts["throats_overlapping"] == 0


def test_touching_spheres_leave_the_textbook_openings():
    """Porosity 0.220364 and a sphere of 0.224745 of four, 0.161254 r2 and 0.1547 r of three."""
    network = build_network(face_centred(), periodic=ALL)
    four = network.pore_radius < 0.3
    assert network.pore_radius[four] == pytest.approx(np.sqrt(1.5) - 1, rel=1e-6)
    assert network.pore_radius[~four] == pytest.approx(np.sqrt(2) - 1, rel=1e-6)
    porosity = network.pore_volume[four] / network.pore_tetra_volume[four]
    assert porosity == pytest.approx(0.220364, abs=1e-6)
    ends = network.pore_group[network.throat_pores]
    three = ends[:, 0] != ends[:, 1]
    assert network.throat_area[three] == pytest.approx(0.161254, abs=1e-6)
    assert network.throat_radius[three] == pytest.approx(2 / np.sqrt(3) - 1, rel=1e-6)


def test_pores_and_throats_of_unequal_overlapping_grains_are_the_closed_forms():
    """Touching spheres and circles, equal powers, areas, heights, and one void by points."""
    network = built(100, 0.66, spread=0.33)
    corner, radius = network.pore_corner, network.pore_corner_radius
    volume = np.abs(closed_forms.signed_volume(corner))
    assert network.pore_tetra_volume == pytest.approx(volume, rel=1e-9)
    centre, touching = closed_forms.touching(corner, radius)
    assert network.pore_radius == pytest.approx(np.nan_to_num(np.maximum(touching, 0)), rel=1e-8)
    # the place is that centre where it lies within, which is where four parts make up the whole
    parts = np.zeros(len(corner))
    for k in range(4):
        part = corner.copy()
        part[:, k] = np.nan_to_num(centre, nan=9.0)
        parts += np.abs(closed_forms.signed_volume(part))
    within = np.abs(parts / volume - 1.0) < 1e-6
    assert 10 < within.sum() < len(corner)
    place = np.where(within[:, None], centre, corner.mean(axis=1))
    assert network.pore_position == pytest.approx(place, abs=1e-6)
    power = np.sum((network.pore_power_centre[:, None] - corner) ** 2, axis=2) - radius**2
    assert np.ptp(power, axis=1) == pytest.approx(0.0, abs=1e-6)
    share = np.random.default_rng(7).dirichlet(np.ones(4), 400_000)
    p = int(np.argmax(np.where(np.sum(radius, axis=1) > 4.2, 0.0, volume - network.pore_volume)))
    away = np.linalg.norm((share @ corner[p])[:, None] - corner[p], axis=2)
    void = np.all(away > radius[p], axis=1).mean()
    assert network.pore_volume[p] / volume[p] == pytest.approx(void, abs=2 / np.sqrt(400_000))
    triangle, disc = network.throat_corner, network.image_radius[network.throat_images]
    circle = np.nan_to_num(np.maximum(closed_forms.touching_circle(triangle, disc), 0.0))
    assert network.throat_radius == pytest.approx(circle, rel=1e-8, abs=1e-12)
    opened = np.where(circle > 0, np.maximum(closed_forms.open_area(triangle, disc), 0.0), 0.0)
    assert network.throat_area == pytest.approx(opened, rel=1e-9, abs=1e-12)
    apart = np.linalg.norm(triangle - np.roll(triangle, 1, axis=1), axis=2)
    overlap = np.any(apart < (disc + np.roll(disc, 1, axis=1)) * (1 - 1e-6), axis=1)
    assert network.counts["throats_overlapping"] == np.sum(overlap & (circle > 0)) > 50
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    own = network.pore_power_centre[network.throat_pores[:, 0]] - triangle[:, 0]
    own = np.sum(own * normal, axis=1)
    assert np.abs(network.throat_heights[:, 0]) == pytest.approx(np.abs(own), abs=1e-6)


def test_void_of_packs_is_their_porosity_by_chords():
    """Also where grains overlap, are unequal, are cut by walls or centred beyond one."""
    walled = random_pack(60, 0.5, periodic=False)
    beyond = walled.position.copy()
    beyond[np.argmin(beyond[:, 1]), 1] = -0.4
    cut = snapshot(beyond, 1.0, walled.box)
    cases = {
        "overlapping": (random_pack(80, 0.66, spread=0.2), ALL),
        "unequal": (random_pack(100, 0.64, spread=0.33), ALL),
        "next to walls": (random_pack(100, 0.5, periodic=False), ONE_WALL),
        "cut by walls": (random_pack(100), ONE_WALL),
        "unequal and cut": (random_pack(100, spread=0.33), ONE_WALL),
        "centred beyond a wall": (cut, NONE),
        **{name: (pack, SIDES) for name, (pack, *_) in LATTICES.items()},
    }
    for name, (pack, periodic) in cases.items():
        network = build_network(pack, periodic=periodic, walls="slip")
        porosity = measure_porosity(pack, periodic=periodic, lines=20_000)
        box = np.prod(np.ptp(pack.box, axis=1))
        assert volume_of(network) == pytest.approx(box, rel=1e-12), name
        near = 5 * porosity.standard_error + 1e-5
        assert void_of(network) == pytest.approx(porosity.mean, abs=near), name
        if name == "overlapping":
            assert porosity.mean > porosity.sum + 1e-4
        beyond_walls = network.counts["grains_centred_beyond_walls"]
        assert beyond_walls == (name == "centred beyond a wall"), name


def test_tetrahedra_tile_the_box_and_facets_pair():
    """Also few grains in a wide box, where the first images are too few, and a single layer."""
    dense = random_pack(120, 0.5, periodic=False)
    wide = {"spread": 0.3, "aspect": 0.6}
    few = [random_pack(12, 0.2, seed=2, **wide), random_pack(19, 0.2, seed=4, **wide)]
    layer = snapshot(np.random.default_rng(0).random((9, 3)) * [8, 8, 0] + 1, 0.1, [[0, 10]] * 3)
    cases = [(dense, sides) for sides in (ALL, SIDES, ONE_WALL, NONE)] + [(layer, NONE)]
    for pack, periodic in cases + list(product(few, (ALL, SIDES, ONE_WALL))):
        network = build_network(pack, periodic=periodic, walls="slip")
        box = np.prod(np.ptp(pack.box, axis=1))
        assert network.counts["throats_unmatched"] == 0
        assert volume_of(network) == pytest.approx(box, rel=1e-12), (len(pack), periodic)
        if pack is not dense:
            continue
        # Delaunay: centres in order along the normal; one place for all parts of a polyhedron
        assert network.throat_heights.sum(axis=1).min() > -1e-9
        places = len(np.unique(network.pore_position, axis=0))
        groups = network.pore_group.max() + 1
        assert 0.99 * groups < places <= groups
        if periodic == ALL:
            assert len(network.throat_pores) == 2 * len(network.pore_position)


# ---- Power tessellation.
def test_no_other_grain_has_less_power_at_a_power_centre():
    pack, network = random_pack(80, spread=0.33), built(80, spread=0.33)
    steps = (np.indices((3, 3, 3)).reshape(3, -1).T - 1) * pack.box[:, 1]
    images = (pack.position[:, None] + steps).reshape(-1, 3)
    away = np.sum((network.pore_power_centre[:, None] - images) ** 2, axis=2)
    own = np.sum((network.pore_power_centre - network.pore_corner[:, 0]) ** 2, axis=1)
    least = (away - np.repeat(pack.radius, 27) ** 2).min(axis=1)
    assert least == pytest.approx(own - network.pore_corner_radius[:, 0] ** 2, abs=1e-9)


def test_a_lattice_of_thousands_of_grains_conducts_as_a_few_cells():
    """Qhull joins what it cannot tell apart in a large set; the shake keeps lattices apart."""
    for made in (simple_cubic, body_centred, face_centred):
        few, many = (build_network(made(n), periodic=ALL) for n in (3, 10))
        k = [whole_permeability(one, LAWS["lubrication"](one))[0] for one in (few, many)]
        assert k[1] == pytest.approx(k[0], rel=1e-9)


# ---- Nodes: power centres, or the points of their tetrahedra that are nearest to them.
def nearest_by_search(corner, place):
    """The point of a tetrahedron nearest to a place, from weights that are searched for."""
    whole = {"type": "eq", "fun": lambda weight: weight.sum() - 1.0}
    how = {"bounds": [(0.0, 1.0)] * 4, "options": {"ftol": 1e-14, "maxiter": 500}}
    away = lambda weight: np.sum((weight @ corner - place) ** 2)  # noqa: E731
    return minimize(away, np.full(4, 0.25), constraints=whole, **how).x @ corner


def inside(corner, place):
    weight = np.linalg.solve(np.vstack([corner.T, np.ones(4)]), np.append(place, 1.0))
    return weight.min() > -1e-9


def test_a_node_is_the_point_of_its_tetrahedron_nearest_to_the_power_centre():
    network = built()
    nodes, corner, centre = nodes_of(network), network.pore_corner, network.pore_power_centre
    node, moved = nodes.position, np.any(nodes.position != centre, axis=1)
    assert 0.1 < moved.mean() < 0.5
    for p in np.flatnonzero(moved)[:60]:
        best = nearest_by_search(corner[p], centre[p])
        assert np.linalg.norm(node[p] - centre[p]) <= np.linalg.norm(best - centre[p]) + 1e-9
        assert inside(corner[p], node[p])
    assert all(inside(corner[p], centre[p]) for p in np.flatnonzero(~moved)[:60])
