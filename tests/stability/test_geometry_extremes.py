"""Hard geometries: the answer by symmetry, closed form or a second method, or a refusal."""

import itertools

import numpy as np
import pytest
from builders import naming

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import NetworkError
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind
from tests.network.packs import face_centred, random_pack, simple_cubic, snapshot, with_fines

ALL, SIDES, NONE = (True,) * 3, (False, True, True), (False,) * 3
SC_SPACING = 2.0


def measure(grains, damaged=None, periodic=SIDES, laws=("lubrication", "section-archie")):
    options = AnalysisChoices.of_pack(law=laws[0], damage_law=laws[1], sections=1, walls="slip")
    return analyse(grains, damaged, periodic=periodic, options=options)


def joined(grains, position, radius):
    return grains.joined(snapshot(position, radius, grains.box, Kind.FINE))


def steps(repeat):
    return np.indices((repeat,) * 3).reshape(3, -1).T


def hexagonal(repeat=2):
    """Hexagonal close packing of unit spheres in a cell of 2 x 2 sqrt(3) x 4 sqrt(2/3)."""
    cell = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 1 / 6, 0.5], [0, 2 / 3, 0.5]])
    edge = np.array([2.0, 2.0 * np.sqrt(3.0), 4.0 * np.sqrt(2.0 / 3.0)])
    places = (steps(repeat)[:, None] + cell + 0.1) * edge
    return snapshot(places, 1.0, np.outer(repeat * edge, [0.0, 1.0]))


LATTICES = {
    "SC": (simple_cubic(), 1 - np.pi / 6),
    "FCC": (face_centred(), 1 - np.pi / np.sqrt(18)),
    "HCP": (hexagonal(), 1 - np.pi / np.sqrt(18)),
}


def shaken(pack, size):
    noise = np.random.default_rng(3).uniform(-size, size, pack.position.shape)
    return snapshot(pack.position + noise, pack.radius, pack.box)


def test_a_shake_of_any_size_leaves_k_continuous():
    """A shake moves k by no more than a few times its size, one of 1e-12 not at all.

    The cells of SC are polyhedra of several tetrahedra, which stand alone once they are shaken:
    their nodes then move. The void is that of the closed form.
    """
    shakes = [(ALL, size) for size in (1e-12, 1e-10, 1e-7, 1e-5, 1e-3)] + [(NONE, 1e-12)]
    for (periodic, size), name in itertools.product(shakes, LATTICES):
        with naming(periodic, size, name):
            pack, porosity = LATTICES[name]
            still, moved = (measure(one, periodic=periodic) for one in (pack, shaken(pack, size)))
            near = 1e-5 + 100 * size + 0.015 * (name == "SC") if size > 1e-12 else 1e-6
            assert moved.k_initial == pytest.approx(still.k_initial, rel=near)
            void = moved.network.pore_volume.sum() / np.prod(np.ptp(pack.box, axis=1))
            assert periodic == NONE or void == pytest.approx(porosity, abs=1e-6 + 10 * size)


def test_a_box_thinner_than_a_grain_between_planes_of_symmetry_is_the_lattice():
    """Half a cell, from the plane through the centres to that between them: one radius thick."""
    lattice = simple_cubic()
    whole = measure(lattice, periodic=ALL).k_initial
    for axis in range(3):
        place = lattice.position + np.where(np.arange(3) == axis, -0.2, 0.8)
        thin = lattice.box.copy()
        thin[axis, 1] = 1.0
        periodic = tuple(side != axis and side > 0 for side in range(3))
        half = measure(snapshot(place[place[:, axis] < 0.5], 1.0, thin), periodic=periodic)
        assert half.k_initial == pytest.approx(whole, rel=1e-3), axis


def test_a_slice_of_a_grain_has_a_k_or_is_refused():
    pack = random_pack(60)
    for thickness in (0.3, 0.05, 1e-3):
        box = pack.box.copy()
        box[0] = [1.0, 1.0 + thickness]
        try:
            analysis = measure(snapshot(pack.position, 1.0, box))
        except NetworkError as error:
            said = str(error)
            assert "grains" in said
        else:
            assert 0 <= analysis.k_initial < 1.0, thickness
            assert 0 <= analysis.porosity_initial <= 1


def test_what_would_take_hours_or_has_no_digits_left_is_refused_at_once():
    """Thousands of images of a thin side, a huge grain or a wide fine; a place far away."""
    pack = random_pack(60)
    middle = pack.box[:, 1] * np.array([[0.5, 0.5, 0.5]])
    swollen = snapshot(pack.position, np.where(np.arange(60) == 7, 1e6, 1.0), pack.box)
    bad = [((swollen,), ALL, "1 of 1 grains reach into the box")]
    for thickness in (3e-3, 1e-5):
        thin = snapshot(pack.position, 1.0, pack.box * [[1], [thickness], [1]])
        bad.append(((thin,), SIDES, "periodic side y .* are needed, expected at most"))
    for radius, periodic in ((0.51 * pack.box[1, 1], ALL), (1e4, ALL), (1e20, ALL), (1e4, NONE)):
        wide = joined(pack, middle, radius)
        bad.append(((pack, wide), periodic, "id 1 has a radius of .* more than half"))
    for lengths in (1e9, 1e12, 1e17):
        offset = lengths * pack.box[0, 1]
        far = snapshot(pack.position + offset, 1.0, pack.box + offset)
        bad.append(((far,), SIDES, "move the specimen to the origin"))
    for spheres, periodic, words in bad:
        with naming(words), pytest.raises(NetworkError, match=words):
            measure(*spheres, periodic=periodic)


def test_fines_of_every_size_ratio_are_all_seen_and_lower_k():
    """Their pieces add up to them; they lower the porosity, less where they overlap each other."""
    for ratio in (2, 5, 10, 20, 40):
        pack = random_pack(60, 0.5)
        filled = with_fines(pack, min(20 * ratio, 500), 1.0 / ratio)
        analysis = measure(pack, filled, ALL)
        solid = 4 / 3 * np.pi / ratio**3 * len(filled.fines())
        pieces = analysis.occupancy.pore_solid_volume.sum()
        assert pieces == pytest.approx(solid, rel=1e-9), ratio
        assert 0 < analysis.k_damaged < analysis.k_initial, ratio
        most = solid / np.prod(np.ptp(pack.box, axis=1))
        drop = analysis.porosity_initial - analysis.porosity_damaged
        assert 0.7 * most - 1e-3 <= drop <= most + 1e-3, ratio


def test_swelling_grains_close_throat_by_throat_until_no_path_is_left():
    """k falls from size to size and ends at 0 with its reason, never below."""
    pack = random_pack(60)
    k, closed = [], []
    for swell in (1.0, 1.1, 1.2, 1.3, 1.5, 2.0):
        analysis = measure(snapshot(pack.position, swell, pack.box), periodic=ALL)
        k.append(analysis.k_initial)
        closed.append(np.mean(analysis.network.throat_radius == 0))
        said = any("k_initial = 0: no open path" in one for one in analysis.warnings)
        assert (analysis.k_initial == 0) == said
    assert k == sorted(k, reverse=True)
    assert closed == sorted(closed)
    assert k[0] > 0
    assert k[-1] == 0
    assert analysis.porosity_initial < 1e-3


def test_fines_larger_than_every_throat_close_a_lattice():
    """In SC the throats between cells have the radius sqrt(2) - 1 = 0.4142.

    A wider fine in the centre of each cell closes the lattice by the rule of the thesis.
    """
    lattice = simple_cubic()
    for radius, open_path in [(0.40, True), (0.43, False), (0.70, False)]:
        filled = joined(lattice, (steps(3) + 0.6) * SC_SPACING, radius)
        analysis = measure(lattice, filled, ALL, ("thesis", "thesis"))
        said = any("k_damaged = 0: no open path" in one for one in analysis.warnings)
        assert (analysis.k_damaged > 0) == open_path, radius
        assert said != open_path, radius
        assert open_path or analysis.k_reduction == 1.0
        assert open_path or analysis.occupancy.blocked.sum() > 0


def test_a_grain_that_is_there_twice_counts_once():
    """Also as its own image, one period away along y."""
    pack = random_pack(40)
    once = measure(pack, periodic=ALL).k_initial
    for apart in [(0, 0, 0), (1e-12, 0, 0), (5e-4, 0, 0), (0, 1, 0)]:
        there = pack.position[:1] + np.array(apart) * [1, pack.box[1, 1], 1]
        twice = snapshot(np.vstack([pack.position, there]), 1.0, pack.box)
        analysis = measure(twice, periodic=ALL)
        assert analysis.k_initial == pytest.approx(once, rel=1e-3), apart
        assert analysis.counts["spheres_dropped"] == 1, apart


def test_coordinates_far_from_the_origin_cost_digits_alone():
    """The moved pack against one at the origin with the same rounded differences."""
    pack = with_fines(random_pack(60), 30, 0.2)
    for lengths, periodic in itertools.product([1e3, 1e6], [ALL, SIDES, NONE]):
        offset = np.round(lengths * pack.box[0, 1]) * np.array([1.0, -1.0, 1.0])
        place, box = pack.position + offset, pack.box + offset[:, None]
        far = snapshot(place, pack.radius, box, pack.kind)
        near = snapshot(place - offset, pack.radius, box - offset[:, None], pack.kind)
        there, here = (measure(one.grains(), one, periodic) for one in (far, near))
        digits = 1e-5 + 1e4 * np.finfo(float).eps * lengths
        for name in ("k_initial", "k_damaged", "porosity_initial", "porosity_damaged"):
            value = pytest.approx(getattr(here, name), rel=digits)
            assert getattr(there, name) == value, (lengths, periodic)
