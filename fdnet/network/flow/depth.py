"""Pressure by depth: how the pressure falls between the pores, and thin layers of a specimen."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.flow.flow import Flow
from fdnet.network.network import Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

FIRST = 1e-3
"""Depth that is divided into layers, m: the first millimetre."""
MOST_LAYERS = 200


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Layers:
    """B thin layers from the formation face, in place: under the pressures of the whole specimen.

    Attributes:
        edges: (B+1,) m.
        k_initial: (B,) m2, without fines.
        k_damaged: (B,) m2, with fines; 0 without flow.
        drop_initial: (B,) share of the specimen's pressure drop in the layer, without fines.
        drop_damaged: (B,) the same with fines; NaN without flow.
        fines_count: (B,) number of fines centred in the layer.
    """

    edges: Array
    k_initial: Array
    k_damaged: Array
    drop_initial: Array
    drop_damaged: Array
    fines_count: Array

    __repr__ = one_line


def layer_edges(box: Array, thickness: float) -> Array:
    """Edges (B+1,) m of layers of `thickness` m that fill the first millimetre of the box.

    The last layer may be thinner, and a specimen that is shorter is divided as a whole. Layers
    are thicker where there would be more than 200.
    """
    low, high = float(box[0, 0]), float(box[0, 1])
    depth = min(FIRST, high - low)
    count = min(max(int(np.ceil(depth / thickness * (1.0 - 1e-9))), 1), MOST_LAYERS)
    thick = max(thickness, depth / MOST_LAYERS)
    return np.append(low + thick * np.arange(count), low + depth)


def depth_pressures(network: Network, flow: Flow, halves: Array, planes: Array) -> Array:
    """Flux-weighted mean pressure (n,) on `planes` (n,) m: 1 on the low x face, 0 on the high.

    The pressure falls from the first node (`nodes`) to the facet by the first of the resistances
    `halves` (T, 2) 1/m3 of a throat, and from there to the second by the other. Most of a throat's
    drop is in its neck, so this places it where it is; `slabs.plane_pressures` spreads it evenly.
    Where x is periodic the pressure is 1 on the low face and falls by 1 per period.
    """
    place, pressure, flux = _pieces(network, flow, halves)
    low, high = map(float, network.box[0])
    turns = (-1, 0, 1) if network.periodic[0] else (0,)
    means = []
    for plane in (low, *map(float, planes)):
        total = net = 0.0
        for turn in turns:
            added = _crossing(place, pressure, flux, plane + turn * (high - low))
            total, net = total + added[0] + turn * added[1], net + added[1]
        means.append(total / net if net else np.nan)
    result = np.array(means[1:])
    if network.periodic[0]:
        return result - means[0] + 1.0
    return np.where(planes <= low, 1.0, np.where(planes >= high, 0.0, result))


def _pieces(network: Network, flow: Flow, halves: Array) -> tuple[Array, Array, Array]:
    """The two pieces of each throat with flux: ends (K, 2) m along x, pressures (K, 2), flux (K,).

    Both ends of a throat whose nodes lie on one side of its facet make one piece.
    """
    use = np.flatnonzero(flow.throat_flux != 0)
    nodes, pores = nodes_of(network), network.throat_pores[use]
    heights, x = nodes.heights[use], nodes.position[pores, 0]
    x[:, 1] += network.throat_shift[use, 0] * float(np.ptp(network.box[0]))
    if not network.periodic[0]:
        x = np.clip(x, *network.box[0])
    pressure = flow.pore_pressure[pores]
    if network.periodic[0]:
        pressure[:, 1] -= network.throat_shift[use, 0]
    first = halves[use, 0] / halves[use].sum(axis=1)
    inside = np.all(heights > 0, axis=1)
    way = np.divide(heights[:, 0], heights.sum(axis=1), out=np.zeros(len(use)), where=inside)
    middle = x[:, 0] + np.where(inside, way, first) * (x[:, 1] - x[:, 0])
    there = pressure[:, 0] + first * (pressure[:, 1] - pressure[:, 0])
    flux = flow.throat_flux[use]
    ends = [np.column_stack([x[:, 0], middle]), np.column_stack([middle, x[:, 1]])]
    falls = [np.column_stack([pressure[:, 0], there]), np.column_stack([there, pressure[:, 1]])]
    return np.concatenate(ends), np.concatenate(falls), np.concatenate([flux, flux])


def _crossing(place: Array, pressure: Array, flux: Array, plane: float) -> tuple[float, float]:
    """Sum of flux times pressure and sum of flux along x, of the pieces that cross `plane` m."""
    crosses = np.flatnonzero((place.min(axis=1) <= plane) & (place.max(axis=1) > plane))
    x, p = place[crosses], pressure[crosses]
    there = p[:, 0] + (plane - x[:, 0]) / (x[:, 1] - x[:, 0]) * (p[:, 1] - p[:, 0])
    signed = flux[crosses] * np.sign(x[:, 1] - x[:, 0])
    return float(np.sum(signed * there)), float(np.sum(signed))


def depth_permeability(network: Network, flow: Flow, halves: Array, edges: Array) -> Array:
    """Permeability (B,) m2 in place between `edges` (B+1,) m, with `depth_pressures`.

    k = Q mu dx / (A dp), as `slabs.inplace_permeability`; 0 without flow.
    """
    if flow.inflow == 0:
        return np.zeros(len(edges) - 1)
    drop = -np.diff(depth_pressures(network, flow, halves, edges))
    return flow.inflow * np.diff(edges) / (network.area * drop)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solved:
    """A network with its flow and the resistances (T, 2) 1/m3 of the halves of its throats."""

    network: Network
    flow: Flow
    halves: Array

    __repr__ = one_line


def make_layers(initial: Solved, damaged: Solved, *, edges: Array, depth: Array) -> Layers:
    """Layers between `edges` (B+1,) m of a specimen before and after; `depth` (F,) m of fines."""
    drops = [
        -np.diff(depth_pressures(one.network, one.flow, one.halves, edges))
        if one.flow.inflow
        else np.full(len(edges) - 1, np.nan)
        for one in (initial, damaged)
    ]
    k = [
        one.flow.inflow * np.diff(edges) / (one.network.area * drop)
        if one.flow.inflow
        else np.zeros(len(drop))
        for one, drop in zip((initial, damaged), drops, strict=True)
    ]
    return Layers(
        edges=frozen(edges),
        k_initial=frozen(k[0]),
        k_damaged=frozen(k[1]),
        drop_initial=frozen(drops[0]),
        drop_damaged=frozen(drops[1]),
        fines_count=frozen(np.histogram(depth, edges)[0]),
    )
