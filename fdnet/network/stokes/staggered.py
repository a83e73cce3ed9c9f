"""The staggered (MAC) grid on which resolved Stokes flow is solved.

Component d of the velocity has its nodes on the faces of the cells across d, at whole numbers
along d and at half numbers along the other axes; pressures are in the middle of the cells. The
unit of length is the cube root of a cell's volume, so that a cell has the volume 1 also where its
edges differ.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import fft

from fdnet.errors import CaseError
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

LEAST_CELLS = 4
WHOLE = 1e-6
"""Part of the longest edge by which an edge may miss a whole number of cubic cells."""
Shape = tuple[int, int, int]
Closed = tuple[bool, bool, bool]
OPEN: Closed = (False, False, False)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Staggered:
    """A grid that repeats along every axis, or is the half of a cell that is mirrored along x.

    Attributes:
        shape: cells along the axes, those inside walls included.
        step: (3,) edges of a cell over the unit of length; their product is 1.
        mirrored: whether the grid is mirrored at both ends of x; component 0 then has one more
            node along x.
        closed: whether walls that hold the fluid close an axis; never x of a mirrored grid.
        inside: cells along the axes between these walls; the others of `shape` are solid.
    """

    shape: Shape
    step: Array = field(default_factory=lambda: np.ones(3))
    mirrored: bool = False
    closed: Closed = OPEN
    inside: Shape | None = None

    __repr__ = one_line

    @property
    def fluid_cells(self) -> Shape:
        """Cells along the axes without those inside walls."""
        return self.inside or self.shape

    @property
    def share(self) -> float:
        """Volume of the specimen over that of the grid."""
        return float(np.prod(self.fluid_cells) / np.prod(self.shape))

    @property
    def shapes(self) -> tuple[Shape, Shape, Shape]:
        """Nodes of each velocity component along the axes."""
        return (self.shape[0] + self.mirrored, *self.shape[1:]), self.shape, self.shape


def stagger(
    edges: Array, cells: int, *, mirrored: bool = False, closed: Closed = OPEN
) -> tuple[Staggered, float]:
    """The grid with `cells` on the longest of the `edges` (3,) m, and its unit of length, m.

    Where another edge is no whole number of cubic cells, the cells are a little longer or shorter
    along it, in a number whose Fourier transform is fast.

    Raises:
        CaseError: there are too few cells, or an edge is not positive.
    """
    if cells < LEAST_CELLS or not np.all(edges > 0.0):
        raise CaseError(
            f"stokes: {cells} cells on edges {edges.tolist()} m, expected at least {LEAST_CELLS} "
            "and positive edges"
        )
    cube = float(edges.max()) / cells
    counts = np.maximum(np.rint(edges / cube).astype(int), 2)
    for axis in np.flatnonzero(np.abs(counts * cube - edges) > WHOLE * edges.max()):
        counts[axis] = fft.next_fast_len(int(counts[axis]), real=True)
    whole = counts.copy()
    for axis in np.flatnonzero(closed):
        whole[axis] = fft.next_fast_len(int(counts[axis]) + 1, real=True)
    unit = float(np.prod(edges / counts)) ** (1.0 / 3.0)
    grid = Staggered(
        shape=(int(whole[0]), int(whole[1]), int(whole[2])),
        step=edges / counts / unit,
        mirrored=mirrored,
        closed=closed,
        inside=(int(counts[0]), int(counts[1]), int(counts[2])),
    )
    return grid, unit
