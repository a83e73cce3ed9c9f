"""Flow of point forces in a periodic box on a staggered (MAC) grid, spacing and viscosity 1.

The discrete Stokes equations, -Laplace(u) + grad(p) = f and div(u) = 0 with the 7-point Laplacian,
are diagonal under the Fourier transform. With g_d = 1 - exp(-i k_d), the symbol of the backward
difference, and lambda = sum |g_d|^2, the velocity is

    u_d = (f_d - g_d sum_e(conj(g_e) f_e) / lambda) / lambda,        mean velocity 0

(Hasimoto 1959, J. Fluid Mech. 5, 317, with the differences of Harlow and Welch 1965, Phys. Fluids
8, 2182). The result is free of divergence in every cell to rounding. Transforms are in single
precision: compared with double precision, k changes by 3e-6 (docs/stokes.md), at half the time and
memory.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft

from fdnet.spheres.snapshot import Array, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Green:
    """Symbols of one grid under the Fourier transform.

    Attributes:
        shape: (3,) cells of the grid, n0, n1, n2.
        difference: symbol g_d of the backward difference along each axis, complex.
        inverse_laplace: (n0, n1, n2 // 2 + 1), 1 / lambda.
    """

    shape: tuple[int, int, int]
    difference: tuple[Array, Array, Array]
    inverse_laplace: Array

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of the grid's shape, of the forces `force`, three such arrays."""
        waves = [fft.rfftn(part, workers=1) for part in force]
        g0, g1, g2 = self.difference
        for i, inverse in enumerate(self.inverse_laplace):
            f0, f1, f2 = (wave[i] for wave in waves)
            pressure = (
                np.conj(g0[i]) * f0 + np.conj(g1)[:, None] * f1 + np.conj(g2) * f2
            ) * inverse
            for part, symbol in ((f0, g0[i]), (f1, g1[:, None]), (f2, g2)):
                part -= symbol * pressure
                part *= inverse
        return [fft.irfftn(wave, s=self.shape, workers=1, overwrite_x=True) for wave in waves]


def build_green(shape: tuple[int, int, int]) -> Green:
    """The Green's function of a periodic grid of `shape` cells."""
    count = [fft.fftfreq(shape[0]), fft.fftfreq(shape[1]), fft.rfftfreq(shape[2])]
    g0, g1, g2 = (1.0 - np.exp(-2j * np.pi * waves) for waves in count)
    laplace = (np.abs(g0) ** 2)[:, None, None] + (np.abs(g1) ** 2)[:, None] + np.abs(g2) ** 2
    laplace[0, 0, 0] = np.inf
    symbols = (frozen(g0, np.complex64), frozen(g1, np.complex64), frozen(g2, np.complex64))
    return Green(
        shape=shape, difference=symbols, inverse_laplace=frozen(1.0 / laplace, np.float32)
    )
