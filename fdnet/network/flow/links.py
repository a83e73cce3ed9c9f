"""Links: the throats, or parts of throats, that carry flow between two planes across x.

Pores on or beyond a plane have the pressure of that plane. A throat that crosses a plane is split
there: the part inside has the conductance g / f, with the conductance g of the throat and the
    share f of its length, along x, inside. Pores of one polyhedron (`Network.pore_group`) are one
    node, and the throats between them carry no flux of their own. A throat that side walls cut
    conducts by its share inside the box.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.errors import FlowError
from fdnet.network.flow.winding import groups, winding_groups
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

INLET, OUTLET, BETWEEN = -1, -2, 0
"""Where a pore lies: on or beyond the inlet plane, the outlet plane, or between them."""
PLANE_TOLERANCE = 1e-9
"""A pore within this distance of a plane, in lengths of the box, lies on the plane."""
SHORTEST_SHARE = 1e-3
"""Smallest share of its length to which a throat is cut."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Links:
    """K conductances between pores and the two planes.

    Attributes:
        ends: (K, 2) number of the group of the pore (`Network.pore_group`), or INLET, or OUTLET.
        conductance: (K,) m3 (flux times viscosity over pressure drop).
        throat: (K,) index of the throat that the link is, or is a part of.
    """

    ends: Array
    conductance: Array
    throat: Array

    __repr__ = one_line

    def where(self, kept: Array) -> "Links":
        """The links for which `kept` (K,) is true."""
        return Links(
            ends=self.ends[kept], conductance=self.conductance[kept], throat=self.throat[kept]
        )


def open_links(network: Network, conductance: Array) -> Links:
    """The links that carry flow from the inlet to the outlet face of the box.

    They are what `solve_flow` solves where x is not periodic. `conductance` (T,) m3 is that of the
    throats. Raises FlowError on a conductance that is negative or not finite.
    """
    check_conductance(conductance, len(network.throat_pores))
    span = (float(network.box[0, 0]), float(network.box[0, 1]))
    return links_between(network, conductance, span)[0]


def check_conductance(conductance: Array, count: int) -> None:
    """Raise FlowError unless there are `count` conductances, all finite and none negative."""
    if conductance.shape != (count,):
        raise FlowError(
            f"conductance has shape {conductance.shape}, expected ({count},), one per throat"
        )
    bad = np.flatnonzero(~np.isfinite(conductance) | (conductance < 0))
    if len(bad):
        raise FlowError(
            f"throat {bad[0]}: conductance {conductance[bad[0]]} m3 is not finite or negative "
            f"({len(bad)} such throats); check the law and the fines"
        )


def links_between(
    network: Network, conductance: Array, span: tuple[float, float]
) -> tuple[Links, Array, Array]:
    """The links that carry flow between the planes at `span` = (low, high) m.

    `conductance` (T,) m3 is that of the throats.

    Returns:
        links: those whose ends are all planes or groups of pores that are tied to both planes.
        place: (G,) INLET, OUTLET or BETWEEN for each group of pores.
        free: (G,) true for groups between the planes that open links tie to both.
    """
    low, high = span
    first = np.unique(network.pore_group, return_index=True)[1]
    place = _places(network, network.pore_position[first, 0], low, high)
    links = _cut_links(network, conductance * network.throat_share, low, high)
    free = _tied_to_both(links, place)
    return links.where(np.all((links.ends < 0) | free[links.ends], axis=1)), place, free


def links_around(network: Network, conductance: Array) -> tuple[Links, Array]:
    """The links that carry flow around the period along x.

    `conductance` (T,) m3 is that of the throats.

    Returns:
        links: those in clusters that go once around the period.
        live: (G,) true for the groups of pores in these clusters.
    """
    group, carried = network.pore_group, conductance * network.throat_share
    ends, jump = group[network.throat_pores], network.throat_shift[:, 0].astype(float)
    throat = np.flatnonzero((carried > 0) & ((ends[:, 0] != ends[:, 1]) | (jump != 0)))
    live = winding_groups(ends[throat], jump[throat], int(group.max()) + 1)[1]
    throat = throat[live[ends[throat, 0]]]
    return Links(ends=ends[throat], conductance=carried[throat], throat=throat), live


def _places(network: Network, x: Array, low: float, high: float) -> Array:
    """INLET or OUTLET where `x` m is on or beyond that plane, else BETWEEN."""
    tolerance = PLANE_TOLERANCE * float(network.box[0, 1] - network.box[0, 0])
    return np.where(x <= low + tolerance, INLET, np.where(x >= high - tolerance, OUTLET, BETWEEN))


def _cut_links(network: Network, conductance: Array, low: float, high: float) -> Links:
    """Open throats with a part between the planes; those that cross a plane are cut there."""
    turned = np.flatnonzero(network.throat_shift[:, 0] != 0)
    throat = np.concatenate([np.arange(len(conductance)), turned])
    length = network.box[0, 1] - network.box[0, 0]
    x = network.pore_position[:, 0][network.throat_pores[throat]]
    x[:, 1] += network.throat_shift[throat, 0] * length
    # a throat across a periodic x face appears at both ends of the box
    x[len(conductance) :] -= (network.throat_shift[turned, 0] * length)[:, None]
    place = _places(network, x, low, high)
    group = network.pore_group[network.throat_pores[throat]]
    on_planes = place != BETWEEN
    use = ((place[:, 0] == BETWEEN) | (place[:, 0] != place[:, 1])) & (conductance[throat] > 0)
    use &= on_planes.any(axis=1) | (group[:, 0] != group[:, 1])
    throat, x, place, group = throat[use], x[use], place[use], group[use]
    inside, whole = np.diff(np.clip(x, low, high), axis=1)[:, 0], np.diff(x, axis=1)[:, 0]
    share = np.divide(inside, whole, out=np.ones(len(x)), where=on_planes[use].any(axis=1))
    return Links(
        ends=np.where(place == BETWEEN, group, place),
        throat=throat,
        conductance=conductance[throat] / np.maximum(share, SHORTEST_SHARE),
    )


def _tied_to_both(links: Links, place: Array) -> Array:
    """True (G,) for groups of pores between the planes that open links tie to both planes."""
    inner = links.ends[np.all(links.ends >= 0, axis=1)]
    cluster = groups(inner, len(place))
    free = place == BETWEEN
    for plane in (INLET, OUTLET):
        near = links.ends[np.any(links.ends == plane, axis=1)].max(axis=1, initial=-1)
        free &= np.isin(cluster, cluster[near[near >= 0]])
    return free
