"""One load step of a pack: strain and stresses given, forces in balance.

A step is the least of a convex energy: contacts are closed or open, slide at the friction that
their normal force had before the step, and bonds are linear. Newton's method with a line search
finds it. A drag on the motion of the grains relative to the strain stands for the dissipation of
the real pack; steps at a constant load follow until it has faded.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fdnet.mechanics.deformed import SOUND, Deformed, Memory, remembered
from fdnet.mechanics.joints import Joints, find_joints
from fdnet.mechanics.kinematics import Kinematics, kinematics
from fdnet.mechanics.solver import direct
from fdnet.mechanics.springs import Material, bond_springs
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

REACH = 0.02
"""Gap over the smaller diameter within which a contact may close in a step."""
NEWTON_STEPS, _HALVES = 12, 12
"""Most Newton steps and halvings in one load step."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """A pack as one step sees it.

    Attributes:
        pack: before the step.
        joints: K joints, also across gaps that may close.
        maps: to the displacements in the joints.
        memory: of the joints.
        overlap: (K,) m, from which the contact bears.
        held: (K, 2) tangential force before the step, N, in the frame of the joint.
        bond: (K, 6) force of the bond before the step, in the frame.
        springs: (K, 6) of the bonds.
        limit: (K,) largest tangential force, N.
        volume: m3.
    """

    pack: Deformed
    joints: Joints
    maps: Kinematics
    memory: Memory
    overlap: Array
    held: Array
    bond: Array
    springs: Array
    limit: Array
    volume: float

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Forces:
    """What K joints bear.

    Attributes:
        total: (K, 6) N and N m, in the frame of the joint, tension above 0.
        tangent: (K, 6, 6) stiffness of the state, N/m and N m.
        normal: (K,) compression of the contact, N.
        shear: (K, 2) of the contact, N.
        bond: (K, 6) of the bond.
        sliding: (K,) whether the contact slides.
    """

    total: Array
    tangent: Array
    normal: Array
    shear: Array
    bond: Array
    sliding: Array

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Load:
    """What is asked of one step.

    Attributes:
        strain: (3,) strain along x, y, z where it is given; nan where the stress is.
        stress: (3,) stress, Pa, compression below 0; used where the strain is nan.
        drag: N/m, on the motion of the grains relative to the strain.
        within: N, norm of the missing forces at which the step is done.
    """

    strain: Array
    stress: Array
    drag: float
    within: float

    __repr__ = one_line


def scene_of(pack: Deformed, material: Material, periodic: tuple[bool, bool, bool]) -> Scene:
    """The pack with its joints, maps and limits of friction."""
    joints = find_joints(pack.grains, periodic, gap=max(REACH, material.gap))
    maps = kinematics(joints, len(pack.grains), length=float(pack.grains.radius.mean()))
    memory = remembered(pack, joints)
    whole = memory.bonded & (memory.broken == SOUND)
    overlap = joints.overlap - memory.rest
    friction = np.where(joints.at_wall, material.wall_friction, material.friction)
    springs = np.where(whole[:, None], bond_springs(joints, material), 0.0)
    turned = np.concatenate(
        [
            np.einsum("kij,kj->ki", maps.frame, memory.bond[:, :3]),
            np.einsum("kij,kj->ki", maps.frame, memory.bond[:, 3:]),
        ],
        axis=1,
    )
    return Scene(
        pack=pack,
        joints=joints,
        maps=maps,
        memory=memory,
        overlap=overlap,
        held=np.einsum("kij,kj->ki", maps.frame, memory.shear)[:, 1:],
        bond=np.where(whole[:, None], turned, 0.0),
        springs=springs,
        limit=friction * material.normal * np.maximum(overlap, 0.0),
        volume=float(np.prod(np.diff(pack.grains.box, axis=1))),
    )


def forces_at(scene: Scene, material: Material, moved_by: Array) -> Forces:
    """Forces in the joints after the displacements `moved_by` (K, 6) in them."""
    overlap = scene.overlap - moved_by[:, 0]
    closed = overlap >= 0
    normal = np.where(closed, material.normal * overlap, 0.0)
    trial = scene.held + np.where(scene.limit > 0, material.shear, 0.0)[:, None] * moved_by[:, 1:3]
    size = np.linalg.norm(trial, axis=1)
    sliding = size > scene.limit
    share = np.where(sliding, scene.limit / np.where(size > 0, size, 1.0), 1.0)
    shear = trial * share[:, None]
    bond = scene.bond + scene.springs * moved_by
    along = trial / np.where(size > 0, size, 1.0)[:, None]
    across = np.eye(2) - np.where(sliding, 1.0, 0.0)[:, None, None] * (
        along[:, :, None] * along[:, None, :]
    )
    tangent = scene.springs[:, :, None] * np.eye(6)
    tangent[:, 0, 0] += np.where(closed, material.normal, 0.0)
    tangent[:, 1:3, 1:3] += (np.where(scene.limit > 0, material.shear, 0.0) * share)[
        :, None, None
    ] * across
    total = bond.copy()
    total[:, 0] -= normal
    total[:, 1:3] += shear
    return Forces(
        total=total, tangent=tangent, normal=normal, shear=shear, bond=bond, sliding=sliding
    )


def balance(scene: Scene, material: Material, load: Load) -> tuple[Array, Array, int]:
    """Motion (6 N,) of the grains and strain (3,) of the box that balance the step.

    The third is the number of Newton steps that it took. What is missing after `NEWTON_STEPS` of
    them is left to the next step.
    """
    count = scene.maps.of_grains.shape[1]
    strain: Array = np.where(np.isnan(load.strain), 0.0, load.strain)
    free = np.flatnonzero(np.isnan(load.strain))
    motion, across = np.zeros(count), scene.maps.of_strain[:, :3][:, free]
    missing = _missing(scene, material, load, motion, strain)
    taken = 0
    while taken < NEWTON_STEPS and _norm(missing) > load.within:
        taken += 1
        forces = forces_at(scene, material, inner_moves(scene, motion, strain))
        step, widening = _newton(scene, forces, across, load, missing)
        way = np.zeros(3)
        way[free] = widening
        start, change = (motion, strain), (step, way)
        slope = _along(scene, material, load, start, change)
        along = np.concatenate([step, widening * scene.maps.length])
        part, missing = _least(slope, float(np.einsum("i,i", missing, along)))
        motion, strain = motion + part * step, strain + part * way
    return motion, strain, taken


def _along(
    scene: Scene,
    material: Material,
    load: Load,
    start: tuple[Array, Array],
    change: tuple[Array, Array],
) -> Callable[[float], tuple[float, Array]]:
    """Fall of the energy, N m, along a change of motion and strain, and what is missing there."""
    free = np.isnan(load.strain)
    along = np.concatenate([change[0], change[1][free] * scene.maps.length])

    def slope(part: float) -> tuple[float, Array]:
        motion, strain = (one + part * way for one, way in zip(start, change, strict=True))
        left = _missing(scene, material, load, motion, strain)
        return float(np.einsum("i,i", left, along)), left

    return slope


def _least(slope: Callable[[float], tuple[float, Array]], start: float) -> tuple[float, Array]:
    """The part of a step at which the energy hardly falls any more, and what is missing there.

    The energy is convex, so its slope only changes from downhill to uphill once.
    """
    low, high, part = 0.0, np.inf, 1.0
    for _ in range(_HALVES):
        now, missing = slope(part)
        if abs(now) <= 0.5 * abs(start):
            break
        low, high = (part, high) if now > 0 else (low, part)
        part = 0.5 * (low + high) if high < np.inf else 2 * part
        if part > 8:
            break
    return part, missing


def _norm(values: Array) -> float:
    return float(np.sqrt(np.einsum("i,i", values, values)))


def inner_moves(scene: Scene, motion: Array, strain: Array) -> Array:
    given = scene.maps.of_grains @ motion + scene.maps.of_strain[:, :3] @ strain
    return given.reshape(-1, 6)


def _missing(scene: Scene, material: Material, load: Load, motion: Array, strain: Array) -> Array:
    """Forces (6 N + F,) that are missing for balance, N.

    The last F are those of the stresses that are given, times volume over a length.
    """
    forces = forces_at(scene, material, inner_moves(scene, motion, strain)).total.ravel()
    free = np.isnan(load.strain)
    grains = -(scene.maps.of_grains.T @ forces) - load.drag * motion
    stress = scene.maps.of_strain[:, :3].T @ forces / scene.volume
    box = ((load.stress - stress) * scene.volume)[free] / scene.maps.length
    return np.concatenate([grains, box])


def _newton(
    scene: Scene, forces: Forces, across: Array, load: Load, missing: Array
) -> tuple[Array, Array]:
    """Change of the motion (6 N,) and of the free strains (F,) by the tangent stiffness."""
    of_grains = scene.maps.of_grains
    joints, count = np.arange(len(forces.tangent)), of_grains.shape[1]
    springs = sparse.bsr_matrix((forces.tangent, joints, np.arange(len(joints) + 1))).tocsr()
    matrix = (of_grains.T @ springs @ of_grains).tocsr()
    matrix = matrix + load.drag * sparse.identity(count, format="csr")
    solve = direct(matrix)
    moved_by = solve(missing[:count])
    if across.shape[1] == 0:
        return moved_by, np.empty(0)
    pulled = springs @ across
    coupling = of_grains.T @ pulled
    reply = np.column_stack([solve(column) for column in coupling.T])
    own = across.T @ pulled - coupling.T @ reply
    own += 1e-9 * np.trace(own) * np.eye(len(own)) + load.drag * scene.maps.length**2 * np.eye(
        len(own)
    )
    wanted = missing[count:] * scene.maps.length - coupling.T @ moved_by
    widening = np.linalg.solve(own, wanted)
    return moved_by - reply @ widening, widening
