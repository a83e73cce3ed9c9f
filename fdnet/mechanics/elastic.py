"""Elastic moduli of a pack from one sparse stiffness and six uniform strains, without time steps.

The pack is a cell with periodic sides or with walls that move with the strain. For each strain the
grains find the displacements and rotations of least energy; twice that energy over volume and
squared strain is the tensor.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fdnet.errors import MechanicsError
from fdnet.mechanics import springs
from fdnet.mechanics.springs import STRAINS, Joints, PackMaterial
from fdnet.spheres.snapshot import Array, Snapshot, one_line

LEAST_STIFFNESS = 1e-7
"""Stiffness along an axis, over that of grains held to the uniform strain, below which a pack
does not carry."""


@dataclass(frozen=True, slots=True)
class Moduli:
    """Elastic constants of an isotropic material, Pa."""

    bulk: float  # K
    shear: float  # G

    @property
    def young(self) -> float:
        """9 K G / (3 K + G)."""
        return 9 * self.bulk * self.shear / (3 * self.bulk + self.shear)

    @property
    def poisson(self) -> float:
        """(3 K - 2 G) / (6 K + 2 G)."""
        return (3 * self.bulk - 2 * self.shear) / (6 * self.bulk + 2 * self.shear)


def voigt_average(tensor: Array) -> Moduli:
    """The isotropic material with the mean stiffness over all directions (Voigt; Hill 1952)."""
    normal, sideways = np.trace(tensor[:3, :3]), tensor[0, 1] + tensor[0, 2] + tensor[1, 2]
    bulk = float(normal + 2 * sideways) / 9
    return Moduli(bulk, float(normal - sideways + 3 * np.trace(tensor[3:, 3:])) / 15)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Elastic:
    """Elastic behaviour of a pack for small strains."""

    tensor: Array  # (6, 6) stiffness, Pa, in the order xx, yy, zz, yz, xz, xy
    affine: Array  # (6, 6) the same with all grains held to the uniform strain: an upper bound
    density: float  # of the dry pack, kg/m3
    coordination: float  # mean number of joints with other grains, of a grain that carries
    grains: int  # number of grains
    rattlers: int  # grains that carry nothing
    contacts: int  # joints that touch, those with walls among them
    bonds: int  # bonded joints
    joints: Joints  # all joints of the grains that carry; their indices count all grains
    # (6, N, 6) for each strain the displacement and rotation of each grain on top of the uniform
    # strain, m and rad
    motion: Array

    __repr__ = one_line

    @property
    def averaged(self) -> Moduli:
        """The mean of the tensor over all directions."""
        return voigt_average(self.tensor)

    @property
    def compliance(self) -> Array | None:
        """The inverse (6, 6), 1/Pa, of the tensor; None where something yields freely."""
        return None if np.linalg.cond(self.tensor) > 1e12 else np.linalg.inv(self.tensor)

    @property
    def anisotropy(self) -> float | None:
        """5 G_V / G_R + K_V / K_R - 6: 0 when isotropic (Ranganathan and Ostoja-Starzewski 2008).

        V is the mean stiffness over all directions, R the mean compliance (Reuss). None where the
        tensor has no inverse.
        """
        if (soft := self.compliance) is None:
            return None
        normal, sideways = np.trace(soft[:3, :3]), soft[0, 1] + soft[0, 2] + soft[1, 2]
        bulk = 1 / float(normal + 2 * sideways)
        shear = 15 / float(4 * normal - 4 * sideways + 3 * np.trace(soft[3:, 3:]))
        return 5 * self.averaged.shear / shear + self.averaged.bulk / bulk - 6

    @property
    def young_along(self) -> tuple[float, ...] | None:
        """Young's modulus, Pa, along x, y and z with free sides: 1 / S_ii; None as above."""
        soft = self.compliance
        return None if soft is None else tuple(float(1 / value) for value in np.diag(soft)[:3])

    @property
    def waves(self) -> tuple[float, float]:
        """Velocity of P waves, sqrt((K + 4 G / 3) / rho), and of S waves, sqrt(G / rho), m/s."""
        bulk, shear = self.averaged.bulk, self.averaged.shear
        p_wave = np.sqrt((bulk + 4 / 3 * shear) / self.density)
        return float(p_wave), float(np.sqrt(shear / self.density))


def elastic_of(
    grains: Snapshot,
    material: PackMaterial,
    *,
    periodic: tuple[bool, bool, bool],
    porosity: float = 0.0,
) -> Elastic:
    """Elastic tensor of a pack of `grains` alone; sides that are not `periodic` are walls.

    The `porosity` is for its density. Raises MechanicsError where the pack does not carry a load
    along every axis.
    """
    joints, kept = carrying(grains, material, periodic)
    volume = float(np.prod(np.diff(grains.box, axis=1)))
    count, length = len(grains), float(grains.radius.mean()) if len(grains) else 1.0
    contacts, pairs = springs.contact_springs(joints, material), ~joints.at_wall
    stiff = contacts + springs.bond_springs(joints, material)
    maps = springs.kinematics(joints, count, length=length)
    pulled = stiff.reshape(-1, 1) * maps.of_strain
    affine = maps.of_strain.T @ pulled / volume
    moving, motion = np.repeat(kept, 6), np.zeros((6 * count, len(STRAINS)))
    if kept.any():
        live = maps.of_grains[:, np.flatnonzero(moving)]
        solve, load = springs.solver_of(springs.stiffness_matrix(live, stiff)), -(live.T @ pulled)
        motion[moving] = np.column_stack([solve(column) for column in load.T])
    tensor = affine + (pulled.T @ (maps.of_grains @ motion)) / volume
    tensor = 0.5 * (tensor + tensor.T)
    rattlers = int(count - kept.sum())
    for axis in range(3):
        if not tensor[axis, axis] > LEAST_STIFFNESS * affine[axis, axis]:
            raise MechanicsError(
                f"pack of {count} grains carries no load along {'xyz'[axis]}: {rattlers} of them "
                "carry nothing, and the joints of the rest form no path from side to side; make "
                "the pack denser, or bridge wider gaps with bonds.gap_ratio"
            )
    shown = motion.T.reshape(len(STRAINS), count, 6).copy()
    shown[:, :, 3:] /= length
    return Elastic(
        tensor=tensor,
        affine=affine,
        density=(1 - porosity) * material.density,
        coordination=2 * float(pairs.sum()) / max(1, int(kept.sum())),
        grains=count,
        rattlers=rattlers,
        contacts=int(np.sum(contacts[:, 0] > 0)),
        bonds=0 if material.cement is None else int(pairs.sum()),
        joints=joints,
        motion=shown,
    )


def carrying(
    grains: Snapshot, material: PackMaterial, periodic: tuple[bool, bool, bool]
) -> tuple[Joints, Array]:
    """Joints of the grains that can carry a load, and which grains those are (N,).

    Grains with fewer than two joints are taken out until none is left, and so are groups that
    touch neither walls nor the largest group.
    """
    joints, count = springs.find_joints(grains, periodic, gap=material.gap), len(grains)
    kept = np.ones(count, bool)
    while True:
        live = kept[joints.first] & (joints.at_wall | kept[joints.second])
        ends = np.concatenate([joints.first[live], joints.second[live & ~joints.at_wall]])
        single = kept & (np.bincount(ends, minlength=count) < 2)
        if not single.any():
            break
        kept = kept & ~single
    # the walls are one more grain, which joins what touches them
    other = np.where(joints.at_wall, count, joints.second)
    links = sparse.coo_matrix(
        (np.ones(live.sum()), (joints.first[live], other[live])), shape=(count + 1, count + 1)
    )
    group = connected_components(links, directed=False)[1][:-1]
    if count:
        kept = kept & (group == np.argmax(np.bincount(group, weights=kept)))
    return joints.where(kept[joints.first] & (joints.at_wall | kept[joints.second])), kept
