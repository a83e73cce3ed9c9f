"""Which throats the fines close, by the width of the throat and by the ratio of fine to throat.

A throat is the circle that touches three grains. At a side wall or an end face it runs out to
the mirror images of the grains, which make it wider than any between grains, and each such throat
counts twice; these have a row of their own, and no width. Shares of a count have Wilson's 95 %
band (J. Am. Stat. Assoc. 22, 209, 1927).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.report.tables import between_grains
from fdnet.spheres.snapshot import Array, one_line

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, math.inf)
"""Edges of the classes of the diameter of a fine over that of the throat."""
CLASSES = 4
"""Classes of throats by their width, of equal number."""
BRIDGED, CLOGGED = 0.5, 0.1
"""Share of the clean conductance up to which a throat is bridged, below which it is clogged."""
_COUNTS = ("throats", "with_fines", "blocked", "clogged", "closed")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Throats:
    """T open throats and what the fines do to them.

    Attributes:
        width: (T,) m, diameter.
        fine: (T,) m, mean diameter of the fines in it; 0 where it holds none.
        held: (T,) whether it holds a fine.
        blocked: (T,) whether one fine covers its whole cross-section.
        left: (T,) conductance over the clean one; 1 where that is 0.
        between: (T,) whether it lies between three grains, and not at a wall or an end face.
    """

    width: Array
    fine: Array
    held: Array
    blocked: Array
    left: Array
    between: Array

    __repr__ = one_line

    def where(self, use: Array) -> "Throats":
        """The throats of a mask (T,)."""
        return Throats(**{name: getattr(self, name)[use] for name in self.__slots__})

    @property
    def bridged(self) -> Array:
        """(T,) whether it lost half of its conductance or more."""
        return self.left <= BRIDGED

    @property
    def clogged(self) -> Array:
        """(T,) whether less than a tenth of its conductance is left."""
        return self.left < CLOGGED


def open_throats(analysis: "Analysis") -> Throats:
    """The throats that the grains leave open, of a specimen with fines."""
    network, occupancy = analysis.network, analysis.occupancy
    assert occupancy is not None
    clean = np.asarray(analysis.conductance_initial, float)
    damaged = np.asarray(analysis.conductance_damaged, float)
    return Throats(
        width=2.0 * np.asarray(network.throat_radius),
        fine=2.0 * np.asarray(occupancy.throat_fine_radius),
        held=np.asarray(occupancy.throat_fines) > 0,
        blocked=np.asarray(occupancy.blocked, bool),
        left=np.divide(damaged, clean, out=np.ones(len(clean)), where=clean > 0),
        between=between_grains(network, network.throat_images),
    ).where(np.asarray(network.throat_radius) > 0)


def width_rows(throats: Throats) -> list[dict[str, Any]]:
    """Classes of throats by width from the narrowest, and those at walls and end faces.

    The columns add up to all open throats, and `blocked` to `throats_blocked` of the summary.
    Diameters are in m; those of the fines are means over the fines in each bridged throat, and
    null where no throat of the class is bridged.
    """
    inner, at_walls = throats.where(throats.between), throats.where(~throats.between)
    rows = []
    if len(inner.width):
        edges = np.quantile(inner.width, np.linspace(0, 1, CLASSES + 1))
        number = np.clip(np.searchsorted(edges, inner.width, side="right") - 1, 0, CLASSES - 1)
        rows = [
            _width_row(inner.where(number == index), (float(low), float(high)))
            for index, (low, high) in enumerate(pairwise(edges))
        ]
    return [*rows, _width_row(at_walls, (None, None))] if len(at_walls.width) else rows


def _width_row(own: Throats, edges: tuple[float | None, float | None]) -> dict[str, Any]:
    inside = own.where(own.bridged & own.held)
    names = ("fines_smallest_m", "fines_median_m", "fines_largest_m")
    some = np.quantile(inside.fine, (0.0, 0.5, 1.0)).tolist() if len(inside.fine) else []
    known = some and edges[0] is not None
    return {
        "throat_from_m": edges[0],
        "throat_to_m": edges[1],
        "throats": len(own.width),
        "with_fines": int(own.held.sum()),
        "bridged": int(own.bridged.sum()),
        "blocked": int(own.blocked.sum()),
        **dict(zip(names, some or (None, None, None), strict=True)),
        "fine_over_throat": float(np.median(inside.fine / inside.width)) if known else None,
    }


def ratio_rows(
    analysis: "Analysis", *, entered: int, fine_diameter: float, concentration: float
) -> list[dict[str, Any]]:
    """The classes of ratio that hold throats, as bridging.csv names their values.

    Of the open throats between grains that conduct, down to the depth above which 95 % of the
    fines lie. The ratio is that of the mean fine in the throat, or of all where it holds none.

    Args:
        analysis: of the damaged specimen.
        entered: number of fines that came in, those that passed too.
        fine_diameter: mean of the fines, m.
        concentration: of the suspension, by volume.
    """
    network, flow = analysis.network, analysis.flow_initial
    depth = network.throat_corner[..., 0].mean(axis=1) - float(network.box[0, 0])
    reached = (depth <= analysis.invasion_depth_p95) & (analysis.conductance_initial > 0)
    between = between_grains(network, network.throat_images)
    use = (reached & between)[np.asarray(network.throat_radius) > 0]
    throats = open_throats(analysis).where(use)
    flux = np.abs(flow.throat_flux[network.throat_radius > 0][use])
    arrived = entered * flux / flow.inflow if flow.inflow > 0 else np.zeros(len(flux))
    ratio = np.where(throats.held, throats.fine, fine_diameter) / throats.width
    return classes_of(ratio, throats, arrived, concentration)


def classes_of(
    ratio: Array, throats: Throats, arrived: Array, concentration: float
) -> list[dict[str, Any]]:
    """`throats` by classes of their `ratio` (T,); `arrived` (T,) fines would come to each."""
    which = np.searchsorted(RATIOS, ratio, "right") - 1
    rows = []
    for number in np.unique(which):
        own = throats.where(which == number)
        counts = (len(own.width), own.held.sum(), own.blocked.sum(), own.clogged.sum())
        closed = int(np.sum(own.blocked | own.clogged))
        edges = (RATIOS[number], RATIOS[number + 1])
        came = float(arrived[which == number].sum())
        rows.append(_row(concentration, edges, [*map(int, counts), closed], came))
    return rows


def pooled(tables: Iterable[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """The rows of several runs added up by concentration and class, in that order."""
    sums: dict[tuple[float, float, float], list[float]] = {}
    for row in (row for table in tables for row in table):
        upper = math.inf if row["ratio_hi"] in (None, "") else float(row["ratio_hi"])
        key = float(row["concentration"]), float(row["ratio_lo"]), upper
        counts = sums.setdefault(key, [0.0] * (len(_COUNTS) + 1))
        own = [float(row[name]) for name in _COUNTS]
        for i, value in enumerate([*own, float(row["arrived_mean"]) * own[0]]):
            counts[i] += value
    return [
        _row(concentration, (low, high), [round(count) for count in counts[:-1]], counts[-1])
        for (concentration, low, high), counts in sorted(sums.items())
    ]


def wilsons_band(hits: int, trials: int) -> tuple[float, float]:
    """The 95 % interval of a binomial share (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    from scipy.stats import binomtest  # slow to import

    band = binomtest(hits, trials).proportion_ci(method="wilson")
    return float(band.low), float(band.high)


def _row(
    concentration: float, ratio: tuple[float, float], counts: Sequence[int], arrived: float
) -> dict[str, Any]:
    """A row of bridging.csv; `counts` are those of `_COUNTS`."""
    named = dict(zip(_COUNTS, counts, strict=True))
    low, high = wilsons_band(named["closed"], named["throats"])
    return {
        "concentration": concentration,
        "ratio_lo": ratio[0],
        "ratio_hi": ratio[1] if math.isfinite(ratio[1]) else None,
        **named,
        "share_closed": named["closed"] / named["throats"],
        "share_low": low,
        "share_high": high,
        "arrived_mean": arrived / named["throats"],
    }
