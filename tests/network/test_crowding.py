"""The porosity of the crowd around a fine."""

import numpy as np
import pytest
from scipy.stats import qmc

from fdnet.network.fines.crowding import DENSEST, local_porosity, weighted_volume
from fdnet.spheres.snapshot import Kind, Snapshot

BOX = np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]])
ALL = (False, True, True)


def spheres(position, radius, kind=Kind.FINE):
    position = np.atleast_2d(np.array(position, float))
    count = len(position)
    return Snapshot(
        step=0,
        time_s=0.0,
        box=BOX,
        id=np.arange(1, count + 1) + 1000 * (kind == Kind.FINE),
        kind=np.full(count, kind),
        position=position,
        radius=np.broadcast_to(np.asarray(radius, float), (count,)),
        velocity=np.zeros((count, 3)),
    )


def volume_by_points(ball, distance, radius):
    """Weighted volume of a sphere in a ball by evenly spread points, a second method."""
    turn, tilt, out = qmc.Sobol(3, seed=3).random(2**17).T
    cosine, far = 2 * tilt - 1, ball * np.cbrt(out)
    across = far * np.sqrt(1 - cosine**2)
    step = np.column_stack(
        [far * cosine, across * np.cos(2 * np.pi * turn), across * np.sin(2 * np.pi * turn)]
    )
    inside = np.sum((step - [distance, 0, 0]) ** 2, axis=1) < radius**2
    return 4 / 3 * np.pi * ball**3 * float(np.mean((1 - (far / ball) ** 2) ** 2 * inside))


@pytest.mark.parametrize("distance", [0.0, 0.3, 0.8, 1.4, 2.2])
@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0])
def test_the_weighted_volume_of_a_sphere_is_that_of_many_points(distance, radius):
    expected = volume_by_points(1.5, distance, radius)
    assert weighted_volume(radius, distance, 1.5) == pytest.approx(expected, rel=2e-3, abs=1e-3)


def test_a_lone_fine_has_porosity_one_in_the_mud_next_to_a_grain_and_at_a_wall():
    mud = local_porosity(spheres([[-3.0, 0.5, 0.5]], 0.01), ALL)
    assert mud.porosity == pytest.approx(1.0, rel=1e-12)
    beside = spheres([[0.5, 0.5, 0.5]], 0.2, Kind.GRAIN).joined(spheres([[0.5, 0.5, 0.71]], 0.01))
    assert local_porosity(beside, ALL).porosity == pytest.approx(1.0, rel=1e-12)
    corner = local_porosity(spheres([[0.5, 0.012, 0.013]], 0.01), (False, False, False))
    assert corner.porosity == pytest.approx(1.0, rel=1e-12)


def test_dilute_fines_have_the_porosity_of_the_suspension():
    """Random places without overlap at a fraction of 0.02: the mean must be 0.98."""
    rng = np.random.default_rng(5)
    radius, count = 0.02, round(0.02 / (4 / 3 * np.pi * 0.02**3))
    placed = np.empty((0, 3))
    while len(placed) < count:
        drawn = rng.random(3)
        gap = placed - drawn
        gap[:, 1:] -= np.round(gap[:, 1:])
        if not np.any(np.sum(gap**2, axis=1) < (2 * radius) ** 2):
            placed = np.vstack([placed, drawn])
    near = local_porosity(spheres(placed, radius), ALL)
    inner = np.abs(placed[:, 0] - 0.5) < 0.42
    assert float(np.mean(near.porosity[inner])) == pytest.approx(0.98, abs=0.004)


def lattice(spacing):
    axis = np.arange(spacing / 2, 1.0, spacing)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)


def test_a_grain_takes_space_and_leaves_the_crowd_beside_it_its_own_porosity():
    """A simple cubic bed cut by a large grain: fines at its surface see the bed, not the grain."""
    radius, spacing = 0.0245, 0.05
    bed = lattice(spacing)
    grain = np.array([0.5, 0.5, 0.5])
    outside = np.linalg.norm(bed - grain, axis=1) > 0.3 + radius
    fines = spheres(bed[outside], radius)
    both = spheres([grain], 0.3, Kind.GRAIN).joined(fines)
    inner = np.all(np.abs(fines.position[:, :1] - 0.5) < 0.35, axis=1)
    gap = np.linalg.norm(fines.position - grain, axis=1) - 0.3
    at_grain = inner & (gap < 1.5 * radius)
    own = 1 - 4 / 3 * np.pi * (radius / spacing) ** 3
    seen = local_porosity(both, ALL).porosity
    assert own < float(np.mean(seen[at_grain])) < own + 0.12, "fines that the grain cut are gone"
    alone = local_porosity(fines, ALL).porosity
    assert float(np.mean(alone[at_grain])) > float(np.mean(seen[at_grain])) + 0.03


def test_neighbours_are_seen_across_periodic_sides():
    bed = lattice(0.1)
    near = local_porosity(spheres(bed, 0.049), ALL)
    layer = np.abs(bed[:, 0] - 0.5) < 0.1
    assert np.ptp(near.porosity[layer]) < 1e-9


def test_a_mixture_counts_its_fines_by_volume_and_surface():
    """A small fine touching a large one: d32 of both, weighted by what lies in the ball."""
    pair = spheres([[0.5, 0.5, 0.5], [0.53, 0.5, 0.5]], [0.01, 0.02])
    near = local_porosity(pair, ALL, reach=20.0)
    cubes, squares = 0.01**3 + 0.02**3, 0.01**2 + 0.02**2
    assert near.size_ratio == pytest.approx(np.array([0.01, 0.02]) / (cubes / squares), rel=0.03)


def test_fines_pressed_into_each_other_are_capped_and_counted():
    crushed = spheres(lattice(0.05), 0.035)
    near = local_porosity(crushed, ALL)
    assert near.capped > 0
    assert near.porosity.min() == pytest.approx(1 - DENSEST, rel=1e-12)
