"""Porosity by chords against closed forms."""

import numpy as np
import pytest

from fdnet.errors import CaseError
from fdnet.network.flow.sections import pooled
from fdnet.spheres.geometry import Porosity, measure_porosity
from tests.network.packs import face_centred, random_pack, simple_cubic, snapshot

BOX = np.array([[0.0, 2.0]] * 3)


@pytest.mark.parametrize(
    ("pack", "expected"), [(simple_cubic(), 1 - np.pi / 6), (face_centred(), 0.259520)]
)
def test_lattices_have_their_known_porosity(pack, expected):
    porosity = measure_porosity(pack, periodic=(True,) * 3)
    assert porosity.mean == pytest.approx(expected, abs=2e-4)
    assert abs(porosity.mean - expected) < 6 * porosity.standard_error + 1e-6
    assert porosity.sum == pytest.approx(expected, abs=1e-6)


def test_overlap_counts_once():
    """Two equal spheres half a radius apart: union from the lens of two caps."""
    radius, apart = 0.5, 0.5
    pair = snapshot([[0.75, 1, 1], [1.25, 1, 1]], radius, BOX)
    lens = np.pi * (2 * radius - apart) ** 2 * (apart**2 + 4 * apart * radius) / (12 * apart)
    union = 2 * 4 / 3 * np.pi * radius**3 - lens
    porosity = measure_porosity(pair, periodic=(False,) * 3)
    assert porosity.mean == pytest.approx(1 - union / 8, abs=6e-5)
    assert porosity.sum == pytest.approx(1 - 2 * 4 / 3 * np.pi * radius**3 / 8)


def test_walls_clip_and_periodic_sides_reach_round():
    corner = snapshot([[0, 0, 0]], 0.8, BOX)
    volume = 4 / 3 * np.pi * 0.8**3
    assert measure_porosity(corner, periodic=(False,) * 3).mean == pytest.approx(
        1 - volume / 8 / 8, abs=2e-4
    )
    assert measure_porosity(corner, periodic=(True,) * 3).mean == pytest.approx(
        1 - volume / 8, abs=1e-4
    )
    assert measure_porosity(corner, periodic=(True, False, False)).mean == pytest.approx(
        1 - volume / 32, abs=1e-4
    )


def test_bins_of_one_sphere_are_its_spherical_segments():
    ball = snapshot([[1, 1, 1]], 0.7, BOX)
    edges = np.array([0.0, 0.5, 0.9, 1.3, 2.0])
    height = np.clip(edges - 0.3, 0, 1.4)
    cap = np.pi * height**2 * (3 * 0.7 - height) / 3
    porosity = measure_porosity(ball, periodic=(False,) * 3, edges=edges)
    assert porosity.profile == pytest.approx(1 - np.diff(cap) / (4 * np.diff(edges)), abs=1e-4)


def test_bins_average_to_the_mean():
    pack = random_pack(40)
    edges = np.linspace(0, pack.box[0, 1], 8)
    porosity = measure_porosity(pack, periodic=(True,) * 3, edges=edges)
    assert porosity.profile.mean() == pytest.approx(porosity.mean, abs=1e-12)


def test_empty_box_is_all_void_and_wrong_edges_are_refused():
    empty = snapshot(np.zeros((0, 3)), 1.0, BOX)
    assert measure_porosity(empty, periodic=(False,) * 3).mean == 1.0
    with pytest.raises(CaseError, match="ascend"):
        measure_porosity(empty, periodic=(False,) * 3, edges=np.array([0.0, 3.0]))


def test_pooling_averages_between_edges_that_leave_out_both_ends():
    """Cuts 0, 1, 3, 4, 6 with 0.1, 0.4, 0.7, 0.2: between 1 and 4 (0.4 x 2 + 0.7 x 1) / 3."""
    fine = Porosity(
        mean=0.0,
        standard_error=0.0,
        edges=np.array([0.0, 1.0, 3.0, 4.0, 6.0]),
        profile=np.array([0.1, 0.4, 0.7, 0.2]),
        sum=0.0,
    )
    assert pooled(fine, np.array([1.0, 3.0, 4.0])) == pytest.approx([0.4, 0.7])
    assert pooled(fine, np.array([1.0, 4.0])) == pytest.approx([0.5])
    assert pooled(fine, np.array([0.0, 3.0, 6.0])) == pytest.approx([0.3, 1.1 / 3])


@pytest.mark.parametrize("radius", [0.3, 0.42, 0.48])
def test_a_sphere_nearly_as_wide_as_its_period_is_whole(radius):
    sphere = snapshot(np.array([[0.9, 0.05, 0.97]]), radius, np.array([[0.0, 1.0]] * 3))
    porosity = measure_porosity(sphere, periodic=(True,) * 3)
    assert (
        abs(porosity.mean - (1 - 4 / 3 * np.pi * radius**3)) < 6 * porosity.standard_error + 1e-6
    )
