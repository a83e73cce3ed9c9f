"""Size classes carried upwind through the pores, with exact balance.

A link leads from a pore of higher pressure to one of lower pressure, so in the order of falling
pressure the upwind system is lower triangular, and one sweep solves it for all classes: the
implicit Euler step on docs/theory/size_classes.md.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.spheres.snapshot import Array, one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Streams:
    """The directed links (K) of one flow through pores (N); links stand by their first pore."""

    order: Array  # (N,) pores, by falling pressure
    first: Array  # (N+1,) the first of the links out of each pore
    source: Array  # (K,) pore that a link leaves
    target: Array  # (K,) pore that it enters
    link: Array  # (K,) its number among those that were given
    share: Array  # (K,) its flow over the inflow
    fed: Array  # (N,) share of the inflow that enters a pore from outside
    outlet: Array  # (N,) whether what enters a pore has left the specimen
    pressure: Array  # (N,) of the pores, over that lost in the specimen
    inflow: float  # of that pressure, in the unit of the flow

    __repr__ = one_line


def streams_of(
    ends: Array, flux: Array, pressure: Array, *, inlet: Array, outlet: Array
) -> Streams:
    """The links with flow, from pores at higher to pores at lower pressure.

    Args:
        ends: (K, 2) pores of each link.
        flux: (K,) flow from the first to the second, of any unit.
        pressure: (N,) of the pores; NaN where no flow reaches one.
        inlet: (N,) whether a pore is fed from outside.
        outlet: (N,) whether what enters it leaves the specimen.
    """
    turned = flux < 0
    one, two = ends[:, 0], ends[:, 1]
    source, target = np.where(turned, two, one), np.where(turned, one, two)
    # the rounding of a solve may turn a link at a plane round
    use = np.flatnonzero((flux != 0) & ~outlet[source] & ~inlet[target] & (source != target))
    use = use[np.argsort(source[use], kind="stable")]
    source, target, flow = source[use], target[use], np.abs(flux[use])
    leaving = np.bincount(source, flow, len(pressure))
    inflow = float(np.sum(leaving[inlet]))
    height = np.where(np.isfinite(pressure), pressure, -np.inf)
    return Streams(
        order=np.argsort(-height, kind="stable"),
        first=np.concatenate([[0], np.cumsum(np.bincount(source, minlength=len(pressure)))]),
        source=source,
        target=target,
        link=use,
        share=flow / inflow if inflow > 0 else flow,
        fed=np.where(inlet, leaving, 0.0) / (inflow or 1.0),
        outlet=outlet,
        pressure=pressure,
        inflow=inflow,
    )


class Swept(NamedTuple):
    """What one step gave, of pores (N), links (K) and classes (C)."""

    concentration: Array
    """(N, C) volume of solids over that of the fluid in each pore."""
    held: Array
    """(K, C) m3 that each link held back, in the order of `Streams`."""
    passed: Array
    """(C,) m3 that left through the outlet."""


def carry(
    streams: Streams, filtrate: float, *, void: Array, inside: Array, feed: Array, holds: Array
) -> Swept:
    """The concentrations after `filtrate` m3 of fluid have entered.

    Args:
        streams: the flow.
        filtrate: m3 of fluid in this step.
        void: (N,) m3 of fluid in each pore.
        inside: (N, C) m3 of solids carried in each pore at the start.
        feed: (N, C) concentrations of what enters a pore from outside.
        holds: (K, C) share that each link of `streams` holds back.
    """
    after, held = np.zeros_like(inside), np.empty_like(holds)
    entered, passed = (filtrate * streams.fed)[:, None] * feed, np.zeros(inside.shape[1])
    _sweep(
        *(streams.order, streams.first, streams.target, filtrate * streams.share),
        *(streams.outlet, void, inside, holds, entered, after, held, passed),
    )
    return Swept(after, held, passed)


@loops_in_place
def _sweep(
    order: Array,
    first: Array,
    target: Array,
    volume: Array,
    outlet: Array,
    void: Array,
    inside: Array,
    holds: Array,
    entered: Array,
    after: Array,
    held: Array,
    passed: Array,
) -> None:
    """Sets `after` (N, C), `held` (K, C) and `passed` (C,); `entered` (N, C) holds what is fed."""
    classes = inside.shape[1]
    for place in range(len(order)):
        n = order[place]
        if outlet[n]:
            for i in range(classes):
                passed[i] += entered[n, i]
            continue
        leaving = 0.0
        for k in range(first[n], first[n + 1]):
            leaving += volume[k]
        room = void[n] + leaving
        for i in range(classes):
            come = inside[n, i] + entered[n, i]
            after[n, i] = come / room if room > 0.0 else 0.0
        for k in range(first[n], first[n + 1]):
            for i in range(classes):
                moved = volume[k] * after[n, i]
                held[k, i] = moved * holds[k, i]
                entered[target[k], i] += moved - held[k, i]
