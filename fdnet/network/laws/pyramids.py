"""The two sides of a throat, pyramids from its facet to the power centres: void and grain surface.

Heights are signed, and so are void and surface: where a power centre lies behind the facet, the
pyramid is subtracted. The overlap of two grains is counted once, by the share of the pyramid in
the dihedral angle. Sources as in `geometry`.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array


def side_voids(network: Network) -> tuple[Array, Array]:
    """Void (T, 2) m3 and grain surface (T, 2) m2 of the sides of the first and second pore."""
    corner, radius = network.throat_corner, network.throat_corner_radius
    base = geometry.flat(corner)
    middle = geometry.power_centre(base, radius)[0]
    area = geometry.triangle_area(corner)
    hidden_volume, hidden_surface = _hidden_by_pairs(network.throat_heights, base, middle, radius)
    void, wall = np.zeros((len(area), 2)), np.zeros((len(area), 2))
    for side in (0, 1):
        height = network.throat_heights[:, side]
        angle = _foot_angles(base, middle, height)
        void[:, side] = (area * height - np.sum(angle * radius**3, axis=1)) / 3.0 + hidden_volume[
            :, side
        ]
        wall[:, side] = np.sum(angle * radius**2, axis=1) - hidden_surface[:, side]
    return void, wall


def _foot_angles(base: Array, middle: Array, height: Array) -> Array:
    """Signed solid angles (T, 3) sr of a pyramid at the corners `base` (T, 3, 2) m of its facet.

    The apex lies `height` (T,) m above the `middle` (T, 2) m of the facet, the point of equal
    power to its three discs.
    """
    apex = np.concatenate([middle, height[:, None]], axis=1)[:, None]
    raised = np.concatenate(
        [np.concatenate([base, np.zeros((*base.shape[:2], 1))], axis=2), apex], axis=1
    )
    return geometry.solid_angles(raised)[:, :3]


def _hidden_by_pairs(
    heights: Array, base: Array, middle: Array, radius: Array
) -> tuple[Array, Array]:
    """Volume (T, 2) m3 and surface (T, 2) m2 of the overlap of grain pairs in either pyramid."""
    volume, surface = np.zeros((len(base), 2)), np.zeros((len(base), 2))
    for first, second in geometry.SIDES:
        along = base[:, second] - base[:, first]
        apart = np.linalg.norm(along, axis=1)
        to_middle = middle - base[:, first]
        inward = (along[:, 0] * to_middle[:, 1] - along[:, 1] * to_middle[:, 0]) / apart
        turn = np.arctan2(heights, inward[:, None]) / (2.0 * np.pi)
        shared, hidden = geometry.lens(radius[:, first], radius[:, second], apart)
        volume += turn * shared[:, None]
        surface += turn * hidden[:, None]
    return volume, surface
