"""Flow along the axis through one right-angled wedge of the section of a throat.

The wedge is half of the share that a disc has on one edge of the section. Its tip is the centre of
the disc, with the angle phi. One side, of length h, lies along the edge and ends in the middle of
the gap to the next disc; the far side is perpendicular to it. The disc, of radius rho, holds the
fluid still; the straight sides carry no shear. The speed w solves laplacian(w) = -1, and its flux
over h^4 depends on phi and x = rho / h alone.

`ray_flux` neglects the shear between neighbouring rays from the tip: on each ray the flow is that
in the annulus of Happel (1959) whose free surface is at the far side. It is an upper bound.
`exact_flux` is the series of Sparrow and Loeffler (1959, AIChE J. 5, 325), fitted to the far side
by least squares. Their ratio varies slowly; `ratio_table` reads it from wedge.csv, which
`python -m fdnet.network.laws.wedge` writes anew.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.spheres.snapshot import Array

TABLE = Path(__file__).with_name("wedge.csv")
STEEPEST = np.radians(84.0)
"""Largest angle of the table, rad."""
ANGLES = np.linspace(0.0, STEEPEST, 43)
DISCS = np.linspace(0.0, 1.0, 21)
THINNEST = 0.02
"""Smallest disc, rho / h, for which the ratio is computed."""


@loops_in_place
def ray_flux(angle: float, slope: float, disc: float) -> float:
    """Flux over h^4 of a wedge of `angle` rad with the tangent `slope`, for `disc` = rho / h.

    Closed form of the integral of (4 d^4 ln(d / rho) - 3 d^4 + 4 d^2 rho^2 - rho^4) / 16 over the
    angle, with d = h / cos(angle). A disc that overlaps the next one (rho > h) leaves only the
    rays open that leave it before the far side.
    """
    whole = _antiderivative(angle, slope, disc)
    if disc <= 1.0:
        return whole
    first = np.arccos(1.0 / disc)
    if angle <= first:
        return 0.0
    return whole - _antiderivative(first, np.sqrt(disc * disc - 1.0), disc)


@loops_in_place
def _antiderivative(angle: float, slope: float, disc: float) -> float:
    constant, of_log = ray_parts(angle, slope)
    square = disc * disc
    return constant - of_log * np.log(disc) + square * (4.0 * slope - square * angle) / 16.0


@loops_in_place
def ray_parts(angle: float, slope: float) -> tuple[float, float]:
    """The parts C and D of a flux over h^4 for rho <= h, which depend on the wedge alone.

    `ray_flux` is C - D ln(x) + (4 x^2 tan(phi) - x^4 phi) / 16, with x = rho / h.
    """
    square = slope * slope
    secant4 = slope * (1.0 + square / 3.0)
    log_secant = 0.5 * np.log1p(square)
    spread = secant4 * log_secant - (slope - angle) * 2.0 / 3.0 - slope * square / 9.0
    return (4.0 * spread - 3.0 * secant4) / 16.0, 0.25 * secant4


@loops_in_place
def shear_ratio(angle: float, disc: float, table: Array) -> float:
    """exact_flux / ray_flux, bilinear in `table`; steeper wedges take its last row."""
    return ratio_in_row(table_row(angle), disc, table)


@loops_in_place
def table_row(angle: float) -> float:
    """The row of the table of `shear_ratio` for an angle, with its fraction."""
    return min(angle / STEEPEST, 1.0) * (len(ANGLES) - 1)


@loops_in_place
def ratio_in_row(row: float, disc: float, table: Array) -> float:
    """The ratio of `shear_ratio` at a row that `table_row` gives."""
    rows, columns = table.shape
    column = min(disc, 1.0) * (columns - 1)
    i, j = min(int(row), rows - 2), min(int(column), columns - 2)
    u, v = row - i, column - j
    low = (1.0 - v) * table[i, j] + v * table[i, j + 1]
    high = (1.0 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return (1.0 - u) * low + u * high


@lru_cache(maxsize=1)
def ratio_table() -> Array:
    """exact_flux / ray_flux at ANGLES (rows) and DISCS (columns)."""
    return np.loadtxt(TABLE, delimiter=",")


def exact_flux(angle: float, disc: float, *, terms: int = 24, points: int = 300) -> float:
    """Flux over h^4 for 0 < angle < pi / 2 and 0 < disc <= 1.

    The relative error is 1e-4 up to 60 degrees and 1e-2 at 80. `terms` is the number of terms of
    the series, `points` that of the points on the far side.
    """
    place = 0.5 * (1.0 - np.cos(np.pi * (np.arange(points) + 0.5) / points))
    height = place * np.tan(angle)
    reach, turn = np.hypot(1.0, height), np.arctan2(height, 1.0)
    order = np.pi / angle * np.arange(1, int(min(terms, max(6, 40.0 * angle / np.pi))) + 1)
    longest = 1.0 / np.cos(angle)
    log_term = (0.5 * np.tan(angle) - 0.5 * disc**2 * angle) / angle + 0.5 * disc**2
    outward = reach[:, None] ** (order - 1.0) * np.cos((order - 1.0) * turn[:, None])
    inward = (
        disc ** (2.0 * order)
        * reach[:, None] ** (-order - 1.0)
        * np.cos((order + 1.0) * turn[:, None])
    )
    slopes = order * (outward + inward) / longest**order
    wanted = np.cos(turn) * (0.5 * reach - log_term / reach)
    weight = np.sqrt(np.sin(np.pi * (np.arange(points) + 0.5) / points))
    factor = np.linalg.lstsq(slopes * weight[:, None], wanted * weight, rcond=1e-13)[0]
    return _total(angle, disc, log_term, order, factor, longest)


def _total(
    angle: float, disc: float, log_term: float, order: Array, factor: Array, longest: float
) -> float:
    point, weight = np.polynomial.legendre.leggauss(48)
    turn = 0.5 * angle * (1.0 + point)[:, None]
    depth = 1.0 / np.cos(turn) - disc
    r = disc + 0.5 * depth * (1.0 + point)
    speed = 0.25 * (disc**2 - r**2) + log_term * np.log(r / disc)
    for one, by in zip(order, factor, strict=True):
        speed += (
            by
            * ((r / longest) ** one - (disc / longest) ** one * (disc / r) ** one)
            * np.cos(one * turn)
        )
    return float(np.sum(0.25 * angle * weight[:, None] * weight * depth * speed * r))


def make_table() -> Array:
    """The ratios of `ratio_table`, computed; the ratio of a wedge of angle 0 is 1."""
    table = np.ones((len(ANGLES), len(DISCS)))
    for i, angle in enumerate(ANGLES[1:], start=1):
        for j, disc in enumerate(np.maximum(DISCS, THINNEST)):
            table[i, j] = exact_flux(angle, disc) / ray_flux(angle, np.tan(angle), disc)
    return table


if __name__ == "__main__":
    np.savetxt(TABLE, make_table(), delimiter=",", fmt="%.6f")
