"""Parts of tetrahedra inside a box: closed forms, and parts that add up to the whole."""

import numpy as np
import pytest

from fdnet.network import geometry
from fdnet.network.fines.deposit import clip_to_box

CORNER = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]])


def volume(corner, box, periodic=(False, False, False)):
    """Volume (C,) of the parts of tetrahedra in a box."""
    parts, owner = clip_to_box(corner, np.asarray(box, float), periodic)
    return np.bincount(owner, np.abs(geometry.signed_volume(parts)), minlength=len(corner))


@pytest.mark.parametrize("cut", [0.25, 0.5, 0.9])
def test_a_corner_and_the_wedge_below_it(cut):
    corner = (1 - cut) ** 3 / 6
    assert volume(CORNER, [[cut, 2], [-1, 2], [-1, 2]]) == pytest.approx([corner], rel=1e-12)
    assert volume(CORNER, [[-1, cut], [-1, 2], [-1, 2]]) == pytest.approx(
        [1 / 6 - corner], rel=1e-12
    )


def test_half_of_a_tetrahedron_with_two_corners_on_either_side():
    corner = np.array([[[-1.0, -1, 0], [-1, 1, 0], [1, 0, -1], [1, 0, 1]]])
    whole = np.abs(geometry.signed_volume(corner))
    assert volume(corner, [[0, 9], [-9, 9], [-9, 9]]) == pytest.approx(whole / 2, rel=1e-12)


def test_parts_in_the_boxes_of_a_grid_add_up_to_the_whole():
    corner = np.random.default_rng(4).random((300, 4, 3))
    whole = np.abs(geometry.signed_volume(corner))
    planes = [-1.0, 0.3, 0.55, 2.0]
    bounds = [(planes[k], planes[k + 1]) for k in range(3)]
    parts = [volume(corner, [x, y, z]) for x in bounds for y in bounds for z in bounds]
    assert sum(parts) == pytest.approx(whole, rel=1e-9)


def test_periodic_faces_cut_nothing_and_what_lies_outside_is_gone():
    assert volume(CORNER, [[0.5, 2], [0, 2], [0, 2]], (True, True, True)) == pytest.approx([1 / 6])
    assert volume(CORNER, [[2, 3], [-1, 2], [-1, 2]]) == pytest.approx([0.0], abs=0)


def test_a_facet_in_the_face_leaves_no_part_without_volume():
    parts, _ = clip_to_box(CORNER, np.array([[0.0, 1], [0, 1], [0, 1]]), (False,) * 3)
    assert np.all(np.abs(geometry.signed_volume(parts)) > 0)
    assert volume(CORNER, [[0, 1], [0, 1], [0, 1]]) == pytest.approx([1 / 6], rel=1e-12)
