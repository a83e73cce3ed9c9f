"""Steady flow through a network: pressures from the mass balance of each pore. Viscosity is factored out (g in m3).

Pressure is held on planes across x: 1 on the inlet plane, 0 on the outlet plane. Pores on or beyond a plane are at
its pressure; a throat that crosses a plane is split there: its part inside has conductance g / f, f the share of its
length (in x) inside. Pores of one polyhedron (`pore_group`) are one node, the throats between them carry no flux of
their own; a throat cut by side walls conducts by its share inside. Where x is periodic and no slab is asked for, the
pressure drops by 1 per period instead.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fdnet.errors import FlowError
from fdnet.network.flow.stiff import Balance, balance_links
from fdnet.network.flow.winding import winding_groups
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

TOLERANCE = 1e-6
INLET, OUTLET, BETWEEN = -1, -2, 0
PLANE_HAIR = 1e-9
SHORTEST_SHARE = 1e-3
NOT_SOLVED = "none"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Flow:
    """Pressures and fluxes of one solve.

    `pore_pressure` (P,) 1 at the inlet plane, 0 at the outlet plane, NaN where cut off; `throat_flux` (T,) m3 from
    the first to the second pore; `inflow` m3 = Q mu / dp; `residual` sum of the pores' imbalances over the inflow
    (a bound for the inflow's relative error);
    `mass_balance` difference of inflow and outflow over the inflow, None without flow (x periodic:
    the flux across the period against the energy spent, which is flux times the drop of 1);
    `isolated_pores` not tied to both planes; `reason` why the inflow is 0, else empty.
    """

    pore_pressure: Array
    throat_flux: Array
    method: str
    residual: float
    mass_balance: float | None
    inflow: float
    isolated_pores: int
    reason: str

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Links:
    """K conductances between pores and the two planes.

    Attributes:
        ends: (K, 2) number of the pores' group (`Network.pore_group`), or INLET, or OUTLET.
        conductance: (K,) m3 (flux times viscosity over pressure drop).
        throat: (K,) index of the throat that the link is, or is a part of.
    """

    ends: Array
    conductance: Array
    throat: Array

    __repr__ = one_line

    def where(self, kept: Array) -> "Links":
        return Links(
            ends=self.ends[kept], conductance=self.conductance[kept], throat=self.throat[kept]
        )


def solve_flow(
    network: Network, conductance: Array, *, span: tuple[float, float] | None = None
) -> Flow:
    """Steady flow along x through the network, by the mass balance of each pore.

    Args:
        network: the pores and throats.
        conductance: (T,) conductance of each throat, m3 (flux times viscosity over pressure drop).
        span: bounds (low, high) of a slab that is cut out and solved alone, m; the whole box
            without it.

    Returns:
        Pressures over the pressure drop and fluxes (m3). No open path is no error: the inflow is 0
        and `reason` says why.

    Raises:
        FlowError: a conductance is negative or not finite, or the residual, the mass balance or the
            bounds of the pressure are off by more than 1e-6.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> network = fdnet.build_network(grains, periodic="yz")
        >>> flow = fdnet.solve_flow(network, fdnet.LAWS["lubrication"](network))
        >>> length, area = 3e-3, 9e-6
        >>> print(f"k = {flow.inflow * length / area:.2g} m2")
        k = 2.5e-09 m2
    """
    _check(conductance, len(network.throat_pores))
    conductance = conductance * network.throat_share
    if span is None and network.periodic[0]:
        return _solve_period(network, conductance)
    low, high = (float(network.box[0, 0]), float(network.box[0, 1])) if span is None else span
    node, state = network.pore_group, _group_state(network, low, high)
    links = _cut_links(network, conductance, low, high)
    free = _tied_to_both(links, state)
    pressure = np.where(state == INLET, 1.0, np.where(state == OUTLET, 0.0, np.nan))
    isolated = int(np.sum(((state == BETWEEN) & ~free)[node]))
    live = _live(links, free)
    if not live.any():
        reason = f"no open path from x = {low:g} m to x = {high:g} m"
        return _no_flow(pressure[node], len(conductance), isolated, reason)
    links = links.where(live)
    found = _solve(links, free)
    pressure[free], flux = found.pressure[1:], found.flux
    pressure = pressure[node]
    inflow, outflow = _through(links, flux, INLET), -_through(links, flux, OUTLET)
    per_throat = np.zeros(len(conductance))
    per_throat[links.throat] = flux
    return _checked(
        Flow(
            pore_pressure=frozen(pressure),
            throat_flux=frozen(per_throat),
            method=found.method,
            inflow=inflow,
            residual=found.defect,
            mass_balance=_apart(inflow, outflow),
            isolated_pores=isolated,
            reason="",
        ),
        bounds=(0.0, 1.0),
    )


def open_links(network: Network, conductance: Array) -> Links:
    """The links that carry flow from the inlet to the outlet face, for throat `conductance` (T,) m3.

    They are what `solve_flow` solves where x is not periodic. Raises FlowError on a conductance that
    is negative or not finite.
    """
    _check(conductance, len(network.throat_pores))
    low, high = float(network.box[0, 0]), float(network.box[0, 1])
    links = _cut_links(network, conductance * network.throat_share, low, high)
    free = _tied_to_both(links, _group_state(network, low, high))
    return links.where(_live(links, free))


def _live(links: Links, free: Array) -> Array:
    """True (K,) where every end of a link is a plane or a pore that is tied to both planes."""
    return np.all((links.ends < 0) | free[links.ends], axis=1)


def _group_state(network: Network, low: float, high: float) -> Array:
    """INLET, OUTLET or BETWEEN for each group of pores."""
    first = np.unique(network.pore_group, return_index=True)[1]
    return _beside_planes(network, network.pore_position[first, 0], low, high)


def _check(conductance: Array, count: int) -> None:
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


def _beside_planes(network: Network, x: Array, low: float, high: float) -> Array:
    """INLET or OUTLET where `x` is on or beyond that plane, else BETWEEN."""
    hair = PLANE_HAIR * float(network.box[0, 1] - network.box[0, 0])
    return np.where(x <= low + hair, INLET, np.where(x >= high - hair, OUTLET, BETWEEN))


def _cut_links(network: Network, conductance: Array, low: float, high: float) -> Links:
    """Throats with a part between the planes; those crossing a plane are shortened to it, to 1e-3 at the least."""
    turned = np.flatnonzero(network.throat_shift[:, 0] != 0)
    throat = np.concatenate([np.arange(len(conductance)), turned])
    x = network.throat_ends[throat, :, 0]
    # a throat across a periodic x face appears at both ends of the box
    x[len(conductance) :] -= (
        network.throat_shift[turned, 0] * (network.box[0, 1] - network.box[0, 0])
    )[:, None]
    side = _beside_planes(network, x, low, high)
    use = ((side[:, 0] == BETWEEN) | (side[:, 0] != side[:, 1])) & (conductance[throat] > 0)
    pores = network.throat_pores[throat]
    use &= (side != BETWEEN).any(axis=1) | (
        network.pore_group[pores[:, 0]] != network.pore_group[pores[:, 1]]
    )
    throat, x, side = throat[use], x[use], side[use]
    inside, whole = np.diff(np.clip(x, low, high), axis=1)[:, 0], np.diff(x, axis=1)[:, 0]
    cut = np.any(side != BETWEEN, axis=1)
    share = np.divide(inside, whole, out=np.ones(len(x)), where=cut)
    return Links(
        ends=np.where(side == BETWEEN, network.pore_group[network.throat_pores[throat]], side),
        throat=throat,
        conductance=conductance[throat] / np.maximum(share, SHORTEST_SHARE),
    )


def _tied_to_both(links: Links, state: Array) -> Array:
    """True (P,) for pores between the planes whose group of open links touches both planes."""
    inner = links.ends[np.all(links.ends >= 0, axis=1)]
    count = len(state)
    graph = sparse.coo_matrix(
        (np.ones(len(inner)), (inner[:, 0], inner[:, 1])), shape=(count, count)
    )
    _, group = connected_components(graph, directed=False)
    free = state == BETWEEN
    for plane in (INLET, OUTLET):
        beside = links.ends[np.any(links.ends == plane, axis=1)].max(axis=1, initial=-1)
        free &= np.isin(group, group[beside[beside >= 0]])
    return free


def _solve(links: Links, free: Array) -> Balance:
    """Balance of the `free` pores, in their order after node 0, which is both planes."""
    node = np.where(links.ends < 0, 0, np.cumsum(free)[links.ends])
    jump = 1.0 * (links.ends[:, 0] == INLET) - 1.0 * (links.ends[:, 1] == INLET)
    return balance_links(node, links.conductance, jump, int(free.sum()) + 1)


def _apart(inflow: float, other: float) -> float:
    """|in - other| / in, infinite for an inflow that is none."""
    return abs(inflow - other) / inflow if inflow > 0 else np.inf


def _through(links: Links, flux: Array, plane: int) -> float:
    """Flux out of the plane into the pores."""
    return float(np.sum(flux[links.ends[:, 0] == plane]) - np.sum(flux[links.ends[:, 1] == plane]))


def _no_flow(pressure: Array, throats: int, isolated: int, reason: str) -> Flow:
    return Flow(
        pore_pressure=frozen(pressure),
        throat_flux=frozen(np.zeros(throats)),
        method=NOT_SOLVED,
        residual=0.0,
        mass_balance=None,
        inflow=0.0,
        isolated_pores=isolated,
        reason=reason,
    )


def _checked(flow: Flow, *, bounds: tuple[float, float]) -> Flow:
    pressure = flow.pore_pressure[np.isfinite(flow.pore_pressure)]
    low, high = float(pressure.min(initial=np.inf)), float(pressure.max(initial=-np.inf))
    within = not len(pressure) or (low >= bounds[0] - TOLERANCE and high <= bounds[1] + TOLERANCE)
    balance = flow.mass_balance or 0.0
    if not (
        np.isfinite(flow.inflow) and flow.residual <= TOLERANCE and balance <= TOLERANCE and within
    ):
        raise FlowError(
            f"solve of {len(pressure)} pores: residual {flow.residual:.2g}, in/out balance {balance:.2g}, "
            f"pressures {low:.6g} to {high:.6g}; expected <= {TOLERANCE:g} and pressures within {bounds}"
        )
    return flow


def _solve_period(network: Network, conductance: Array) -> Flow:
    """A pressure drop of 1 per period along x; one pore of each connected group is the reference."""
    group = network.pore_group
    count = int(group.max()) + 1
    pair, jump = group[network.throat_pores], network.throat_shift[:, 0].astype(float)
    throat = np.flatnonzero((conductance > 0) & ((pair[:, 0] != pair[:, 1]) | (jump != 0)))
    pair, jump = pair[throat], jump[throat]
    live = winding_groups(pair, jump, count)[1]
    isolated = int(np.sum(~live[group]))
    if not live.any():
        nowhere = np.full(len(group), np.nan)
        return _no_flow(
            nowhere, len(conductance), isolated, "no open path around the period along x"
        )
    use = live[pair[:, 0]]
    throat, node, jump = throat[use], (np.cumsum(live) - 1)[pair[use]], jump[use]
    g = conductance[throat]
    found = balance_links(node, g, jump, int(live.sum()))
    pressure = np.full(count, np.nan)
    pressure[live] = found.pressure
    inflow, spent = float(found.flux @ jump), float(np.sum(found.flux**2 / g))
    return _checked(
        Flow(
            pore_pressure=frozen(pressure[group]),
            throat_flux=frozen(
                np.bincount(throat, weights=found.flux, minlength=len(conductance))
            ),
            method=found.method,
            residual=found.defect,
            inflow=inflow,
            mass_balance=_apart(inflow, spent),
            isolated_pores=isolated,
            reason="",
        ),
        bounds=(-np.inf, np.inf),
    )
