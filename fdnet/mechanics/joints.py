"""Joints of a pack: where two grains, or a grain and a wall, touch or are bonded."""

from dataclasses import dataclass

import numpy as np

from fdnet.spheres.arrays import one_line
from fdnet.spheres.contacts import touching_pairs
from fdnet.spheres.images import wrapped
from fdnet.spheres.snapshot import Array, Snapshot

WALL = -1
"""Stands for a wall in the place of a second grain."""
CONTACT_GAP = 1e-6
"""Two grains touch when their gap is below this share of the smaller diameter."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Joints:
    """K joints between N grains.

    Attributes:
        first: (K,) index of a grain.
        second: (K,) index of the other grain, `WALL` for a wall.
        overlap: (K,) m; a negative one is a gap.
        normal: (K, 3) unit vector from the first grain to the second, or into the wall.
        arm_first: (K, 3) m, from the centre of the first grain to the point of contact.
        arm_second: (K, 3) m, from the centre of the second grain; zero for a wall.
        radius: (K,) m, of the smaller of the two grains.
        joint_radius: (K,) m, R1 R2 / (R1 + R2); at a wall that of the grain.
    """

    first: Array
    second: Array
    overlap: Array
    normal: Array
    arm_first: Array
    arm_second: Array
    radius: Array
    joint_radius: Array

    __repr__ = one_line

    def __len__(self) -> int:
        return len(self.first)

    @property
    def at_wall(self) -> Array:
        """(K,) whether the second is a wall."""
        return self.second == WALL

    @property
    def branch(self) -> Array:
        """(K, 3) m, from centre to centre, or from the centre to the wall."""
        return self.arm_first - self.arm_second

    def where(self, mask: Array) -> "Joints":
        """The joints for which `mask` (K,) is true, or those of the indices `mask`."""
        return Joints(**{name: getattr(self, name)[mask] for name in self.__slots__})


def find_joints(
    grains: Snapshot, periodic: tuple[bool, bool, bool], *, gap: float = CONTACT_GAP
) -> Joints:
    """All pairs of grains, and grains at walls, that are nearer than `gap` smaller diameters.

    Sides that are not periodic are walls. The point of contact halves the overlap, as in PFC.
    """
    pairs, walls = _pair_joints(grains, periodic, gap), _wall_joints(grains, periodic, gap)
    return Joints(
        **{
            name: np.concatenate([getattr(pairs, name), getattr(walls, name)])
            for name in Joints.__slots__
        }
    )


def _pair_joints(grains: Snapshot, periodic: tuple[bool, bool, bool], gap: float) -> Joints:
    pairs, overlap = touching_pairs(grains, periodic, gap=gap)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    pairs, overlap = pairs[order], overlap[order]
    place = wrapped(grains.position, grains.box, periodic)
    side = np.diff(grains.box, axis=1)[:, 0]
    apart = place[pairs[:, 1]] - place[pairs[:, 0]]
    apart -= np.where(periodic, side * np.round(apart / side), 0.0)
    distance = np.linalg.norm(apart, axis=1)
    normal = apart / np.where(distance > 0, distance, 1.0)[:, None]
    radius = grains.radius[pairs]
    reach = radius[:, 0] - 0.5 * overlap
    return Joints(
        first=pairs[:, 0],
        second=pairs[:, 1],
        overlap=overlap,
        normal=normal,
        arm_first=normal * reach[:, None],
        arm_second=-normal * (distance - reach)[:, None],
        radius=radius.min(axis=1),
        joint_radius=radius.prod(axis=1) / radius.sum(axis=1),
    )


def _wall_joints(grains: Snapshot, periodic: tuple[bool, bool, bool], gap: float) -> Joints:
    owner, normal, distance = [], [], []
    for axis in (axis for axis in range(3) if not periodic[axis]):
        for end, sign in ((0, -1.0), (1, 1.0)):
            away = sign * (grains.box[axis, end] - grains.position[:, axis])
            near = np.flatnonzero(away < grains.radius * (1 + 2 * gap))
            owner.append(near)
            distance.append(away[near])
            normal.append(np.repeat(sign * np.eye(3)[None, axis], len(near), axis=0))
    which = np.concatenate([np.empty(0, int), *owner])
    length = np.concatenate([np.empty(0), *distance])
    facing = np.concatenate([np.empty((0, 3)), *normal])
    return Joints(
        first=which,
        second=np.full(len(which), WALL),
        overlap=grains.radius[which] - length,
        normal=facing,
        arm_first=facing * length[:, None],
        arm_second=np.zeros((len(which), 3)),
        radius=grains.radius[which],
        joint_radius=grains.radius[which],
    )
