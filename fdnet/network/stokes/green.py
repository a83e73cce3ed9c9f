"""Flow of point forces in a periodic box on a staggered grid, volume of a cell and viscosity 1.

The discrete Stokes equations, -Laplace(u) + grad(p) = f and div(u) = 0 with the 7-point Laplacian,
are diagonal under the Fourier transform. With g_d = (1 - exp(-i k_d)) / s_d, the symbol of the
backward difference over a step s_d, and lambda = sum |g_d|^2, the velocity is

    u_d = (f_d - g_d sum_e(conj(g_e) f_e) / lambda) / lambda,        mean velocity 0

(Hasimoto 1959, J. Fluid Mech. 5, 317, with the differences of Harlow and Welch 1965, Phys. Fluids
8, 2182). The result is free of divergence in every cell to rounding. Transforms are in single
precision: compared with double precision, k changes by 3e-6 (docs/stokes.md), at half the time and
memory.

A periodic box that is its own mirror image about the planes x = 0 and x = n needs only its half of
n cells (`MirroredGreen`). The velocity across the planes is even and has nodes on both of them
(n + 1 nodes, cosine transform DCT-I); the velocities along them are odd (n nodes, sine transform
DST-II). The backward difference along x then has the real symbol 2 sin(pi i / 2n) / s_0, and the
rest is as above.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import fft

from fdnet.network.stokes.staggered import Staggered
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen


class Grid(Protocol):
    """What a grid offers to the forces on it."""

    @property
    def grid(self) -> Staggered:
        """Where its nodes are."""

    @property
    def volume(self) -> float:
        """Cells of the whole periodic box."""

    def copies(self, component: int, node: Array) -> Array:
        """How many nodes of the whole box each of the flat indices `node` stands for, (M,)."""

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of `grid.shapes`, of the forces `force`, three such arrays."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Green:
    """Symbols of one grid under the Fourier transform.

    Attributes:
        grid: of n0, n1, n2 cells.
        difference: symbol g_d of the backward difference along each axis, complex.
        inverse_laplace: (n0, n1, n2 // 2 + 1), 1 / lambda.
    """

    grid: Staggered
    difference: tuple[Array, Array, Array]
    inverse_laplace: Array

    __repr__ = one_line

    @property
    def volume(self) -> float:
        """Cells of the box."""
        return float(np.prod(self.grid.shape))

    def copies(self, component: int, node: Array) -> Array:
        """One (M,): every node stands for itself."""
        return np.ones(len(node))

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of the grid's shape, of the forces `force`, three such arrays."""
        waves = [fft.rfftn(part, workers=1) for part in force]
        _respond(waves, self.difference, self.inverse_laplace)
        return [fft.irfftn(wave, s=self.grid.shape, workers=1, overwrite_x=True) for wave in waves]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MirroredGreen:
    """Symbols of the half of a mirrored box under cosine, sine and Fourier transforms.

    Attributes:
        grid: of n0, n1, n2 cells, the half; the box has 2 n0 along x.
        difference: symbol g_d of the backward difference along each axis, real along x.
        inverse_laplace: (n0 + 1, n1, n2 // 2 + 1), 1 / lambda.
    """

    grid: Staggered
    difference: tuple[Array, Array, Array]
    inverse_laplace: Array

    __repr__ = one_line

    @property
    def volume(self) -> float:
        """Cells of the box and its mirror image."""
        return 2.0 * float(np.prod(self.grid.shape))

    def copies(self, component: int, node: Array) -> Array:
        """Two (M,), for a node and its image, and one for nodes on the planes."""
        along = node // (self.grid.shape[1] * self.grid.shape[2])
        on_plane = (component == 0) & ((along == 0) | (along == self.grid.shape[0]))
        return np.where(on_plane, 1.0, 2.0)

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of `grid.shapes`, of the forces `force`, three such arrays."""
        waves = [fft.rfftn(fft.dct(force[0], type=1, axis=0), axes=(1, 2))]
        for part in force[1:]:
            wave = np.zeros(self.inverse_laplace.shape, np.complex64)
            wave[1:] = fft.rfftn(fft.dst(part, type=2, axis=0), axes=(1, 2))
            waves.append(wave)
        _respond(waves, self.difference, self.inverse_laplace)
        flows = [
            fft.irfftn(wave, s=self.grid.shape[1:], axes=(1, 2))
            for wave in (waves[0], waves[1][1:], waves[2][1:])
        ]
        return [
            fft.idct(flows[0], type=1, axis=0, overwrite_x=True),
            *(fft.idst(flow, type=2, axis=0, overwrite_x=True) for flow in flows[1:]),
        ]


def build_green(grid: Staggered) -> Green | MirroredGreen:
    """The Green's function of a grid, of half of a mirrored box where it is mirrored."""
    n = grid.shape[0]
    if grid.mirrored:
        along = 2.0 * np.sin(0.5 * np.pi * np.arange(n + 1) / n)
        difference, inverse = _symbols(along, grid)
        return MirroredGreen(grid=grid, difference=difference, inverse_laplace=inverse)
    difference, inverse = _symbols(1.0 - np.exp(-2j * np.pi * fft.fftfreq(n)), grid)
    return Green(grid=grid, difference=difference, inverse_laplace=inverse)


def _symbols(along: Array, grid: Staggered) -> tuple[tuple[Array, Array, Array], Array]:
    """Symbols of the differences and 1 / lambda, from that of the differences `along` x."""
    waves = (fft.fftfreq(grid.shape[1]), fft.rfftfreq(grid.shape[2]))
    g0, g1, g2 = (
        one / step
        for one, step in zip(
            (along, *(1.0 - np.exp(-2j * np.pi * wave) for wave in waves)), grid.step, strict=True
        )
    )
    laplace = (np.abs(g0) ** 2)[:, None, None] + (np.abs(g1) ** 2)[:, None] + np.abs(g2) ** 2
    laplace[0, 0, 0] = np.inf
    symbols = (frozen(g0, np.complex64), frozen(g1, np.complex64), frozen(g2, np.complex64))
    return symbols, frozen(1.0 / laplace, np.float32)


def _respond(
    waves: list[Array], difference: tuple[Array, Array, Array], inverse_laplace: Array
) -> None:
    """Turns the transforms of forces into those of velocities, in place."""
    g0, g1, g2 = difference
    for i, inverse in enumerate(inverse_laplace):
        f0, f1, f2 = (wave[i] for wave in waves)
        pressure = (np.conj(g0[i]) * f0 + np.conj(g1)[:, None] * f1 + np.conj(g2) * f2) * inverse
        for part, symbol in ((f0, g0[i]), (f1, g1[:, None]), (f2, g2)):
            part -= symbol * pressure
            part *= inverse
