"""Springs of the joints: contacts, and parallel bonds over their discs.

A joint has six springs in its own frame: one along its normal, two across it, one that twists
about the normal and two that bend.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.mechanics.joints import CONTACT_GAP, Joints
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Cement:
    """Parallel bonds, as a case gives them, in SI.

    Attributes:
        radius_ratio: radius of the disc over that of the smaller grain.
        normal: normal stiffness per area, Pa/m.
        shear: shear stiffness per area, Pa/m.
        tensile_strength: Pa; infinite: the bonds never break.
        shear_strength: Pa; infinite: the bonds never break.
        gap_ratio: widest gap that is bridged, over the smaller diameter.
    """

    radius_ratio: float
    normal: float
    shear: float
    tensile_strength: float = np.inf
    shear_strength: float = np.inf
    gap_ratio: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """How grains act on each other, in SI.

    Attributes:
        normal: normal stiffness of a contact of two grains, N/m.
        shear: tangential stiffness of such a contact, N/m.
        friction: coefficient of sliding friction of two grains.
        wall_friction: of a grain and a wall.
        glued: whether grains stick to the walls, as to the plates of an elastic test.
        density: of the solid, kg/m3.
        cement: of the bonds; None without.
    """

    normal: float
    shear: float
    friction: float = 0.55
    wall_friction: float = 0.0
    glued: bool = True
    density: float = 2650.0
    cement: Cement | None = None

    @property
    def gap(self) -> float:
        """Gap, over the smaller diameter, up to which two grains act on each other."""
        return max(CONTACT_GAP, 0.0 if self.cement is None else self.cement.gap_ratio)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Discs:
    """The discs of K bonds (Potyondy and Cundall 2004, equation 14).

    Attributes:
        radius: (K,) m; 0 where there is no bond.
        area: (K,) pi R^2, m2.
        bending: (K,) second moment of area I = pi R^4 / 4, m4.
        twist: (K,) polar moment J = pi R^4 / 2, m4.
    """

    radius: Array
    area: Array
    bending: Array
    twist: Array

    __repr__ = one_line


def discs_of(joints: Joints, material: Material) -> Discs:
    """The disc of each joint; walls are bonded where the grains are glued to them."""
    ratio = 0.0 if material.cement is None else material.cement.radius_ratio
    radius = np.where(joints.at_wall & (not material.glued), 0.0, ratio * joints.radius)
    return Discs(
        radius=radius,
        area=np.pi * radius**2,
        bending=np.pi * radius**4 / 4,
        twist=np.pi * radius**4 / 2,
    )


def contact_springs(joints: Joints, material: Material) -> Array:
    """(K, 6) stiffness of the contacts: N/m, and 0 N m for rotations; 0 across a gap."""
    touches = joints.overlap > -2 * CONTACT_GAP * joints.radius
    slides = joints.at_wall & (not material.glued and material.wall_friction == 0)
    normal = np.where(touches, material.normal, 0.0)
    shear = np.where(touches & ~slides, material.shear, 0.0)
    none = np.zeros(len(joints))
    return np.column_stack([normal, shear, shear, none, none, none])


def bond_springs(joints: Joints, material: Material) -> Array:
    """(K, 6) stiffness of the bonds: kn A, ks A twice, N/m, then ks J, kn I twice, N m.

    Source: Potyondy and Cundall (2004), equation 15.
    """
    cement = material.cement
    if cement is None:
        return np.zeros((len(joints), 6))
    disc = discs_of(joints, material)
    across, bend = cement.shear * disc.area, cement.normal * disc.bending
    return np.column_stack(
        [cement.normal * disc.area, across, across, cement.shear * disc.twist, bend, bend]
    )


def bond_stress(force: Array, disc: Discs) -> tuple[Array, Array]:
    """Largest tensile and shear stress (K,), Pa, in bonds with the forces (K, 6), N and N m.

    By the theory of beams: Fn / A + |Mb| R / I and |Fs| / A + |Mt| R / J, with Fn > 0 in tension
    (Potyondy and Cundall 2004, equation 16). Zero where there is no bond.
    """
    there = disc.area > 0
    area, bending, twist = (
        np.where(there, moment, 1.0) for moment in (disc.area, disc.bending, disc.twist)
    )
    bent = np.hypot(force[:, 4], force[:, 5])
    sheared = np.hypot(force[:, 1], force[:, 2])
    tension = force[:, 0] / area + bent * disc.radius / bending
    shear = sheared / area + np.abs(force[:, 3]) * disc.radius / twist
    return np.where(there, tension, 0.0), np.where(there, shear, 0.0)
