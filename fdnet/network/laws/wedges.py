"""Flow in the wedges of a section: elementary functions, the table of a wedge, rays and tubes.

The elementary functions are for loops over many numbers at once. They have no branch and no call,
so the processor takes several numbers together. They agree with those of the C library to a few
units of the last digit. Sources: Abramowitz and Stegun 1964, 4.1.27 (logarithm by the inverse
hyperbolic tangent), 4.3.65 and 4.3.66 (sine and cosine), 4.4.42 (inverse tangent).
"""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np

from fdnet.network.compiled import bits_of, loops_in_place, loops_inside, number_of
from fdnet.spheres.snapshot import Array

QUARTER = 0.5 * math.pi
LN2 = math.log(2.0)
EXPONENT = np.uint64(52)
"""Place of the exponent in the bits of a number."""
ROOT_HALF = np.uint64(0x3FE6A09E667F3BCD)
"""Bits of sqrt(1/2)."""
ONE = np.uint64(1023 << 52)
"""Bits of 1."""
WHOLE = np.uint64(0x433 << 52)
"""Bits of 2^52; a small whole number in its last bits is added to it."""
OFFSET = 2.0**52 + 1023.0
STEEP = math.sqrt(2.0) - 1.0
"""Tangent of a sixteenth of a turn."""
SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(11))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(12))
ARC = tuple((-1.0) ** k / (2 * k + 1) for k in range(20))
"""Coefficients of the series of sine, cosine and inverse tangent."""


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


@loops_inside
def sine_of(x: float) -> float:
    """Sine of an angle between -pi / 2 and pi / 2."""
    z = x * x
    w = z * z
    low = (SINE[0] + z * SINE[1]) + w * (SINE[2] + z * SINE[3])
    middle = (SINE[4] + z * SINE[5]) + w * (SINE[6] + z * SINE[7])
    high = (SINE[8] + z * SINE[9]) + w * SINE[10]
    return x * (low + w * w * (middle + w * w * high))


@loops_inside
def cosine_of(x: float) -> float:
    """Cosine of an angle between -pi / 2 and pi / 2."""
    z = x * x
    w = z * z
    low = (COSINE[0] + z * COSINE[1]) + w * (COSINE[2] + z * COSINE[3])
    middle = (COSINE[4] + z * COSINE[5]) + w * (COSINE[6] + z * COSINE[7])
    high = (COSINE[8] + z * COSINE[9]) + w * (COSINE[10] + z * COSINE[11])
    return low + w * w * (middle + w * w * high)


@loops_inside
def angle_of(y: float, x: float) -> float:
    """Angle between -pi and pi of the vector (x, y), as arctan2; the vector is not 0.

    Below an eighth of a turn the series of the inverse tangent is taken at y / x or x / y, or,
    above half of that, at the tangent of the angle to an eighth.
    """
    ax, ay = abs(x), abs(y)
    short, long = min(ax, ay), max(ax, ay)
    steep = short > STEEP * long
    s = (short - long if steep else short) / (short + long if steep else long)
    z = s * s
    w = z * z
    v = w * w
    low = (ARC[0] + z * ARC[1]) + w * (ARC[2] + z * ARC[3])
    second = (ARC[4] + z * ARC[5]) + w * (ARC[6] + z * ARC[7])
    third = (ARC[8] + z * ARC[9]) + w * (ARC[10] + z * ARC[11])
    fourth = (ARC[12] + z * ARC[13]) + w * (ARC[14] + z * ARC[15])
    last = (ARC[16] + z * ARC[17]) + w * (ARC[18] + z * ARC[19])
    angle = s * (low + v * (second + v * (third + v * (fourth + v * last))))
    angle = angle + 0.5 * QUARTER if steep else angle
    angle = QUARTER - angle if ay > ax else angle
    angle = 2.0 * QUARTER - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


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
STEEPEST = np.radians(84.0)
"""Largest angle of the table, rad."""
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
# The flow on one ray from the centre of a disc, and where a ray ends.
#
# Shear between neighbouring rays is neglected; on each ray the flow is that in the annulus of
# Happel (1959) whose free surface is where the ray ends. The functions have no branch, for loops
# over many rays (`elementary`).


POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
FINE_POINTS, FINE_WEIGHTS = np.polynomial.legendre.leggauss(12)


@loops_inside
def flux_on_ray(reach: float, disc: float) -> float:
    """Flux m4 per angle on a ray from the rim of a disc to the distance `reach` m from its centre.

    `disc` m is the radius of the disc. The flux is 0 on a ray that does not leave it.
    """
    d2, r2 = reach * reach, disc * disc
    flux = (4.0 * d2 * d2 * log_of(reach / disc) - 3.0 * d2 * d2 + 4.0 * d2 * r2 - r2 * r2) / 16.0
    return flux if reach > disc else 0.0


@loops_inside
def midway(half: float, below: float) -> float:
    """Distance m from the centre of a disc to the line midway between its rim and that of another.

    With the distance a of the centres and the excess e of the radius of the other disc, `half` m2
    is (a^2 - e^2) / 2, and `below` m is a cos(t) + e on the ray at the angle t from the line
    between the centres. Infinite where the ray never meets the line.
    """
    return max(half / below, 0.0) if below > 0.0 else np.inf


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


WIDENING = 8.0 / 3.0
"""Factor of da^2 in the resistance above."""
OPEN_WIDENING = 0.6 * WIDENING
"""Factor of da^2 in an open section."""


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
