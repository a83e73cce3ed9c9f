"""From the motion of grains, and a uniform strain, to the displacements in the joints.

Grains have six degrees of freedom: three displacements and three rotations times `length`, all in
m. A uniform strain moves each centre, and each point of a wall, with it and turns nothing; the
displacements of the grains come on top of that.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fdnet.mechanics.joints import Joints
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

STRAINS = ("xx", "yy", "zz", "yz", "xz", "xy")
"""Order of the strains: three normal ones, then three shears by their angle (Voigt)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Kinematics:
    """Linear maps to the displacements in K joints, six a joint, in each joint's frame.

    Attributes:
        of_grains: (6 K, 6 N) sparse, from the motion of the grains.
        of_strain: (6 K, 6), m, from a uniform strain in the order of `STRAINS`.
        frame: (K, 3, 3) normal and two tangents of each joint.
        length: m, that turns a rotation into a degree of freedom.
    """

    of_grains: sparse.csr_matrix
    of_strain: Array
    frame: Array
    length: float

    __repr__ = one_line


def kinematics(joints: Joints, count: int, *, length: float) -> Kinematics:
    """The maps of the joints between `count` grains."""
    frame = frames(joints.normal)
    near = _block(frame, joints.arm_first, length)
    far = _block(frame, joints.arm_second, length)
    return Kinematics(
        of_grains=_sparse(joints, near, far, count),
        of_strain=_of_strain(frame, joints.branch),
        frame=frame,
        length=length,
    )


def frames(normal: Array) -> Array:
    """(K, 3, 3) right-handed frames whose first rows are the unit vectors `normal` (K, 3)."""
    least = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normal, first, np.cross(normal, first)], axis=1)


def _block(frame: Array, arm: Array, length: float) -> Array:
    """(K, 6, 6) displacements at the end of `arm` by the motion of the grain it belongs to."""
    block = np.zeros((len(arm), 6, 6))
    block[:, :3, :3] = frame
    block[:, :3, 3:] = -frame @ _crossed(arm) / length
    block[:, 3:, 3:] = frame / length
    return block


def _crossed(arm: Array) -> Array:
    """(K, 3, 3) matrices whose product with a vector v is arm x v."""
    x, y, z = arm.T
    none = np.zeros_like(x)
    return np.stack([none, -z, y, z, none, -x, -y, x, none], axis=1).reshape(-1, 3, 3)


def _sparse(joints: Joints, near: Array, far: Array, count: int) -> sparse.csr_matrix:
    row = 6 * np.arange(len(joints))[:, None, None] + np.arange(6)[None, :, None]
    column = np.arange(6)[None, None, :]
    kept = ~joints.at_wall
    parts = [(joints.first, -near, row), (joints.second[kept], far[kept], row[kept])]
    rows, columns, values = [], [], []
    for grain, block, line in parts:
        place = 6 * grain[:, None, None] + column
        rows.append(np.broadcast_to(line, block.shape).ravel())
        columns.append(np.broadcast_to(place, block.shape).ravel())
        values.append(block.ravel())
    shape = (6 * len(joints), 6 * count)
    return sparse.csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape
    )


def _of_strain(frame: Array, branch: Array) -> Array:
    """(6 K, 6): the strain times the branch, in the frame; the rotations stay 0."""
    x, y, z = branch.T
    none = np.zeros_like(x)
    moved = np.stack(
        [
            np.stack([x, none, none, none, z / 2, y / 2], axis=1),
            np.stack([none, y, none, z / 2, none, x / 2], axis=1),
            np.stack([none, none, z, y / 2, x / 2, none], axis=1),
        ],
        axis=1,
    )
    result = np.zeros((len(branch), 6, 6))
    result[:, :3] = frame @ moved
    return result.reshape(-1, 6)
