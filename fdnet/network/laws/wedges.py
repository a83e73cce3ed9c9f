"""Flow in the wedges of a section: a logarithm, the table of a wedge, and tubes.

The logarithm is for loops over many numbers at once. It has no branch and no call, so the
processor takes several numbers together. It agrees with that of the C library to a few units of
the last digit (Abramowitz and Stegun 1964, 4.1.27, by the inverse hyperbolic tangent).
"""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np

from fdnet.network.compiled import bits_of, loops_in_place, loops_inside, number_of
from fdnet.spheres.snapshot import Array

LN2 = math.log(2.0)
EXPONENT = np.uint64(52)  # Place of the exponent in the bits of a number
ROOT_HALF = np.uint64(0x3FE6A09E667F3BCD)  # Bits of sqrt(1/2)
ONE = np.uint64(1023 << 52)  # Bits of 1
WHOLE = np.uint64(0x433 << 52)
"""Bits of 2^52; a small whole number in its last bits is added to it."""
OFFSET = 2.0**52 + 1023.0


@loops_inside
def log_of(x: float) -> float:
    """Natural logarithm of a normal number above 0; any finite number for others.

    x = 2^e m with m between sqrt(1/2) and sqrt(2), and ln(m) = 2 artanh((m - 1) / (m + 1)).
    """
    bits = bits_of(x)
    power = (bits - ROOT_HALF + ONE) >> EXPONENT
    m = number_of(bits - (power << EXPONENT) + ONE)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    w = z * z
    series = (
        (1.0 / 3.0 + z / 5.0)
        + w * (1.0 / 7.0 + z * (1.0 / 9.0))
        + w * w * ((1.0 / 11.0 + z * (1.0 / 13.0)) + w * (1.0 / 15.0 + z * (1.0 / 17.0)))
        + w * w * w * w * (1.0 / 19.0)
    )
    return (number_of(power | WHOLE) - OFFSET) * LN2 + (2.0 * s + 2.0 * s * z * series)


# ------------------------------------------------------------------------------------------------
# Flow along the axis through one right-angled wedge of the section of a throat.
#
# The wedge is half of the share that a disc has on one edge of the section. Its tip is the centre
# of the disc, with the angle phi. One side, of length h, lies along the edge and ends in the
# middle of the gap to the next disc; the far side is perpendicular to it. The disc, of radius rho,
# holds the fluid still; the straight sides carry no shear. The speed w solves laplacian(w) = -1,
# and its flux over h^4 depends on phi and x = rho / h alone.
#
# The flux on rays from the tip neglects the shear between neighbours: on each ray the flow is that
# in the annulus of Happel (1959) whose free surface is at the far side. It is an upper bound. The
# exact flux is the series of Sparrow and Loeffler (1959, AIChE J. 5, 325), fitted to the far side
# by least squares. Their ratio varies slowly; `ratio_table` reads it from wedge.csv, which
# `python -m tests.network.wedge_table` writes anew.


TABLE = Path(__file__).with_name("wedge.csv")
STEEPEST = np.radians(84.0)  # Largest angle of the table, rad
ANGLES = np.linspace(0.0, STEEPEST, 43)
DISCS = np.linspace(0.0, 1.0, 21)


@loops_in_place
def shear_ratio(angle: float, disc: float, table: Array) -> float:
    """Exact flux over that on rays, bilinear in `table`; steeper wedges take its last row."""
    rows, columns = table.shape
    row = min(angle / STEEPEST, 1.0) * (rows - 1)
    column = min(disc, 1.0) * (columns - 1)
    i, j = min(int(row), rows - 2), min(int(column), columns - 2)
    u, v = row - i, column - j
    low = (1.0 - v) * table[i, j] + v * table[i, j + 1]
    high = (1.0 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return (1.0 - u) * low + u * high


@lru_cache(maxsize=1)
def ratio_table() -> Array:
    """Exact flux over that on rays at ANGLES (rows) and DISCS (columns)."""
    return np.loadtxt(TABLE, delimiter=",")


# ------------------------------------------------------------------------------------------------
# Resistance of a tube between sections of different width.
#
#     dR = 8 / (pi a^4) sqrt(dz^2 + 8/3 da^2),
#
# where a is the radius of the round tube that carries as much as the section (`lubrication`).
#
# An open section lies between the discs of spheres and has no wall around it, so the fluid moves a
# shorter way sideways. In the cell of a cylinder whose radius varies along it (Happel 1959) the
# exact addition to second order is 0.52 to 0.65 of that one, as long as the cylinder fills 0.04 to
# 0.5 of the cell (docs/physics_network.md, section 8). So 0.6 times 8/3 stands for 8/3 there.


WIDENING = 8.0 / 3.0  # Factor of da^2 in the resistance above
OPEN_WIDENING = 0.6 * WIDENING  # Factor of da^2 in an open section


def resistance_of(flux: Array, part: Array, step: Array, widening: float) -> Array:
    """Integral of dR (S,), 1/m3, over the sections of S sides of throats of the fluxes (S, n) m4.

    `part` (S,) is the share of the sections inside the box, `step` (S,) m lies between two of
    them, and `widening` is the factor of da^2. 1/a is linear within a step; the integral is
    extrapolated from all and from half of the steps. It is infinite where a section is closed.
    """
    resistance = np.full(len(flux), np.inf)
    _set_resistances(flux, part, step, widening, np.empty(flux.shape[1]), resistance)
    return resistance


@loops_in_place
def _set_resistances(
    flux: Array, part: Array, step: Array, widening: float, narrow: Array, resistance: Array
) -> None:
    """Sets the `resistance` of sides without a closed section; `narrow` (n,) is room for 1/a."""
    for s in range(len(flux)):
        least = np.inf
        for k in range(len(narrow)):
            least = min(least, part[s] * flux[s, k])
            narrow[k] = 1.0 / np.sqrt(np.sqrt(8.0 / np.pi * part[s] * flux[s, k]))
        if least > 0.0:
            every = np.int64(1)
            fine = summed(narrow, step[s], every, widening)
            coarse = summed(narrow, step[s], every + 1, widening)
            resistance[s] = (4.0 * fine - coarse) / 3.0


@loops_in_place
def summed(narrow: Array, step: float, every: int, widening: float) -> float:
    """Resistance 1/m3 between sections of 1/a = `narrow` (n,) 1/m that lie `step` m apart.

    It is the sum of dR over the intervals between every `every`-th of them.
    """
    total, shear = 0.0, np.sqrt(widening) / 3.0
    for k in range(every, len(narrow), every):
        a, b = narrow[k - every], narrow[k]
        a2, b2 = a * a, b * b
        straight = 0.2 * every * step * (a2 * (a2 + a * b + b2) + b2 * (a * b + b2))
        sideways = shear * (b - a) * (a2 + a * b + b2)
        total += 8.0 / np.pi * np.sqrt(straight * straight + sideways * sideways)
    return total
