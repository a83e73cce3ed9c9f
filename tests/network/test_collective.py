"""The preconditioner of the wall forces: symmetric, positive definite, and worth its cost."""

import numpy as np
import pytest

import fdnet
from fdnet.network import stokes
from fdnet.network.field.field import build_lattice, on_grid
from fdnet.network.stokes import (
    Problem,
    find_walls,
    neighbour_differences,
    summed_product,
)


def _grains() -> fdnet.Snapshot:
    """Grains of two sizes at 4 x 3 x 3 places, shaken, in a box of 4 x 3 x 3 mm."""
    place = (np.indices((4, 3, 3)).reshape(3, -1).T + 0.5) * 1e-3
    shaken = place + 0.1e-3 * np.random.default_rng(1).standard_normal(place.shape)
    radius = np.where(np.arange(len(place)) % 3 == 0, 0.35e-3, 0.5e-3)
    return fdnet.Snapshot.from_arrays(
        shaken, radius, box=np.array([[0.0, 4e-3], [0.0, 3e-3], [0.0, 3e-3]])
    )


def _problem(periodic: str) -> Problem:
    sides = ("x" in periodic, "y" in periodic, "z" in periodic)
    grains, diameter = _grains(), 2.0 * float(_grains().radius.mean())
    lattice = build_lattice(
        grains.box, sides, spacing=diameter / 8.0, upstream=1e-3, downstream=0.5 * diameter
    )
    kept = grains.where(on_grid(lattice, grains.position, grains.radius))
    walls = [find_walls(lattice, d, kept.position, kept.radius) for d in range(3)]
    return Problem(walls, lattice.response, 4.0)


def test_differences_are_those_with_the_six_neighbours_at_the_walls_alone() -> None:
    numbers = np.random.default_rng(3)
    weight = np.maximum(numbers.random((3, 5, 6, 7)) - 0.5, 0.0).astype("f")
    value = numbers.standard_normal(weight.shape).astype("f") * (weight > 0)
    beside = sum(np.roll(value, step, axis) for axis in (1, 2, 3) for step in (1, -1))
    expected = np.where(weight > 0, value + 0.5 * (6.0 * value - beside), 0.0)
    assert neighbour_differences(value, weight, 0.5) == pytest.approx(expected, abs=1e-5)


def test_the_greatest_eigenvalue_is_known_to_half_a_percent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """More steps of the process of Lanczos can only raise it."""
    slow = _problem("").collective
    few = slow.greatest()
    monkeypatch.setattr(stokes, "PROBED", 60)
    assert few == pytest.approx(slow.greatest(), rel=5e-3)


@pytest.mark.parametrize("periodic", ["yz", "z", ""])
def test_the_preconditioner_is_symmetric_and_positive_definite(periodic: str) -> None:
    problem = _problem(periodic)
    walled = problem.weight > 0
    one, two = np.random.default_rng(2).standard_normal((2, *walled.shape)).astype("f") * walled
    slow = np.zeros_like(one)  # along x, once to and fro across the box: most of it is taken out
    across = (np.arange(walled.shape[2]) + 0.5) / walled.shape[2]
    slow[0] = problem.weight[0] * np.cos(2.0 * np.pi * across)[:, None]
    one, two = problem.project(one), problem.project(two)
    assert summed_product(one, problem.smoothed(two)) == pytest.approx(
        summed_product(two, problem.smoothed(one)), rel=1e-4
    )
    for force in (one, two, slow):
        assert summed_product(force, problem.smoothed(force)) > 0.0
    assert summed_product(slow, problem.smoothed(slow)) < 0.7 * summed_product(
        slow, problem.differences(slow)
    )


def test_fewer_iterations_give_the_same_flow(monkeypatch: pytest.MonkeyPatch) -> None:
    fields = []
    for share in (0.0, stokes.TAKEN_OUT):
        monkeypatch.setattr(stokes, "TAKEN_OUT", share)
        fields.append(fdnet.velocity_field(_grains(), periodic="yz", cells=10.0, tolerance=0.01))
    without, taken = fields
    assert taken.solved.iterations < 0.7 * without.solved.iterations
    assert taken.resistance == pytest.approx(without.resistance, rel=1e-4)
