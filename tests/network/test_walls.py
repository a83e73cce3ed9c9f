"""Faces that are not periodic are mirror planes.

The specimen is a part of the periodic pack that its images make up.
"""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.sections import inplace_permeability
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.network.tessellation.delaunay import onto_walls
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Kind
from tests.network.packs import random_pack, simple_cubic, snapshot, with_fines

ALL, NONE = (True,) * 3, (False,) * 3


def doubled(pack, axes):
    """The periodic pack made of `pack` and its mirror images across the high faces of `axes`."""
    for axis in axes:
        low, high = pack.box[axis]
        image = pack.position.copy()
        image[:, axis] = 2 * high - image[:, axis]
        other = (pack.position[:, axis] > low) & (pack.position[:, axis] < high)
        box = pack.box.copy()
        box[axis, 1] = 2 * high - low
        pack = snapshot(
            np.vstack([pack.position, image[other]]),
            np.concatenate([pack.radius, pack.radius[other]]),
            box,
        )
    return pack


def permeabilities(pack, periodic):
    """By each law for rigid grains.

    A grain that a wall cuts near its centre is a clump with its mirror image in the doubled pack
    alone, and clumps have a law of their own (up to 2.5 % apart here), so no grain is marked.
    """
    network = build_network(pack, periodic=periodic, walls="slip")
    network = replace(network, image_fine=np.zeros_like(network.image_fine))
    length = np.ptp(pack.box[0])
    return np.array(
        [solve_flow(network, law(network)).inflow * length / network.area for law in LAWS.values()]
    )


PACKS = {
    "next to walls": lambda: random_pack(100, 0.5, periodic=False),
    "cut by walls": lambda: random_pack(100),
    "radii 1:2": lambda: random_pack(100, spread=0.33),
    "simple cubic": simple_cubic,
}


@pytest.mark.parametrize("pack", PACKS)
@pytest.mark.parametrize("axes", [(1,), (1, 2), (0, 1, 2)])
def test_walled_pack_conducts_as_the_periodic_pack_of_its_mirror_images(pack, axes):
    pack = PACKS[pack]()
    walled = permeabilities(pack, tuple(axis not in axes for axis in range(3)))
    assert walled == pytest.approx(permeabilities(doubled(pack, axes), ALL), rel=1e-6)


def test_sections_of_a_walled_pack_are_those_of_its_doubled_pack():
    pack = random_pack(100, 0.5, periodic=False)
    in_place = []
    for one, periodic in ((pack, NONE), (doubled(pack, (1, 2)), (False, True, True))):
        network = build_network(one, periodic=periodic, walls="slip")
        flow = solve_flow(network, LAWS["effective"](network))
        in_place.append(inplace_permeability(network, flow, np.linspace(0, pack.box[0, 1], 5)))
    assert in_place[0] == pytest.approx(
        in_place[1], rel=1e-4
    )  # stubs inside polyhedra differ by the split


@pytest.mark.parametrize("pack", PACKS)
def test_void_of_a_walled_box_is_its_porosity(pack):
    """One pair of walls: a grain cut by two of them overlaps three images in one place."""
    pack, periodic = PACKS[pack](), (True, False, True)
    network = build_network(pack, periodic=periodic, walls="slip")
    porosity = measure_porosity(pack, periodic=periodic, lines=20_000)
    void = np.sum(network.pore_share * network.pore_volume) / np.prod(np.ptp(pack.box, axis=1))
    assert void == pytest.approx(porosity.mean, abs=5 * porosity.standard_error + 1e-5)


def test_throats_in_a_wall_count_by_their_half():
    network = build_network(simple_cubic(4), periodic=(True, False, True), walls="slip")
    both = network.pore_share[network.throat_pores] < 1
    assert set(network.throat_share[both.all(axis=1)]) == {0.5}
    assert np.all(network.throat_share[~both.all(axis=1)] == 1)


def test_grain_centred_beyond_a_wall_becomes_a_half_sphere_of_its_cap():
    pack = random_pack(60, 0.5, periodic=False)
    position = pack.position.copy()
    position[np.argmin(position[:, 1]), 1] = -0.4
    cut = snapshot(position, 1.0, pack.box)
    moved, count = onto_walls(cut, NONE)
    changed = moved.radius != 1.0
    assert count == changed.sum() == 1
    assert moved.position[changed, 1] == 0
    assert 2 / 3 * np.pi * moved.radius[changed] ** 3 == pytest.approx(
        np.pi * 0.6**2 * (3 - 0.6) / 3
    )
    network = build_network(cut, periodic=NONE, walls="slip")
    assert network.counts["grains_centred_beyond_walls"] == 1
    assert network.grain_radius == 1.0
    porosity = measure_porosity(cut, periodic=NONE, lines=20_000)
    box = np.prod(np.ptp(pack.box, axis=1))
    void = np.sum(network.pore_share * network.pore_volume) / box
    assert np.sum(network.pore_share * network.pore_tetra_volume) == pytest.approx(box, rel=1e-12)
    assert void == pytest.approx(porosity.mean, abs=5 * porosity.standard_error + 1e-5)


CELLS = {
    "simple cubic": ([[0, 0, 0]], 2.0),
    "body-centred": ([[0, 0, 0], [0.5, 0.5, 0.5]], 4 / np.sqrt(3)),
    "face-centred": ([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]], np.sqrt(8)),
}


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(
    ("periodic", "error"),
    [((True, False, True), 1e-6), ((True, False, False), 1e-6), (NONE, 5e-4)],
)
def test_lattice_between_its_own_mirror_planes_conducts_as_the_periodic_one(cell, periodic, error):
    """Grains centred on walls are their own images; on x faces they are moved in by 1e-4 radii."""
    places, edge = CELLS[cell]
    steps = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    position = (steps + np.array(places)).reshape(-1, 3) * edge
    measured = []
    for sides in (ALL, periodic):
        last = 3 * edge + np.where(sides, -1e-9, 1e-9)
        pack = snapshot(position[np.all(position <= last, axis=1)], 1.0, [[0, 3 * edge]] * 3)
        measured.append(permeabilities(pack, sides))
    assert measured[1] == pytest.approx(measured[0], rel=error)


@pytest.mark.parametrize(("seed", "count"), [(2, 12), (4, 19)])
@pytest.mark.parametrize("periodic", [ALL, (False, True, True), (True, False, True)])
def test_few_grains_in_a_wide_box_still_tile_it(seed, count, periodic):
    """Voids as wide as the box: the first images are too few.

    That shows only in facets without partner.
    """
    pack = random_pack(count, 0.2, seed=seed, spread=0.3, aspect=0.6)
    network = build_network(pack, periodic=periodic, walls="slip")
    box = np.prod(np.ptp(pack.box, axis=1))
    assert network.counts["throats_unmatched"] == 0
    assert np.sum(network.pore_share * network.pore_tetra_volume) == pytest.approx(box, rel=1e-12)


def test_fines_at_a_wall_fill_the_throats_in_it_with_their_images():
    """With doubled fines the doubled pack has the same porosity in all throats in the wall."""
    pack = with_fines(random_pack(60, 0.5, periodic=False), 150, 0.2)
    grains, fines = pack.grains(), pack.fines()
    both = doubled(grains, (1,))
    image = fines.position * [1, -1, 1] + [0, 2 * pack.box[1, 1], 0]
    more = snapshot(np.vstack([fines.position, image]), 0.2, both.box, Kind.FINE)
    solids = []
    for one, of_it, periodic in ((grains, fines, (True, False, True)), (both, more, ALL)):
        network = build_network(one, periodic=periodic, walls="slip")
        solid = measure_occupancy(network, of_it).throat_solid_volume
        walls = network.throat_ends[:, :, 1] / pack.box[1, 1]
        solids.append(solid[np.all(np.abs(walls - np.round(walls)) < 1e-9, axis=1)].sum())
    assert solids[0] > 0.1
    assert solids[0] == pytest.approx(
        solids[1], rel=1e-4
    )  # stubs inside polyhedra differ by the split
