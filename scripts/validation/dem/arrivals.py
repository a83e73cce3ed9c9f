"""Which fines came to which throats, counted from the states that an invasion kept.

A fine has arrived at a throat when the straight way of its centre between two kept states crosses
the facet of the throat, or when it rests there at the end: its centre lies over the facet, nearer
to it than its own radius. Each fine counts once at a throat. Between two states a fine may have
gone round a corner, so states should be so close that a fine moves by half a grain at most.
"""

from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, Snapshot

STILL = 0.01
"""Way in radii below which a fine stays where it was."""


def arrivals(network: Network, states: Iterable[Snapshot]) -> Array:
    """Number (T,) of fines that arrived at each throat, over the states in order of time."""
    facets = _Facets(network)
    came: list[Array] = []
    former: Snapshot | None = None
    for state in states:
        fines = state.fines()
        if former is not None:
            _, old, new = np.intersect1d(former.id, fines.id, return_indices=True)
            came.append(facets.crossed(fines.where(new), former.position[old]))
        former = fines
    if former is not None:
        came.append(facets.resting(former))
    pairs = np.unique(np.concatenate([np.zeros((0, 2), int), *came]), axis=0)
    return np.bincount(pairs[:, 1], minlength=len(network.throat_radius))


class _Facets:
    """The facets of the throats, with their images across the periodic sides."""

    def __init__(self, network: Network) -> None:
        corner = np.asarray(network.throat_corner)
        self.box, self.periodic = network.box, network.periodic
        size = np.ptp(self.box, axis=1)
        shifts = [
            np.array([i, j, k]) * size
            for i in _turns(self.periodic[0])
            for j in _turns(self.periodic[1])
            for k in _turns(self.periodic[2])
        ]
        own = np.arange(len(corner))
        self.corner = np.concatenate([corner + shift for shift in shifts])
        self.throat = np.tile(own, len(shifts))
        middle = self.corner.mean(axis=1)
        self.reach = float(np.linalg.norm(self.corner - middle[:, None], axis=2).max(initial=0.0))
        self.tree = cKDTree(middle)

    def crossed(self, fines: Snapshot, former: Array) -> Array:
        """Rows (id, throat) of the facets that the ways from `former` (N, 3) m on cross."""
        size = np.ptp(self.box, axis=1)
        way = fines.position - former
        way = way - np.where(self.periodic, np.round(way / size) * size, 0.0)
        moved = np.linalg.norm(way, axis=1) > STILL * fines.radius
        start, way, who = fines.position[moved] - way[moved], way[moved], fines.id[moved]
        row, facet = self._near(start + 0.5 * way, 0.5 * np.linalg.norm(way, axis=1))
        share, a, b = _meets(start[row], way[row], self.corner[facet])
        hit = (share >= 0.0) & (share < 1.0) & (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)
        return np.column_stack([who[row[hit]], self.throat[facet[hit]]])

    def resting(self, fines: Snapshot) -> Array:
        """Rows (id, throat) of the facets that the fines lie over, within their radius."""
        row, facet = self._near(fines.position, fines.radius)
        corner = self.corner[facet]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        reach = fines.radius[row][:, None] * normal
        share, a, b = _meets(fines.position[row] - reach, 2.0 * reach, corner)
        hit = (share >= 0.0) & (share <= 1.0) & (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)
        return np.column_stack([fines.id[row[hit]], self.throat[facet[hit]]])

    def _near(self, place: Array, reach: Array) -> tuple[Array, Array]:
        """Pairs of a place and a facet that it may touch within its `reach` (N,) m."""
        near = self.tree.query_ball_point(place, reach + self.reach)
        counts = [len(one) for one in near]
        facet = np.array([one for some in near for one in some], int)
        return np.repeat(np.arange(len(place)), counts), facet


def _turns(periodic: bool) -> tuple[int, ...]:
    return (-1, 0, 1) if periodic else (0,)


def _meets(start: Array, way: Array, corner: Array) -> tuple[Array, Array, Array]:
    """Where lines meet the planes of triangles: share of the way, and the two coordinates there.

    Moller and Trumbore 1997 (J. Graphics Tools 2, 21). A line along the plane gives nan.
    """
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    across = np.cross(way, two)
    volume = np.sum(one * across, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(volume != 0.0, 1.0 / volume, np.nan)
    off = start - corner[:, 0]
    turned = np.cross(off, one)
    return (
        np.sum(two * turned, axis=1) * inverse,
        np.sum(off * across, axis=1) * inverse,
        np.sum(way * turned, axis=1) * inverse,
    )
