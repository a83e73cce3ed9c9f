"""Groups of spheres of which no two touch."""

import itertools

import numpy as np
import pytest

from fdnet.spheres.geometry import groups_apart, touching_pairs
from fdnet.spheres.snapshot import resting

CORNER = np.zeros((1, 3))
FACES = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]])


def lattice(cell, cells: int, radius: float):
    """A periodic lattice of `cells` unit cells in each direction, with spheres at `cell`."""
    steps = np.array(list(itertools.product(range(cells), repeat=3)))
    places = (steps[:, None] + cell).reshape(-1, 3) + 0.1
    return resting(places, radius, np.array([[0.0, cells]] * 3))


@pytest.mark.parametrize(
    ("cell", "cells", "radius", "least", "most"),
    [
        (CORNER, 4, 0.49, 1, 1),
        (CORNER, 4, 0.51, 2, 2),
        (CORNER, 3, 0.51, 3, 7),
        (FACES, 3, np.sqrt(0.125), 4, 13),
    ],
    ids=["apart", "two by turns", "odd period", "twelve contacts"],
)
def test_no_two_of_a_group_touch_and_groups_are_few(cell, cells, radius, least, most):
    """Lattices whose number of groups is known, or its bounds: the cliques of a face-centred
    lattice have four spheres, and its spheres twelve contacts (exact contact counts here).
    """
    periodic = (True, True, True)
    spheres = lattice(cell, cells, radius)
    group = groups_apart(spheres, periodic)
    pairs, _ = touching_pairs(spheres, periodic, gap=1e-6)
    assert least <= group.max() <= most
    assert group.min() == 1
    assert not np.any(group[pairs[:, 0]] == group[pairs[:, 1]])
