"""Sizes of the spheres that a run placed, next to those that its case asks for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.dem.batches import batches_of
from fdnet.dem.measured_fines import drawn_fines
from fdnet.scales.scales import InvasionScales, scales_of
from fdnet.scales.sizes import SHARES, diameter_at
from fdnet.sizes.curve import SizeCurve
from fdnet.sizes.deal import volume_quantiles
from fdnet.spheres.snapshot import Array, Snapshot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedSizes:
    """One kind of spheres of measured sizes.

    Attributes:
        name: "grains" or "fines".
        law: "log-normal", "rosin-rammler", "measured" or "mixture".
        asked: diameters, m, by the share that is finer, as the case gives them.
        curve: of the case.
        placed: (N,) m, diameters of the spheres that were placed.
        invaded: (M,) m, diameters of the fines that lie in the specimen at the end; None for
            grains.
    """

    name: str
    law: str
    asked: Mapping[float, float]
    curve: SizeCurve
    placed: Array
    invaded: Array | None = None


def placed_sizes(
    case: Case, grains: Snapshot, damaged: Snapshot | None, supplied: int
) -> list[PlacedSizes]:
    """Grains and fines, where their sizes are measured ones.

    `damaged` is the specimen at the end and `supplied` the number of fines that entered.
    """
    result = []
    if case.grains.measured:
        result.append(_sizes("grains", case.grains, 2 * grains.radius))
    if isinstance(case, InvasionCase) and case.fines.measured and damaged is not None:
        fines = damaged.fines()
        inside = (fines.position[:, 0] >= 0) & (fines.position[:, 0] < case.size_m[0])
        placed = _supplied_fines(case, scales_of(case), supplied)
        result.append(_sizes("fines", case.fines, placed, 2 * fines.radius[inside]))
    return result


def _supplied_fines(case: InvasionCase, scales: InvasionScales, supplied: int) -> Array:
    """Diameters (N,) m of the fines of the batches that entered."""
    counts = batches_of(case, scales).counts
    entered = sum(total <= supplied for total in accumulate(counts))
    drawn = drawn_fines(case, counts)[:entered]
    return np.concatenate([2 * batch.radius for batch in drawn])


def _sizes(
    name: str, spheres: Spheres, placed: Array, invaded: Array | None = None
) -> PlacedSizes:
    sizes = spheres.sizes
    law = "mixture" if sizes is None else ("measured" if sizes.fit is None else sizes.fit.name)
    asked: dict[float, float] = {}
    if sizes is not None:
        asked = sizes.asked or dict(sizes.points)
    return PlacedSizes(
        name=name, law=law, asked=asked, curve=spheres.curve, placed=placed, invaded=invaded
    )


def size_summary(sizes: Sequence[PlacedSizes]) -> dict[str, Any]:
    """The key `sizes` of summary.json: D10, D50 and D90 asked for, of the curve and placed, m.

    All shares are of the whole solids, with those left out; a diameter that is left out is null.
    """
    return {one.name: _numbers(one) for one in sizes}


def _numbers(one: PlacedSizes) -> dict[str, Any]:
    names = {share: f"D{100 * share:.0f}" for share in SHARES}
    result: dict[str, Any] = {
        "law": one.law,
        "asked_m": {name: one.asked[p] for p, name in names.items() if p in one.asked},
        "curve_m": {name: diameter_at(one.curve, p) for p, name in names.items()},
        "placed_m": {name: _placed_at(one, one.placed, p) for p, name in names.items()},
        "placed_count": len(one.placed),
        "smallest_m": float(one.placed.min()),
        "largest_m": float(one.placed.max()),
        "finer_left_out": one.curve.below,
        "coarser_left_out": one.curve.above,
    }
    if one.invaded is not None and len(one.invaded):
        values = volume_quantiles(one.invaded, SHARES)
        result["invaded_m"] = dict(zip(names.values(), values, strict=True))
    return result


def _placed_at(one: PlacedSizes, diameter: Array, share: float) -> float | None:
    inside = (share - one.curve.below) / one.curve.kept
    return volume_quantiles(diameter, [inside])[0] if 0 <= inside <= 1 else None
