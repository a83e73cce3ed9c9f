"""Steady flow through a network: pressures from the mass balance of each pore.

Viscosity is factored out, so conductances and fluxes are in m3. Pressure is held on two planes
across x: 1 on the inlet plane, 0 on the outlet plane (`links`). Where x is periodic and no slab is
cut out, the pressure drops by 1 per period instead.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.errors import FlowError
from fdnet.network.flow.links import (
    BETWEEN,
    INLET,
    OUTLET,
    Links,
    check_conductance,
    links_around,
    links_between,
)
from fdnet.network.flow.stiff import Balance, balance_links
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

TOLERANCE = 1e-6
"""Largest residual and mass balance, and largest excess of a pressure over its bounds."""
NOT_SOLVED = "none"
"""Method of a flow without an open path."""


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
    """

    pore_pressure: Array
    throat_flux: Array
    method: str
    residual: float
    mass_balance: float | None
    inflow: float
    isolated_pores: int
    carrying_throats: float
    reason: str

    __repr__ = one_line


def solve_flow(
    network: Network, conductance: Array, *, span: tuple[float, float] | None = None
) -> Flow:
    """Steady flow along x through the network, by the mass balance of each pore.

    Args:
        network: the pores and throats.
        conductance: (T,) conductance of each throat, m3 (flux times viscosity over pressure drop).
        span: bounds (low, high) of a slab that is cut out, m; the whole box without it.

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
    if span is None and network.periodic[0]:
        return _solve_period(network, conductance)
    low, high = map(float, network.box[0] if span is None else span)
    links, place, free = links_between(network, conductance, (low, high))
    isolated = int(np.sum(((place == BETWEEN) & ~free)[network.pore_group]))
    pressure = np.where(place == INLET, 1.0, np.where(place == OUTLET, 0.0, np.nan))
    if not len(links.throat):
        reason = f"no open path from x = {low:g} m to x = {high:g} m"
        return _no_flow(pressure[network.pore_group], len(conductance), isolated, reason)
    balance = _solve(links, free)
    pressure[free], flux = balance.pressure[1:], balance.flux
    inflow, outflow = _through(links, flux, INLET), -_through(links, flux, OUTLET)
    per_throat = np.bincount(links.throat, weights=flux, minlength=len(conductance))
    return _checked(
        Flow(
            pore_pressure=frozen(pressure[network.pore_group]),
            throat_flux=frozen(per_throat),
            method=balance.method,
            inflow=inflow,
            residual=balance.defect,
            mass_balance=_apart(inflow, outflow),
            isolated_pores=isolated,
            carrying_throats=_carrying(balance.flux, links.conductance),
            reason="",
        ),
        bounds=(0.0, 1.0),
    )


def _solve(links: Links, free: Array) -> Balance:
    """Balance of the `free` (G,) groups, in their order after node 0, which is both planes."""
    node = np.where(links.ends < 0, 0, np.cumsum(free)[links.ends])
    jump = 1.0 * (links.ends[:, 0] == INLET) - 1.0 * (links.ends[:, 1] == INLET)
    return balance_links(node, links.conductance, jump, int(free.sum()) + 1)


def _apart(inflow: float, other: float) -> float:
    """|inflow - other| / inflow, infinite for an inflow that is not positive."""
    return abs(inflow - other) / inflow if inflow > 0 else np.inf


def _through(links: Links, flux: Array, plane: int) -> float:
    """Flux m3 out of the plane into the pores."""
    return float(np.sum(flux[links.ends[:, 0] == plane]) - np.sum(flux[links.ends[:, 1] == plane]))


def _carrying(flux: Array, conductance: Array) -> float:
    """`Flow.carrying_throats` of links (K,) with these `flux` and `conductance`, m3."""
    drop = np.abs(flux) / conductance
    energy = np.abs(flux) / np.abs(flux).max() * (drop / drop.max())
    return float(energy.sum() ** 2 / np.sum(energy**2))


def _no_flow(pressure: Array, throats: int, isolated: int, reason: str) -> Flow:
    """The flow where no open path joins inlet and outlet."""
    return Flow(
        pore_pressure=frozen(pressure),
        throat_flux=frozen(np.zeros(throats)),
        method=NOT_SOLVED,
        residual=0.0,
        mass_balance=None,
        inflow=0.0,
        isolated_pores=isolated,
        carrying_throats=0.0,
        reason=reason,
    )


def _checked(flow: Flow, *, bounds: tuple[float, float]) -> Flow:
    """The same flow. Raises FlowError if it does not balance or leaves the pressure `bounds`."""
    pressure = flow.pore_pressure[np.isfinite(flow.pore_pressure)]
    low, high = float(pressure.min(initial=np.inf)), float(pressure.max(initial=-np.inf))
    within = not len(pressure) or (low >= bounds[0] - TOLERANCE and high <= bounds[1] + TOLERANCE)
    balance = flow.mass_balance or 0.0
    if not (
        np.isfinite(flow.inflow) and flow.residual <= TOLERANCE and balance <= TOLERANCE and within
    ):
        raise FlowError(
            f"solve of {len(pressure)} pores: residual {flow.residual:.2g}, in/out balance "
            f"{balance:.2g}, pressures {low:.6g} to {high:.6g}; expected <= {TOLERANCE:g} and "
            f"pressures within {bounds}"
        )
    return flow


def _solve_period(network: Network, conductance: Array) -> Flow:
    """Flow for a pressure drop of 1 per period along x.

    The pressure of one pore in each connected group is the reference of that group.
    """
    group = network.pore_group
    links, live = links_around(network, conductance)
    isolated = int(np.sum(~live[group]))
    if not live.any():
        nowhere = np.full(len(group), np.nan)
        return _no_flow(
            nowhere, len(conductance), isolated, "no open path around the period along x"
        )
    throat, g = links.throat, links.conductance
    node, jump = (np.cumsum(live) - 1)[links.ends], network.throat_shift[throat, 0].astype(float)
    balance = balance_links(node, g, jump, int(live.sum()))
    pressure = np.full(len(live), np.nan)
    pressure[live] = balance.pressure
    inflow, spent = float(balance.flux @ jump), float(np.sum(balance.flux**2 / g))
    return _checked(
        Flow(
            pore_pressure=frozen(pressure[group]),
            throat_flux=frozen(
                np.bincount(throat, weights=balance.flux, minlength=len(conductance))
            ),
            method=balance.method,
            residual=balance.defect,
            inflow=inflow,
            mass_balance=_apart(inflow, spent),
            isolated_pores=isolated,
            carrying_throats=_carrying(balance.flux, links.conductance),
            reason="",
        ),
        bounds=(-np.inf, np.inf),
    )
