"""A pack confined and compressed, quasi-statically: its joints, load steps and the test."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from fdnet.errors import CaseError, MechanicsError
from fdnet.mechanics import springs
from fdnet.mechanics.springs import CONTACT_GAP, Joints, Kinematics, PackMaterial
from fdnet.spheres.snapshot import Array, Snapshot, one_line, resting

SOUND, TENSION, SHEAR = 0, 1, 2  # State of a bond: whole, or broken in tension or in shear


class Memory(NamedTuple):
    """What K joints remember."""

    rest: Array  # (K,) m, overlap at which the contact bears nothing
    shear: Array  # (K, 3) tangential force of the contact, N
    bond: Array  # (K, 6) force and moment of the bond, N and N m, along x, y, z
    bonded: Array  # (K,) whether there was a bond
    broken: Array  # (K,) `SOUND`, `TENSION` or `SHEAR`

    @property
    def whole(self) -> Array:
        """(K,) whether there is a bond that is not broken."""
        return self.bonded & (self.broken == SOUND)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deformed:
    """A pack under load, where its grains and the faces of its box are."""

    grains: Snapshot
    key: Array  # (M,) numbers of the joints that remember something, sorted; see `keys_of`
    memory: Memory  # of these joints
    strain: Array  # (3,) of the box since the start, logarithmic; compression is below 0


def at_rest(
    grains: Snapshot, material: PackMaterial, periodic: tuple[bool, bool, bool], *, relieved: bool
) -> Deformed:
    """A pack before any load.

    `relieved` takes the overlaps as the state without stress; otherwise they are compressed
    springs. Bonds hold no force yet.
    """
    joints = springs.find_joints(grains, periodic, gap=material.gap)
    key, count = keys_of(joints, len(grains)), len(joints)
    order = np.argsort(key)
    touches = joints.overlap > -2 * CONTACT_GAP * joints.radius
    memory = Memory(
        rest=np.where(touches & relieved, joints.overlap, 0.0)[order],
        shear=np.zeros((count, 3)),
        bond=np.zeros((count, 6)),
        bonded=(~joints.at_wall & (material.cement is not None))[order],
        broken=np.full(count, SOUND),
    )
    return Deformed(grains=grains, key=key[order], memory=memory, strain=np.zeros(3))


def keys_of(joints: Joints, count: int) -> Array:
    """(K,) one number for each pair of grains, and for each grain and wall."""
    axis = np.argmax(np.abs(joints.normal), axis=1)
    side = np.take_along_axis(joints.normal, axis[:, None], axis=1)[:, 0] > 0
    other = np.where(joints.at_wall, count + 2 * axis + side, joints.second)
    return joints.first * (count + 6) + other


# ------------------------------------------------------------------------------------------------
# One load step of a pack: strain and stresses given, forces in balance.
#
# A step is the least of a convex energy: contacts are closed or open, slide at the friction that
# their normal force had before the step, and bonds are linear. Newton's method with a line search
# finds it. A drag on the motion of the grains relative to the strain stands for the dissipation of
# the real pack; steps at a constant load follow until it has faded.


REACH = 0.02  # Gap over the smaller diameter within which a contact may close in a step
NEWTON_STEPS, _HALVES = 12, 12  # Most Newton steps and halvings in one load step


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadedPack:
    """A pack as one step sees it."""

    pack: Deformed  # before the step
    material: PackMaterial
    joints: Joints  # K joints, also across gaps that may close
    maps: Kinematics  # to the displacements in the joints
    memory: Memory  # of the joints
    overlap: Array  # (K,) m, from which the contact bears
    held: Array  # (K, 2) tangential force before the step, N, in the frame of the joint
    bond: Array  # (K, 6) force of the bond before the step, in the frame
    springs: Array  # (K, 6) of the bonds
    limit: Array  # (K,) largest tangential force, N
    volume: float  # m3

    def moves(self, motion: Array, strain: Array) -> Array:
        """Displacements (K, 6) in the joints by a motion (6 N,) and a strain (3,)."""
        given = self.maps.of_grains @ motion + self.maps.of_strain[:, :3] @ strain
        return given.reshape(-1, 6)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointForces:
    """What K joints bear."""

    total: Array  # (K, 6) N and N m, in the frame of the joint, tension above 0
    tangent: Array  # (K, 6, 6) stiffness of the state, N/m and N m
    normal: Array  # (K,) compression of the contact, N
    shear: Array  # (K, 2) of the contact, N
    bond: Array  # (K, 6) of the bond
    sliding: Array  # (K,) whether the contact slides


class Load(NamedTuple):
    """What is asked of one step."""

    strain: Array  # (3,) strain along x, y, z where it is given; nan where the stress is
    stress: Array  # (3,) stress, Pa, compression below 0; used where the strain is nan
    drag: float  # N/m, on the motion of the grains relative to the strain
    within: float  # N, norm of the missing forces at which the step is done


def loaded_pack(
    pack: Deformed, material: PackMaterial, periodic: tuple[bool, bool, bool]
) -> LoadedPack:
    """The pack with its joints, what they remember, maps and limits of friction.

    Forces across the normal are turned with it, at their size.
    """
    joints = springs.find_joints(pack.grains, periodic, gap=max(REACH, material.gap))
    maps = springs.kinematics(joints, len(pack.grains), length=float(pack.grains.radius.mean()))
    key, kept = keys_of(joints, len(pack.grains)), pack.memory
    place = np.minimum(np.searchsorted(pack.key, key), max(0, len(pack.key) - 1))
    known = pack.key[place] == key if len(pack.key) else np.zeros(len(key), bool)
    force = np.where(known[:, None], kept.shear[place], 0.0)
    across = force - np.einsum("ki,ki->k", force, joints.normal)[:, None] * joints.normal
    length = np.linalg.norm(across, axis=1)
    turn = np.linalg.norm(force, axis=1) / np.where(length > 0, length, 1.0)
    memory = Memory(
        rest=np.where(known, kept.rest[place], 0.0),
        shear=across * turn[:, None],
        bond=np.where(known[:, None], kept.bond[place], 0.0),
        bonded=known & kept.bonded[place],
        broken=np.where(known, kept.broken[place], SOUND),
    )
    whole, overlap = memory.whole[:, None], joints.overlap - memory.rest
    friction = np.where(joints.at_wall, material.wall_friction, material.friction)
    bond = np.einsum("kij,klj->kli", maps.frame, memory.bond.reshape(-1, 2, 3)).reshape(-1, 6)
    return LoadedPack(
        pack=pack,
        material=material,
        joints=joints,
        maps=maps,
        memory=memory,
        overlap=overlap,
        held=np.einsum("kij,kj->ki", maps.frame, memory.shear)[:, 1:],
        bond=np.where(whole, bond, 0.0),
        springs=np.where(whole, springs.bond_springs(joints, material), 0.0),
        limit=friction * material.normal * np.maximum(overlap, 0.0),
        volume=float(np.prod(np.diff(pack.grains.box, axis=1))),
    )


def forces_at(loaded: LoadedPack, moved_by: Array) -> JointForces:
    """Forces in the joints after the displacements `moved_by` (K, 6) in them."""
    material, overlap = loaded.material, loaded.overlap - moved_by[:, 0]
    closed = overlap >= 0
    normal = np.where(closed, material.normal * overlap, 0.0)
    stiff = np.where(loaded.limit > 0, material.shear, 0.0)
    trial = loaded.held + stiff[:, None] * moved_by[:, 1:3]
    size = np.linalg.norm(trial, axis=1)
    sliding, least = size > loaded.limit, np.where(size > 0, size, 1.0)
    share = np.where(sliding, loaded.limit / least, 1.0)
    shear, along = trial * share[:, None], trial / least[:, None]
    across = np.eye(2) - np.where(sliding, 1.0, 0.0)[:, None, None] * (
        along[:, :, None] * along[:, None, :]
    )
    bond = loaded.bond + loaded.springs * moved_by
    tangent = loaded.springs[:, :, None] * np.eye(6)
    tangent[:, 0, 0] += np.where(closed, material.normal, 0.0)
    tangent[:, 1:3, 1:3] += (stiff * share)[:, None, None] * across
    total = bond.copy()
    total[:, 0] -= normal
    total[:, 1:3] += shear
    return JointForces(
        total=total, tangent=tangent, normal=normal, shear=shear, bond=bond, sliding=sliding
    )


def balance(loaded: LoadedPack, load: Load) -> tuple[Array, Array, int]:
    """Motion (6 N,) of the grains and strain (3,) of the box that balance the step.

    The third is the number of Newton steps that it took. What is missing after `NEWTON_STEPS` of
    them is left to the next step.
    """
    strain: Array = np.where(np.isnan(load.strain), 0.0, load.strain)
    free = np.flatnonzero(np.isnan(load.strain))
    motion = np.zeros(loaded.maps.of_grains.shape[1])
    missing = _missing(loaded, load, motion, strain)
    taken = 0
    while taken < NEWTON_STEPS and np.sqrt(np.einsum("i,i", missing, missing)) > load.within:
        taken += 1
        forces = forces_at(loaded, loaded.moves(motion, strain))
        step, widening = _newton(loaded, forces, free, load, missing)
        way = np.zeros(3)
        way[free] = widening
        along = np.concatenate([step, widening * loaded.maps.length])
        start = abs(float(np.einsum("i,i", missing, along)))
        # the energy is convex: its slope changes from downhill to uphill once
        low, high, part = 0.0, np.inf, 1.0
        for _ in range(_HALVES):
            missing = _missing(loaded, load, motion + part * step, strain + part * way)
            slope = float(np.einsum("i,i", missing, along))
            if abs(slope) <= 0.5 * start:
                break
            low, high = (part, high) if slope > 0 else (low, part)
            part = 0.5 * (low + high) if high < np.inf else 2 * part
            if part > 8:
                break
        motion, strain = motion + part * step, strain + part * way
    return motion, strain, taken


def _missing(loaded: LoadedPack, load: Load, motion: Array, strain: Array) -> Array:
    """Forces (6 N + F,) that are missing for balance, N.

    The last F are those of the stresses that are given, times volume over a length.
    """
    forces = forces_at(loaded, loaded.moves(motion, strain)).total.ravel()
    grains = -(loaded.maps.of_grains.T @ forces) - load.drag * motion
    stress = loaded.maps.of_strain[:, :3].T @ forces / loaded.volume
    box = ((load.stress - stress) * loaded.volume)[np.isnan(load.strain)] / loaded.maps.length
    return np.concatenate([grains, box])


def _newton(
    loaded: LoadedPack, forces: JointForces, free: Array, load: Load, missing: Array
) -> tuple[Array, Array]:
    """Change of the motion (6 N,) and of the `free` (F,) strains by the tangent stiffness."""
    of_grains, across = loaded.maps.of_grains, loaded.maps.of_strain[:, :3][:, free]
    joints, count = np.arange(len(forces.tangent)), of_grains.shape[1]
    stiff = sparse.bsr_matrix((forces.tangent, joints, np.arange(len(joints) + 1))).tocsr()
    matrix = (of_grains.T @ stiff @ of_grains).tocsr()
    solve = springs.solver_of(matrix + load.drag * sparse.identity(count, format="csr"))
    moved_by = solve(missing[:count])
    if not len(free):
        return moved_by, np.empty(0)
    pulled = stiff @ across
    coupling = of_grains.T @ pulled
    reply = np.column_stack([solve(column) for column in coupling.T])
    own, square = across.T @ pulled - coupling.T @ reply, loaded.maps.length**2
    own += 1e-9 * np.trace(own) * np.eye(len(own)) + load.drag * square * np.eye(len(own))
    wanted = missing[count:] * loaded.maps.length - coupling.T @ moved_by
    widening = np.linalg.solve(own, wanted)
    return moved_by - reply @ widening, widening


def carried_out(loaded: LoadedPack, motion: Array, strain: Array) -> tuple[Deformed, JointForces]:
    """The pack after a motion (6 N,) on top of a strain (3,) of the box, and what it bears.

    Bonds that no longer have a joint within reach are remembered as they were.
    """
    forces = forces_at(loaded, loaded.moves(motion, strain))
    pack, frame = loaded.pack, loaded.maps.frame
    bond = np.einsum("kji,klj->kli", frame, forces.bond.reshape(-1, 2, 3)).reshape(-1, 6)
    shear = np.einsum("kji,kj->ki", frame[:, 1:], forces.shear)
    memory = loaded.memory._replace(shear=shear, bond=bond)
    grains, shift = pack.grains, motion.reshape(-1, 6)[:, :3]
    low = grains.box[:, :1]
    box = low + (grains.box - low) * (1 + strain)[:, None]
    place = low[:, 0] + (grains.position - low[:, 0]) * (1 + strain) + shift
    key = keys_of(loaded.joints, len(grains))
    kept, lost = np.argsort(key), pack.memory.bonded & ~np.isin(pack.key, key)
    key = np.concatenate([key[kept], pack.key[lost]])
    order = np.argsort(key)
    values = [
        np.concatenate([now[kept], before[lost]])[order]
        for now, before in zip(memory, pack.memory, strict=True)
    ]
    after = Deformed(
        grains=resting(place, grains.radius, box, grains.kind),
        key=key[order],
        memory=Memory(*values),
        strain=pack.strain + np.log1p(strain),
    )
    return after, forces


def overloaded(loaded: LoadedPack, forces: JointForces) -> tuple[Array, Array]:
    """Stress over strength (K,) of each whole bond, and how it would break."""
    cement = loaded.material.cement
    if cement is None:
        return np.zeros(len(loaded.joints)), np.full(len(loaded.joints), SOUND)
    tension, shear = springs.bond_stress(
        forces.bond, springs.disc_radius(loaded.joints, loaded.material)
    )
    pulled = tension / cement.tensile_strength
    cut = shear / cement.shear_strength
    ratio = np.where(loaded.memory.whole, np.maximum(pulled, cut), 0.0)
    return ratio, np.where(pulled >= cut, TENSION, SHEAR)


# ------------------------------------------------------------------------------------------------
# The triaxial test: confining stress held on the sides, axial strain rising, quasi-statically.
#
# Each load step raises the axial strain; then the pack is brought to rest at that strain, bonds
# beyond their strength break, those nearest to it first, and it is brought to rest again.


MOST_DRAG, LEAST_DRAG = 1e-1, 1e-4
"""Drag on the motion of grains relative to the strain, over the stiffness of a contact: at the
first step of each load, and what it falls to as the steps get easy."""
MOST_RESTS = 60  # Most steps at one load before the pack counts as restless
_GROUP = 0.8  # Bonds break together whose stress over strength is above this share of the largest
MOST_OVERLAP = 0.05
"""Overlap over diameter that a confining stress may cause; springs hold no more."""
CONFINING_STEPS = 4  # Steps in which the confining stress is put on
PROBE = 0.1  # Part of the first load step that gives the initial slope


@dataclass(frozen=True, slots=True, kw_only=True)
class Triaxial:
    """What a triaxial test does.

    `tolerance` is the largest unbalanced force over the mean force of a contact, and the largest
    change of the axial stress between two steps at rest, over the stress.
    """

    confining: float  # stress on the sides, Pa
    strain: float = 0.02  # axial, at the end; compression above 0
    steps: int = 40  # load steps to that strain
    tolerance: float = 1e-2
    relieved: bool = True  # whether the overlaps of the pack are its state without stress


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadStep:
    """The pack at rest after one load step; stresses in Pa, compression above 0."""

    axial_strain: float  # logarithmic, since the confining stress was reached
    volume_strain: float  # the same of the volume
    axial: float  # stress along x
    side: float  # mean stress along y and z
    tension: int  # bonds broken in tension so far
    shear: int  # bonds broken in shear so far
    contacts: float  # closed contacts of two grains over grains
    sliding: float  # share of the closed contacts that slide
    unbalanced: float  # largest unbalanced force over the mean contact force
    rests: int  # steps that it took

    @property
    def deviatoric(self) -> float:
        """Axial less side stress, Pa."""
        return self.axial - self.side


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sheared:
    """A finished triaxial test."""

    test: Triaxial  # what was done
    rows: tuple[LoadStep, ...]  # the pack after the confining stress, then after each load step
    pack: Deformed  # at the end
    bonds: int  # number of bonds at the start
    restless: int  # load steps that never came within the tolerance

    __repr__ = one_line

    @property
    def young(self) -> float:
        """Slope of the first load step, Pa."""
        start, first = self.rows[:2]
        return (first.deviatoric - start.deviatoric) / first.axial_strain

    @property
    def poisson(self) -> float:
        """Sideways over axial strain of the first load step."""
        return 0.5 * (1 - self.rows[1].volume_strain / self.rows[1].axial_strain)

    @property
    def peak(self) -> LoadStep:
        """The row of the largest deviatoric stress."""
        return max(self.rows, key=lambda row: row.deviatoric)


def triaxial(
    grains: Snapshot,
    material: PackMaterial,
    test: Triaxial,
    *,
    periodic: tuple[bool, bool, bool],
    follow: Callable[[LoadStep], None] = lambda row: None,
) -> Sheared:
    """Confine a pack of grains and compress it along x.

    Walls are smooth plates that move with the box. `follow` is called with each row.

    Raises CaseError for a stress that the springs cannot hold, MechanicsError for a pack that
    carries none.
    """
    material = replace(material, glued=False)
    pack, row, restless = confined(grains, material, test, periodic)
    pack = replace(pack, strain=np.zeros(3))
    rows = [replace(row, axial_strain=0.0, volume_strain=0.0)]
    follow(rows[0])
    step, stress = 1 / test.steps, np.full(3, -test.confining)
    # the first step is divided, for the initial slope
    for share in (PROBE * step, (1 - PROBE) * step, *[step] * (test.steps - 1)):
        strain = np.array([-share * test.strain, np.nan, np.nan])
        pack, row, calm = _brought_to_rest(pack, material, test, periodic, strain, stress)
        restless += not calm
        rows.append(row)
        follow(row)
    bonds = int(pack.memory.bonded.sum())
    return Sheared(test=test, rows=tuple(rows), pack=pack, bonds=bonds, restless=restless)


def confined(
    grains: Snapshot, material: PackMaterial, test: Triaxial, periodic: tuple[bool, bool, bool]
) -> tuple[Deformed, LoadStep, int]:
    """The pack under the confining stress, its row, and steps that did not come to rest.

    Raises what `triaxial` raises.
    """
    joints = springs.find_joints(grains, periodic, gap=material.gap)
    if len(joints) == 0:
        raise MechanicsError(
            f"pack of {len(grains)} grains has no contacts; make it denser, or bridge its gaps "
            "with bonds.gap_ratio"
        )
    stress, diameter = test.confining, 2 * float(grains.radius.mean())
    overlap = springs.mean_force(grains, joints, stress) / material.normal / diameter
    if overlap > MOST_OVERLAP:
        raise CaseError(
            f"--confining-MPa: {stress / 1e6:g} presses grains {100 * overlap:.3g} % of a "
            f"diameter into each other, expected at most {100 * MOST_OVERLAP:g} % "
            f"({stress / 1e6 * MOST_OVERLAP / overlap:.3g} MPa); lower the stress or raise "
            "grains.normal_stiffness_N_m"
        )
    pack = at_rest(grains, material, periodic, relieved=test.relieved)
    restless, parts = 0, CONFINING_STEPS if test.relieved else 1
    for part in range(1, parts + 1):
        held, free = np.full(3, -stress * part / parts), np.full(3, np.nan)
        pack, row, calm = _brought_to_rest(pack, material, test, periodic, free, held)
        restless += not calm
    if row.contacts == 0 or not row.axial > 0.5 * stress:
        raise MechanicsError(
            f"pack of {len(pack.grains)} grains does not hold {stress:.3g} Pa: it bears "
            f"{row.axial:.3g} Pa along x; take a denser pack"
        )
    return pack, row, restless


def _brought_to_rest(
    pack: Deformed,
    material: PackMaterial,
    test: Triaxial,
    periodic: tuple[bool, bool, bool],
    strain: Array,
    stress: Array,
) -> tuple[Deformed, LoadStep, bool]:
    """The pack after a strain (3,) and steps at rest, its row, and whether it came to rest.

    Where the strain is nan the stress (3,), Pa, is held. Raises MechanicsError for a pack that
    falls apart.
    """
    drag, before = MOST_DRAG, np.inf
    within = 0.1 * test.tolerance * test.confining * 4 * float(pack.grains.radius.mean()) ** 2
    for rests in range(1, MOST_RESTS + 1):
        loaded = loaded_pack(pack, material, periodic)
        load = Load(strain=strain, stress=stress, drag=drag * material.normal, within=within)
        motion, given, taken = balance(loaded, load)
        if len(loaded.joints) == 0 or not np.all(given > -1.0):
            raise MechanicsError(
                f"pack of {len(pack.grains)} grains falls apart under {test.confining:.3g} Pa: "
                "its contacts open before they bear the stress; take a denser pack, a lower "
                "--confining-MPa, or bonds"
            )
        strain = np.where(np.isnan(strain), np.nan, 0.0)
        pack, forces = carried_out(loaded, motion, given)
        # the bonds that are farthest beyond their strength break
        ratio, how = overloaded(loaded, forces)
        worst = float(ratio.max(initial=0.0))
        if worst > 1:
            gone = ratio >= max(1.0, _GROUP * worst)
            place = np.searchsorted(pack.key, keys_of(loaded.joints, len(pack.grains))[gone])
            broken, bond = pack.memory.broken.copy(), pack.memory.bond.copy()
            broken[place], bond[place] = how[gone], 0.0
            pack = replace(pack, memory=pack.memory._replace(broken=broken, bond=bond))
        row = _row_of(pack, loaded, forces, rests)
        easier = 0.25 if taken < NEWTON_STEPS // 2 else 1.0 if taken < NEWTON_STEPS else 4.0
        drag = min(max(drag * easier, LEAST_DRAG), MOST_DRAG)
        change = abs(row.axial - before) / max(abs(row.axial), 1e-300)
        before = row.axial
        if worst <= 1 and row.unbalanced <= test.tolerance and change <= test.tolerance:
            return pack, row, True
    return pack, row, False


def _row_of(pack: Deformed, loaded: LoadedPack, forces: JointForces, rests: int) -> LoadStep:
    total = loaded.maps.of_strain[:, :3].T @ forces.total.ravel() / loaded.volume
    left = loaded.maps.of_grains.T @ forces.total.ravel()
    pairs = (forces.normal > 0) & ~loaded.joints.at_wall
    mean = float(forces.normal[pairs].mean()) if pairs.any() else 1e-300
    return LoadStep(
        axial_strain=-float(pack.strain[0]),
        volume_strain=-float(pack.strain.sum()),
        axial=-float(total[0]),
        side=-float(total[1:].mean()),
        tension=int(np.sum(pack.memory.broken == TENSION)),
        shear=int(np.sum(pack.memory.broken == SHEAR)),
        contacts=2 * float(pairs.sum()) / len(pack.grains),
        sliding=float(np.mean(forces.sliding[pairs])) if pairs.any() else 0.0,
        unbalanced=float(np.abs(left).max()) / mean,
        rests=rests,
    )
