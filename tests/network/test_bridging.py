"""What fines do to throats: classes by width and ratio, Wilson's band, runs added up."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from packs import simple_cubic

from fdnet.network.network import build_network
from fdnet.run.bridging import OpenThroats, classes_of, open_throats, width_rows, wilsons_band
from fdnet.spheres.snapshot import Snapshot


def throats(ratio, clogged):
    """Throats of width 1 that hold a fine of the ratio each."""
    none = np.zeros(len(ratio), bool)
    return OpenThroats(
        width=np.ones(len(ratio)),
        fine=np.array(ratio),
        held=~none,
        blocked=none,
        left=np.where(np.array(clogged, bool), 0.0, 1.0),
        between=~none,
    )


def rows_of(ratio, clogged, concentration):
    own = throats(ratio, clogged)
    return classes_of(own.fine, own, np.ones(len(ratio)), concentration)


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    [
        (0, 10, 0.0, 0.2775),
        (5, 10, 0.2366, 0.7634),
        (10, 10, 0.7225, 1.0),
        (81, 263, 0.2553, 0.3662),
    ],
)
def test_wilsons_band(hits, trials, low, high):
    """Values of Brown, Cai and DasGupta (2001), and Newcombe (1998) for 81 of 263."""
    assert wilsons_band(hits, trials) == pytest.approx((low, high), abs=5e-5)


def test_throats_fall_into_their_classes():
    first = rows_of([0.15, 0.2, 0.29, 2.0], [0, 1, 0, 1], 0.1)
    assert [(row["ratio_lo"], row["ratio_hi"]) for row in first] == [
        (0.1, 0.2),
        (0.2, 0.3),
        (1.5, None),
    ]
    assert [row["throats"] for row in first] == [1, 2, 1]
    assert [row["closed"] for row in first] == [0, 1, 1]


def specimen(network, *, fine=0.0, held=None, blocked=None, left=1.0):
    """An analysis of a network whose throats hold these fines."""
    count = len(network.throat_radius)
    none = np.zeros(count, bool)
    return SimpleNamespace(
        network=network,
        occupancy=SimpleNamespace(
            throat_fine_radius=np.broadcast_to(fine, count),
            throat_fines=none if held is None else held,
            blocked=none if blocked is None else blocked,
        ),
        conductance_initial=np.ones(count),
        conductance_damaged=np.broadcast_to(left, count),
    )


def test_bridged_throats_are_counted_by_width_with_the_fines_in_them():
    """Four widths between grains, one that they close, and one out to a mirror image."""
    network = SimpleNamespace(
        throat_radius=np.array([1.0, 2.0, 3.0, 4.0, 0.0, 9.0]),
        throat_images=np.array([*[[0, 1, 2]] * 5, [0, 1, 3]]),
        image_position=np.array([*[[0.5, 0.5, 0.5]] * 3, [0.5, -0.5, 0.5]]),
        box=np.array([[0.0, 1.0]] * 3),
        periodic=(False, False, True),
    )
    blocked = np.array([True, False, False, False, False, True])
    analysis = specimen(
        network,
        fine=np.array([0.5, 0.0, 2.0, 0.0, 9.0, 1.0]),
        held=np.array([1, 0, 2, 0, 3, 1]),
        blocked=blocked,
        left=np.array([0.0, 1.0, 0.5, 0.6, 1.0, 0.05]),
    )
    *rows, beside = width_rows(open_throats(analysis))
    assert [row["throats"] for row in rows] == [1, 1, 1, 1]
    assert [row["bridged"] for row in rows] == [1, 0, 1, 0]
    assert [row["blocked"] for row in rows] == [1, 0, 0, 0]
    assert [row["fine_over_throat"] for row in rows] == [0.5, None, pytest.approx(2 / 3), None]
    assert rows[-1]["throat_to_m"] == 8.0
    assert beside["throat_from_m"] is beside["fine_over_throat"] is None
    assert (beside["throats"], beside["bridged"], beside["fines_median_m"]) == (1, 1, 2.0)
    assert sum(row["blocked"] for row in (*rows, beside)) == blocked.sum()
    network.periodic = (False, True, True)  # then it is a grain beyond the period
    assert sum(row["throats"] for row in width_rows(open_throats(analysis))) == 5


def test_the_gap_to_a_wall_is_no_throat_of_the_sand():
    """Touching grains of a cubic lattice, 0.4 diameters d away from all walls.

    No circle through three corners of a cube is wider than the sphere around it, sqrt 3 d, so
    (sqrt 3 - 1) d = 0.73 d is left. Across the gap to the mirror images circles are wider.
    """
    bed = simple_cubic(repeat=3)
    d, size = 2.0 * float(bed.radius[0]), np.ptp(bed.box, axis=1)
    box = np.column_stack([np.zeros(3), size + 0.8 * d])
    place = bed.position - bed.box[:, 0] + 0.4 * d
    loose = Snapshot.from_arrays(place, bed.radius, box=box)
    network = build_network(loose, periodic=(False, False, False))
    *rows, beside = width_rows(open_throats(specimen(network)))
    assert beside["throat_to_m"] is None
    assert 2.0 * network.throat_radius.max() > 0.8 * d
    assert 0 < rows[-1]["throat_to_m"] <= (math.sqrt(3) - 1) * d * (1 + 1e-9)
