"""Flow of point forces on a staggered grid, periodic or between slip planes, by transforms.

Spacing along x and viscosity are 1. The discrete Stokes equations, -Laplace(u) + grad(p) = f and
div(u) = 0 with the 7-point Laplacian, are diagonal under the transforms. With g_d, the symbol of
the backward difference along axis d over the spacing there, and lambda = sum |g_d|^2,

    p = sum_e(conj(g_e) f_e) / lambda,        u_d = (f_d - g_d p) / lambda,        means 0

(Hasimoto 1959, J. Fluid Mech. 5, 317, with the differences of Harlow and Welch 1965, Phys. Fluids
8, 2182). Across periodic sides the transform is Fourier's and g = 1 - exp(-i k). Between two slip
planes the velocity across them is odd (sine transform DST-I, n - 1 nodes), all else is even
(cosine transform DCT-II), and g = -2 sin(pi i / 2n). The flow is free of divergence in every cell
to rounding. Transforms are in single precision: see docs/stokes.md for what that costs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import fft

from fdnet.network.compiled import compiled
from fdnet.network.field.lattice import Lattice
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Response:
    """Symbols of one grid.

    Attributes:
        shape: cells.
        walled: whether the sides across x, y, z are slip planes.
        scale: (3,) cells' edges along x over those along each axis.
        difference: symbol g of the backward difference along each axis, complex (n,).
    """

    shape: tuple[int, int, int]
    walled: tuple[bool, bool, bool]
    scale: Array
    difference: tuple[Array, Array, Array]

    __repr__ = one_line

    def velocity(self, force: list[Array], kept: Array | None = None) -> list[Array]:
        """Velocity, three arrays of the grid's shape with mean 0, of such forces.

        Each wave is multiplied by what is `kept` of it, where that is given.
        """
        waves = [self._forward(part, d) for d, part in enumerate(force)]
        _respond(waves[0], waves[1], waves[2], *self.difference)
        if kept is not None:
            waves = [wave * kept for wave in waves]
        return [self._back(wave, d) for d, wave in enumerate(waves)]

    def pressure(self, force: list[Array]) -> Array:
        """Pressure in the middle of the cells, mean 0, of forces (three arrays of the shape)."""
        waves = [self._forward(part, d) for d, part in enumerate(force)]
        _press(waves[0], waves[1], waves[2], *self.difference)
        return self._back(waves[0], -1)

    @property
    def _wrapping(self) -> tuple[int, ...]:
        return tuple(axis for axis in range(3) if not self.walled[axis])

    @property
    def _between_walls(self) -> tuple[int, ...]:
        return tuple(axis for axis in range(3) if self.walled[axis])

    def _forward(self, part: Array, component: int) -> Array:
        part = part.copy()  # the only one: what follows may work in place
        for axis in self._between_walls:
            part = (
                _inside(fft.dst, part, axis)
                if axis == component
                else fft.dct(part, axis=axis, overwrite_x=True)
            )
        return fft.rfftn(part, axes=self._wrapping, workers=1)

    def _back(self, wave: Array, component: int) -> Array:
        size = [self.shape[axis] for axis in self._wrapping]
        part = fft.irfftn(wave, s=size, axes=self._wrapping, workers=1, overwrite_x=True)
        for axis in self._between_walls:
            part = (
                _inside(fft.idst, part, axis)
                if axis == component
                else fft.idct(part, axis=axis, overwrite_x=True)
            )
        return part


def build_response(lattice: Lattice) -> Response:
    """The flow of forces on a grid."""
    scale = frozen(lattice.unit / lattice.spacing)
    return Response(
        shape=lattice.shape,
        walled=lattice.walled,
        scale=scale,
        difference=symbols(lattice.shape, lattice.walled, scale),
    )


def symbols(
    shape: tuple[int, ...], walled: tuple[bool, bool, bool], scale: Array
) -> tuple[Array, Array, Array]:
    """Symbols of the backward difference along each axis, times its `scale` (3,)."""
    last = max(axis for axis in range(3) if not walled[axis])
    along = []
    for axis, n in enumerate(shape):
        if walled[axis]:
            symbol = -2.0 * np.sin(0.5 * np.pi * np.arange(n) / n) + 0j
        else:
            waves = fft.rfftfreq(n) if axis == last else fft.fftfreq(n)
            symbol = 1.0 - np.exp(-2j * np.pi * waves)
        along.append(frozen(scale[axis] * symbol, np.complex64))
    return along[0], along[1], along[2]


def _inside(transform: Callable[..., Array], part: Array, axis: int) -> Array:
    """A sine transform of the nodes between two walls; node 0, on the wall, has no mode.

    `part` is overwritten.
    """
    nodes = np.moveaxis(part, axis, 0)
    done = transform(nodes[1:], type=1, axis=0, overwrite_x=True)
    if not np.may_share_memory(done, part):
        nodes[1:] = done
    nodes[0] = 0.0
    return part


@compiled
def _inverse_square(p: complex, q: complex, r: complex) -> Any:
    """One over the square of a wave's gradient (p, q, r); 0 for the mean, which has none."""
    square = (
        p.real * p.real
        + p.imag * p.imag
        + q.real * q.real
        + q.imag * q.imag
        + r.real * r.real
        + r.imag * r.imag
    )
    return np.float32(0.0) if square == 0.0 else np.float32(1.0) / square


@compiled
def _respond(a: Array, b: Array, c: Array, g0: Array, g1: Array, g2: Array) -> None:
    """Turns the transforms of forces into those of velocities, in place."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                p, q, r = g0[i], g1[j], g2[k]
                inverse = _inverse_square(p, q, r)
                x, y, z = a[i, j, k], b[i, j, k], c[i, j, k]
                along = (np.conj(p) * x + np.conj(q) * y + np.conj(r) * z) * inverse
                a[i, j, k] = (x - p * along) * inverse
                b[i, j, k] = (y - q * along) * inverse
                c[i, j, k] = (z - r * along) * inverse


@compiled
def _press(a: Array, b: Array, c: Array, g0: Array, g1: Array, g2: Array) -> None:
    """Turns the transforms of forces into that of the pressure, in place of `a`."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                p, q, r = g0[i], g1[j], g2[k]
                inverse = _inverse_square(p, q, r)
                x, y, z = a[i, j, k], b[i, j, k], c[i, j, k]
                a[i, j, k] = (np.conj(p) * x + np.conj(q) * y + np.conj(r) * z) * inverse
