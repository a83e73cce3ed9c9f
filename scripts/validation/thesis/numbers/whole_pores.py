"""The whole pores and throats of a specimen's first millimetre, as the figures draw them.

The thesis describes the same quantities in its section 3.3 (Shi 2011).
"""

from dataclasses import dataclass

import numpy as np

from fdnet.spheres.snapshot import Array
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.first_millimetre import first_millimetre

MM = 1e3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WholePores:
    """T throats and P pores centred in the first millimetre, in the units of the figures.

    Attributes:
        throat_radius: (T,) mm, inscribed radius; 0 where the grains close the throat.
        throat_length: (T,) mm, distance between the centres of its pores.
        throat_depth: (T,) mm, depth of its middle from the formation face.
        throat_porosity: (T,) porosity of its cylinder; 0 where overlapping fines would make it
            negative.
        throat_fines: (T,) number of fines that reach into it.
        blocked: (T,) True where a fine blocks it.
        conductance_initial: (T,) mm3, without fines, by the thesis's law.
        conductance_damaged: (T,) mm3, with fines, by the thesis's law.
        pore_radius: (P,) mm, inscribed radius; 0 where the grains close the pore.
        pore_volume: (P,) mm3, void volume of its tetrahedron.
        pore_volume_left: (P,) mm3, void volume less that of the fines.
    """

    throat_radius: Array
    throat_length: Array
    throat_depth: Array
    throat_porosity: Array
    throat_fines: Array
    blocked: Array
    conductance_initial: Array
    conductance_damaged: Array
    pore_radius: Array
    pore_volume: Array
    pore_volume_left: Array


def whole_pores(examined: Examined) -> WholePores:
    """Pores of four grains of the specimen and throats between two such pores.

    Conductance is by the thesis's laws. Raises CaseError on a specimen without fines.
    """
    section, analysis = first_millimetre(examined, whole=True), examined.thesis
    network, occupancy = section.network, section.occupancy
    pore, throat = section.pore_weight > 0, section.throat_weight > 0
    depth = network.throat_ends[:, :, 0].mean(axis=1) - network.box[0, 0]
    volume = np.maximum(network.pore_volume, 0.0)
    return WholePores(
        throat_radius=network.throat_radius[throat] * MM,
        throat_length=network.throat_length[throat] * MM,
        throat_depth=depth[throat] * MM,
        throat_porosity=np.maximum(occupancy.throat_porosity, 0.0)[throat],
        throat_fines=occupancy.throat_fines[throat],
        blocked=occupancy.blocked[throat],
        conductance_initial=analysis.conductance_initial[throat] * MM**3,
        conductance_damaged=analysis.conductance_damaged[throat] * MM**3,
        pore_radius=network.pore_radius[pore] * MM,
        pore_volume=volume[pore] * MM**3,
        pore_volume_left=np.maximum(volume - occupancy.pore_solid_volume, 0.0)[pore] * MM**3,
    )


def share_within(values: Array, low: float, high: float) -> float:
    """The share of the values (N,) in [low, high); 0 when there are no values."""
    return float(np.mean((values >= low) & (values < high))) if len(values) else 0.0
