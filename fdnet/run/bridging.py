"""Bridging statistics: which throats the fines block, by the ratio of fine to throat.

A throat that fines could reach either stays open or is blocked: one fine covers its
cross-section, or it is clogged, its conductance below `CLOGGED` of the clean one. Shares of a
count have Wilson's 95 % band (J. Am. Stat. Assoc. 22, 209, 1927).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.spheres.arrays import Array, one_line
from fdnet.statistics.shares import wilson_interval

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, math.inf)
"""Edges of the classes of the diameter of a fine over that of the throat."""
CLOGGED = 0.1
"""Share of the clean conductance below which a throat counts as clogged."""
_COUNTS = ("throats", "with_fines", "covered", "clogged", "blocked")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Throats:
    """The T open throats that fines could reach.

    Attributes:
        ratio: (T,) mean diameter of the fines in it, or of all where it holds none, over that of
            the throat.
        held: (T,) whether it holds a fine.
        covered: (T,) whether one fine covers its whole cross-section.
        clogged: (T,) whether its conductance is below `CLOGGED` of the clean one.
        arrived: (T,) fines that would pass it with the clean flow if none were caught.
    """

    ratio: Array
    held: Array
    covered: Array
    clogged: Array
    arrived: Array

    __repr__ = one_line


def reached_throats(analysis: "Analysis", entered: int, fine_diameter: float) -> Throats:
    """The open throats down to the depth above which 95 % of the fines lie.

    Args:
        analysis: of the damaged specimen.
        entered: number of fines that came in, those that passed too.
        fine_diameter: mean of the fines, m.
    """
    network, occupancy, flow = analysis.network, analysis.occupancy, analysis.flow_initial
    assert occupancy is not None
    depth = network.throat_corner[..., 0].mean(axis=1) - float(network.box[0, 0])
    clean = analysis.conductance_initial
    reached = depth <= analysis.invasion_depth_p95
    use = np.flatnonzero(reached & (network.throat_radius > 0) & (clean > 0))
    held = occupancy.throat_fines[use] > 0
    diameter = np.where(held, 2.0 * occupancy.throat_fine_radius[use], fine_diameter)
    flux = np.abs(flow.throat_flux[use])
    return Throats(
        ratio=diameter / (2.0 * network.throat_radius[use]),
        held=held,
        covered=np.asarray(occupancy.blocked[use], bool),
        clogged=analysis.conductance_damaged[use] < CLOGGED * clean[use],
        arrived=entered * flux / flow.inflow if flow.inflow > 0 else np.zeros(len(use)),
    )


def bridging_rows(throats: Throats, concentration: float) -> list[dict[str, Any]]:
    """The classes of ratio that hold throats, as bridging.csv names their values."""
    which = np.searchsorted(RATIOS, throats.ratio, "right") - 1
    rows = []
    for number in np.unique(which):
        own = which == number
        rows.append(
            _row(
                concentration,
                (RATIOS[number], RATIOS[number + 1]),
                throats=int(own.sum()),
                held=int(throats.held[own].sum()),
                covered=int(throats.covered[own].sum()),
                clogged=int(throats.clogged[own].sum()),
                blocked=int(np.sum(throats.clogged[own] | throats.covered[own])),
                arrived=float(throats.arrived[own].sum()),
            )
        )
    return rows


def pooled(tables: Iterable[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """The rows of several runs added up by concentration and class, in that order."""
    sums: dict[tuple[float, float, float], list[float]] = {}
    for row in (row for table in tables for row in table):
        upper = math.inf if row["ratio_hi"] in (None, "") else float(row["ratio_hi"])
        key = float(row["concentration"]), float(row["ratio_lo"]), upper
        counts = sums.setdefault(key, [0.0] * 6)
        own = [float(row[name]) for name in _COUNTS]
        for i, value in enumerate([*own, float(row["arrived_mean"]) * own[0]]):
            counts[i] += value
    return [
        _row(
            concentration,
            (low, high),
            throats=round(counts[0]),
            held=round(counts[1]),
            covered=round(counts[2]),
            clogged=round(counts[3]),
            blocked=round(counts[4]),
            arrived=counts[5],
        )
        for (concentration, low, high), counts in sorted(sums.items())
    ]


def _row(
    concentration: float,
    ratio: tuple[float, float],
    *,
    throats: int,
    held: int,
    covered: int,
    clogged: int,
    blocked: int,
    arrived: float,
) -> dict[str, Any]:
    low, high = wilson_interval(blocked, throats)
    return {
        "concentration": concentration,
        "ratio_lo": ratio[0],
        "ratio_hi": ratio[1] if math.isfinite(ratio[1]) else None,
        "throats": throats,
        "with_fines": held,
        "covered": covered,
        "clogged": clogged,
        "blocked": blocked,
        "share_blocked": blocked / throats,
        "share_low": low,
        "share_high": high,
        "arrived_mean": arrived / throats,
    }
