"""Small networks made by hand: what flow and damage need, the rest zero."""

import numpy as np

from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, frozen


def network_of(
    position: Array, pairs: Array, box: Array, *, radius: float = 0.1, **given: object
) -> Network:
    """Pores at `position` (P, 3) joined by throats `pairs` (T, 2), not periodic.

    The fields of `given` replace the zeros.
    """
    position, pairs = np.asarray(position, float), np.asarray(pairs, int)
    pores, throats = len(position), len(pairs)
    ends = position[pairs]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    box = np.asarray(box, float)
    fields: dict[str, object] = {
        "box": box,
        "periodic": (False, False, False),
        "grain_radius": 1.0,
        "area": float(np.prod(np.ptp(box[1:], axis=1))),
        "image_grain": np.zeros(1, int),
        "image_fine": np.zeros(1, bool),
        "image_position": np.zeros((1, 3)),
        "image_radius": np.ones(1),
        "image_own_radius": np.ones(1),
        "image_outward": np.zeros(1),
        "pore_images": np.zeros((pores, 4), int),
        "pore_wrap": np.zeros((pores, 3), int),
        "pore_position": position,
        "pore_radius": np.full(pores, radius),
        "pore_power_centre": position,
        **dict.fromkeys(("pore_tetra_volume", "pore_volume", "pore_wall_surface"), np.ones(pores)),
        "pore_share": np.ones(pores),
        "pore_group": np.arange(pores),
        "throat_pores": pairs,
        "throat_shift": np.zeros((throats, 3), int),
        "throat_images": np.zeros((throats, 3), int),
        "throat_share": np.ones(throats),
        "throat_heights": np.zeros((throats, 2)),
        "throat_radius": np.full(throats, radius),
        "throat_radius_effective": np.full(throats, radius),
        "throat_area": np.full(throats, np.pi * radius**2),
        "throat_length": length,
        "counts": {"grains_outside_box": 0},
    } | given
    for name, value in fields.items():
        fields[name] = frozen(value) if isinstance(value, np.ndarray) else value
    return Network(**fields)


def chain(count: int, *, step: float = 1.0) -> Network:
    """`count` throats in a row along x, the first and last pore on the faces."""
    position = np.full((count + 1, 3), 0.5)
    position[:, 0] = np.arange(count + 1) * step
    pairs = np.stack([np.arange(count), np.arange(1, count + 1)], axis=1)
    return network_of(position, pairs, [[0, count * step], [0, 1], [0, 1]])
