"""Section by section, the law that "auto" takes of the two that were computed."""

import numpy as np

from fdnet.network.flow.slabs import SlabK
from fdnet.spheres.arrays import sauter_mean
from fdnet.spheres.snapshot import Array, Snapshot, frozen

LIGHT, LIGHT_OF_SMALL = 0.5, 0.15
"""Share of the permeability above which "auto" takes `side-kozeny`: of large and of small fines.

The error of `all-spheres` is a share of the permeability, that of `side-kozeny` a share of what
the fines take, so the one is better under heavy damage and the other under light damage. Small
fines in a pore are a porous bed, which is what `side-kozeny` knows. Where they are few, the
network of all spheres cuts wide pores into narrow ones. Large fines are not a bed.
"""
SMALL = 0.26
"""Radius of fines over that of the grains below which they are small.

It is the geometric mean of 1/3 and 1/5, the two ratios between which the deposits of
docs/accuracy.md tell the laws apart.
"""


def light_share(fines: Snapshot | None, grains: Snapshot) -> float:
    """Share of the permeability above which `fines` among `grains` are a light deposit.

    The radii that are compared are Sauter's means, the sum of r^3 over that of r^2.
    """
    if fines is None or not len(fines):
        return LIGHT
    ratio = sauter_mean(fines.radius) / sauter_mean(grains.radius)
    return LIGHT_OF_SMALL if ratio < SMALL else LIGHT


def light_sections(before: SlabK, after: SlabK, share: float) -> Array:
    """Whether (S,) the fines leave more than `share` of the permeability of a section cut out.

    `before` is without fines and `after` with them, by a law of the network of the grains.
    """
    return np.asarray(after.cut_out > share * before.cut_out)


def by_section(
    light: Array, two_scale: SlabK, resolved: SlabK, edges: Array
) -> tuple[SlabK, float]:
    """Sections (S,) of the two-scale law where `light`, else those of all spheres.

    Returns:
        The sections, and the permeability m2 of the whole: of those in place in series, between
        `edges` (S+1,) m.
    """
    cut_out, inplace = (
        frozen(np.where(light, getattr(two_scale, name), getattr(resolved, name)))
        for name in ("cut_out", "inplace")
    )
    thick = np.diff(edges)
    whole = float(thick.sum() / np.sum(thick / inplace)) if np.all(inplace > 0) else 0.0
    flows = (*two_scale.flows, *resolved.flows)
    return SlabK(cut_out=cut_out, inplace=inplace, flows=flows), whole
