"""The exact flux through a wedge, and the table of it that the laws read (`wedge.csv`).

`python -m tests.network.wedge_table` writes the table anew.
"""

import numpy as np

from fdnet.network.laws.wedges import ANGLES, DISCS, TABLE
from fdnet.spheres.snapshot import Array

THINNEST = 0.02
"""Smallest disc, rho / h, for which the ratio is computed."""


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
    inward = reach[:, None] ** (-order - 1.0) * np.cos((order + 1.0) * turn[:, None])
    inward = disc ** (2.0 * order) * inward
    slopes = order * (outward + inward) / longest**order
    wanted = np.cos(turn) * (0.5 * reach - log_term / reach)
    weight = np.sqrt(np.sin(np.pi * (np.arange(points) + 0.5) / points))
    factor = np.linalg.lstsq(slopes * weight[:, None], wanted * weight, rcond=1e-13)[0]
    point, weight = np.polynomial.legendre.leggauss(48)
    turn = 0.5 * angle * (1.0 + point)[:, None]
    depth = 1.0 / np.cos(turn) - disc
    r = disc + 0.5 * depth * (1.0 + point)
    speed = 0.25 * (disc**2 - r**2) + log_term * np.log(r / disc)
    for one, by in zip(order, factor, strict=True):
        radial = (r / longest) ** one - (disc / longest) ** one * (disc / r) ** one
        speed += by * radial * np.cos(one * turn)
    return float(np.sum(0.25 * angle * weight[:, None] * weight * depth * speed * r))


def ray_flux(angle: float, disc: float) -> float:
    """Flux over h^4 on the rays of a wedge up to its far side, for a disc of rho / h.

    The integral of (4 d^4 ln(d / rho) - 3 d^4 + 4 d^2 rho^2 - rho^4) / 16 over the angle, with
    d = h / cos(angle). A disc that overlaps the next one leaves only the rays open that leave it
    before the far side.
    """
    first = np.arccos(1.0 / disc) if disc > 1.0 else 0.0
    point, weight = np.polynomial.legendre.leggauss(80)
    turn = first + 0.5 * max(angle - first, 0.0) * (1.0 + point)
    d = 1.0 / np.cos(turn)
    flux = 4.0 * d**4 * np.log(d / disc) - 3.0 * d**4 + 4.0 * d**2 * disc**2 - disc**4
    return float(0.5 * max(angle - first, 0.0) * np.sum(weight * flux) / 16.0)


def make_table() -> Array:
    """The ratios of `ratio_table`, computed; the ratio of a wedge of angle 0 is 1."""
    table = np.ones((len(ANGLES), len(DISCS)))
    for i, angle in enumerate(ANGLES[1:], start=1):
        for j, disc in enumerate(np.maximum(DISCS, THINNEST)):
            table[i, j] = exact_flux(angle, disc) / ray_flux(angle, disc)
    return table


if __name__ == "__main__":
    np.savetxt(TABLE, make_table(), delimiter=",", fmt="%.6f")
