"""How far the grains of a bonded pack give way under the flow through it."""

import numpy as np

from fdnet.mechanics.elastic import carrying
from fdnet.mechanics.kinematics import kinematics
from fdnet.mechanics.solver import solver_of, stiffness
from fdnet.mechanics.springs import Material, bond_springs, contact_springs
from fdnet.spheres.snapshot import Array, Snapshot


def displacement_under_flow(
    grains: Snapshot,
    material: Material,
    gradient: float,
    *,
    periodic: tuple[bool, bool, bool],
) -> Array:
    """Displacement (N, 3), m, of the grains by a fall of pressure along x of `gradient` Pa/m.

    The fluid pushes each grain with the gradient times the volume of the box over the number of
    grains that carry; the plates at the ends, to which the outermost grains are glued, hold the
    pack. Grains that carry nothing stay where they are.
    """
    joints, kept = carrying(grains, material, periodic)
    length = float(grains.radius.mean())
    springs = contact_springs(joints, material) + bond_springs(joints, material)
    moving = np.flatnonzero(np.repeat(kept, 6))
    live = kinematics(joints, len(grains), length=length).of_grains[:, moving]
    push = np.zeros((len(grains), 6))
    volume = float(np.prod(np.diff(grains.box, axis=1)))
    push[kept, 0] = gradient * volume / max(1, int(kept.sum()))
    moved = np.zeros(6 * len(grains))
    moved[moving] = solver_of(stiffness(live, springs))(push.ravel()[moving])
    return moved.reshape(-1, 6)[:, :3]
