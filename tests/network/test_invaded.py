"""The cake before the formation face."""

import numpy as np
import pytest

from fdnet.network.specimen import measure_invaded
from fdnet.spheres.snapshot import Kind
from tests.network.packs import snapshot

BOX = np.array([[0, 10], [0, 4], [0, 4.0]])
A = 0.1


def cake(fines, *, periodic=(False,) * 3):
    position = np.vstack([[[1.0, 2, 2]], np.array(fines, float).reshape(-1, 3)])
    count = len(position)
    spheres = snapshot(
        position,
        np.append(1.0, np.full(count - 1, A)),
        BOX,
        np.append(Kind.GRAIN, np.full(count - 1, Kind.FINE)),
    )
    return measure_invaded(spheres, periodic=periodic)


def test_chain_of_fines_on_a_grain_is_the_cake():
    """Three fines in a row from the grain's front at x = 0; a fourth apart from them."""
    invaded = cake([[-0.1, 2, 2], [-0.3, 2, 2], [-0.5, 2, 2], [-0.75, 2, 2]])
    assert invaded.cake_thickness == pytest.approx(0.6)
    assert invaded.count == 0
    assert invaded.depth == invaded.depth_p95 == 0.0


@pytest.mark.parametrize(("gap", "thickness"), [(0.0019, 0.4019), (0.0021, 0.2)])
def test_contact_is_a_gap_of_one_percent_of_the_smaller_diameter(gap, thickness):
    assert cake([[-0.1, 2, 2], [-0.3 - gap, 2, 2]]).cake_thickness == pytest.approx(thickness)


def test_fines_held_by_a_fine_inside_the_face_count():
    assert cake([[0.05, 0.5, 0.5], [-0.15, 0.5, 0.5]]).cake_thickness == pytest.approx(0.25)


def test_floating_fines_are_no_cake():
    assert cake([[-0.5, 2, 2], [-0.7, 2, 2]]).cake_thickness == 0.0
    assert cake([]).cake_thickness == 0.0


def test_contact_reaches_across_a_periodic_side():
    fines = [[0.05, 0.05, 2], [-0.10, 3.92, 2]]  # 0.13 apart across the side y
    assert cake(fines, periodic=(False, True, True)).cake_thickness == pytest.approx(0.2)
    assert cake(fines).cake_thickness == 0.0


def test_a_fine_a_rounding_below_a_periodic_side_is_wrapped():
    """Its place modulo the period is rounded to the period itself."""
    fines = [[0.05, -1e-20, 2], [-0.10, 0.13, 2]]
    assert cake(fines, periodic=(False, True, True)).cake_thickness == pytest.approx(0.2)
