"""Closed forms for tetrahedra, triangles and spheres."""

import numpy as np
import pytest

from fdnet.network import geometry
from tests.network import closed_forms

TOUCHING = np.array(
    [[0, 0, 0], [2, 0, 0], [1, np.sqrt(3), 0], [1, 1 / np.sqrt(3), 2 * np.sqrt(2 / 3)]]
)


def test_four_touching_spheres_leave_a_porosity_of_0_220364():
    solid, surface = closed_forms.solid_in_tetrahedra(TOUCHING[None], np.ones((1, 4)))
    assert 1 - solid[0] / abs(geometry.signed_volume(TOUCHING)) == pytest.approx(
        0.220364, abs=1e-6
    )
    assert surface[0] == pytest.approx(3 * solid[0])


def test_three_touching_discs_leave_0_161254_and_pass_a_sphere_of_0_1547():
    triangle = TOUCHING[:3]
    assert closed_forms.open_area(triangle[None], np.ones((1, 3)))[0] == pytest.approx(
        0.161254, abs=1e-6
    )
    assert closed_forms.touching_circle(triangle[None], np.ones((1, 3)))[0] == pytest.approx(
        2 / np.sqrt(3) - 1
    )


def test_sphere_between_four_touching_spheres_is_0_224745():
    centre, radius = closed_forms.touching_sphere(TOUCHING[None], np.ones((1, 4)))
    assert radius[0] == pytest.approx(np.sqrt(1.5) - 1)
    assert centre[0] == pytest.approx(TOUCHING.mean(axis=0))


def test_touching_sphere_of_unequal_spheres_touches_each():
    rng = np.random.default_rng(2)
    radius = rng.uniform(0.6, 1.0, (50, 4))
    corner = TOUCHING * 1.3 + rng.normal(0, 0.1, (50, 4, 3))
    centre, touching = closed_forms.touching_sphere(corner, radius)
    gap = np.linalg.norm(corner - centre[:, None], axis=2) - radius
    assert gap == pytest.approx(np.repeat(touching[:, None], 4, axis=1), abs=1e-10)
    assert np.all(touching > 0)


def test_no_sphere_touches_where_discs_cover_the_gap():
    assert closed_forms.touching_circle(TOUCHING[None, :3], np.full((1, 3), 1.2))[0] < 0


def test_solid_angles_and_dihedrals_of_regular_tetrahedron_and_octant():
    assert np.abs(closed_forms.solid_angles(TOUCHING)) == pytest.approx(
        3 * np.arccos(1 / 3) - np.pi
    )
    assert closed_forms.dihedral_angles(TOUCHING) == pytest.approx(np.arccos(1 / 3))
    octant = np.vstack([np.zeros(3), np.eye(3)])
    assert closed_forms.solid_angles(octant)[0] == pytest.approx(np.pi / 2)
    assert closed_forms.solid_angles(octant[[0, 2, 1, 3]])[0] == pytest.approx(-np.pi / 2)


def test_lens_of_discs_against_a_fine_grid():
    for first, second, apart in (
        (1.0, 0.7, 1.2),
        (1.0, 0.5, 0.7),
        (0.4, 1.0, 0.3),
        (1.0, 1.0, 2.1),
    ):
        x, y = np.meshgrid(np.linspace(-1, 1.7, 1351), np.linspace(-1, 1, 1001))
        both = (x**2 + y**2 < first**2) & ((x - apart) ** 2 + y**2 < second**2)
        area = closed_forms.disc_lens_area(
            np.array([first]), np.array([second]), np.array([apart])
        )[0]
        assert area == pytest.approx(both.sum() * 0.002**2, abs=2e-3)


def test_overlapping_pair_is_counted_once_in_the_tetrahedron():
    """Against random points in a tetrahedron of two overlapping spheres and two small ones."""
    radius = np.array([1.1, 1.05, 0.6, 0.6])
    rng = np.random.default_rng(7)
    share = rng.dirichlet(np.ones(4), 400_000)
    point = share @ TOUCHING
    solid = np.any(np.linalg.norm(point[:, None] - TOUCHING, axis=2) < radius, axis=1).mean()
    share = closed_forms.solid_in_tetrahedra(TOUCHING[None], radius[None])[0][0] / abs(
        geometry.signed_volume(TOUCHING)
    )
    assert share == pytest.approx(solid, abs=4 * np.sqrt(0.25 / 400_000))


def test_open_area_between_overlapping_discs_against_a_fine_grid():
    triangle = np.array([[0, 0, 0], [1.8, 0, 0], [0.8, 1.9, 0.0]])
    radius = np.array([1.0, 0.9, 0.7])
    x, y = np.meshgrid(np.arange(0.0005, 1.8, 0.001), np.arange(0.0005, 1.9, 0.001))
    inside = (y * 0.8 < x * 1.9) & (y * (0.8 - 1.8) > (x - 1.8) * 1.9)
    for corner, size in zip(triangle, radius, strict=True):
        inside &= (x - corner[0]) ** 2 + (y - corner[1]) ** 2 > size**2
    assert closed_forms.open_area(triangle[None], radius[None])[0] == pytest.approx(
        inside.sum() * 1e-6, abs=2e-3
    )
