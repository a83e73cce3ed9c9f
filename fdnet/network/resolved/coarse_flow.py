"""Permeability of small sections from resolved Stokes flow, on two coarse grids.

The throats of a section of some thirty grains are too few for their errors to cancel: its
permeability by the network is off by 4 % (rms) without fines, and by as much with them where few
throats carry the flow. Both are known better from resolved flow, in about the time that the
network of all spheres takes without fines, and in some ten seconds with them (docs/accuracy.md).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np
from scipy.fft import next_fast_len

from fdnet.errors import CaseError, FlowError
from fdnet.network.resolved.slab import Sides, cut_out
from fdnet.network.stokes.staggered import Closed, stagger
from fdnet.network.stokes.stokes import solve_slab
from fdnet.network.stokes.two_grids import estimate
from fdnet.spheres.snapshot import Array, Snapshot, frozen

LARGEST_ERROR = 0.05
"""Estimated error, as a share of k, above which a section keeps the value of the network."""
TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Grids:
    """A coarser and a finer grid for the sections of one state of a specimen.

    Attributes:
        state: "without fines" or "with fines".
        across_a_grain: cells of the two grids across the mean radius of the grains.
        across_a_fine: cells across the Sauter mean radius of the fines.
        most_cells: of the finer grids of all sections together.
    """

    state: str
    across_a_grain: tuple[float, float]
    across_a_fine: tuple[float, float]
    most_cells: int

    def cells(self, slab: Snapshot) -> tuple[int, int]:
        """Cells on the longest edge of the two grids, numbers whose Fourier transform is fast."""
        sizes = []
        if len(grains := slab.grains().radius):
            sizes.append((self.across_a_grain, float(grains.mean())))
        if len(fines := slab.fines().radius):
            sizes.append((self.across_a_fine, float(np.sum(fines**3) / np.sum(fines**2))))
        longest = float(np.diff(slab.box, axis=1).max())
        coarse, fine = (max(across[i] / radius for across, radius in sizes) for i in (0, 1))
        return next_fast_len(ceil(coarse * longest)), next_fast_len(ceil(fine * longest))


WITHOUT_FINES = Grids(
    state="without fines",
    across_a_grain=(6.0, 10.0),
    across_a_fine=(0.0, 0.0),
    most_cells=200_000,
)
"""Some three seconds on one core."""
WITH_FINES = Grids(
    state="with fines",
    across_a_grain=(10.0, 15.0),
    across_a_fine=(4.0 / 3.0, 2.0),
    most_cells=500_000,
)
"""Some ten seconds on one core."""


def resolved_sections(
    spheres: Snapshot, edges: Array, sides: Sides, *, wanted: Array, grids: Grids
) -> tuple[Array, dict[int, str]]:
    """Permeability (S,) m2 of the `wanted` (S,) slabs between `edges` (S+1,) m, cut out.

    The slabs are solved from the face on, as many as the grids may have cells. The others are not
    a number, as are slabs that cannot be solved on these grids, and all of them where x repeats or
    the fluid slips along the side walls.

    Returns:
        The permeabilities, and one sentence for each slab, by its index, that was not solved.
    """
    unknown = np.full(len(edges) - 1, np.nan)
    closed: Closed = (False, not sides.periodic[1], not sides.periodic[2])
    if sides.periodic[0] or (any(closed) and sides.walls == "slip"):
        return frozen(unknown), {}
    refused, left = dict[int, str](), grids.most_cells
    for number, span in enumerate(_spans(edges)):
        slab = cut_out(spheres, span, sides.periodic) if wanted[number] else None
        if slab is None or not len(slab):
            continue
        try:
            cells = grids.cells(slab)
            left -= _size(slab, cells[1], closed)
            if left < 0:
                break
            unknown[number] = _permeability(slab, span, cells, closed)
        except (CaseError, FlowError) as error:
            refused[number] = _doubts(number, grids.state, error)
    return frozen(unknown), refused


def _doubts(number: int, state: str, error: Exception) -> str:
    return (
        f"section {number + 1} {state} was left to the network: resolved flow gave no value "
        f"there, {error}"
    )


def _spans(edges: Array) -> Iterator[tuple[float, float]]:
    return ((float(low), float(high)) for low, high in pairwise(edges))


def _size(slab: Snapshot, cells: int, closed: Closed) -> int:
    """Cells of the grid with `cells` on the longest edge."""
    return int(np.prod(stagger(np.diff(slab.box, axis=1)[:, 0], cells, closed=closed)[0].shape))


def _permeability(
    slab: Snapshot, span: tuple[float, float], cells: tuple[int, int], closed: Closed
) -> float:
    """m2; raises FlowError where the two grids are too far apart."""
    coarse, fine = (
        solve_slab(slab, span, cells=number, tolerance=TOLERANCE, closed=closed)
        for number in cells
    )
    end = estimate(coarse, fine, with_fines=len(slab.fines()) > 0)
    both = f"stokes: two grids give {coarse.k:.4g} and {fine.k:.4g} m2"
    if not end.k > 0.0:
        raise FlowError(f"{both}, too far apart to be extrapolated to no spacing")
    if end.error > LARGEST_ERROR:
        raise FlowError(
            f"{both}, an error of {end.error:.1%}, expected at most {LARGEST_ERROR:.0%}"
        )
    return end.k
