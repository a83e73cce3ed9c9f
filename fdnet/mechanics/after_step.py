"""A pack after a load step: where it is, what its joints remember, which bonds are overloaded."""

import numpy as np

from fdnet.mechanics.deformed import SHEAR, SOUND, TENSION, Deformed, Memory, moved
from fdnet.mechanics.load_step import Forces, Scene, forces_at, inner_moves
from fdnet.mechanics.springs import Material, bond_stress, discs_of
from fdnet.spheres.snapshot import Array


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
