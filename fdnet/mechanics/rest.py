"""A pack brought to rest under a load: steps at that load until the forces balance."""

from dataclasses import dataclass, replace

import numpy as np

from fdnet.mechanics.after_step import carried_out, overloaded
from fdnet.mechanics.deformed import SHEAR, TENSION, Deformed, keys_of
from fdnet.mechanics.load_step import (
    NEWTON_STEPS,
    Forces,
    Load,
    Scene,
    balance,
    scene_of,
)
from fdnet.mechanics.springs import Material
from fdnet.spheres.snapshot import Array

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
