"""Permeability of slabs across the flow: cut out, and from the pressures of the whole specimen."""

import numpy as np

from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array


def whole_permeability(network: Network, conductance: Array) -> tuple[float, Flow]:
    """k (m2) of the whole box, and its flow."""
    flow = solve_flow(network, conductance)
    return flow.inflow * float(np.ptp(network.box[0])) / network.area, flow


def slab_permeability(
    network: Network, conductance: Array, span: tuple[float, float]
) -> tuple[float, Flow]:
    """k (m2) of the slab cut out, and its flow."""
    flow = solve_flow(network, conductance, span=span)
    return flow.inflow * (span[1] - span[0]) / network.area, flow


def inplace_permeability(network: Network, flow: Flow, edges: Array) -> Array:
    """k (S,) m2 of each slab from the pressure it takes in the whole specimen; 0 where nothing flows.

    k = Q mu dx / (A dp) with dp between the flux-weighted mean pressures of the planes, that is the energy the slab
    spends over the flow: always positive, and the drops add up to the whole.
    """
    if flow.inflow == 0:
        return np.zeros(len(edges) - 1)
    pressure = plane_pressures(network, flow, edges)
    return flow.inflow * np.diff(edges) / (network.area * -np.diff(pressure))


def plane_pressures(network: Network, flow: Flow, planes: Array) -> Array:
    """Flux-weighted mean pressure (n,) on `planes` (n,) m; 1 on the low face, 0 on the high face of the box."""
    if not network.periodic[0]:
        inner = [_crossing_sums(network, flow, plane) for plane in planes]
        low, high = network.box[0]
        return np.array(
            [
                1.0 if plane <= low else 0.0 if plane >= high else total / net
                for plane, (total, net) in zip(planes, inner, strict=True)
            ]
        )
    length = float(network.box[0, 1] - network.box[0, 0])
    found = []
    for plane in (float(network.box[0, 0]), *planes):
        # the plane one period on has the pressure of this one less 1
        sums = [
            (turn, *_crossing_sums(network, flow, plane + turn * length)) for turn in (-1, 0, 1)
        ]
        found.append(
            sum(total + turn * net for turn, total, net in sums) / sum(net for _, _, net in sums)
        )
    return np.array(found[1:]) - found[0] + 1.0


def _crossing_sums(network: Network, flow: Flow, plane: float) -> tuple[float, float]:
    """Sum of flux times pressure, and of flux, of the throats where they cross `plane`, along x."""
    x = network.throat_ends[:, :, 0]
    crosses = np.flatnonzero(
        (x.min(axis=1) <= plane) & (x.max(axis=1) > plane) & (flow.throat_flux != 0)
    )
    x, flux = x[crosses], flow.throat_flux[crosses]
    pressure = flow.pore_pressure[network.throat_pores[crosses]]
    if network.periodic[0]:
        pressure = pressure - network.throat_shift[crosses, 0, None] * np.array([0.0, 1.0])
    along = (plane - x[:, 0]) / (x[:, 1] - x[:, 0])
    there = pressure[:, 0] + along * (pressure[:, 1] - pressure[:, 0])
    signed = flux * np.sign(x[:, 1] - x[:, 0])
    return float(np.sum(signed * there)), float(np.sum(signed))
