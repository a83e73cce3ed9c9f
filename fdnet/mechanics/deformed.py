"""A pack while it is deformed: places, box, and what its joints remember."""

from dataclasses import dataclass

import numpy as np

from fdnet.mechanics.joints import CONTACT_GAP, Joints, find_joints
from fdnet.mechanics.springs import Material
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, resting

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
