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
from scipy.ndimage import gaussian_filter

from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.network.field.lattice import LEAST_CELLS
from fdnet.network.field.response import Response, symbols
from fdnet.spheres.snapshot import Array

SHARE = 0.8
"""Share that is taken out of the force that the differences weigh most."""
PROBED = 10
"""Power iterations for the greatest eigenvalue."""


class Collective:
    """The slowly varying forces on wall nodes (M,) of three components.

    Args:
        nodes: of each component, flat indices on the grid.
        weight: (M,) of the nodes.
        response: of the grid.
        differences: G, from (M,) to (M,).
        reach: length within which forces are alike, in cells along x.
    """

    def __init__(
        self,
        nodes: list[Array],
        weight: Array,
        response: Response,
        differences: Callable[[Array], Array],
        reach: float,
    ) -> None:
        fine = np.array(response.shape)
        scale = response.scale
        coarse = np.round(fine / scale / (0.5 * reach)).astype(int)
        coarse = np.clip(coarse, np.minimum(LEAST_CELLS, fine), fine)
        self.shape = (int(coarse[0]), int(coarse[1]), int(coarse[2]))
        self.weight, self.differences = weight, differences
        self.block = np.concatenate(
            [
                d * coarse.prod() + _blocks(node, response.shape, self.shape)
                for d, node in enumerate(nodes)
            ]
        ).astype(np.int32)
        difference = symbols(self.shape, response.walled, scale * coarse / fine)
        self.response = replace(response, shape=self.shape, difference=difference)
        squares = np.meshgrid(*(np.abs(one) ** 2 for one in difference), indexing="ij")
        wave = np.asarray(sum(squares), np.float32)
        self.kept = wave * np.exp(-(reach**2) * wave)
        self.scale = self._scales(reach * coarse / fine * scale)
        self.share = SHARE / self._greatest()

    def taken(self, weighed: Array) -> Array:
        """What is taken out of the forces (M,) that the differences weigh."""
        return self.share * self.differences(self._spread(self._filtered(weighed)))

    def _filtered(self, weighed: Array) -> Array:
        """The smooth fields F Z' `weighed`."""
        fields = gathered(self.block, self.weight, weighed, self.scale.size)
        fields = (self.scale * fields).astype(np.float32).reshape(3, *self.shape)
        return np.stack(self.response.velocity(list(fields), self.kept))

    def _spread(self, fields: Array) -> Array:
        """Z times the `fields`."""
        forces = np.empty(len(self.weight))
        spread(forces, self.block, self.weight, self.scale * fields.reshape(-1))
        return forces

    def _scales(self, width: Array) -> Array:
        """One over the root of the smoothed density of the walls, flat, for three components."""
        count = 3 * int(np.prod(self.shape))
        own = gathered(self.block, self.weight, self.differences(self.weight), count)
        modes = ["reflect" if walled else "wrap" for walled in self.response.walled]
        parts = []
        for density in own.reshape(3, *self.shape):
            some = (density > 0).astype(float)
            smooth, area = (
                gaussian_filter(one, np.sqrt(2.0) * width, mode=modes) for one in (density, some)
            )
            mean = np.divide(smooth, area, out=np.zeros_like(smooth), where=density > 0)
            parts.append(np.divide(1.0, np.sqrt(mean), out=mean, where=mean > 0))
        return np.concatenate([part.reshape(-1) for part in parts])

    def _greatest(self) -> float:
        """The greatest eigenvalue of F Z' G Z, by power iterations."""
        fields, value = np.random.default_rng(0).standard_normal(self.scale.size), 1.0
        for _ in range(PROBED):
            fields = self._filtered(self.differences(self._spread(fields))).reshape(-1)
            value = float(np.linalg.norm(fields))
            if not value > 0.0:
                return 1.0
            fields = fields / value
        return value


def _blocks(node: Array, fine: tuple[int, ...], coarse: tuple[int, ...]) -> Array:
    """The coarse cell of each node, flat."""
    places = np.unravel_index(node, fine)
    cells = [place * m // n for place, n, m in zip(places, fine, coarse, strict=True)]
    return np.ravel_multi_index(cells, coarse)


@compiled
def gathered(block: Array, weight: Array, value: Array, count: int) -> Array:
    """Sums (count,) of `weight` times `value` (M,) over the nodes of each block."""
    total = np.zeros(count)
    for one in range(len(value)):
        total[block[one]] += weight[one] * value[one]
    return total


@compiled_in_place
def spread(force: Array, block: Array, weight: Array, field: Array) -> None:
    """Sets the `force` (M,) to the `weight` times the `field` of each node's block."""
    for one in range(len(force)):
        force[one] = weight[one] * field[block[one]]
