"""Sizes of the pores and throats of a section, each with the weight it has there."""

from dataclasses import dataclass

from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PoreSizes:
    """Sizes of P pores and T throats, SI units.

    Attributes:
        pore_radius: (P,) m, radius of the sphere inscribed between the four grains of a pore.
        pore_volume: (P,) m3, void volume of the pore.
        throat_radius: (T,) m, radius of the circle inscribed between the three grains of a throat.
        throat_length: (T,) m, distance between the centres of the two pores of a throat.
        pore_weight: (P,) weight of each pore, 1 for a pore that counts whole.
        sphere_weight: (P,) as `pore_weight`, but 0 for a pore without an inscribed sphere of its
            own.
        throat_weight: (T,) weight of each throat.
    """

    pore_radius: Array
    pore_volume: Array
    throat_radius: Array
    throat_length: Array
    pore_weight: Array
    sphere_weight: Array
    throat_weight: Array
