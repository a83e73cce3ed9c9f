"""Forces that vary slowly from grain to grain, for the preconditioner of the wall forces.

The differences of `forces` weigh each force by what its own wall does. Where the grains of a
region are all pushed alike, the fluid between them moves along, and they move it much farther than
each of them alone. Without more, conjugate gradients take most of their iterations for such
forces.

So most of them are taken out of what the differences G give. With Z, which spreads three smooth
fields on the wall nodes, and the low-pass filter F of fields without divergence,

    preconditioner = G - share G Z F Z' G,        F = exp(-|q|2 reach2) for the wave number q.

Z is scaled by the smoothed density of the walls, so that Z' G Z is about 1. The greatest
eigenvalue of F Z' G Z sets the share, so that the whole stays positive definite. The fields live
on cells of half the reach, where all this costs little.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.ndimage import gaussian_filter

from fdnet.network.compiled import loops_in_place
from fdnet.network.field.lattice import LEAST_CELLS
from fdnet.network.field.response import Response, symbols
from fdnet.spheres.snapshot import Array

SHARE = 0.99
"""Share that is taken out of the force that the differences weigh most."""
REACH = 1.2
"""Length within which forces are alike, over the mean radius of the grains."""
PROBED = 12
"""Steps of the process of Lanczos for the greatest eigenvalue. In the pack of specimen 5 they give
it to 0.1 %, so the whole stays positive definite."""

Blocks = tuple[Array, Array, Array]
"""The coarse cell (n,) of each node along x, y and z."""


class Collective:
    """The slowly varying forces on wall nodes, on grids (3, n0, n1, n2).

    Args:
        weight: of the nodes, 0 where there is no wall.
        response: of the grid.
        differences: G, from forces to forces.
        radius: mean radius of the grains, in cells along x.
    """

    def __init__(
        self,
        weight: Array,
        response: Response,
        differences: Callable[[Array], Array],
        radius: float,
    ) -> None:
        fine, reach = np.array(response.shape), REACH * radius
        scale = response.scale
        coarse = np.round(fine / scale / (0.5 * reach)).astype(int)
        coarse = np.clip(coarse, np.minimum(LEAST_CELLS, fine), fine)
        self.shape = (int(coarse[0]), int(coarse[1]), int(coarse[2]))
        self.weight, self.differences = weight, differences
        self.blocks = _blocks(response.shape, self.shape)
        difference = symbols(self.shape, response.walled, scale * coarse / fine)
        self.response = replace(response, shape=self.shape, difference=difference)
        squares = np.meshgrid(*(np.abs(one) ** 2 for one in difference), indexing="ij")
        wave = np.asarray(sum(squares), np.float32)
        self.kept = wave * np.exp(-(reach**2) * wave)
        self.scale = self._scales(reach * coarse / fine * scale)
        self.share = SHARE / self._greatest()

    def reduced(self, force: Array) -> Array:
        """The `force` less what is taken out of it: `force` - share Z F Z' G `force`."""
        fields = self.scale * self._smooth(self.scale * self._gathered(self.differences(force)))
        reduced = np.empty_like(force)
        _reduce((force, self.weight), self.blocks, self.share * fields, reduced)
        return reduced

    def _smooth(self, fields: Array) -> Array:
        """F times the `fields`."""
        return np.stack(self.response.velocity(list(fields.astype(np.float32)), self.kept))

    def _gathered(self, force: Array) -> Array:
        """Sums (3, m0, m1, m2) of weight times `force` over the nodes of each block."""
        total = np.zeros((3, *self.shape))
        _gather(force, self.weight, self.blocks, np.empty(force.shape[3]), total)
        return total

    def _scales(self, width: Array) -> Array:
        """One over the root of the smoothed density of the walls, for three components."""
        own = self._gathered(self.differences(self.weight))
        modes = ["reflect" if walled else "wrap" for walled in self.response.walled]
        parts = []
        for density in own:
            some = (density > 0).astype(float)
            smooth, area = (
                gaussian_filter(one, np.sqrt(2.0) * width, mode=modes) for one in (density, some)
            )
            mean = np.divide(smooth, area, out=np.zeros_like(smooth), where=density > 0)
            parts.append(np.divide(1.0, np.sqrt(mean), out=mean, where=mean > 0))
        return np.stack(parts)

    def _greatest(self) -> float:
        """The greatest eigenvalue of F Z' G Z, by the process of Lanczos (1950).

        With E = Z' G Z, F E is symmetric in the product x' E y.
        """
        field = np.asarray(np.random.default_rng(0).standard_normal(self.scale.shape))
        former = np.zeros_like(field)
        diagonal: list[float] = []
        beside: list[float] = []
        for _ in range(PROBED):
            weighed = self._weighed(field)
            size = float(np.sqrt(max(float(np.vdot(field, weighed)), 0.0)))
            if not size > 0.0:
                break
            field, weighed = field / size, weighed / size
            moved = self._smooth(weighed)
            beside.append(size)
            diagonal.append(float(np.vdot(moved, weighed)))
            former, field = field, moved - diagonal[-1] * field - size * former
        if not max(diagonal, default=0.0) > 0.0:
            return 1.0
        return float(eigh_tridiagonal(diagonal, beside[1:], eigvals_only=True)[-1])

    def _weighed(self, fields: Array) -> Array:
        """Z' G Z times the `fields`."""
        forces = np.empty_like(self.weight)
        given = (np.zeros_like(self.weight), self.weight)
        _reduce(given, self.blocks, -self.scale * fields, forces)
        return np.asarray(self.scale * self._gathered(self.differences(forces)))


def _blocks(fine: tuple[int, ...], coarse: tuple[int, ...]) -> Blocks:
    """The coarse cell of each node along each axis."""
    x, y, z = (np.arange(n) * m // n for n, m in zip(fine, coarse, strict=True))
    return x, y, z


@loops_in_place
def _gather(force: Array, weight: Array, blocks: Blocks, row: Array, total: Array) -> None:
    """Adds weight times `force` to the `total` (3, m0, m1, m2); `row` is room for n2 numbers."""
    x, y, z = blocks
    for d in range(3):
        for i in range(len(x)):
            for j in range(len(y)):
                if j == 0 or y[j] != y[j - 1]:
                    row[:] = 0.0
                one, own = force[d, i, j], weight[d, i, j]
                for k in range(len(z)):
                    row[k] += np.float64(own[k] * one[k])
                if j + 1 == len(y) or y[j + 1] != y[j]:
                    into = total[d, x[i], y[j]]
                    for k in range(len(z)):
                        into[z[k]] += row[k]


@loops_in_place
def _reduce(given: tuple[Array, Array], blocks: Blocks, fields: Array, reduced: Array) -> None:
    """Sets `reduced` to the force less weight times the field of each node's block."""
    force, weight = given
    x, y, z = blocks
    for d in range(3):
        for i in range(len(x)):
            for j in range(len(y)):
                field, one, own = fields[d, x[i], y[j]], force[d, i, j], weight[d, i, j]
                done = reduced[d, i, j]
                for k in range(len(z)):
                    done[k] = one[k] - own[k] * np.float32(field[z[k]])
