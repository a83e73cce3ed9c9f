"""Permeability of small sections without fines from resolved Stokes flow, on two coarse grids.

The throats of a section of some thirty grains are too few for their errors to cancel: its
permeability by the network is off by 4 % (rms), and so is k/k0. Grains need no fine grid. With 12
and 20 cells across the mean grain, extrapolated to no spacing, their permeability is off by 1.1 %
(rms; docs/accuracy.md), in about the time that the network of all spheres takes.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import ceil

import numpy as np
from scipy.fft import next_fast_len

from fdnet.errors import CaseError, FlowError
from fdnet.network.resolved.slab import Sides, cut_out
from fdnet.network.stokes.staggered import Closed, stagger
from fdnet.network.stokes.stokes import extrapolate, solve_slab
from fdnet.spheres.snapshot import Array, Snapshot, frozen

ACROSS = (12.0, 20.0)
"""Cells of the two grids across the mean grain of a section."""
MOST_CELLS = 200_000
"""Cells of the finer grids of all sections together; some three seconds on one core."""
LARGEST_ERROR = 0.05
"""Estimated error, as a share of k, above which a section keeps the value of the network."""
TOLERANCE = 1e-3


def resolved_intact(grains: Snapshot, edges: Array, sides: Sides) -> tuple[Array, list[str]]:
    """Permeability (S,) m2 of the slabs of `grains` between `edges` (S+1,) m, cut out.

    The slabs are solved from the face on, as many as `MOST_CELLS` allows. The others are not a
    number, as are slabs that cannot be solved on these grids, and all of them where x repeats or
    the fluid slips along the side walls.

    Returns:
        The permeabilities, and for each slab that could not be solved one sentence.
    """
    unknown = np.full(len(edges) - 1, np.nan)
    closed: Closed = (False, not sides.periodic[1], not sides.periodic[2])
    if sides.periodic[0] or (any(closed) and sides.walls == "slip"):
        return frozen(unknown), []
    spans = [(float(low), float(high)) for low, high in pairwise(edges)]
    slabs = [cut_out(grains, span, sides.periodic) for span in spans]
    refused, left = [], MOST_CELLS
    for number, slab in enumerate(slabs):
        if not len(slab):
            continue
        try:
            left -= _size(slab, closed)
            if left < 0:
                break
            unknown[number] = _permeability(slab, spans[number], closed)
        except (CaseError, FlowError) as error:
            refused.append(
                f"section {number + 1} without fines was left to the network: resolved flow gave "
                f"no value there, {error}"
            )
    return frozen(unknown), refused


def _cells(slab: Snapshot) -> Iterator[int]:
    """Cells of the two grids on the longest edge, numbers whose Fourier transform is fast."""
    longest = float(np.diff(slab.box, axis=1).max()) / float(slab.radius.mean())
    return (next_fast_len(ceil(0.5 * across * longest)) for across in ACROSS)


def _size(slab: Snapshot, closed: Closed) -> int:
    """Cells of the finer grid."""
    *_, finer = _cells(slab)
    return int(np.prod(stagger(np.diff(slab.box, axis=1)[:, 0], finer, closed=closed)[0].shape))


def _permeability(slab: Snapshot, span: tuple[float, float], closed: Closed) -> float:
    """m2; raises FlowError where the two grids are too far apart."""
    coarse, fine = (
        solve_slab(slab, span, cells=cells, tolerance=TOLERANCE, closed=closed)
        for cells in _cells(slab)
    )
    end = extrapolate(coarse, fine)
    if not (end.k > 0.0 and 0.0 <= end.relative_error <= LARGEST_ERROR):
        raise FlowError(
            f"stokes: two grids give {coarse.k:.4g} and {fine.k:.4g} m2, an error of "
            f"{abs(end.relative_error):.1%}, expected at most {LARGEST_ERROR:.0%}"
        )
    return end.k
