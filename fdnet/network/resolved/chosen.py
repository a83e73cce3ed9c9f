"""Section by section, the law that "auto" takes of the two that were computed."""

import numpy as np

from fdnet.network.flow.slabs import SlabK
from fdnet.spheres.snapshot import Array, frozen

LIGHT = 0.5
"""Share of the permeability above which "auto" takes `side-kozeny`.

The error of `all-spheres` is a share of the permeability, that of `side-kozeny` a share of what
the fines take, so the one is better under heavy damage and the other under light damage.
"""


def light_sections(before: SlabK, after: SlabK) -> Array:
    """Whether (S,) the fines leave more than `LIGHT` of the permeability of a section cut out.

    `before` is without fines and `after` with them, by a law of the network of the grains.
    """
    return np.asarray(after.cut_out > LIGHT * before.cut_out)


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
