"""The compiled measures of tetrahedra and facets are the `closed_forms`."""

import numpy as np
import pytest

from fdnet.network import geometry
from fdnet.network.tessellation import delaunay as tetrahedron
from fdnet.network.tessellation import facets as section
from tests.network import closed_forms

COUNT = 400


def bodies(corners: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, radii and corners of tetrahedra or triangles whose spheres overlap in part."""
    rng = np.random.default_rng(corners)
    points = rng.normal(size=(COUNT * corners, 3))
    radius = rng.uniform(0.1, 0.8, len(points))
    return points, radius, np.arange(len(points), dtype=np.int32).reshape(COUNT, corners)


def test_touching_spheres_and_whether_their_centres_are_within():
    points, radius, vertex = bodies(4)
    centre, touching, within = tetrahedron.touching_spheres(points, radius, vertex, 1e-5)
    expected_centre, expected = closed_forms.touching_sphere(points[vertex], radius[vertex])
    real = np.isfinite(expected)
    assert np.array_equal(np.isfinite(touching), real)
    assert 50 < real.sum() < COUNT
    assert touching[real] == pytest.approx(expected[real], rel=1e-8)
    assert centre[real] == pytest.approx(expected_centre[real], rel=1e-7, abs=1e-8)
    # the centre is within where the four tetrahedra that it makes add up to the whole
    whole = np.abs(geometry.signed_volume(points[vertex]))
    parts = np.zeros(COUNT)
    for k in range(4):
        corner = points[vertex].copy()
        corner[:, k] = centre
        parts += np.abs(geometry.signed_volume(corner))
    inside = np.abs(parts / whole - 1.0) < 1e-6
    assert np.array_equal(inside[real], within[real])
    assert within.sum() > 10
    assert not within[~real].any()


def test_solids_in_tetrahedra():
    points, radius, vertex = bodies(4)
    measured = tetrahedron.solids(points, radius, vertex)
    expected = closed_forms.solid_in_tetrahedra(points[vertex], radius[vertex])
    for one, other in zip(measured, expected, strict=True):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12)


def test_power_centres_volumes_and_reaches():
    points, radius, vertex = bodies(4)
    shaken = points + 1e-7
    volume = np.abs(geometry.signed_volume(points[vertex]))
    flattest = float(np.quantile(volume, 0.1))
    centre, reach, given, flat = tetrahedron.centres(points, shaken, radius, vertex, flattest, 2.0)
    place = np.where((volume < flattest)[:, None, None], shaken[vertex], points[vertex])
    expected, power = closed_forms.power_centre(place, radius[vertex])
    assert given == pytest.approx(volume, rel=1e-12)
    assert np.array_equal(flat, volume < flattest)
    assert np.max(np.abs(centre - expected) / np.abs(expected).max(axis=1)[:, None]) < 1e-9
    assert reach == pytest.approx(np.sqrt(np.maximum(power + 4.0, 0.0)), rel=1e-9)


def test_sections():
    points, radius, vertex = bodies(3)
    inscribed, area, overlap = section.sections(points, radius, vertex, 1e-6)
    corner, disc = points[vertex], radius[vertex]
    expected = closed_forms.touching_circle(corner, disc)
    real = np.isfinite(expected)
    assert np.array_equal(np.isfinite(inscribed), real)
    assert 50 < real.sum() < COUNT
    assert inscribed[real] == pytest.approx(expected[real], rel=1e-8)
    assert area == pytest.approx(closed_forms.open_area(corner, disc), rel=1e-9, abs=1e-12)
    apart = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    assert np.array_equal(overlap, np.any(apart < disc + np.roll(disc, 1, axis=1), axis=1))


def test_heights_are_those_of_the_places_and_sides_those_of_the_shaken():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.0]])
    shaken = points + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, -1e-7]])
    centre = np.array([[0.2, 0.2, -0.5], [0.2, 0.2, -0.75]])
    measured = section.heights(
        points,
        shaken,
        np.array([[0, 1, 2]], np.int32),
        np.array([3]),
        centre,
        np.array([[0, 1]], np.int32),
        np.array([[0.0, 0.0, 1.0]]),
    )
    assert measured[0] == pytest.approx([0.5, 0.25], rel=1e-14)
