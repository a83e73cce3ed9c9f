"""Permeability of slabs across the flow: cut out, and from the pressures of the whole specimen."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SlabK:
    """Permeability of S slabs of one state of a specimen.

    Attributes:
        cut_out: (S,) m2, of each slab alone, with the pressure held on its two planes.
        inplace: (S,) m2, from the pressures of the whole specimen.
        flows: S flows through the slabs cut out.
    """

    cut_out: Array
    inplace: Array
    flows: tuple[Flow, ...]

    __repr__ = one_line


def whole_permeability(network: Network, conductance: Array) -> tuple[float, Flow]:
    """Permeability m2 of the whole box, and its flow; `conductance` (T,) m3."""
    flow = solve_flow(network, conductance)
    return flow.inflow * float(np.ptp(network.box[0])) / network.area, flow


def slab_permeability(
    network: Network, conductance: Array, span: tuple[float, float]
) -> tuple[float, Flow]:
    """Permeability m2 of the slab `span` = (low, high) m cut out, and its flow."""
    flow = solve_flow(network, conductance, span=span)
    return flow.inflow * (span[1] - span[0]) / network.area, flow


def inplace_permeability(network: Network, flow: Flow, edges: Array) -> Array:
    """Permeability (S,) m2 of the slabs between `edges` (S+1,) m in the whole specimen.

    k = Q mu dx / (A dp), with the thickness dx of the slab, the cross-section A of the box, the
    flow Q, the viscosity mu and the difference dp between the flux-weighted mean pressures of the
    two planes. That is the energy which the slab spends over the flow: it is always positive, and
    the differences add up to that of the whole. Without flow the permeability is 0.
    """
    if flow.inflow == 0:
        return np.zeros(len(edges) - 1)
    pressure = plane_pressures(network, flow, edges)
    return flow.inflow * np.diff(edges) / (network.area * -np.diff(pressure))


def plane_pressures(network: Network, flow: Flow, planes: Array) -> Array:
    """Flux-weighted mean pressure (n,) on `planes` (n,) m: 1 on the low x face, 0 on the high."""
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
    means = []
    for plane in (float(network.box[0, 0]), *planes):
        # the plane one period on has the pressure of this one less 1
        sums = [
            (turn, *_crossing_sums(network, flow, plane + turn * length)) for turn in (-1, 0, 1)
        ]
        means.append(
            sum(total + turn * net for turn, total, net in sums) / sum(net for _, _, net in sums)
        )
    return np.array(means[1:]) - means[0] + 1.0


def _crossing_sums(network: Network, flow: Flow, plane: float) -> tuple[float, float]:
    """Sum of flux times pressure and sum of flux along x, of the throats that cross `plane` m."""
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
