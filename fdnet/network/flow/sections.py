"""Permeability by depth: slabs cut out and in place, thin layers, sections and profile."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fdnet.errors import CaseError, Doubt
from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.network import Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.geometry import Porosity
from fdnet.spheres.snapshot import Array, frozen, one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SlabK:
    """Permeability of S slabs of one state of a specimen."""

    cut_out: Array  # (S,) m2, of each slab alone, with the pressure held on its two planes
    inplace: Array  # (S,) m2, from the pressures of the whole specimen
    flows: tuple[Flow, ...]  # S flows through the slabs cut out

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


def inplace_permeability(
    network: Network, flow: Flow, edges: Array, halves: Array | None = None
) -> Array:
    """Permeability (S,) m2 of the slabs between `edges` (S+1,) m in the whole specimen.

    k = Q mu dx / (A dp), with the thickness dx of the slab, the cross-section A of the box, the
    flow Q, the viscosity mu and the difference dp between the flux-weighted mean pressures of the
    two planes (`plane_pressures`): the energy that the slab spends over the flow, which is always
    positive. The differences add up to that of the whole. Without flow the permeability is 0.
    """
    if flow.inflow == 0:
        return np.zeros(len(edges) - 1)
    pressure = plane_pressures(network, flow, edges, halves)
    return flow.inflow * np.diff(edges) / (network.area * -np.diff(pressure))


def plane_pressures(
    network: Network, flow: Flow, planes: Array, halves: Array | None = None
) -> Array:
    """Flux-weighted mean pressure (n,) on `planes` (n,) m: 1 on the low x face, 0 on the high.

    With the resistances `halves` (T, 2) 1/m3 of the throats the pressure falls from the first node
    (`nodes`) to the facet by the first of them, and from there to the second node by the other;
    without them evenly along each throat. Most of a throat's drop is in its neck. Where x is
    periodic the pressure is 1 on the low face and falls by 1 per period.
    """
    x, pressure, flux = _pieces(network, flow, halves)
    low, high = map(float, network.box[0])
    turns = (-1, 0, 1) if network.periodic[0] else (0,)
    least, most, means = x.min(axis=1), x.max(axis=1), []
    for plane in (low, *map(float, planes)):
        total = net = 0.0
        for turn in turns:
            # the plane one period on has the pressure of this one less 1
            there = plane + turn * (high - low)
            crosses = np.flatnonzero((least <= there) & (most > there))
            (one, two), (start, end) = x[crosses].T, pressure[crosses].T
            mean = start + (there - one) / (two - one) * (end - start)
            signed = flux[crosses] * np.sign(two - one)
            net_here = float(np.sum(signed))
            total, net = total + float(np.sum(signed * mean)) + turn * net_here, net + net_here
        means.append(total / net if net else np.nan)
    result = np.array(means[1:])
    if network.periodic[0]:
        return result - means[0] + 1.0
    return np.where(planes <= low, 1.0, np.where(planes >= high, 0.0, result))


def _pieces(network: Network, flow: Flow, halves: Array | None) -> tuple[Array, Array, Array]:
    """Pieces of the throats with flux: ends (K, 2) m along x, pressures (K, 2), flux (K,).

    A throat is one piece without `halves` and two with them, one on each side of its facet. Both
    ends of a throat whose nodes lie on one side of its facet make one piece.
    """
    use = np.flatnonzero(flow.throat_flux != 0)
    pores, flux = network.throat_pores[use], flow.throat_flux[use]
    nodes = None if halves is None else nodes_of(network)
    x = (network.pore_position if nodes is None else nodes.position)[pores, 0]
    x[:, 1] += network.throat_shift[use, 0] * float(np.ptp(network.box[0]))
    pressure = flow.pore_pressure[pores]
    if network.periodic[0]:
        pressure[:, 1] -= network.throat_shift[use, 0]
    if nodes is None or halves is None:
        return x, pressure, flux
    if not network.periodic[0]:
        x = np.clip(x, *network.box[0])
    heights, first = nodes.heights[use], halves[use, 0] / halves[use].sum(axis=1)
    inside = np.all(heights > 0, axis=1)
    way = np.divide(heights[:, 0], heights.sum(axis=1), out=np.zeros(len(use)), where=inside)
    middle = x[:, 0] + np.where(inside, way, first) * (x[:, 1] - x[:, 0])
    there = pressure[:, 0] + first * (pressure[:, 1] - pressure[:, 0])
    ends = [np.column_stack([x[:, 0], middle]), np.column_stack([middle, x[:, 1]])]
    falls = [np.column_stack([pressure[:, 0], there]), np.column_stack([there, pressure[:, 1]])]
    return np.concatenate(ends), np.concatenate(falls), np.concatenate([flux, flux])


# ---- Thin layers of the first millimetre of a specimen.
FIRST = 1e-3  # Depth that is divided into layers, m: the first millimetre
MOST_LAYERS = 200


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Layers:
    """B thin layers from the formation face, under the pressures of the whole specimen."""

    edges: Array  # (B+1,) m
    k_initial: Array  # (B,) m2, without fines
    k_damaged: Array  # (B,) m2, with fines; 0 without flow
    drop_initial: Array  # (B,) share of the specimen's pressure drop in the layer, without fines
    drop_damaged: Array  # (B,) the same with fines; NaN without flow
    fines_count: Array  # (B,) number of fines centred in the layer

    __repr__ = one_line


def layer_edges(box: Array, thickness: float) -> Array:
    """Edges (B+1,) m of layers of `thickness` m that fill the first millimetre of the box.

    The last layer may be thinner. Layers are thicker where there would be more than 200.
    """
    low, high = float(box[0, 0]), float(box[0, 1])
    depth = min(FIRST, high - low)
    count = min(max(int(np.ceil(depth / thickness * (1.0 - 1e-9))), 1), MOST_LAYERS)
    thick = max(thickness, depth / MOST_LAYERS)
    return np.append(low + thick * np.arange(count), low + depth)


# ---- Permeability, porosity and fines by depth: sections with their own k, and a finer profile.
FACE_TOLERANCE = 1e-6  # Given edges may miss the faces of the box by this share of its length
DIAMETER_TOLERANCE = 1e-9
"""A section that is thinner than a grain diameter by at most this share of it is not thin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A slab [x_lo, x_hi) across the flow, before and after the fines. Permeabilities are in m2.

    "Cut out" is the slab alone, with the pressure held on its two planes (Shi 2011, section
    3.3.1). "In place" is the slab under the pressures of the whole specimen; in series these
    values make up the permeability of the whole.
    """

    section: int  # number of the slab, from 1 at the low x face
    x_lo: float  # m, lower bound
    x_hi: float  # m, upper bound
    porosity_initial: float  # without fines, overlap of spheres counted once
    porosity_damaged: float  # with fines, overlap of spheres counted once
    k_initial: float  # m2, cut out, without fines
    k_damaged: float  # m2, cut out, with fines
    k_reduction: float | None  # 1 - k_damaged / k_initial; None where k_initial is 0
    k_initial_inplace: float  # m2, in place, without fines
    k_damaged_inplace: float  # m2, in place, with fines
    fines_count: int  # number of fines centred in the slab
    fines_fraction: float  # these as a share of all invaded fines

    def row(self) -> dict[str, Any]:
        """The values by the names of sections.csv, which end in their unit (m, m2)."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {f"{name}{SECTION_UNITS.get(name, '')}": value for name, value in values.items()}


SECTION_UNITS = dict.fromkeys(("x_lo", "x_hi"), "_m") | dict.fromkeys(
    ("k_initial", "k_damaged", "k_initial_inplace", "k_damaged_inplace"), "_m2"
)
"""How the names of a section's values end in tables."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Profile:
    """Porosity and fines in B finer bins of depth."""

    edges: Array  # (B+1,) m
    porosity_initial: Array  # (B,) without fines
    porosity_damaged: Array  # (B,) with fines
    fines_fraction: Array  # (B,) share of all invaded fines

    __repr__ = one_line


def section_edges(sections: int | Sequence[float], box: Array) -> Array:
    """Edges (S+1,) m of the sections.

    `sections` is a count of equal slabs, or the edges m themselves; `box` (3, 2) m. Raises
    CaseError unless the edges ascend from face to face.
    """
    low, high = map(float, box[0])
    if isinstance(sections, int | np.integer):
        return np.linspace(low, high, int(sections) + 1)
    edges = np.array(sections, dtype=float)
    tolerance = FACE_TOLERANCE * (high - low)
    ascend = len(edges) > 1 and np.all(np.diff(edges) > 0)
    if not ascend or np.any(np.abs(edges[[0, -1]] - (low, high)) > tolerance):
        raise CaseError(
            f"analysis.sections: edges {edges.tolist()} do not ascend from {low:g} to {high:g} m"
        )
    edges[[0, -1]] = low, high
    return edges


def profile_edges(bin_size: float, box: Array) -> Array:
    """Edges (B+1,) m of equal bins of about `bin_size` m that fill the `box` (3, 2) m."""
    low, high = float(box[0, 0]), float(box[0, 1])
    return np.linspace(low, high, max(1, round((high - low) / bin_size)) + 1)


def make_sections(
    edges: Array, porosity: tuple[Porosity, Porosity], k: tuple[SlabK, SlabK], depth: Array
) -> tuple[Section, ...]:
    """Sections between `edges` (S+1,) m from porosity and slab permeabilities before and after.

    `depth` (F,) m are the places of the invaded fines along x.
    """
    count = np.histogram(depth, edges)[0]
    share = count / max(len(depth), 1)
    before, after = (pooled(one, edges) for one in porosity)
    return tuple(
        Section(
            section=s + 1,
            x_lo=float(edges[s]),
            x_hi=float(edges[s + 1]),
            porosity_initial=float(before[s]),
            porosity_damaged=float(after[s]),
            k_initial=float(k[0].cut_out[s]),
            k_damaged=float(k[1].cut_out[s]),
            k_reduction=reduction(float(k[0].cut_out[s]), float(k[1].cut_out[s])),
            k_initial_inplace=float(k[0].inplace[s]),
            k_damaged_inplace=float(k[1].inplace[s]),
            fines_count=int(count[s]),
            fines_fraction=float(share[s]),
        )
        for s in range(len(edges) - 1)
    )


def thin_slabs(sections: Sequence[Section], diameter: float) -> Iterator[str]:
    """A warning if sections are thinner than the mean `diameter` of the grains, m."""
    least = diameter * (1.0 - DIAMETER_TOLERANCE)
    thin = [one.section for one in sections if one.x_hi - one.x_lo < least]
    if thin:
        count = int((sections[-1].x_hi - sections[0].x_lo) / least)
        cure = f"take fewer sections: analysis.sections = {count} or less"
        yield Doubt(
            "thin-sections",
            f"sections {thin} are thinner than the mean grain diameter ({1e3 * diameter:.3g} mm): "
            "the permeability of each is that of single throats; "
            + (cure if count else "take a specimen that is longer along x"),
        )


def make_profile(edges: Array, porosity: tuple[Porosity, Porosity], depth: Array) -> Profile:
    """Profile between `edges` (B+1,) m of porosity before and after, and of fines at `depth` m."""
    return Profile(
        edges=frozen(edges),
        porosity_initial=frozen(pooled(porosity[0], edges)),
        porosity_damaged=frozen(pooled(porosity[1], edges)),
        fines_fraction=frozen(np.histogram(depth, edges)[0] / max(len(depth), 1)),
    )


def pooled(porosity: Porosity, edges: Array) -> Array:
    """Porosity (S,) between `edges` (S+1,) m, which are among those of its finer profile."""
    first = np.searchsorted(porosity.edges, edges[:-1])
    end = np.searchsorted(porosity.edges, edges[-1])
    width, void = np.diff(porosity.edges)[:end], porosity.profile[:end]
    return np.add.reduceat(width * void, first) / np.add.reduceat(width, first)


def reduction(before: float, after: float) -> float | None:
    """1 - after / before, None where `before` is 0."""
    return None if before == 0 else 1.0 - after / before
