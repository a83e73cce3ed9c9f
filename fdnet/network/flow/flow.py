"""The flow through a network: its open links, pressures and fluxes.

Links are the throats, or parts of throats, that carry flow between two planes across x. Pores on
or beyond a plane have the pressure of that plane. A throat that crosses a plane is split there:
the part inside has the conductance g / f, with the conductance g of the throat and the share f of
its length, along x, inside. Pores of one polyhedron (`Network.pore_group`) are one node, and the
throats between them carry no flux of their own. A throat that side walls cut conducts by its share
inside the box.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fdnet.errors import FlowError
from fdnet.network.flow.solver import Balance, balance_links, groups, winding_groups
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, frozen, one_line

INLET, OUTLET, BETWEEN = -1, -2, 0
"""Where a pore lies: on or beyond the inlet plane, the outlet plane, or between them."""
PLANE_TOLERANCE = 1e-9
"""A pore within this distance of a plane, in lengths of the box, lies on the plane."""
SHORTEST_SHARE = 1e-3  # Smallest share of its length to which a throat is cut


class Links(NamedTuple):
    """K conductances between pores and the two planes."""

    ends: Array
    """(K, 2) number of the group of the pore (`Network.pore_group`), or INLET, or OUTLET."""
    conductance: Array  # (K,) m3 (flux times viscosity over pressure drop)
    throat: Array  # (K,) index of the throat that the link is, or is a part of


def open_links(network: Network, conductance: Array) -> Links:
    """The links that carry flow from the inlet to the outlet face of the box, as in `solve_flow`.

    `conductance` (T,) m3 is that of the throats. Raises FlowError where it is not usable.
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
    """The links that carry flow between the planes at `span` = (low, high) m, both included.

    `conductance` (T,) m3 is that of the throats. Returns the links, whose ends are planes or
    groups of pores that are tied to both planes; for each group (G,) INLET, OUTLET or BETWEEN; and
    whether (G,) it lies between the planes and open links tie it to both.
    """
    first = np.unique(network.pore_group, return_index=True)[1]
    place = _places(network, network.pore_position[first, 0], span)
    links = _cut_links(network, conductance * network.throat_share, span)
    cluster = groups(links.ends[np.all(links.ends >= 0, axis=1)], len(place))
    free = place == BETWEEN
    for plane in (INLET, OUTLET):
        near = links.ends[np.any(links.ends == plane, axis=1)].max(axis=1, initial=-1)
        free &= np.isin(cluster, cluster[near[near >= 0]])
    kept = np.all((links.ends < 0) | free[links.ends], axis=1)
    return Links(*(column[kept] for column in links)), place, free


def links_around(network: Network, conductance: Array) -> tuple[Links, Array]:
    """The links that go once around the period along x, and the groups of pores (G,) on them.

    `conductance` (T,) m3 is that of the throats.
    """
    group, carried = network.pore_group, conductance * network.throat_share
    ends, jump = group[network.throat_pores], network.throat_shift[:, 0].astype(float)
    throat = np.flatnonzero((carried > 0) & ((ends[:, 0] != ends[:, 1]) | (jump != 0)))
    live = winding_groups(ends[throat], jump[throat], int(group.max()) + 1)[1]
    throat = throat[live[ends[throat, 0]]]
    return Links(ends=ends[throat], conductance=carried[throat], throat=throat), live


def _places(network: Network, x: Array, span: tuple[float, float]) -> Array:
    """INLET or OUTLET where `x` m is on or beyond that plane, else BETWEEN."""
    tolerance = PLANE_TOLERANCE * float(network.box[0, 1] - network.box[0, 0])
    low, high = span[0] + tolerance, span[1] - tolerance
    return np.where(x <= low, INLET, np.where(x >= high, OUTLET, BETWEEN))


def _cut_links(network: Network, conductance: Array, span: tuple[float, float]) -> Links:
    """Open throats with a part between the planes; those that cross a plane are cut there."""
    turned = np.flatnonzero(network.throat_shift[:, 0] != 0)
    throat = np.concatenate([np.arange(len(conductance)), turned])
    length = network.box[0, 1] - network.box[0, 0]
    x = network.pore_position[:, 0][network.throat_pores[throat]]
    x[:, 1] += network.throat_shift[throat, 0] * length
    # a throat across a periodic x face appears at both ends of the box
    x[len(conductance) :] -= (network.throat_shift[turned, 0] * length)[:, None]
    place = _places(network, x, span)
    group = network.pore_group[network.throat_pores[throat]]
    on_planes = place != BETWEEN
    use = ((place[:, 0] == BETWEEN) | (place[:, 0] != place[:, 1])) & (conductance[throat] > 0)
    use &= on_planes.any(axis=1) | (group[:, 0] != group[:, 1])
    throat, x, place, group = throat[use], x[use], place[use], group[use]
    inside, whole = np.diff(np.clip(x, *span), axis=1)[:, 0], np.diff(x, axis=1)[:, 0]
    share = np.divide(inside, whole, out=np.ones(len(x)), where=on_planes[use].any(axis=1))
    return Links(
        ends=np.where(place == BETWEEN, group, place),
        throat=throat,
        conductance=conductance[throat] / np.maximum(share, SHORTEST_SHARE),
    )


# ------------------------------------------------------------------------------------------------
# Steady flow through a network: pressures from the mass balance of each pore.
#
# Viscosity is factored out, so conductances and fluxes are in m3. The pressure is 1 on the inlet
# plane, 0 on the outlet plane. Where x is periodic and no slab is cut out, it drops by 1 per
# period instead.


TOLERANCE = 1e-6
"""Largest residual and mass balance, and largest excess of a pressure over its bounds."""
NOT_SOLVED = "none"  # Method of a flow without an open path


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Flow:
    """Pressures in the pores (P) and fluxes in the throats (T) of one solve.

    Attributes:
        pore_pressure: (P,) over the pressure drop: 1 at the inlet plane, 0 at the outlet plane,
            NaN where the pore is not connected to both planes.
        throat_flux: (T,) m3, from the first to the second pore: flux inside the box times
            viscosity over the pressure drop; the sum over the parts of a throat that is cut twice.
        method: how the system was solved.
        residual: sum of the imbalances of the pores over the inflow, which bounds the relative
            error of the inflow.
        mass_balance: difference of inflow and outflow over the inflow; where x is periodic, of the
            flux across the period and the energy spent, which is flux times the drop of 1. None
            without flow.
        inflow: m3, flux times viscosity over the pressure drop.
        isolated_pores: number of pores that are not connected to both planes.
        carrying_throats: number of throats that carry the flow, 1 / sum of w^2, where w is the
            share of a throat in the energy spent. It is T where all of T spend alike, and near 1
            where one throat spends nearly all (the participation number; Bell and Dean 1970,
            Discuss. Faraday Soc. 50, 55). 0 without flow.
        reason: why the inflow is 0; empty where there is flow.
        balance: that of its links, from which a solve with like conductances can start.
    """

    pore_pressure: Array
    throat_flux: Array
    isolated_pores: int
    method: str = NOT_SOLVED
    residual: float = 0.0
    mass_balance: float | None = None
    inflow: float = 0.0
    carrying_throats: float = 0.0
    reason: str = ""
    balance: Balance | None = None

    __repr__ = one_line


def solve_flow(
    network: Network,
    conductance: Array,
    *,
    span: tuple[float, float] | None = None,
    near: Flow | None = None,
) -> Flow:
    """Steady flow along x through the network, by the mass balance of each pore.

    Args:
        network: the pores and throats.
        conductance: (T,) conductance of each throat, m3 (flux times viscosity over pressure drop).
        span: bounds (low, high) of a slab that is cut out, m; the whole box without it.
        near: a flow of this span through the same open throats, from which the solve starts.

    Returns:
        Pressures over the pressure drop and fluxes (m3). No open path is no error: the inflow is 0
        and `reason` says why.

    Raises:
        FlowError: a conductance is negative or not finite, or the residual, the mass balance or
            the bounds of the pressure are off by more than 1e-6.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> network = fdnet.build_network(grains, periodic="yz")
        >>> flow = fdnet.solve_flow(network, fdnet.LAWS["lubrication"](network))
        >>> print(f"k = {flow.inflow * 3e-3 / 9e-6:.2g} m2")
        k = 2.5e-09 m2
    """
    check_conductance(conductance, len(network.throat_pores))
    group, around = network.pore_group, span is None and network.periodic[0]
    if around:
        links, free = links_around(network, conductance)
        lost, pressure = ~free, np.full(len(free), np.nan)
        # one pore of each connected group is the reference of that group
        node = (np.cumsum(free) - 1)[links.ends]
        jump = network.throat_shift[links.throat, 0].astype(float)
        reason, bounds = "no open path around the period along x", (-np.inf, np.inf)
    else:
        low, high = map(float, network.box[0] if span is None else span)
        links, place, free = links_between(network, conductance, (low, high))
        lost = (place == BETWEEN) & ~free
        pressure = np.where(place == INLET, 1.0, np.where(place == OUTLET, 0.0, np.nan))
        # both planes are node 0, before the free groups
        node = np.where(links.ends < 0, 0, np.cumsum(free)[links.ends])
        jump = 1.0 * (links.ends[:, 0] == INLET) - 1.0 * (links.ends[:, 1] == INLET)
        reason, bounds = f"no open path from x = {low:g} m to x = {high:g} m", (0.0, 1.0)
    isolated = int(np.sum(lost[group]))
    if not len(links.throat):
        return Flow(
            pore_pressure=frozen(pressure[group]),
            throat_flux=frozen(np.zeros(len(conductance))),
            isolated_pores=isolated,
            reason=reason,
        )
    count, start = int(free.sum()) + (not around), None if near is None else near.balance
    solved = balance_links(node, links.conductance, jump, count, near=start)
    pressure[free], flux = solved.pressure[0 if around else 1 :], solved.flux
    if around:
        inflow, other = float(flux @ jump), float(np.sum(flux**2 / links.conductance))
    else:
        inflow, other = _through(links, flux, INLET), -_through(links, flux, OUTLET)
    drop = np.abs(flux) / links.conductance
    energy = np.abs(flux) / np.abs(flux).max() * (drop / drop.max())
    flow = Flow(
        pore_pressure=frozen(pressure[group]),
        throat_flux=frozen(np.bincount(links.throat, weights=flux, minlength=len(conductance))),
        method=solved.method,
        inflow=inflow,
        residual=solved.defect,
        mass_balance=abs(inflow - other) / inflow if inflow > 0 else np.inf,
        isolated_pores=isolated,
        carrying_throats=float(energy.sum() ** 2 / np.sum(energy**2)),
        balance=solved,
    )
    _check(flow, bounds)
    return flow


def _through(links: Links, flux: Array, plane: int) -> float:
    """Flux m3 out of the plane into the pores."""
    return float(np.sum(flux[links.ends[:, 0] == plane]) - np.sum(flux[links.ends[:, 1] == plane]))


def _check(flow: Flow, bounds: tuple[float, float]) -> None:
    """Raise FlowError if the flow does not balance or leaves the pressure `bounds`."""
    pressure = flow.pore_pressure[np.isfinite(flow.pore_pressure)]
    low, high = float(pressure.min(initial=np.inf)), float(pressure.max(initial=-np.inf))
    within = not len(pressure) or (low >= bounds[0] - TOLERANCE and high <= bounds[1] + TOLERANCE)
    balance = flow.mass_balance or 0.0
    worst = np.maximum(flow.residual, balance)
    if not (np.isfinite(flow.inflow) and worst <= TOLERANCE and within):
        raise FlowError(
            f"solve of {len(pressure)} pores: residual {flow.residual:.2g}, in/out balance "
            f"{balance:.2g}, pressures {low:.6g} to {high:.6g}; expected <= {TOLERANCE:g} and "
            f"pressures within {bounds}"
        )
