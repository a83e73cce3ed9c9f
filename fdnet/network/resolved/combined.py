"""The mean of two ways of measuring the damage, weighted by their errors.

The network of all spheres errs by a share of the permeability, whatever the fines take. The damage
law `section-archie` errs by a share of the logarithm of what they leave, so it is the better one
under light damage and the worse one under heavy damage. Their errors are independent of each
other, so the mean of the logarithms with weights 1 / error^2 is better than either.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fdnet.network.flow.slabs import SlabK
from fdnet.spheres.snapshot import Array, frozen

ERROR_ALL_SPHERES = 0.04
"""Error of ln k by all spheres; 0.037 (rms) on the slabs that were known (docs/accuracy.md)."""
ERROR_SECTION_ARCHIE = 0.13
"""Error of ln k/k0 by `section-archie` over ln k/k0 itself, chosen on the same slabs.

It is 0.10 (rms) over all of them, and 0.14 to 0.17 where the fines leave 0.3 to 0.7, where the
weights matter most.
"""


def combined(intact: Array, all_spheres: Array, section_archie: Array) -> Array:
    """Permeability (S,) m2 of sections with fines, from two of them.

    Args:
        intact: (S,) m2, without fines.
        all_spheres: (S,) m2, with fines, by the network of all spheres.
        section_archie: (S,) m2, with fines, by the network of the grains.
    """
    both = (intact > 0.0) & (all_spheres > 0.0) & (section_archie > 0.0)
    log_intact, log_whole, log_two = (
        np.log(np.where(both, k, 1.0)) for k in (intact, all_spheres, section_archie)
    )
    taken = (log_whole - log_intact) ** 2
    weight = taken / (taken + (ERROR_ALL_SPHERES / ERROR_SECTION_ARCHIE) ** 2)
    mean = np.exp(weight * log_whole + (1.0 - weight) * log_two)
    return frozen(np.where(both, mean, all_spheres))


def carried_over(network: Array, intact: Array, all_spheres: Array) -> Array:
    """Permeability (S,) m2 by all spheres, once the grains alone are known better.

    Where the fines leave most of the permeability, the networks of the grains and of all spheres
    err alike, and k changes by the factor of the grains. Where they leave little, the throats that
    count are between fines, and it keeps its value. The exponent in between is the share left.

    Args:
        network: (S,) m2, without fines, by the network of the grains.
        intact: (S,) m2, without fines, as accurately as it is known.
        all_spheres: (S,) m2, with fines, by the network of all spheres.
    """
    left = np.minimum(over(all_spheres, network), 1.0)
    return frozen(all_spheres * over(intact, network) ** left)


def combined_slabs(intact: SlabK, all_spheres: SlabK, section_archie: SlabK) -> SlabK:
    """`combined` of sections cut out and in place."""
    return _of_both(combined, intact, all_spheres, section_archie)


def carried_slabs(network: SlabK, intact: SlabK, all_spheres: SlabK) -> SlabK:
    """`carried_over` of sections cut out and in place."""
    return _of_both(carried_over, network, intact, all_spheres)


def _of_both(law: Callable[..., Array], *slabs: SlabK) -> SlabK:
    cut_out, inplace = (
        law(*(getattr(one, name) for one in slabs)) for name in ("cut_out", "inplace")
    )
    return SlabK(
        cut_out=cut_out, inplace=inplace, flows=tuple(flow for one in slabs for flow in one.flows)
    )


def scaled(slabs: SlabK, factor: Array) -> SlabK:
    """The permeabilities of sections times `factor` (S,)."""
    return SlabK(
        cut_out=frozen(slabs.cut_out * factor),
        inplace=frozen(slabs.inplace * factor),
        flows=slabs.flows,
    )


def replaced(slabs: SlabK, known: Array) -> SlabK:
    """The same sections, with the permeability cut out that is `known` (S,) m2 where it is finite.

    The permeability in place changes by the same factor. A closed section stays closed.
    """
    resolved = np.isfinite(known) & (slabs.cut_out > 0.0)
    factor = np.where(resolved, over(known, slabs.cut_out), 1.0)
    cut_out = frozen(np.where(resolved, known, slabs.cut_out))
    return replace(scaled(slabs, factor), cut_out=cut_out, resolved=frozen(resolved))


def in_series(inplace: Array, edges: Array) -> float:
    """Permeability m2 of the whole between `edges` (S+1,) m, from its sections (S,) in place."""
    thick = np.diff(edges)
    return float(thick.sum() / np.sum(thick / inplace)) if np.all(inplace > 0.0) else 0.0


def over(part: Array, whole: Array) -> Array:
    """`part` over `whole`; 1 where `whole` is 0."""
    return np.divide(part, whole, out=np.ones_like(whole), where=whole > 0.0)
