"""Size classes carried upwind through the pores, with exact balance.

A link leads from a pore of higher pressure to one of lower pressure, so in the order of falling
pressure the upwind system is lower triangular, and one sweep solves it for all classes: the
implicit Euler step on docs/theory/size_classes.md.
"""

import math
from dataclasses import dataclass

import numpy as np

from fdnet.classes.capture import bridging_chance
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


LOADED = (0.06, 1.6, 0.33)
"""Chance per arrival that a deposit beside a throat stops a fine: a + b s, at most c, of the share
s that it takes of the two pores."""
NONE = 1e-3
"""Share of two pores below which a deposit stops nothing: less than a fine in hundreds of them."""
WEDGES = 1.3
"""A fine up to so many passages wide sits in the throat that holds it, a wider one before it."""


@loops_in_place
def carry(
    order: Array,
    first: Array,
    target: Array,
    link: Array,
    share: Array,
    outlet: Array,
    filtrate: float,
    fluid: Array,
    void: Array,
    solid: Array,
    full: Array,
    gap: Array,
    bare: Array,
    passage: Array,
    way: Array,
    filtering: Array,
    diameter: Array,
    volume: Array,
    high: Array,
    over: Array,
    carried: Array,
    in_pores: Array,
    attached: Array,
    in_throats: Array,
    passed: Array,
) -> None:
    """Carry the classes (C) through all links and settle what each holds back.

    The first six describe the flow (`Streams`). Pores (N) have `fluid` and `void` m3 and the
    filling that `deposit.Holding` describes, throats (T) a `passage` m and a clean `way` m, on
    which `filtering` (C,) 1/m acts. Classes have a `diameter`, the `volume` of one fine, the
    logarithm of their `high` end, and `over`, 1 over its distance from that of the low end. The
    last five change. `carried` (N, C) m3 is what pores and `filtrate` bring; at each pore it
    becomes a concentration first.
    """
    start, slope, most = LOADED
    for place in range(len(order)):
        n = order[place]
        if outlet[n]:
            for i in range(len(volume)):
                passed[i] += carried[n, i]
                carried[n, i] = 0.0
            continue
        whole = fluid[n]
        for k in range(first[n], first[n + 1]):
            whole += filtrate * share[k]
        for i in range(len(volume)):
            carried[n, i] /= whole
        for k in range(first[n], first[n + 1]):
            throat, behind, flow = link[k], target[k], filtrate * share[k]
            near = (solid[n] + solid[behind]) / (void[n] + void[behind])
            chance = min(start * (near > NONE) + slope * near, most)
            clean, beside, room = math.log(passage[throat]), min(gap[n], gap[behind]), 2.0
            narrow = 1.0 / passage[throat]
            # wide ones first, for a throat has room for one fine
            for i in range(len(volume) - 1, -1, -1):
                moved = flow * carried[n, i]
                if moved <= 0.0:
                    continue
                wide = min(max((high[i] - clean) * over[i], 0.0), 1.0)
                near_wide = min(max((high[i] - beside) * over[i], 0.0), 1.0)
                bed = min(max((high[i] - gap[behind]) * over[i], 0.0), 1.0)
                loose = (1.0 - wide) * (1.0 - bridging_chance(diameter[i] * narrow))
                loose *= (1.0 - chance * near_wide) * (1.0 - full[behind] * bed)
                sticks = 0.0
                if filtering[i] > 0.0:
                    sticks = -math.expm1(-filtering[i] * way[throat] * bare[n])
                held = moved * (1.0 - loose * (1.0 - sticks))
                carried[behind, i] += moved - held
                if held <= 0.0:
                    continue
                if sticks > 0.0:
                    stuck = min(moved * sticks, held)  # not above it by rounding
                    attached[n, i] += stuck
                    held -= stuck
                if diameter[i] * narrow <= WEDGES:
                    if room > 1.0:
                        room = 1.0
                        for j in range(len(volume)):
                            room -= in_throats[throat, j] / volume[j]
                    wedged = min(held, max(room, 0.0) * volume[i])
                    room -= wedged / volume[i]
                    in_throats[throat, i] += wedged
                    held -= wedged
                in_pores[n, i] += held
        for i in range(len(volume)):
            carried[n, i] *= fluid[n]


@loops_in_place
def pile_up(ends: Array, in_pores: Array, in_throats: Array, diameter: Array, sums: Array) -> None:
    """Add to `sums` (N, 2) the m3 of all classes (C) in a pore, and this over their diameter.

    What is in a throat counts half for each of its `ends` (T, 2).
    """
    for n in range(len(in_pores)):
        for i in range(len(diameter)):
            sums[n, 0] += in_pores[n, i]
            sums[n, 1] += in_pores[n, i] / diameter[i]
    for t in range(len(in_throats)):
        for i in range(len(diameter)):
            half = 0.5 * in_throats[t, i]
            if half > 0.0:
                for side in range(2):
                    sums[ends[t, side], 0] += half
                    sums[ends[t, side], 1] += half / diameter[i]
