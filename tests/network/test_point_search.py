"""Points in boxes against trying every pair."""

import numpy as np
import pytest

from fdnet.network.fines.deposit import points_in_boxes


@pytest.mark.parametrize("stretch", [[1, 1, 1], [10, 1, 0], [1e-9, 0, 0], [0, 0, 0]])
def test_every_point_in_every_box_once(stretch):
    rng = np.random.default_rng(2)
    point = rng.random((300, 3)) * stretch
    low = (rng.random((50, 3)) * 1.6 - 0.3) * stretch
    high = low + rng.random((50, 3)) * np.array(stretch) * 0.6
    box, index = points_in_boxes(point, low, high)
    every = np.all((point >= low[:, None]) & (point <= high[:, None]), axis=2)
    assert sorted(zip(box, index, strict=True)) == [tuple(pair) for pair in np.argwhere(every)]
    assert np.all(np.diff(box) >= 0)


def test_nothing_is_found_among_nothing():
    empty = np.zeros((0, 3))
    assert len(points_in_boxes(empty, np.zeros((2, 3)), np.ones((2, 3)))[0]) == 0
    assert len(points_in_boxes(np.ones((2, 3)), empty, empty)[1]) == 0
