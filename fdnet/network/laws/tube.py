"""Resistance of a tube between sections of different width.

    dR = 8 / (pi a^4) sqrt(dz^2 + 8/3 da^2),

where a is the radius of the round tube that carries as much as the section (`lubrication`).

An open section lies between the discs of spheres and has no wall around it, so the fluid moves a
shorter way sideways. In the cell of a cylinder whose radius varies along it (Happel 1959) the
exact addition to second order is 0.52 to 0.65 of that one, as long as the cylinder fills 0.04 to
0.5 of the cell (docs/physics_network.md, section 8). So 0.6 times 8/3 stands for 8/3 there.
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.spheres.snapshot import Array

WIDENING = 8.0 / 3.0
"""Factor of da^2 in the resistance above."""
OPEN_WIDENING = 0.6 * WIDENING
"""Factor of da^2 in an open section."""


@loops_in_place
def resistance_of(flux: Array, given: tuple[float, float, float]) -> float:
    """Integral of dR, 1/m3, over sections of the fluxes `flux` (K,) m4, which are written over.

    `given` are the share of the sections inside the box, m between two of them, and the factor of
    da^2. 1/a is linear within a step; the integral is extrapolated from all and from half of the
    steps.
    """
    part, step, widening = given
    for k in range(len(flux)):
        if not part * flux[k] > 0.0:
            return np.inf
    for k in range(len(flux)):
        flux[k] = 1.0 / np.sqrt(np.sqrt(8.0 / np.pi * part * flux[k]))
    return (4.0 * summed(flux, step, 1, widening) - summed(flux, step, 2, widening)) / 3.0


@loops_in_place
def summed(narrow: Array, step: float, every: int, widening: float) -> float:
    """Resistance 1/m3 between sections of 1/a = `narrow` (K,) 1/m that lie `step` m apart.

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
