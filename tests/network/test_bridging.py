"""Bridging statistics: classes of throats, Wilson's band, runs added up."""

import numpy as np
import pytest

from fdnet.run.bridging import Throats, bridging_rows, pooled
from fdnet.statistics.shares import wilson_interval


def throats(ratio, blocked):
    none = np.zeros(len(ratio), bool)
    return Throats(
        ratio=np.array(ratio),
        held=none,
        covered=none,
        clogged=np.array(blocked, bool),
        arrived=np.ones(len(ratio)),
    )


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
    assert wilson_interval(hits, trials) == pytest.approx((low, high), abs=5e-5)


def test_throats_fall_into_their_classes_and_runs_add_up():
    first = bridging_rows(throats([0.15, 0.2, 0.29, 2.0], [0, 1, 0, 1]), 0.1)
    assert [(row["ratio_lo"], row["ratio_hi"]) for row in first] == [
        (0.1, 0.2),
        (0.2, 0.3),
        (1.5, None),
    ]
    assert [row["throats"] for row in first] == [1, 2, 1]
    assert [row["blocked"] for row in first] == [0, 1, 1]
    second = bridging_rows(throats([0.25, 0.25], [1, 1]), 0.1)
    other = bridging_rows(throats([0.25], [0]), 0.2)
    rows = pooled([first, second, other])
    assert [
        (row["concentration"], row["ratio_lo"], row["throats"], row["blocked"]) for row in rows
    ] == [
        (0.1, 0.1, 1, 0),
        (0.1, 0.2, 4, 3),
        (0.1, 1.5, 1, 1),
        (0.2, 0.2, 1, 0),
    ]
    assert rows[1]["share_low"] < 0.75 < rows[1]["share_high"]
    assert rows[1]["arrived_mean"] == 1.0
