"""The flow on one ray from the centre of a disc, and where a ray ends.

Shear between neighbouring rays is neglected; on each ray the flow is that in the annulus of Happel
(1959) whose free surface is where the ray ends. The functions have no branch, for loops over many
rays (`elementary`).
"""

import numpy as np

from fdnet.network.compiled import compiled_for_loops
from fdnet.network.laws.elementary import log_of

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
FINE_POINTS, FINE_WEIGHTS = np.polynomial.legendre.leggauss(12)


@compiled_for_loops
def flux_on_ray(reach: float, disc: float) -> float:
    """Flux m4 per angle on a ray from the rim of a disc to the distance `reach` m from its centre.

    `disc` m is the radius of the disc. The flux is 0 on a ray that does not leave it.
    """
    d2, r2 = reach * reach, disc * disc
    flux = (4.0 * d2 * d2 * log_of(reach / disc) - 3.0 * d2 * d2 + 4.0 * d2 * r2 - r2 * r2) / 16.0
    return flux if reach > disc else 0.0


@compiled_for_loops
def midway(half: float, below: float) -> float:
    """Distance m from the centre of a disc to the line midway between its rim and that of another.

    With the distance a of the centres and the excess e of the radius of the other disc, `half` m2
    is (a^2 - e^2) / 2, and `below` m is a cos(t) + e on the ray at the angle t from the line
    between the centres. Infinite where the ray never meets the line.
    """
    return max(half / below, 0.0) if below > 0.0 else np.inf
