"""What the cake resists, by Carman and Kozeny, from the fines that lie in it."""

import math
from dataclasses import dataclass

from fdnet.scales.darcy import carman_kozeny
from fdnet.spheres.snapshot import Snapshot

LEAST_LAYERS = 3
"""Thickness of a cake in Sauter diameters of its fines, below which it is only what sticks out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cake:
    """The deposit before the formation face.

    Attributes:
        thickness: m.
        porosity: of the suspension and deposit within it, from the centres of the fines.
        permeability: m2, by Carman and Kozeny with the Sauter diameter of the fines.
        resistance: thickness over permeability, 1/m.
    """

    thickness: float
    porosity: float
    permeability: float
    resistance: float


def cake_of(spheres: Snapshot, thickness: float) -> Cake | None:
    """The cake of a `thickness` in m; None where there is none or it holds no fine.

    Fines count whose centres lie within the thickness upstream of the low x face. Fewer than
    `LEAST_LAYERS` layers of fines are no bed of Carman and Kozeny's, and so no cake either.
    """
    fines = spheres.fines()
    x = fines.position[:, 0] - spheres.box[0, 0]
    radius = fines.radius[(x < 0) & (x >= -thickness)]
    if thickness <= 0 or not len(radius):
        return None
    sauter = 2.0 * float((radius**3).sum() / (radius**2).sum())
    if thickness < LEAST_LAYERS * sauter:
        return None
    (y0, y1), (z0, z1) = spheres.box[1:]
    solid = 4 / 3 * math.pi * float((radius**3).sum())
    porosity = 1.0 - solid / ((y1 - y0) * (z1 - z0) * thickness)
    if not 0 < porosity < 1:
        return None
    k = carman_kozeny(porosity, sauter)
    return Cake(
        thickness=thickness, porosity=float(porosity), permeability=k, resistance=thickness / k
    )
