"""The power tessellation of unequal grains."""

import numpy as np
import pytest

from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.network.tessellation import delaunay
from fdnet.spheres.geometry import measure_porosity
from tests.network import closed_forms
from tests.network.packs import random_pack, snapshot

ALL = (True,) * 3


@pytest.mark.parametrize("periodic", [ALL, (False, True, False)])
def test_equal_radii_make_the_network_of_delaunay(monkeypatch, periodic):
    pack = random_pack(120)
    plain = build_network(pack, periodic=periodic, walls="slip")
    monkeypatch.setattr(delaunay, "EQUAL_SPREAD", -1.0)
    power = build_network(pack, periodic=periodic, walls="slip")
    # prisms cut by a wall may be split otherwise
    for name in ("pore_volume", "throat_radius", "throat_heights") if all(periodic) else ():
        one, two = (np.sort(getattr(network, name).ravel()) for network in (plain, power))
        assert one == pytest.approx(two, abs=1e-6)
    for law in LAWS.values():
        assert solve_flow(power, law(power)).inflow == pytest.approx(
            solve_flow(plain, law(plain)).inflow, rel=1e-6
        )


def test_power_centres_of_a_body_centred_lattice_of_two_sizes():
    """The power centre is (a/2, y, 0) with y^2 - R1^2 = (y - a/2)^2 - R2^2.

    The tetrahedron has the corners (0,0,0), (a,0,0) and the centres (a,a,+-a)/2; the powers
    |x - p|^2 - r^2 are equal.
    """
    edge, corner, centre = 2.0, 1.0, 0.7
    steps = (
        np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * edge
    )
    pack = snapshot(
        np.vstack([steps, steps + 0.5 * edge]),
        np.repeat([corner, centre], 27),
        np.array([[0.0, 3 * edge]] * 3),
    )
    network = build_network(pack, periodic=ALL)
    along = edge / 4 + (corner**2 - centre**2) / edge
    place = np.sort(
        np.minimum(network.pore_power_centre % edge, edge - network.pore_power_centre % edge),
        axis=1,
    )
    assert place == pytest.approx(
        np.tile(np.sort([edge / 2, along, 0.0]), (len(place), 1)), abs=1e-9
    )
    assert len(place) == 12 * 27


def test_radical_centre_of_three_discs_on_paper():
    """Discs of radius 1, 1, 2 at (0,0), (4,0), (0,4): lines x = 2 and y = (16 + 1 - 4) / 8."""
    centre, power = closed_forms.power_centre(
        np.array([[0.0, 0], [4, 0], [0, 4]]), np.array([1.0, 1, 2])
    )
    assert centre == pytest.approx([2, 13 / 8])
    assert power == pytest.approx(4 + (13 / 8) ** 2 - 1)


def test_no_other_grain_has_less_power_at_a_power_centre():
    pack = random_pack(80, spread=0.33)
    network = build_network(pack, periodic=ALL)
    steps = (
        np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        * pack.box[:, 1]
    )
    images = (pack.position[:, None] + steps).reshape(-1, 3)
    away = (
        np.sum((network.pore_power_centre[:, None] - images) ** 2, axis=2)
        - np.repeat(pack.radius, 27) ** 2
    )
    own = np.sum((network.pore_power_centre - network.pore_corner[:, 0]) ** 2, axis=1)
    assert away.min(axis=1) == pytest.approx(own - network.pore_corner_radius[:, 0] ** 2, abs=1e-9)


def test_swallowed_grain_is_counted_and_leaves_the_void():
    pack = random_pack(80, spread=0.33)
    big = np.argmax(pack.radius)
    inside = pack.position[big] + [0.3, 0.1, 0.0]
    more = snapshot(np.vstack([pack.position, inside]), np.append(pack.radius, 0.4), pack.box)
    plain, network = build_network(pack, periodic=ALL), build_network(more, periodic=ALL)
    assert plain.counts["grains_hidden"] == 0
    assert network.counts["grains_inside_others"] == 1
    assert network.pore_volume.sum() == pytest.approx(plain.pore_volume.sum(), rel=1e-9)


def test_void_of_unequal_grains_is_the_porosity_by_chords():
    pack = random_pack(100, 0.64, spread=0.33)
    network = build_network(pack, periodic=ALL)
    porosity = measure_porosity(pack, periodic=ALL, lines=20_000)
    void = network.pore_volume.sum() / np.prod(pack.box[:, 1])
    assert network.pore_tetra_volume.sum() == pytest.approx(np.prod(pack.box[:, 1]), rel=1e-12)
    assert void == pytest.approx(porosity.mean, abs=5 * porosity.standard_error + 1e-5)
