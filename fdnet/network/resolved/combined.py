"""The mean of two ways of measuring the damage, weighted by their errors.

The network of all spheres errs by a share of the permeability, whatever the fines take. The damage
law `section-archie` errs by a share of the logarithm of what they leave, so it is the better one
under light damage and the worse one under heavy damage. Their errors are independent of each
other, so the mean of the logarithms with weights 1 / error^2 is better than either.
"""

import numpy as np

from fdnet.network.flow.slabs import SlabK
from fdnet.spheres.snapshot import Array, frozen

ERROR_ALL_SPHERES = 0.04
"""Error of ln k by all spheres, on the slabs that the laws have seen (docs/accuracy.md)."""
ERROR_SECTION_ARCHIE = 0.13
"""Error of ln k/k0 by `section-archie` over ln k/k0 itself, on the same slabs."""


def combined(network: Array, intact: Array, all_spheres: Array, section_archie: Array) -> Array:
    """Permeability (S,) m2 of sections with fines, from two of them with fines.

    Args:
        network: (S,) m2, without fines, by the network of the grains.
        intact: (S,) m2, without fines, as accurately as it is known; 0 only where `network` is.
        all_spheres: (S,) m2, with fines, by the network of all spheres.
        section_archie: (S,) m2, with fines, by the network of the grains.
    """
    whole = carried_over(network, intact, all_spheres)
    two_scale = intact * over(section_archie, network)
    both = (whole > 0.0) & (two_scale > 0.0)
    log_whole, log_two, log_intact = (
        np.log(np.where(both, k, 1.0)) for k in (whole, two_scale, intact)
    )
    taken = (log_whole - log_intact) ** 2
    weight = taken / (taken + (ERROR_ALL_SPHERES / ERROR_SECTION_ARCHIE) ** 2)
    mean = np.exp(weight * log_whole + (1.0 - weight) * log_two)
    return frozen(np.where(both, mean, whole))


def carried_over(network: Array, intact: Array, all_spheres: Array) -> Array:
    """Permeability (S,) m2 by all spheres, once the grains alone are known better.

    Where the fines leave most of the permeability, the networks of the grains and of all spheres
    err alike, and k changes by the factor of the grains. Where they leave little, the throats that
    count are between fines, and it keeps its value. The exponent in between is the share left.
    """
    left = np.minimum(over(all_spheres, network), 1.0)
    return np.asarray(all_spheres * over(intact, network) ** left)


def combined_slabs(network: SlabK, intact: SlabK, whole: SlabK, two_scale: SlabK) -> SlabK:
    """`combined` of sections cut out and in place; `whole` are those by all spheres."""
    cut_out, inplace = (
        combined(*(getattr(slabs, name) for slabs in (network, intact, whole, two_scale)))
        for name in ("cut_out", "inplace")
    )
    return SlabK(cut_out=cut_out, inplace=inplace, flows=(*whole.flows, *two_scale.flows))


def scaled(slabs: SlabK, factor: Array) -> SlabK:
    """The permeabilities of sections times `factor` (S,)."""
    return SlabK(
        cut_out=frozen(slabs.cut_out * factor),
        inplace=frozen(slabs.inplace * factor),
        flows=slabs.flows,
    )


def in_series(inplace: Array, edges: Array) -> float:
    """Permeability m2 of the whole between `edges` (S+1,) m, from its sections (S,) in place."""
    thick = np.diff(edges)
    return float(thick.sum() / np.sum(thick / inplace)) if np.all(inplace > 0.0) else 0.0


def over(part: Array, whole: Array) -> Array:
    """`part` over `whole`; 1 where `whole` is 0."""
    return np.divide(part, whole, out=np.ones_like(whole), where=whole > 0.0)
