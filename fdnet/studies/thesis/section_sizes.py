"""Sizes and contents of the throats and pores of a specimen's first millimetre (Shi 2011, section 3.3)."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.permeability import Analysis
from fdnet.snapshot import Array

DEPTH = 1e-3
"""Thickness m of the thesis's sections."""
MM = 1e3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SectionSizes:
    """Throats (T) and pores (P) centred in the first millimetre; lengths mm, volumes mm3, conductance mm3.

    `throat_radius`, `pore_radius` inscribed (0 where grains close it); `throat_depth` of the middle;
    `throat_porosity` of the cylinder, 0 where fines overlap so that it would be negative; `throat_fines` how many;
    `conductance_initial`, `conductance_damaged` by the analysis's law; `pore_volume` void of the tetrahedron,
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


def section_sizes(analysis: Analysis) -> SectionSizes:
    """Pores of four grains of the specimen and throats between two such, as in the thesis, whose tessellation ends at
    the outermost grains: none cut by a face, and no facets within one polyhedron, which are split at will."""
    network, occupancy = analysis.network, analysis.occupancy
    face = network.box[0, 0]
    middle = network.throat_ends[:, :, 0].mean(axis=1) - face
    uncut = network.pore_share == 1.0
    group = network.pore_group[network.throat_pores]
    throat = (middle < DEPTH) & uncut[network.throat_pores].all(axis=1) & (group[:, 0] != group[:, 1])
    pore = (network.pore_position[:, 0] - face < DEPTH) & uncut
    volume = np.maximum(network.pore_volume, 0.0)
    count = len(throat)
    porosity, fines, blocked, solid = np.ones(count), np.zeros(count, int), np.zeros(count, bool), np.zeros(len(pore))
    if occupancy is not None:
        porosity, fines = np.maximum(occupancy.throat_porosity, 0.0), occupancy.throat_fines
        blocked, solid = occupancy.blocked, occupancy.pore_solid_volume
    return SectionSizes(
        throat_radius=network.throat_radius[throat] * MM,
        throat_length=network.throat_length[throat] * MM,
        throat_depth=middle[throat] * MM,
        throat_porosity=porosity[throat],
        throat_fines=fines[throat],
        blocked=blocked[throat],
        conductance_initial=analysis.conductance_initial[throat] * MM**3,
        conductance_damaged=analysis.conductance_damaged[throat] * MM**3,
        pore_radius=network.pore_radius[pore] * MM,
        pore_volume=volume[pore] * MM**3,
        pore_volume_left=np.maximum(volume - solid, 0.0)[pore] * MM**3,
    )


def share_within(values: Array, low: float, high: float) -> float:
    """The share of `values` (N,) in [low, high); 0 of none."""
    return float(np.mean((values >= low) & (values < high))) if len(values) else 0.0
