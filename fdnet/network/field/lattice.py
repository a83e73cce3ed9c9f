"""The staggered grid of a velocity field: where its cells lie, and which sides are walls.

Cells are nearly cubic. Component d of the velocity has its nodes on the lower faces of the cells
across d: node (i, j, k) lies at i along d and at j + 1/2, k + 1/2 along the others, in cells. A
pair of periodic sides wraps. Between two walls, node 0 of the component across them lies on the
lower wall and carries no flow; there is none on the upper one. The grid always wraps along x: a
specimen that is not periodic along x lies in a gap of clear fluid, upstream and downstream of it,
that is wide enough for the flow to become even again.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft

from fdnet.errors import NetworkError
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

LEAST_CELLS = 4
"""Fewest cells along an axis."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lattice:
    """A staggered grid.

    Attributes:
        low: (3,) m, lower corner.
        spacing: (3,) m, edges of a cell.
        shape: cells along x, y and z.
        walled: whether the sides across x, y and z are walls; never those across x.
        specimen: lower and upper end of the specimen along x, m; the side walls hold the fluid
            between them, and let it slip beyond.
        repeats: whether the specimen itself is periodic along x.
    """

    low: Array
    spacing: Array
    shape: tuple[int, int, int]
    walled: tuple[bool, bool, bool]
    specimen: tuple[float, float]
    repeats: bool

    __repr__ = one_line

    @property
    def unit(self) -> float:
        """Unit of length of the solve, m: the spacing along x."""
        return float(self.spacing[0])

    @property
    def high(self) -> Array:
        """Upper corner (3,) m."""
        return np.asarray(self.low + self.spacing * self.shape)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape))

    @property
    def volume(self) -> float:
        """Volume m3."""
        return float(np.prod(self.spacing * self.shape))


def build_lattice(
    box: Array,
    periodic: tuple[bool, bool, bool],
    *,
    spacing: float,
    upstream: float,
    downstream: float,
) -> Lattice:
    """The grid of a specimen.

    Args:
        box: (3, 2) m, bounds of the specimen.
        periodic: whether its sides x, y, z are periodic.
        spacing: m, the largest edge of a cell.
        upstream: m of clear fluid before the specimen; without meaning where x is periodic.
        downstream: m of clear fluid, at least, beyond the specimen; likewise.

    Raises:
        NetworkError: the box has no extent, or the spacing is not positive.
    """
    edges = box[:, 1] - box[:, 0]
    if not (np.all(edges > 0.0) and 0.0 < spacing < np.inf):
        raise NetworkError(
            f"velocity field: cells of {spacing:g} m in a box of edges {edges.tolist()} m, "
            "expected positive numbers; give the spheres a box"
        )
    low = box[:, 0].copy()
    shape = [_fast(edge / spacing) for edge in edges]
    steps = edges / shape
    if not periodic[0]:
        steps[0] = spacing
        low[0] -= upstream
        shape[0] = _fast((edges[0] + upstream + downstream) / spacing)
    return Lattice(
        low=frozen(low),
        spacing=frozen(steps),
        shape=(shape[0], shape[1], shape[2]),
        walled=(False, not periodic[1], not periodic[2]),
        specimen=(float(box[0, 0]), float(box[0, 1])),
        repeats=periodic[0],
    )


def _fast(cells: float) -> int:
    """The least number of cells, `cells` at least, whose Fourier transform is fast."""
    wanted = max(LEAST_CELLS, int(np.ceil(cells * (1.0 - 1e-9))))
    return int(fft.next_fast_len(wanted))
