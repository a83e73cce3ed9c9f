"""How much of the flow through a section a fourth grain leaves that reaches into it.

The section of a throat has three grains on its corners. It may also be entered by the fourth grain
of the tetrahedron on that side: by a large grain behind a small one, or by the mirror image of a
grain near a face. Among equal grains this does not happen.

The section is shared as in `cross_section`: each disc keeps what its rays see before a line midway
to another rim or the far side of the triangle. The rays of the fourth disc run from where they
enter the triangle to where they leave it or meet a line midway. Adding a solid never adds flow, so
the share is at most 1.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled
from fdnet.network.laws.cross_section import FINE_POINTS, FINE_WEIGHTS, midway, ray
from fdnet.network.laws.section_rays import disc_flux
from fdnet.network.laws.wedge import shear_ratio
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array


def fourth_grains(network: Network, part: slice) -> tuple[Array, Array]:
    """The fourth grain of the tetrahedra on both sides of the throats `part` (K).

    Returns:
        image: (K, 2) index of its image in the network.
        place: (K, 2, 3) m, along the first edge of the facet, across it towards the third corner,
            and its height above the facet, of the centre of that image from the first corner.
    """
    size, pores = np.ptp(network.box, axis=1), network.throat_pores[part]
    wrap = network.pore_wrap[pores[:, 0]] * size
    facet = network.image_position[network.throat_images[part]] - wrap[:, None]
    along = facet[:, 1] - facet[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    normal = geometry.cross(along, facet[:, 2] - facet[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    across = geometry.cross(normal, along)
    rows = np.arange(len(pores))
    image, place = np.empty(pores.shape, int), np.empty((*pores.shape, 3))
    for side in (0, 1):
        pore = pores[:, side]
        moved = network.throat_shift[part] * side - network.pore_wrap[pore]
        corner = network.image_position[network.pore_images[pore]] + (moved * size)[:, None]
        apart = np.linalg.norm(corner[:, :, None] - facet[:, None], axis=3).min(axis=2)
        apex = np.argmax(apart, axis=1)
        image[:, side] = network.pore_images[pore, apex]
        away = corner[rows, apex] - facet[:, 0]
        place[:, side, 0] = geometry.dot(away, along)
        place[:, side, 1] = geometry.dot(away, across)
        place[:, side, 2] = np.abs(geometry.dot(away, normal))
    return image, place


@compiled
def share_left(base: Array, disc: Array, x: float, y: float, fourth: float, table: Array) -> float:
    """Share of the flux through a triangle with discs that a fourth disc leaves, 0 to 1.

    `base` (3, 2) m are the corners, `disc` (3,) m the radii on them; the fourth disc has the
    centre `x`, `y` m and the radius `fourth` m.
    """
    if not _reaches(base, x, y, fourth):
        return 1.0
    clear = _corner_shares(base, disc, x, y, 0.0, table)
    if not clear > 0.0:
        return 1.0
    left = _corner_shares(base, disc, x, y, fourth, table)
    discs = np.empty((4, 3))
    for i in range(3):
        discs[i] = base[i, 0], base[i, 1], disc[i]
    discs[3] = x, y, fourth
    left += disc_flux(base, discs, 4, 3, table)
    return min(left / clear, 1.0)


@compiled
def _inward(base: Array, side: int) -> tuple[float, float]:
    """Unit normal of the side from corner `side` to the next, towards the third corner."""
    j, k = (side + 1) % 3, (side + 2) % 3
    ex, ey = base[j, 0] - base[side, 0], base[j, 1] - base[side, 1]
    length = np.hypot(ex, ey)
    nx, ny = -ey / length, ex / length
    if nx * (base[k, 0] - base[side, 0]) + ny * (base[k, 1] - base[side, 1]) < 0.0:
        return -nx, -ny
    return nx, ny


@compiled
def _reaches(base: Array, x: float, y: float, disc: float) -> bool:
    """Whether a disc reaches into the triangle, side line by side line."""
    for i in range(3):
        nx, ny = _inward(base, i)
        if nx * (x - base[i, 0]) + ny * (y - base[i, 1]) <= -disc:
            return False
    return True


@compiled
def _corner_shares(
    base: Array, disc: Array, x: float, y: float, fourth: float, table: Array
) -> float:
    """Flux m4 on the rays of the three discs; without a fourth disc if its radius is 0."""
    total = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        jx, jy = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        kx, ky = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        qx, qy = x - base[i, 0], y - base[i, 1]
        aj, ak, aq = np.hypot(jx, jy), np.hypot(kx, ky), np.hypot(qx, qy)
        if fourth > 0.0 and aq <= fourth - disc[i]:
            continue
        turned = jx * ky - jy * kx
        sense = 1.0 if turned > 0.0 else -1.0
        opening = np.arctan2(abs(turned), jx * kx + jy * ky)
        across = np.hypot(kx - jx, ky - jy)
        height = abs(turned) / across
        foot = np.arctan2(-(jx * (kx - jx) + jy * (ky - jy)) / across, height)
        towards = np.arctan2(sense * (jx * qy - jy * qx), jx * qx + jy * qy)
        flux, nearest = 0.0, np.inf
        # numba knows no strict zip
        for point, weight in zip(FINE_POINTS, FINE_WEIGHTS):  # noqa: B905
            turn = 0.5 * opening * (1.0 + point)
            reach = height / max(np.cos(turn - foot), 1e-3)
            reach = min(
                reach,
                midway(aj, disc[j] - disc[i], turn),
                midway(ak, disc[k] - disc[i], opening - turn),
            )
            if fourth > 0.0:
                reach = min(reach, midway(aq, fourth - disc[i], turn - towards))
            flux += weight * 0.5 * opening * ray(reach, disc[i])
            nearest = min(nearest, reach)
        if flux > 0.0:
            closest = min(disc[i] / nearest, 1.0) if nearest > 0.0 else 1.0
            total += flux * shear_ratio(0.5 * opening, closest, table)
    return total
