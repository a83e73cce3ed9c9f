"""Which throats the fines close, by the ratio of fine to throat.

A throat is the circle that touches three grains. At a side wall or an end face it runs out to
the mirror images of the grains, which make it wider than any between grains; these do not count.
Shares of a count have Wilson's 95 % band (J. Am. Stat. Assoc. 22, 209, 1927).
"""

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fdnet.report.tables import between_grains
from fdnet.spheres.snapshot import Array

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, math.inf)
"""Edges of the classes of the diameter of a fine over that of the throat."""
CLOGGED = 0.1  # Share of the clean conductance below which a throat is clogged
COUNTS = ("throats", "with_fines", "blocked", "clogged", "closed")
"""The counts of a row of bridging.csv."""


class OpenThroats(NamedTuple):
    """T open throats and what the fines do to them."""

    width: Array  # (T,) m, diameter
    fine: Array  # (T,) m, mean diameter of the fines in it; 0 where it holds none
    held: Array  # (T,) whether it holds a fine
    blocked: Array  # (T,) whether one fine covers its whole cross-section
    left: Array  # (T,) conductance over the clean one; 1 where that is 0
    between: Array  # (T,) whether it lies between three grains, and not at a wall or an end face

    def where(self, use: Array) -> "OpenThroats":
        """The throats of a mask (T,)."""
        return OpenThroats(*(values[use] for values in self))

    @property
    def clogged(self) -> Array:
        """(T,) whether less than a tenth of its conductance is left."""
        return self.left < CLOGGED


def open_throats(analysis: "Analysis") -> OpenThroats:
    """The throats that the grains leave open, of a specimen with fines."""
    network, occupancy = analysis.network, analysis.occupancy
    assert occupancy is not None
    clean = np.asarray(analysis.conductance_initial, float)
    damaged = np.asarray(analysis.conductance_damaged, float)
    every = OpenThroats(
        width=2.0 * np.asarray(network.throat_radius),
        fine=2.0 * np.asarray(occupancy.throat_fine_radius),
        held=np.asarray(occupancy.throat_fines) > 0,
        blocked=np.asarray(occupancy.blocked, bool),
        left=np.divide(damaged, clean, out=np.ones(len(clean)), where=clean > 0),
        between=between_grains(network, network.throat_images),
    )
    return every.where(np.asarray(network.throat_radius) > 0)


def ratio_rows(
    analysis: "Analysis", *, entered: int, fine_diameter: float, concentration: float
) -> list[dict[str, Any]]:
    """The classes of ratio that hold throats, as bridging.csv names their values.

    Of the open throats between grains that conduct, down to the depth above which 95 % of the
    fines lie. The ratio is that of the mean fine in the throat, or of all (`fine_diameter`, m)
    where it holds none. Fines that passed have `entered` too; the `concentration` is by volume.
    """
    network, flow = analysis.network, analysis.flow_initial
    depth, is_open = network.throat_corner[..., 0].mean(axis=1), network.throat_radius > 0
    reached = depth - float(network.box[0, 0]) <= analysis.invasion_depth_p95
    throats = open_throats(analysis)
    use = (reached & (analysis.conductance_initial > 0))[is_open] & throats.between
    throats, flux = throats.where(use), np.abs(flow.throat_flux[is_open][use])
    arrived = entered * flux / flow.inflow if flow.inflow > 0 else np.zeros(len(flux))
    ratio = np.where(throats.held, throats.fine, fine_diameter) / throats.width
    which, rows = np.searchsorted(RATIOS, ratio, "right") - 1, []
    for number in np.unique(which):
        own, came = throats.where(which == number), float(arrived[which == number].sum())
        some = (own.held, own.blocked, own.clogged, own.blocked | own.clogged)
        counts = [len(own.width), *(int(one.sum()) for one in some)]
        rows.append(class_row(concentration, RATIOS[number], RATIOS[number + 1], counts, came))
    return rows


def wilsons_band(hits: int, trials: int) -> tuple[float, float]:
    """The 95 % interval of a binomial share (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    # by its formula: to import scipy.stats takes 0.7 s, the bands of a whole run next to nothing
    square = NormalDist().inv_cdf(0.975) ** 2
    wide = math.sqrt(square * (hits * (trials - hits) / trials + square / 4))
    low, high = ((hits + square / 2 + side * wide) / (trials + square) for side in (-1, 1))
    return low if hits else 0.0, high if hits < trials else 1.0


def class_row(
    concentration: float, ratio_lo: float, ratio_hi: float, counts: Sequence[int], arrived: float
) -> dict[str, Any]:
    """A row of bridging.csv; `counts` are those of `COUNTS`."""
    named = dict(zip(COUNTS, counts, strict=True))
    low, high = wilsons_band(named["closed"], named["throats"])
    return {
        "concentration": concentration,
        "ratio_lo": ratio_lo,
        "ratio_hi": ratio_hi if math.isfinite(ratio_hi) else None,
        **named,
        "share_closed": named["closed"] / named["throats"],
        "share_low": low,
        "share_high": high,
        "arrived_mean": float(arrived) / named["throats"],
    }
