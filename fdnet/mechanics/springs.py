"""Joints of a pack, where two grains, or a grain and a wall, touch or are bonded, as springs."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import sparse

from fdnet.errors import MechanicsError
from fdnet.network.flow.solver import dissected, factored
from fdnet.spheres.geometry import touching_pairs, wrapped
from fdnet.spheres.snapshot import Array, Snapshot

WALL = -1  # Stands for a wall in the place of a second grain
CONTACT_GAP = 1e-6  # Two grains touch when their gap is below this share of the smaller diameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Joints:
    """K joints between N grains."""

    first: Array  # (K,) index of a grain
    second: Array  # (K,) index of the other grain, `WALL` for a wall
    overlap: Array  # (K,) m; a negative one is a gap
    normal: Array  # (K, 3) unit vector from the first grain to the second, or into the wall
    # (K, 3) m, from the centre of each grain to the point of contact; the second is zero for a
    # wall
    arm_first: Array
    arm_second: Array
    radius: Array  # (K,) m, of the smaller of the two grains

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
    kinds = [
        Joints(
            first=pairs[:, 0],
            second=pairs[:, 1],
            overlap=overlap,
            normal=normal,
            arm_first=normal * reach[:, None],
            arm_second=-normal * (distance - reach)[:, None],
            radius=radius.min(axis=1),
        )
    ]
    for axis, end in product(np.flatnonzero(~np.array(periodic)), (0, 1)):
        sign = 2.0 * end - 1.0
        away = sign * (grains.box[axis, end] - grains.position[:, axis])
        near = np.flatnonzero(away < grains.radius * (1 + 2 * gap))
        normal = np.repeat(sign * np.eye(3)[None, axis], len(near), axis=0)
        kinds.append(
            Joints(
                first=near,
                second=np.full(len(near), WALL),
                overlap=grains.radius[near] - away[near],
                normal=normal,
                arm_first=normal * away[near, None],
                arm_second=np.zeros((len(near), 3)),
                radius=grains.radius[near],
            )
        )
    names = Joints.__slots__
    return Joints(**{k: np.concatenate([getattr(one, k) for one in kinds]) for k in names})


def mean_force(grains: Snapshot, joints: Joints, pressure: float) -> float:
    """Mean force of a contact, N, under an isotropic `pressure`, Pa: 3 p V / sum(b).

    b are the branches of the joints (Digby 1981).
    """
    volume = float(np.prod(np.diff(grains.box, axis=1)))
    return 3 * pressure * volume / float(np.sum(np.linalg.norm(joints.branch, axis=1)))


# ------------------------------------------------------------------------------------------------
# From the motion of grains, and a uniform strain, to the displacements in the joints.
#
# Grains have six degrees of freedom: three displacements and three rotations times `length`, all
# in m. A uniform strain moves each centre, and each point of a wall, with it and turns nothing;
# the displacements of the grains come on top of that.


STRAINS = ("xx", "yy", "zz", "yz", "xz", "xy")
"""Order of the strains: three normal ones, then three shears by their angle (Voigt)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Kinematics:
    """Linear maps to the displacements in K joints, six a joint, in each joint's frame."""

    of_grains: sparse.csr_matrix  # (6 K, 6 N) sparse, from the motion of the grains
    of_strain: Array  # (6 K, 6), m, from a uniform strain in the order of `STRAINS`
    frame: Array  # (K, 3, 3) normal and two tangents of each joint
    length: float  # m, that turns a rotation into a degree of freedom


def kinematics(joints: Joints, count: int, *, length: float) -> Kinematics:
    """The maps of the joints between `count` grains."""
    frame = _frames(joints.normal)
    kept, place = ~joints.at_wall, np.arange(6)
    grain = np.concatenate([joints.first, joints.second[kept]])
    first, second = (_block(frame, arm, length) for arm in (joints.arm_first, joints.arm_second))
    block = np.concatenate([-first, second[kept]])
    row = 6 * np.arange(len(joints))[:, None, None] + place[None, :, None]
    row = np.broadcast_to(np.concatenate([row, row[kept]]), block.shape)
    column = np.broadcast_to(6 * grain[:, None, None] + place, block.shape)
    entries, shape = (row.ravel(), column.ravel()), (6 * len(joints), 6 * count)
    of_grains = sparse.csr_matrix((block.ravel(), entries), shape=shape)
    of_strain = _of_strain(frame, joints.branch)
    return Kinematics(of_grains=of_grains, of_strain=of_strain, frame=frame, length=length)


def _frames(normal: Array) -> Array:
    """(K, 3, 3) right-handed frames whose first rows are the unit vectors `normal` (K, 3)."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normal, first, np.cross(normal, first)], axis=1)


def _block(frame: Array, arm: Array, length: float) -> Array:
    """(K, 6, 6) displacements at the end of `arm` by the motion of the grain it belongs to."""
    x, y, z = arm.T
    none = np.zeros_like(x)
    # the product of `crossed` with a vector v is arm x v
    crossed = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=1).reshape(-1, 3, 3)
    block = np.zeros((len(arm), 6, 6))
    block[:, :3, :3] = frame
    block[:, :3, 3:] = -frame @ crossed / length
    block[:, 3:, 3:] = frame / length
    return block


def _of_strain(frame: Array, branch: Array) -> Array:
    """(6 K, 6): the strain times the branch, in the frame; the rotations stay 0."""
    x, y, z = branch.T
    moved = np.zeros((len(branch), 3, 6))
    moved[:, 0, 0], moved[:, 1, 1], moved[:, 2, 2] = x, y, z
    moved[:, 1, 3], moved[:, 0, 4], moved[:, 0, 5] = z / 2, z / 2, y / 2
    moved[:, 2, 3], moved[:, 2, 4], moved[:, 1, 5] = y / 2, x / 2, x / 2
    result = np.zeros((len(branch), 6, 6))
    result[:, :3] = frame @ moved
    return result.reshape(-1, 6)


# ------------------------------------------------------------------------------------------------
# Springs of the joints: contacts, and parallel bonds over their discs.
#
# A joint has six springs in its own frame: one along its normal, two across it, one that twists
# about the normal and two that bend.


@dataclass(frozen=True, slots=True, kw_only=True)
class Cement:
    """Parallel bonds, as a case gives them, in SI."""

    radius_ratio: float  # radius of the disc over that of the smaller grain
    normal: float  # normal stiffness per area, Pa/m
    shear: float  # shear stiffness per area, Pa/m
    tensile_strength: float = np.inf  # Pa; infinite: the bonds never break
    shear_strength: float = np.inf  # Pa; infinite: the bonds never break
    gap_ratio: float = 0.01  # widest gap that is bridged, over the smaller diameter


@dataclass(frozen=True, slots=True, kw_only=True)
class PackMaterial:
    """How grains act on each other, in SI."""

    normal: float  # normal stiffness of a contact of two grains, N/m
    shear: float  # tangential stiffness of such a contact, N/m
    friction: float = 0.55  # coefficient of sliding friction of two grains
    wall_friction: float = 0.0  # of a grain and a wall
    glued: bool = True  # whether grains stick to the walls, as to the plates of an elastic test
    density: float = 2650.0  # of the solid, kg/m3
    cement: Cement | None = None  # of the bonds; None without

    @property
    def gap(self) -> float:
        """Gap, over the smaller diameter, up to which two grains act on each other."""
        return max(CONTACT_GAP, 0.0 if self.cement is None else self.cement.gap_ratio)


def disc_radius(joints: Joints, material: PackMaterial) -> Array:
    """Radius (K,) m of the disc of each bond; 0 without one, as at walls that do not glue."""
    ratio = 0.0 if material.cement is None else material.cement.radius_ratio
    return np.where(joints.at_wall & (not material.glued), 0.0, ratio * joints.radius)


def contact_springs(joints: Joints, material: PackMaterial) -> Array:
    """(K, 6) stiffness of the contacts: N/m, and 0 N m for rotations; 0 across a gap."""
    touches = joints.overlap > -2 * CONTACT_GAP * joints.radius
    slides = joints.at_wall & (not material.glued and material.wall_friction == 0)
    normal = np.where(touches, material.normal, 0.0)
    shear = np.where(touches & ~slides, material.shear, 0.0)
    none = np.zeros(len(joints))
    return np.column_stack([normal, shear, shear, none, none, none])


def bond_springs(joints: Joints, material: PackMaterial) -> Array:
    """(K, 6) stiffness of the bonds: kn A, ks A twice, N/m, then ks J, kn I twice, N m.

    Of the disc of radius R the area is A = pi R^2, the second moment of area I = pi R^4 / 4 and
    the polar moment J = pi R^4 / 2 (Potyondy and Cundall 2004, equations 14 and 15).
    """
    cement = material.cement
    if cement is None:
        return np.zeros((len(joints), 6))
    radius = disc_radius(joints, material)
    area, bending, twist = np.pi * radius**2, np.pi * radius**4 / 4, np.pi * radius**4 / 2
    across, bend = cement.shear * area, cement.normal * bending
    along, turn = cement.normal * area, cement.shear * twist
    return np.column_stack([along, across, across, turn, bend, bend])


def bond_stress(force: Array, radius: Array) -> tuple[Array, Array]:
    """Largest tensile and shear stress (K,), Pa, in bonds with the forces (K, 6), N and N m.

    By the theory of beams: Fn / A + |Mb| R / I and |Fs| / A + |Mt| R / J, with Fn > 0 in tension
    and the `radius` R (K,) m of the disc (Potyondy and Cundall 2004, equation 16). Zero where
    there is no bond.
    """
    there = radius > 0
    moments = np.pi * radius**2, np.pi * radius**4 / 4, np.pi * radius**4 / 2
    area, bending, twist = (np.where(there, moment, 1.0) for moment in moments)
    bent = np.hypot(force[:, 4], force[:, 5])
    sheared = np.hypot(force[:, 1], force[:, 2])
    tension = force[:, 0] / area + bent * radius / bending
    shear = sheared / area + np.abs(force[:, 3]) * radius / twist
    return np.where(there, tension, 0.0), np.where(there, shear, 0.0)


# ---- Stiffness matrices of packs: assembled, and factored.
_FLOOR = 1e-11
"""Stiffness, over the largest, that keeps motions which no spring resists from growing."""

SolveLoad = Callable[[Array], Array]


def stiffness_matrix(of_grains: sparse.csr_matrix, springs: Array) -> sparse.csr_matrix:
    """Stiffness matrix B^T D B (6 N, 6 N), N/m, of joints with the springs (K, 6).

    Motions that nothing resists get 1e-11 of the largest stiffness, so that the system can be
    solved; no load acts on them.
    """
    matrix = (of_grains.T @ sparse.diags(springs.ravel()) @ of_grains).tocsr()
    floor = _FLOOR * float(matrix.diagonal().max(initial=0.0))
    return matrix + floor * sparse.identity(matrix.shape[0], format="csr")


def solver_of(matrix: sparse.csr_matrix) -> SolveLoad:
    """Solves with a stiffness matrix (6 N, 6 N) for one load (6 N,) at a time.

    It is factored once (`flow.solver.factored`), the six motions of a grain together: 10,000
    grains take 4 s and 0.6 GB.

    Raises MechanicsError where the matrix cannot be factored.
    """
    blocks, count = matrix.tobsr((6, 6)), matrix.shape[0] // 6
    entries = np.ones(len(blocks.indices)), blocks.indices, blocks.indptr
    links = sparse.csr_matrix(entries, shape=(count, count))
    try:
        return factored(matrix, (6 * dissected(links)[:, None] + np.arange(6)).ravel())
    except RuntimeError as error:
        raise MechanicsError(
            f"stiffness of {count} grains cannot be factored ({error}); raise the stiffness of "
            "the contacts or add bonds"
        ) from error
