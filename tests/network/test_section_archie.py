"""The damage law by sections: which fines a throat meets, limits, symmetries, steps."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws import section_archie
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.laws.section_archie import FineImages, measured_sections, parts_of
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind
from tests.network.packs import random_pack, simple_cubic, snapshot, with_fines

SIDES = "yz"
LAW = "section-archie"


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40), 150, 0.2)


@pytest.fixture(scope="module")
def network(pack):
    return build_network(pack.grains(), periodic=(False, True, True))


def k_of(pack, **choices):
    return analyse(pack, periodic=SIDES, damage_law=LAW, **choices).k_damaged


def conductances(network, fines):
    clean = LAWS["lubrication"](network)
    return clean, DAMAGE_LAWS[LAW](network, measure_occupancy(network, fines), clean)


def test_a_throat_meets_the_fines_whose_bodies_reach_into_its_prism(network, pack):
    """Places in the prisms are tried one by one, against all images of all fines."""
    fines, size = pack.fines(), np.ptp(network.box, axis=1)
    some, rng = 25, np.random.default_rng(3)
    beside = FineImages(network, fines.position, fines.radius).beside(next(parts_of(network)))
    sides = [np.array([0.0, y, z]) * size for y in (-1, 0, 1) for z in (-1, 0, 1)]
    mirrored = [fines.position * (-1.0, 1.0, 1.0) + (2.0 * x, 0, 0) for x in network.box[0]]
    image = np.concatenate([one + side for one in (fines.position, *mirrored) for side in sides])
    met = 0
    for t in range(some):
        corner = network.image_position[network.throat_images[t]]
        normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
        normal /= np.linalg.norm(normal)
        height = rng.uniform(*np.sort(nodes_of(network).heights[t] * (-1.0, 1.0)), 1500)
        near = np.linalg.norm(image - corner.mean(axis=0), axis=1) < 4.0
        own = beside.place[beside.first[t] : beside.first[t + 1], 2]
        both = []
        for sense in (1.0, -1.0):  # the normal may point either way
            place = rng.dirichlet(np.ones(3), 1500) @ corner + sense * height[:, None] * normal
            apart = np.linalg.norm(place[:, None] - image[near], axis=2)
            inside = image[near][np.any(apart < 0.2, axis=0)]
            up = sense * (inside - corner[0]) @ normal
            both.append(np.all(np.any(np.abs(up[:, None] - own) < 1e-9, axis=1)))
            met += len(inside)
        assert any(both)
    assert met > 50


def test_throats_without_fines_keep_their_conductance(network, pack):
    one = pack.fines().where(np.array([0]))
    clean, damage = conductances(network, one)
    changed = damage.conductance != clean
    assert 0 < changed.sum() < 0.2 * len(clean)
    assert set(damage.law_used[~changed & (clean > 0)]) == {"clean"}
    assert set(damage.law_used[changed]) <= {"sections", "blocked"}


def test_a_fine_that_vanishes_changes_nothing(pack):
    grains, fines = pack.grains(), pack.fines().where(np.arange(20))
    k0, radius = k_of(grains), np.ones(20)
    lost = [
        1.0 - k_of(grains.joined(replace(fines, radius=one * radius))) / k0
        for one in (0.2, 0.05, 0.0125)
    ]
    assert lost[0] > lost[1] > lost[2] >= 0.0
    assert lost[2] < 1e-3


def test_a_fine_that_is_too_small_for_the_sections_is_counted(network, pack):
    """A radius of 1e-300 would ask for more sections than a number counts."""
    fines = pack.fines()
    radius = np.where(np.arange(len(fines)) == 3, 1e-300, fines.radius)
    _, damage = conductances(network, replace(fines, radius=radius))
    assert damage.counts["throats_coarse"] > 0
    _, usual = conductances(network, fines)
    assert usual.counts["throats_coarse"] == 0


def test_a_fine_as_wide_as_the_throat_all_but_closes_it():
    """In the gap of four grains of a simple cubic lattice; the corners of the gap stay open."""
    grains = simple_cubic(3)
    network = build_network(grains, periodic=(True, True, True))
    edge = np.ptp(network.box[0]) / 3.0
    gap = grains.position[:1] + np.array([[0.0, 0.5, 0.5]]) * edge
    fine = snapshot(gap, 0.5 * edge * np.sqrt(2.0) - 1.0 + 0.02, grains.box, Kind.FINE)
    clean, damage = conductances(network, fine)
    kept = damage.conductance[clean > 0] / clean[clean > 0]
    assert 0.0 < kept.min() < 0.05
    assert np.median(kept) == 1.0


def test_the_answer_keeps_the_symmetries_of_the_pack(pack):
    own = k_of(pack)
    mirrored, shifted = pack.position.copy(), pack.position.copy()
    mirrored[:, 1] = pack.box[1].sum() - mirrored[:, 1]
    shifted[:, 1:] += 0.37 * np.ptp(pack.box[1:], axis=1)
    turned = pack.where(np.random.default_rng(1).permutation(len(pack)))
    larger = replace(pack, position=3 * pack.position, radius=3 * pack.radius, box=3 * pack.box)
    for other, factor in (
        (replace(pack, position=mirrored), 1.0),
        (replace(pack, position=shifted), 1.0),
        (turned, 1.0),
        (larger, 9.0),
    ):
        assert k_of(other) == pytest.approx(factor * own, rel=3e-4)


def test_a_pack_between_planes_is_half_its_mirrored_double(pack):
    """Pressure planes are planes of symmetry: the fines have mirror images there."""
    length = pack.box[0, 1] - pack.box[0, 0]
    other = pack.position.copy()
    other[:, 0] = 2.0 * pack.box[0, 1] - other[:, 0]
    box = pack.box.copy()
    box[0, 1] += length
    double = replace(pack, box=box).joined(replace(pack, position=other, box=box))
    network = build_network(double.grains(), periodic="xyz")
    _, damage = conductances(network, double.fines())
    whole = whole_permeability(network, damage.conductance)[0]
    assert k_of(pack) == pytest.approx(whole, rel=0.02)


def test_twice_as_many_sections_change_little(pack, monkeypatch):
    own = k_of(pack)
    monkeypatch.setattr(section_archie, "STEP", 0.5 * section_archie.STEP)
    monkeypatch.setattr(section_archie, "LEAST_STEPS", 2 * section_archie.LEAST_STEPS)
    assert k_of(pack) == pytest.approx(own, rel=0.03)


def test_the_power_of_the_share_is_the_one_constant(network, pack, monkeypatch):
    """At the power 0 nothing is lost, and the clean resistance is that of `lubrication`."""
    without = section_archie.fine_resistances(network, pack.fines())[0]
    halves = half_resistances(network)
    some = np.flatnonzero(np.any(without != 1.0, axis=1) & np.isfinite(halves.sum(axis=1)))
    assert len(some) > 100
    off = np.abs(without[some].sum(axis=1) / halves[some].sum(axis=1) - 1.0)
    assert np.percentile(off, 95) < 5e-3
    monkeypatch.setattr(section_archie, "EXPONENT", 0.0)
    _, damage = conductances(network, pack.fines())
    assert set(damage.law_used) == {"clean"}


@pytest.mark.parametrize(("periodic", "spread"), [("yz", 1.0), ("", 1.0), ("", 10.0)])
def test_fines_that_come_leave_and_move_renew_the_throats_they_reach(pack, periodic, spread):
    """Bit for bit what all throats give when they are summed anew.

    Radii differ by up to the factor `spread`.
    """
    network = build_network(pack.grains(), periodic=periodic)
    rng, fines = np.random.default_rng(8), pack.fines()
    radius = fines.radius * spread ** -rng.uniform(size=len(fines))
    fines = replace(fines, radius=radius)
    place = np.array(fines.position)
    place[::15] += rng.normal(0.0, 0.1, place[::15].shape)
    before, after = fines.where(np.arange(len(fines)) > 3), replace(fines, position=place)
    after = after.where(np.arange(len(fines)) < len(fines) - 3)
    grown, full = (
        measured_sections(network, before).changed_to(after),
        measured_sections(network, after),
    )
    assert 0 < grown.renewed < 0.6 * full.renewed
    assert np.array_equal(grown.raised, full.raised)
    assert np.array_equal(grown.without, full.without)
    with np.errstate(invalid="raise", divide="raise"):
        assert np.all((full.factor >= 0.0) & (full.factor <= 1.0))
    clean, damage = conductances(network, after)
    raised = np.sum(full.without / np.maximum(full.factor, 1e-12), axis=1)
    kept = full.without.sum(axis=1) / raised
    lost = damage.conductance[clean > 0] / clean[clean > 0]
    assert kept[clean > 0] == pytest.approx(lost, abs=0.01)


def test_throats_in_several_parts_and_parts_kept_from_before_change_nothing(pack, monkeypatch):
    network, fines = build_network(pack.grains(), periodic="yz"), pack.fines()
    moved = replace(fines, position=fines.position + 0.05)
    whole = measured_sections(network, fines)
    monkeypatch.setattr(section_archie, "THROATS", 37)
    kept = measured_sections(network, moved)
    assert len(kept.parts) > 3
    again = measured_sections(network, fines, parts=kept.parts)
    for other in (again, kept.changed_to(fines), whole.changed_to(fines)):
        assert np.array_equal(other.raised, whole.raised)
        assert np.array_equal(other.without, whole.without)
    assert whole.changed_to(fines).renewed == 0
    none = kept.changed_to(fines.where(np.zeros(len(fines), bool)))
    assert np.all(none.factor == 1.0)
