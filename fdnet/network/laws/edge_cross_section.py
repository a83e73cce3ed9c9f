"""Flow along the axis through a section of a throat on an edge of the box, between two side walls.

The facet of the throat has a grain and its mirror images across both walls as corners. Its plane
is normal to both walls. Two such triangles make the rectangle between the grain and its three
images, and a quarter of that lies inside the box: the rectangle between the centre of the disc, of
radius rho, its feet on the walls, H_1 and H_2 away, and the edge of the box.

Disc and walls share the fluid as in `wall_cross_section`. The line midway between the rim and a
wall is a parabola, that between the two walls halves their angle, and all three lines meet at the
distance d from both walls,

    d = b - sqrt(b^2 - H_1^2 - H_2^2 + rho^2),  b = H_1 + H_2 + rho.

The film on a wall has the flux y^3 / 3 per length for the thickness y up to the nearest line.
There is no constant. Against finite differences the flux is within 5 % for H_2 / H_1 from 1 to 2
and rho / H_1 from 0.2 to 1.
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.network.laws.elementary import QUARTER, angle_of, cosine_of, sine_of
from fdnet.network.laws.rays import FINE_POINTS, FINE_WEIGHTS, flux_on_ray
from fdnet.network.laws.wall_cross_section import TOLERANCE
from fdnet.network.laws.wedge import shear_ratio
from fdnet.spheres.snapshot import Array


@loops_in_place
def edge_fluxes(place: Array, disc: Array, room: tuple[Array, Array], flux: Array) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 between two walls and a disc in K sections.

    `place` (2,) m are the heights of its centre above the walls, `disc` (K,) m its radii. `room`
    is as in `wall_fluxes`.
    """
    lanes, table = room
    near, turn, share = lanes[0], lanes[1], lanes[2]
    for k in range(len(flux)):
        b = place[0] + place[1] + disc[k]
        rest = place[0] ** 2 + place[1] ** 2 - disc[k] ** 2
        near[k] = b - np.sqrt(max(b * b - rest, 0.0))
        flux[k] = 0.0
    for i in range(2):
        height, along = place[i], place[1 - i]
        for k in range(len(flux)):
            turn[k] = angle_of(max(along - near[k], 0.0), height - near[k])
        _set_rays((height, along), disc, turn, share)
        for k in range(len(flux)):
            ratio = shear_ratio(turn[k], min(2.0 * disc[k] / (height + disc[k]), 1.0), table)
            flux[k] += share[k] * ratio
        _add_film((height, along), disc, flux)


@loops_in_place
def _set_rays(place: tuple[float, float], disc: Array, turn: Array, share: Array) -> None:
    """Sets the flux (K,) m4 on the rays of the disc up to `turn` (K,) rad from the normal.

    `place` are the height m of the disc above the wall, and its distance m from the other wall.
    """
    height, along = place
    for k in range(len(share)):
        share[k] = 0.0
    for p in range(len(FINE_POINTS)):
        part, weight = 0.5 * (1.0 + FINE_POINTS[p]), 0.5 * FINE_WEIGHTS[p]
        for k in range(len(share)):
            angle = part * turn[k] - QUARTER
            cosine, sine = -sine_of(angle), cosine_of(angle)
            reach = min((height + disc[k]) / (1.0 + cosine), along / max(sine, TOLERANCE))
            share[k] += weight * turn[k] * flux_on_ray(reach, disc[k])


@loops_in_place
def _add_film(place: tuple[float, float], disc: Array, flux: Array) -> None:
    """Adds the share of one wall, m4, from the foot of the disc to the edge of the box."""
    height, along = place
    for p in range(len(FINE_POINTS)):
        x, weight = 0.5 * along * (1.0 + FINE_POINTS[p]), 0.5 * along * FINE_WEIGHTS[p]
        for k in range(len(flux)):
            midway = (x * x + height * height - disc[k] * disc[k]) / (2.0 * (height + disc[k]))
            film = max(min(midway, along - x, height), 0.0)
            flux[k] += weight * film**3 / 3.0
