"""A pack while it is deformed: places, box, and what its joints remember."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from fdnet.errors import CaseError, MechanicsError
from fdnet.mechanics.springs import (
    CONTACT_GAP,
    Joints,
    Kinematics,
    Material,
    bond_springs,
    bond_stress,
    direct,
    discs_of,
    find_joints,
    kinematics,
)
from fdnet.spheres.snapshot import Array, Snapshot, one_line, resting

SOUND, TENSION, SHEAR = 0, 1, 2
"""State of a bond: whole, or broken in tension or in shear."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deformed:
    """A pack under load.

    Attributes:
        grains: where the grains and the faces of the box are.
        key: (M,) numbers of the joints that remember something, sorted; see `keys_of`.
        rest: (M,) m, overlap at which the contact bears nothing.
        shear: (M, 3) tangential force of the contact, N.
        bond: (M, 6) force and moment of the bond, N and N m, along x, y, z.
        bonded: (M,) whether there was a bond.
        broken: (M,) `SOUND`, `TENSION` or `SHEAR`.
        strain: (3,) of the box since the start, logarithmic; compression is below 0.
    """

    grains: Snapshot
    key: Array
    rest: Array
    shear: Array
    bond: Array
    bonded: Array
    broken: Array
    strain: Array

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Memory:
    """What K joints remember, in the order of the joints; the fields are those of `Deformed`."""

    rest: Array
    shear: Array
    bond: Array
    bonded: Array
    broken: Array

    __repr__ = one_line


def at_rest(
    grains: Snapshot, material: Material, periodic: tuple[bool, bool, bool], *, relieved: bool
) -> Deformed:
    """A pack before any load.

    `relieved` takes the overlaps as the state without stress; otherwise they are compressed
    springs. Bonds hold no force yet.
    """
    joints = find_joints(grains, periodic, gap=material.gap)
    key = keys_of(joints, len(grains))
    order = np.argsort(key)
    touches = joints.overlap > -2 * CONTACT_GAP * joints.radius
    count = len(joints)
    rest = np.where(touches & relieved, joints.overlap, 0.0)
    return Deformed(
        grains=grains,
        key=key[order],
        rest=rest[order],
        shear=np.zeros((count, 3)),
        bond=np.zeros((count, 6)),
        bonded=(~joints.at_wall & (material.cement is not None))[order],
        broken=np.full(count, SOUND),
        strain=np.zeros(3),
    )


def keys_of(joints: Joints, count: int) -> Array:
    """(K,) one number for each pair of grains, and for each grain and wall."""
    axis = np.argmax(np.abs(joints.normal), axis=1)
    side = np.take_along_axis(joints.normal, axis[:, None], axis=1)[:, 0] > 0
    other = np.where(joints.at_wall, count + 2 * axis + side, joints.second)
    return joints.first * (count + 6) + other


def remembered(pack: Deformed, joints: Joints) -> Memory:
    """What the joints of the pack remember; new ones remember nothing.

    Forces across the normal are turned with it, at their size.
    """
    key = keys_of(joints, len(pack.grains))
    place = np.minimum(np.searchsorted(pack.key, key), max(0, len(pack.key) - 1))
    known = pack.key[place] == key if len(pack.key) else np.zeros(len(key), bool)
    column = known[:, None]
    return Memory(
        rest=np.where(known, pack.rest[place], 0.0),
        shear=_across(np.where(column, pack.shear[place], 0.0), joints.normal),
        bond=np.where(column, pack.bond[place], 0.0),
        bonded=known & pack.bonded[place],
        broken=np.where(known, pack.broken[place], SOUND),
    )


def _across(force: Array, normal: Array) -> Array:
    size = np.linalg.norm(force, axis=1)
    flat = force - np.einsum("ki,ki->k", force, normal)[:, None] * normal
    length = np.linalg.norm(flat, axis=1)
    return flat * (size / np.where(length > 0, length, 1.0))[:, None]


def moved(pack: Deformed, joints: Joints, memory: Memory, shift: Array, strain: Array) -> Deformed:
    """The pack after its grains moved by `shift` (N, 3) m on top of a strain (3,) of the box."""
    grains = pack.grains
    low = grains.box[:, :1]
    box = low + (grains.box - low) * (1 + strain)[:, None]
    place = low[:, 0] + (grains.position - low[:, 0]) * (1 + strain) + shift
    key = keys_of(joints, len(grains))
    kept = np.argsort(key)
    lost = pack.bonded & ~np.isin(pack.key, key)
    key = np.concatenate([key[kept], pack.key[lost]])
    order = np.argsort(key)
    values = {
        name: np.concatenate([getattr(memory, name)[kept], getattr(pack, name)[lost]])[order]
        for name in Memory.__slots__
    }
    return Deformed(
        grains=resting(place, grains.radius, box, grains.kind),
        key=key[order],
        strain=pack.strain + np.log1p(strain),
        **values,
    )


# ------------------------------------------------------------------------------------------------
# One load step of a pack: strain and stresses given, forces in balance.
#
# A step is the least of a convex energy: contacts are closed or open, slide at the friction that
# their normal force had before the step, and bonds are linear. Newton's method with a line search
# finds it. A drag on the motion of the grains relative to the strain stands for the dissipation of
# the real pack; steps at a constant load follow until it has faded.


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


# ------------------------------------------------------------------------------------------------
# A pack after a load step: where it is, what its joints remember, which bonds are overloaded.


def carried_out(
    scene: Scene, material: Material, motion: Array, strain: Array
) -> tuple[Deformed, Forces]:
    """The pack after a step, and the forces in its joints."""
    forces = forces_at(scene, material, inner_moves(scene, motion, strain))
    frame = scene.maps.frame
    memory = Memory(
        rest=scene.memory.rest,
        shear=np.einsum("kji,kj->ki", frame[:, 1:], forces.shear),
        bond=np.concatenate(
            [
                np.einsum("kji,kj->ki", frame, forces.bond[:, :3]),
                np.einsum("kji,kj->ki", frame, forces.bond[:, 3:]),
            ],
            axis=1,
        ),
        bonded=scene.memory.bonded,
        broken=scene.memory.broken,
    )
    shift = motion.reshape(-1, 6)[:, :3]
    return moved(scene.pack, scene.joints, memory, shift, strain), forces


def overloaded(scene: Scene, forces: Forces, material: Material) -> tuple[Array, Array]:
    """Stress over strength (K,) of each whole bond, and how it would break."""
    if material.cement is None:
        return np.zeros(len(scene.joints)), np.full(len(scene.joints), SOUND)
    tension, shear = bond_stress(forces.bond, discs_of(scene.joints, material))
    pulled, cut = (
        tension / material.cement.tensile_strength,
        shear / material.cement.shear_strength,
    )
    whole = scene.memory.bonded & (scene.memory.broken == SOUND)
    ratio = np.where(whole, np.maximum(pulled, cut), 0.0)
    return ratio, np.where(pulled >= cut, TENSION, SHEAR)


# ------------------------------------------------------------------------------------------------
# A pack brought to rest under a load: steps at that load until the forces balance.


MOST_DRAG = 1e-1
"""Drag of the first step at each load, over the stiffness of a contact.

It falls to `Triaxial.drag` as the steps get easy."""
_GROUP = 0.8
"""Bonds break together whose stress over strength is above this share of the largest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Triaxial:
    """What a triaxial test does.

    Attributes:
        confining: stress on the sides, Pa.
        strain: axial strain at the end, compression above 0.
        steps: load steps to that strain.
        tolerance: largest unbalanced force over the mean force of a contact, and the largest
            change of the axial stress between two steps at rest, over the stress.
        drag: on the motion of grains relative to the strain, over the stiffness of a contact.
        rests: most steps at one load before the pack counts as restless.
        relieved: whether the overlaps of the pack are its state without stress.
        sides: whether the stress is held on the sides (a triaxial test); otherwise they do not
            move (an oedometer).
    """

    confining: float
    strain: float = 0.02
    steps: int = 40
    tolerance: float = 1e-2
    drag: float = 1e-4
    rests: int = 60
    relieved: bool = True
    sides: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """The pack at rest after one load step; stresses in Pa, compression above 0.

    Attributes:
        axial_strain: logarithmic, since the confining stress was reached.
        volume_strain: the same of the volume; compression above 0.
        axial: stress along x.
        side: mean stress along y and z.
        tension: bonds broken in tension so far.
        shear: bonds broken in shear so far.
        contacts: closed contacts of two grains over grains.
        sliding: share of the closed contacts that slide.
        unbalanced: largest unbalanced force over the mean contact force.
        rests: steps that it took.
    """

    axial_strain: float
    volume_strain: float
    axial: float
    side: float
    tension: int
    shear: int
    contacts: float
    sliding: float
    unbalanced: float
    rests: int

    @property
    def deviatoric(self) -> float:
        """Axial less side stress, Pa."""
        return self.axial - self.side


def brought_to_rest(
    pack: Deformed,
    material: Material,
    test: Triaxial,
    periodic: tuple[bool, bool, bool],
    *,
    strain: Array,
    stress: Array,
) -> tuple[Deformed, Row, bool]:
    """The pack after a strain (3,) and steps at rest, its row, and whether it came to rest.

    Where the strain is nan the stress (3,), Pa, is held.
    """
    drag, now, before = MOST_DRAG, strain, np.inf
    still = np.where(np.isnan(strain), np.nan, 0.0)
    within = 0.1 * test.tolerance * test.confining * 4 * float(pack.grains.radius.mean()) ** 2
    for rests in range(1, test.rests + 1):
        scene = scene_of(pack, material, periodic)
        load = Load(strain=now, stress=stress, drag=drag * material.normal, within=within)
        motion, given, taken = balance(scene, material, load)
        pack, forces = carried_out(scene, material, motion, given)
        pack, fell = _broken(pack, scene, forces, material)
        now = still
        row = _row_of(pack, scene, forces, rests)
        drag = min(max(drag * _eased(taken), test.drag), MOST_DRAG)
        change = abs(row.axial - before) / max(abs(row.axial), 1e-300)
        before = row.axial
        if not fell and row.unbalanced <= test.tolerance and change <= test.tolerance:
            return pack, row, True
    return pack, row, False


def _eased(taken: int) -> float:
    """Factor on the drag after a step of `taken` Newton steps."""
    if taken < NEWTON_STEPS // 2:
        return 0.25
    return 1.0 if taken < NEWTON_STEPS else 4.0


def _broken(
    pack: Deformed, scene: Scene, forces: Forces, material: Material
) -> tuple[Deformed, bool]:
    """The pack without the bonds that are nearest beyond their strength."""
    ratio, how = overloaded(scene, forces, material)
    worst = float(ratio.max(initial=0.0))
    if worst <= 1:
        return pack, False
    gone = ratio >= max(1.0, _GROUP * worst)
    place = np.searchsorted(pack.key, keys_of(scene.joints, len(pack.grains))[gone])
    broken, bond = pack.broken.copy(), pack.bond.copy()
    broken[place], bond[place] = how[gone], 0.0
    return replace(pack, broken=broken, bond=bond), True


def _row_of(pack: Deformed, scene: Scene, forces: Forces, rests: int) -> Row:
    total = scene.maps.of_strain[:, :3].T @ forces.total.ravel() / scene.volume
    left = scene.maps.of_grains.T @ forces.total.ravel()
    pairs = (forces.normal > 0) & ~scene.joints.at_wall
    mean = float(forces.normal[pairs].mean()) if pairs.any() else 1e-300
    return Row(
        axial_strain=0.0,
        volume_strain=0.0,
        axial=-float(total[0]),
        side=-float(total[1:].mean()),
        tension=int(np.sum(pack.broken == TENSION)),
        shear=int(np.sum(pack.broken == SHEAR)),
        contacts=2 * float(pairs.sum()) / len(pack.grains),
        sliding=float(np.mean(forces.sliding[pairs])) if pairs.any() else 0.0,
        unbalanced=float(np.abs(left).max()) / mean,
        rests=rests,
    )


# ------------------------------------------------------------------------------------------------
# The triaxial test: confining stress held on the sides, axial strain rising, quasi-statically.
#
# Each load step raises the axial strain; then the pack is brought to rest at that strain, bonds
# beyond their strength break, those nearest to it first, and it is brought to rest again.


MOST_OVERLAP = 0.05
"""Overlap over diameter that a confining stress may cause; springs hold no more."""
CONFINING_STEPS = 4
"""Steps in which the confining stress is put on."""
PROBE = 0.1
"""Part of the first load step that gives the initial slope."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sheared:
    """A finished triaxial test.

    Attributes:
        test: what was done.
        rows: the pack after the confining stress, then after each load step.
        confined: the pack under the confining stress.
        pack: at the end.
        bonds: number of bonds at the start.
        restless: load steps that never came within the tolerance.
    """

    test: Triaxial
    rows: tuple[Row, ...]
    confined: Deformed
    pack: Deformed
    bonds: int
    restless: int

    __repr__ = one_line

    @property
    def young(self) -> float:
        """Slope of the first load step, Pa."""
        first, second = self.rows[0], self.rows[1]
        return (second.deviatoric - first.deviatoric) / (second.axial_strain - first.axial_strain)

    @property
    def poisson(self) -> float:
        """Sideways over axial strain of the first load step."""
        first, second = self.rows[0], self.rows[1]
        axial = second.axial_strain - first.axial_strain
        return 0.5 * (1 - (second.volume_strain - first.volume_strain) / axial)

    @property
    def peak(self) -> Row:
        """The row of the largest deviatoric stress."""
        return max(self.rows, key=lambda row: row.deviatoric)


def triaxial(
    grains: Snapshot,
    material: Material,
    test: Triaxial,
    *,
    periodic: tuple[bool, bool, bool],
    follow: Callable[[Row], None] = lambda row: None,
) -> Sheared:
    """Confine a pack of grains and compress it along x.

    Walls are smooth plates that move with the box. `follow` is called with each row.

    Raises CaseError for a stress that the springs cannot hold, MechanicsError for a pack that
    carries none.
    """
    material = replace(material, glued=False)
    refuse_stress(grains, material, test.confining, periodic)
    start = at_rest(grains, material, periodic, relieved=test.relieved)
    pack, row, restless = _confined(start, material, test, periodic)
    begun = pack = replace(pack, strain=np.zeros(3))
    rows = [_since(row, pack)]
    follow(rows[0])
    sides = np.nan if test.sides else 0.0
    for share in _shares(test.steps):
        pack, row, calm = brought_to_rest(
            pack,
            material,
            test,
            periodic,
            strain=np.array([-share * test.strain, sides, sides]),
            stress=np.full(3, -test.confining),
        )
        restless += not calm
        rows.append(_since(row, pack))
        follow(rows[-1])
    return Sheared(
        test=test,
        rows=tuple(rows),
        confined=begun,
        pack=pack,
        bonds=int(pack.bonded.sum()),
        restless=restless,
    )


def _shares(steps: int) -> list[float]:
    """Parts of the strain in each step; the first is divided, for the initial slope."""
    step = 1 / steps
    return [PROBE * step, (1 - PROBE) * step, *[step] * (steps - 1)]


def _confined(
    pack: Deformed, material: Material, test: Triaxial, periodic: tuple[bool, bool, bool]
) -> tuple[Deformed, Row, int]:
    """The pack under the confining stress, its row, and steps that did not come to rest."""
    restless, parts = 0, CONFINING_STEPS if test.relieved else 1
    for part in range(1, parts + 1):
        stress = np.full(3, -test.confining * part / parts)
        pack, row, calm = brought_to_rest(
            pack, material, test, periodic, strain=np.full(3, np.nan), stress=stress
        )
        restless += not calm
    if row.contacts == 0 or not row.axial > 0.5 * test.confining:
        raise MechanicsError(
            f"pack of {len(pack.grains)} grains does not hold {test.confining:.3g} Pa: it bears "
            f"{row.axial:.3g} Pa along x; take a denser pack"
        )
    return pack, row, restless


def confined(
    grains: Snapshot,
    material: Material,
    stress: float,
    *,
    periodic: tuple[bool, bool, bool],
    tolerance: float = 1e-2,
) -> Snapshot:
    """The grains under an isotropic stress, Pa; their box has shrunk with them.

    The overlaps of the pack are its state without stress. Raises what `triaxial` raises.
    """
    material = replace(material, glued=False)
    refuse_stress(grains, material, stress, periodic)
    start = at_rest(grains, material, periodic, relieved=True)
    test = Triaxial(confining=stress, tolerance=tolerance)
    pack, _, _ = _confined(start, material, test, periodic)
    return pack.grains


def _since(row: Row, pack: Deformed) -> Row:
    return replace(
        row, axial_strain=-float(pack.strain[0]), volume_strain=-float(pack.strain.sum())
    )


def refuse_stress(
    grains: Snapshot, material: Material, stress: float, periodic: tuple[bool, bool, bool]
) -> None:
    """Raise CaseError where the mean contact would overlap by more than `MOST_OVERLAP`."""
    joints = find_joints(grains, periodic, gap=material.gap)
    if len(joints) == 0:
        raise MechanicsError(
            f"pack of {len(grains)} grains has no contacts; make it denser, or bridge its gaps "
            "with bonds.gap_ratio"
        )
    volume = float(np.prod(np.diff(grains.box, axis=1)))
    reach = float(np.sum(np.linalg.norm(joints.branch, axis=1)))
    diameter = 2 * float(grains.radius.mean())
    overlap = 3 * stress * volume / reach / material.normal / diameter
    if overlap > MOST_OVERLAP:
        raise CaseError(
            f"--confining_MPa: {stress / 1e6:g} presses grains {100 * overlap:.3g} % of a "
            f"diameter into each other, expected at most {100 * MOST_OVERLAP:g} % "
            f"({stress / 1e6 * MOST_OVERLAP / overlap:.3g} MPa); lower the stress or raise "
            "grains.normal_stiffness_N_m"
        )
