"""Spheres in a box: porosity by chords against closed forms, and groups that touch nowhere."""

import numpy as np
import pytest

from fdnet.spheres.geometry import groups_apart, measure_porosity, touching_pairs
from fdnet.spheres.snapshot import resting
from tests.network.packs import random_pack, snapshot

BOX = np.array([[0.0, 2.0]] * 3)
ALL, NONE = (True,) * 3, (False,) * 3


def test_overlap_counts_once():
    """Two equal spheres half a radius apart: union from the lens of two caps."""
    radius, apart = 0.5, 0.5
    pair = snapshot([[0.75, 1, 1], [1.25, 1, 1]], radius, BOX)
    lens = np.pi * (2 * radius - apart) ** 2 * (apart**2 + 4 * apart * radius) / (12 * apart)
    union = 2 * 4 / 3 * np.pi * radius**3 - lens
    porosity = measure_porosity(pair, periodic=NONE)
    assert porosity.mean == pytest.approx(1 - union / 8, abs=6e-5)
    assert porosity.sum == pytest.approx(1 - 2 * 4 / 3 * np.pi * radius**3 / 8)


def test_walls_clip_and_periodic_sides_reach_round():
    corner, volume = snapshot([[0, 0, 0]], 0.8, BOX), 4 / 3 * np.pi * 0.8**3
    x_only = (True, False, False)
    for periodic, share, error in [(NONE, 1 / 8, 2e-4), (ALL, 1, 1e-4), (x_only, 1 / 4, 1e-4)]:
        porosity = measure_porosity(corner, periodic=periodic).mean
        assert porosity == pytest.approx(1 - share * volume / 8, abs=error), periodic
    for radius in (0.3, 0.42, 0.48):  # nearly as wide as the period
        one = snapshot([[0.9, 0.05, 0.97]], radius, [[0.0, 1.0]] * 3)
        porosity = measure_porosity(one, periodic=ALL)
        error = abs(porosity.mean - (1 - 4 / 3 * np.pi * radius**3))
        assert error < 6 * porosity.standard_error + 1e-6, radius


def test_bins_of_one_sphere_are_its_spherical_segments_and_average_to_the_mean():
    edges = np.array([0.0, 0.5, 0.9, 1.3, 2.0])
    height = np.clip(edges - 0.3, 0, 1.4)
    cap = np.pi * height**2 * (3 * 0.7 - height) / 3
    porosity = measure_porosity(snapshot([[1, 1, 1]], 0.7, BOX), periodic=NONE, edges=edges)
    assert porosity.profile == pytest.approx(1 - np.diff(cap) / (4 * np.diff(edges)), abs=1e-4)
    pack = random_pack(40)
    porosity = measure_porosity(pack, periodic=ALL, edges=np.linspace(0, pack.box[0, 1], 8))
    assert porosity.profile.mean() == pytest.approx(porosity.mean, abs=1e-12)


def test_no_two_of_a_group_touch_and_groups_are_few():
    """At least the spheres of a clique, four in a face-centred lattice; at most contacts + 1."""
    corner, faces = [[0, 0, 0]], [[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]
    for name, cell, cells, radius, least, most in [
        ("apart", corner, 4, 0.49, 1, 1),
        ("two by turns", corner, 4, 0.51, 2, 2),
        ("odd period", corner, 3, 0.51, 3, 7),
        ("twelve contacts", faces, 3, np.sqrt(0.125), 4, 13),
    ]:
        steps = np.indices((cells,) * 3).reshape(3, -1).T
        places = (steps[:, None] + np.array(cell)).reshape(-1, 3) + 0.1
        spheres = resting(places, radius, np.array([[0.0, cells]] * 3))
        group, (pairs, _) = groups_apart(spheres, ALL), touching_pairs(spheres, ALL, gap=1e-6)
        assert least <= group.max() <= most, name
        assert group.min() == 1, name
        assert not np.any(group[pairs[:, 0]] == group[pairs[:, 1]]), name
