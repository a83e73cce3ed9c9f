"""Sizes and contents of the throats and pores of a specimen's first millimetre (Shi 2011, section 3.3)."""

from dataclasses import dataclass

import numpy as np

from fdnet.spheres.snapshot import Array
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.first_section import first_section

MM = 1e3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SectionSizes:
    """Throats (T) and pores (P) centred in the first millimetre; lengths mm, volumes mm3, conductance mm3.

    `throat_radius`, `pore_radius` inscribed (0 where grains close it); `throat_depth` of the middle;
    `throat_porosity` of the cylinder, 0 where fines overlap so that it would be negative; `throat_fines` how many;
    `conductance_initial`, `conductance_damaged` by the thesis's laws; `pore_volume` void of the tetrahedron,
    `pore_volume_left` without the fines.
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


def section_sizes(examined: Examined) -> SectionSizes:
    """Its whole pores, of four grains of the specimen, and the throats between two such (`first_section`); conductance
    by the thesis's laws. Raises CaseError on a specimen without fines."""
    section, analysis = first_section(examined, whole=True), examined.thesis
    network, occupancy = section.network, section.occupancy
    pore, throat = section.pore_weight > 0, section.throat_weight > 0
    depth = network.throat_ends[:, :, 0].mean(axis=1) - network.box[0, 0]
    volume = np.maximum(network.pore_volume, 0.0)
    return SectionSizes(
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
    """The share of `values` (N,) in [low, high); 0 of none."""
    return float(np.mean((values >= low) & (values < high))) if len(values) else 0.0
