"""Faces that are not periodic are mirror planes: the specimen is a part of the periodic pack that
its images make up."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.spheres.snapshot import Kind
from tests.network.packs import random_pack, snapshot, with_fines

ALL, NONE = (True,) * 3, (False,) * 3
PACKS = {
    "next to walls": lambda: random_pack(100, 0.5, periodic=False),
    "radii 1:2": lambda: random_pack(100, spread=0.33),
}


def doubled(pack, axes):
    """The periodic pack made of `pack` and its mirror images across the high faces of `axes`."""
    for axis in axes:
        low, high = pack.box[axis]
        image, box = pack.position.copy(), pack.box.copy()
        image[:, axis] = 2 * high - image[:, axis]
        other = (pack.position[:, axis] > low) & (pack.position[:, axis] < high)
        box[axis, 1] = 2 * high - low
        place = np.vstack([pack.position, image[other]])
        pack = snapshot(place, np.concatenate([pack.radius, pack.radius[other]]), box)
    return pack


def permeabilities(pack, periodic):
    """By each law for rigid grains.

    A grain that a wall cuts near its centre is a clump with its mirror image in the doubled pack
    alone, and clumps have a law of their own (up to 2.5 % apart here), so no grain is marked.
    """
    network = build_network(pack, periodic=periodic, walls="slip")
    network = replace(network, image_fine=np.zeros_like(network.image_fine))
    flows = [solve_flow(network, law(network)) for law in LAWS.values()]
    return np.array([flow.inflow * np.ptp(pack.box[0]) / network.area for flow in flows])


@pytest.mark.parametrize("name", PACKS)
def test_a_walled_pack_conducts_as_the_periodic_pack_of_its_mirror_images(name):
    pack = PACKS[name]()
    for axes in ((1,), (1, 2), (0, 1, 2)):
        walled = permeabilities(pack, tuple(axis not in axes for axis in range(3)))
        assert walled == pytest.approx(permeabilities(doubled(pack, axes), ALL), rel=1e-6), axes


def test_a_lattice_between_its_own_mirror_planes_conducts_as_the_periodic_one():
    """Body-centred; grains centred on walls are their own images, on x moved in by 1e-4 radii."""
    edge, steps = 4 / np.sqrt(3), np.indices((4, 4, 4)).reshape(3, -1).T[:, None]
    position = (steps + np.array([[0, 0, 0], [0.5, 0.5, 0.5]])).reshape(-1, 3) * edge

    @cache
    def measured(sides):
        last = 3 * edge + np.where(sides, -1e-9, 1e-9)
        pack = snapshot(position[np.all(position <= last, axis=1)], 1.0, [[0, 3 * edge]] * 3)
        return permeabilities(pack, sides)

    for sides, error in (((1, 0, 1), 1e-6), ((1, 0, 0), 1e-6), ((0, 0, 0), 5e-4)):
        sides = tuple(map(bool, sides))
        assert measured(sides) == pytest.approx(measured(ALL), rel=error), sides


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
    # stubs inside polyhedra differ by the split
    assert solids[0] == pytest.approx(solids[1], rel=1e-4)
