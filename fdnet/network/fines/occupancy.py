"""What fines take up of each throat and pore.

Volume of spheres inside cylinders with flat ends: exact, and as the thesis estimates it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, pi, sqrt
from typing import NamedTuple

import numpy as np

from fdnet.errors import CaseError, NetworkError
from fdnet.network import geometry
from fdnet.network.compiled import compiled
from fdnet.network.fines import deposit
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line

GAUSS_POINTS = 10  # Points of the Gauss-Legendre rule of `exact_volume`


class Pairs(NamedTuple):
    """K pairs of a sphere and a cylinder, which spans depth 0 to its length."""

    sphere: Array  # (K,) m, radius of the sphere
    offset: Array  # (K,) m, distance of the centre of the sphere from the axis
    depth: Array  # (K,) m, place of the centre along the axis
    tube: Array  # (K,) m, radius of the cylinder
    length: Array  # (K,) m, of the cylinder

    def where(self, mask: Array) -> "Pairs":
        """The pairs for which `mask` (K,) is true."""
        return Pairs(*(column[mask] for column in self))


def exact_volume(pairs: Pairs) -> Array:
    """Volume (K,) m3 common to sphere and cylinder.

    Discs of the sphere, cut by the tube, are integrated along the axis: in closed form where the
    disc lies within the tube or covers it; where they cross, by a Gauss-Legendre rule in the angle
    phi with place = middle + half sin(phi), which smooths the ends. The error is below 1e-6 of the
    sphere (docs/validation/throat-occupancy.csv).
    """
    volume = np.zeros(len(pairs.sphere))
    node, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    angle = 0.5 * np.pi * node
    _fill_volumes(pairs, np.sin(angle), 0.5 * np.pi * weight * np.cos(angle), volume)
    return volume


@compiled
def _fill_volumes(pairs: Pairs, place: Array, weight: Array, volume: Array) -> None:
    sphere, offset, depth, tube, length = pairs
    for k in range(len(sphere)):
        a, d, r = sphere[k], offset[k], tube[k]
        low, high = max(-depth[k], -a), min(length[k] - depth[k], a)
        if high <= low or d >= a + r:
            continue
        covers = sqrt(max(a**2 - (r + d) ** 2, 0.0))
        crosses = sqrt(max(a**2 - (r - d) ** 2, 0.0))
        total = pi * r**2 * max(min(high, covers) - max(low, -covers), 0.0)
        if r > d:
            total += _segment(a, low, min(high, -crosses)) + _segment(a, max(low, crosses), high)
        total += _crossing(a, d, r, max(low, -crosses), min(high, -covers), place, weight)
        total += _crossing(a, d, r, max(low, covers), min(high, crosses), place, weight)
        volume[k] = total


@compiled
def _segment(a: float, low: float, high: float) -> float:
    """Volume of the sphere of radius `a` about 0 between two planes."""
    return pi * (a**2 * (high - low) - (high**3 - low**3) / 3.0) if high > low else 0.0


@compiled
def _crossing(
    a: float, d: float, r: float, low: float, high: float, place: Array, weight: Array
) -> float:
    """Integral of the lens of the sphere's disc and the tube's, whose centres are `d` apart."""
    if high <= low:
        return 0.0
    total = 0.0
    for m in range(len(place)):
        square = a**2 - (0.5 * (low + high) + 0.5 * (high - low) * place[m]) ** 2
        to_chord = (d**2 + r**2 - square) / (2.0 * d)
        half = sqrt(max(r**2 - to_chord**2, 0.0))
        lens = r**2 * atan2(half, to_chord) + square * atan2(half, d - to_chord) - d * half
        total += weight[m] * lens
    return 0.5 * (high - low) * total


@compiled
def _place_by_axis(
    start: Array, end: Array, throat: Array, point: Array, image: Array
) -> tuple[Array, Array]:
    """Distance (K,) m of `point[image]` from the axis of a throat, and its place (K,) m along it.

    A throat between two pores at one place has the direction x.
    """
    offset, depth = np.empty(len(throat)), np.empty(len(throat))
    for k in range(len(throat)):
        a, b, p = start[throat[k]], end[throat[k]], point[image[k]]
        x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        span = sqrt(x * x + y * y + z * z)
        if span > 0.0:
            x, y, z = x / span, y / span, z / span
        else:
            x = 1.0
        u, v, w = p[0] - a[0], p[1] - a[1], p[2] - a[2]
        depth[k] = u * x + v * y + w * z
        u, v, w = u - depth[k] * x, v - depth[k] * y, w - depth[k] * z
        offset[k] = sqrt(u * u + v * v + w * w)
    return offset, depth


def two_plane_volume(pairs: Pairs) -> Array:
    """Volume (K,) m3 common to sphere and cylinder, as Shi 2011 estimates it (section 3.2.2).

    It is the mean of the two caps that are cut off by the planes through the highest and the
    lowest point of the intersection curve. These are read as the plane tangent to the tube, and
    the plane of the chord through the crossings of the two circles in the section at the centre of
    the sphere. The thesis does not mention the ends; they take off the share of the sphere beyond
    them.
    """
    apart = np.maximum(pairs.offset, 1e-12 * pairs.tube)
    chord = (pairs.offset**2 + pairs.tube**2 - pairs.sphere**2) / (2.0 * apart)
    caps = [
        geometry.cap_volume(pairs.sphere, pairs.sphere + plane - pairs.offset)
        for plane in (pairs.tube, chord)
    ]
    ball = 4.0 / 3.0 * np.pi * pairs.sphere**3
    within = pairs.offset + pairs.sphere <= pairs.tube
    apart_from = pairs.offset >= pairs.tube + pairs.sphere
    across = np.where(within, ball, np.where(apart_from, 0.0, 0.5 * (caps[0] + caps[1])))
    below = [
        geometry.cap_volume(pairs.sphere, pairs.sphere + plane - pairs.depth)
        for plane in (0.0, pairs.length)
    ]
    return across * (below[1] - below[0]) / ball


def covers_section(pairs: Pairs) -> Array:
    """True (K,) where the sphere covers a whole section of the cylinder (Shi 2011, figure 39)."""
    nearest = np.clip(pairs.depth, 0.0, pairs.length) - pairs.depth
    reach = np.sqrt(np.maximum(pairs.sphere**2 - nearest**2, 0.0))
    return (pairs.tube > 0) & (reach > 0) & (reach >= pairs.offset + pairs.tube)


OVERLAPS = {"exact": exact_volume, "two-plane": two_plane_volume}
"""Estimates of the common volume by their names in a case."""


# ---- What fines take up of each throat and pore. They never change the network itself.
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Occupancy:
    """Fines in throats (T) and pores (P), and pairs (K) of a throat and a fine in it; SI units.

    A throat here is the cylinder of its inscribed radius between the positions of its two pores
    (Shi 2011, section 3.2.2).

    Attributes:
        throat_solid_volume: (T,) m3, fines in the cylinder.
        throat_porosity: (T,) 1 - solid / cylinder; negative where fines overlap, 1 where the
            radius of the throat is 0.
        throat_fine_radius: (T,) m, mean radius of the fines in it; 0 without fines.
        throat_fines: (T,) number of fines in it.
        blocked: (T,) whether one fine covers a whole cross-section.
        pore_solid_volume: (P,) m3, fines in the tetrahedron.
        pore_solid_surface: (P,) m2, surface of the fines in the tetrahedron.
        pore_porosity: (P,) (void - fines) / tetrahedron.
        pair_throat: (K,) index of the throat.
        pair_fine: (K,) index of the fine.
        pair_distance: (K,) distance of the centre of the fine from the axis over the radius of
            the throat.
        pair_radius: (K,) m, radius of the fine.
        pair_volume: (K,) m3 of the fine in the throat.
        fines: those whose spheres reach into the box.
        counts: how many fines lie outside the box, how many porosities are negative.
    """

    throat_solid_volume: Array
    throat_porosity: Array
    throat_fine_radius: Array
    throat_fines: Array
    blocked: Array
    pore_solid_volume: Array
    pore_solid_surface: Array
    pore_porosity: Array
    pair_throat: Array
    pair_fine: Array
    pair_distance: Array
    pair_radius: Array
    pair_volume: Array
    fines: Snapshot
    counts: Mapping[str, int]

    __repr__ = one_line


def measure_occupancy(network: Network, fines: Snapshot, *, overlap: str = "exact") -> Occupancy:
    """What `fines` fill of the throats and pores of a network (Shi 2011, section 3.2).

    Throats and pores see every fine whose sphere reaches into the box, also one that is centred
    upstream of it. Pores hold what of it lies inside the box; a pore or throat that a mirrored
    face cuts stands for its mirrored part as well. Throats also see the mirror images of the fines
    centred inside. Fines centred outside are counted (`fines_outside_box`).

    Args:
        network: pores and throats of the grains.
        fines: the small spheres, m.
        overlap: volume of a fine in a throat, "exact" or "two-plane" (the thesis).

    Raises:
        CaseError: `overlap` is unknown.
        NetworkError: a fine is wider than a periodic side.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> network = fdnet.build_network(grains, periodic="yz")
        >>> fine = fdnet.Snapshot.from_arrays([[1e-3] * 3], 5e-5, box=grains.box, kind="fine")
        >>> occupancy = fdnet.measure_occupancy(network, fine)
        >>> print(f"{1e18 * occupancy.pore_solid_volume.sum():.0f} um3 of fines in the pores")
        523599 um3 of fines in the pores
    """
    if overlap not in OVERLAPS:
        raise CaseError(
            f"analysis.throat_overlap: {overlap!r} is not known; choose one of {sorted(OVERLAPS)}"
        )
    refuse_wide(network, fines)
    throat, fine, pairs = _touching_pairs(network, fines)
    volume = OVERLAPS[overlap](pairs)
    count = len(network.throat_radius)
    blocked = np.zeros(count, bool)
    blocked[throat[covers_section(pairs)]] = True
    use = volume > 0
    throat, fine, volume, pairs = throat[use], fine[use], volume[use], pairs.where(use)
    filled = np.bincount(throat, weights=volume, minlength=count)
    number = np.bincount(throat, minlength=count)
    radii = np.bincount(throat, weights=pairs.sphere, minlength=count)
    porosity = 1.0 - ratio(filled, np.pi * network.throat_radius**2 * network.throat_length)
    reaching = fines.where(deposit.reaching_inside(network, fines))
    solid, surface = deposit.deposit_in_pores(network, reaching)
    values = {
        "throat_solid_volume": filled,
        "throat_porosity": porosity,
        "throat_fine_radius": ratio(radii, number),
        "throat_fines": number,
        "blocked": blocked,
        "pore_solid_volume": solid,
        "pore_solid_surface": surface,
        "pore_porosity": ratio(network.pore_volume - solid, network.pore_tetra_volume),
        "pair_throat": throat,
        "pair_fine": fine,
        "pair_distance": pairs.offset / pairs.tube,
        "pair_radius": pairs.sphere,
        "pair_volume": volume,
    }
    counts = {
        "fines_outside_box": int(np.sum(~deposit.centred_inside(network, fines.position))),
        "throat_porosity_negative": int(np.sum(porosity < 0)),
        "pore_porosity_negative": int(np.sum((solid > 0) & (solid > network.pore_volume))),
    }
    return Occupancy(
        fines=reaching, counts=counts, **{name: frozen(value) for name, value in values.items()}
    )


def refuse_wide(network: Network, fines: Snapshot) -> None:
    """Raise NetworkError on fines that would meet their own image across a periodic side."""
    side = np.where(network.periodic, np.ptp(network.box, axis=1), np.inf)
    wide = np.flatnonzero(2.0 * fines.radius > side.min())
    if len(wide):
        raise NetworkError(
            f"occupancy: fine {fines.id[wide[0]]} of radius {fines.radius[wide[0]]:.3g} m meets "
            f"its own image across the periodic side {'xyz'[int(np.argmin(side))]} of "
            f"{side.min():.3g} m ({len(wide)} such fines); check units and box"
        )


def _touching_pairs(network: Network, fines: Snapshot) -> tuple[Array, Array, Pairs]:
    """Throat and fine (K,) of the pairs that touch, with images, and their relative places."""
    index = np.flatnonzero(deposit.reaching_inside(network, fines))
    throat = np.flatnonzero(network.throat_radius > 0)
    ends = network.throat_ends[throat]
    if not len(index) or not len(throat):
        return throat[:0], index[:0], Pairs(*[np.zeros(0)] * 5)
    low, high = ends.min(axis=1), ends.max(axis=1)
    largest = float(fines.radius[index].max())
    # a throat shorter than the shortest allowed reaches beyond its ends
    beyond = network.throat_length[throat] - np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    reach = (network.throat_radius[throat] + np.maximum(beyond, 0.0) + largest)[:, None]
    low, high = low - reach, high + reach
    position, owner = deposit.images_near(
        network, fines.position[index], low.min(axis=0), high.max(axis=0), 0.0
    )
    row, image = deposit.points_in_boxes(position, low, high)
    offset, depth = _place_by_axis(ends[:, 0], ends[:, 1], row, position, image)
    throat, fine = throat[row], index[owner[image]]
    sphere = fines.radius[fine]
    tube, length = network.throat_radius[throat], network.throat_length[throat]
    use = (offset < sphere + tube) & (depth > -sphere) & (depth < length + sphere)
    return throat[use], fine[use], Pairs(sphere, offset, depth, tube, length).where(use)


def ratio(top: Array, bottom: Array) -> Array:
    """top / bottom, 0 where `bottom` is not positive."""
    return np.divide(top, bottom, out=np.zeros(np.shape(top)), where=np.asarray(bottom) > 0)
