"""Where fines sit in the throats of the first section (Shi 2011, Figures 56 and 57).

The thesis chooses between its two damage laws by it. The measure is the distance of a fine's
centre from the throat's axis over the throat's radius, for every fine that fills some of the
throat's cylinder. Below 1/2 the fine is nearer the axis, above 1/2 nearer the wall, and above 1
its centre is outside of the throat. Fines spread evenly over the cross-section have 3/4 of their
centres nearer the wall.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.network.laws.damage import CLOGGING, DEPOSITION
from fdnet.spheres.snapshot import Array
from validation.engine.bands import wilson_interval
from validation.engine.csv_rows import write_flat
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.first_millimetre import FirstMillimetre, first_millimetre
from validation.thesis.numbers.statistics import share, within
from validation.thesis.numbers.values import DepositionClaim, specimen_number, thesis_values

HALFWAY, WALL = 0.5, 1.0
DEPOSITION_SPECIMEN = "5"
"""The specimen Figures 56 and 57 are of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepositionRow:
    """Fines in the throats of one class of porosity; each field is a column of deposition.csv.

    Attributes:
        id: name of the run.
        seed: seed of the run.
        low: lowest porosity of the class; 0 also takes in throats below it.
        high: porosity below which the class ends; 1 also takes in throats at it.
        whole: whether only whole throats count, as in `FirstMillimetre`.
        throats: number of throats with fines; one cut by a face counts by its part inside.
        fines: number of fines in them; a fine counts once in each throat it reaches.
        nearer_axis: share of the fines nearer the axis, by number.
        nearer_wall: share centred within the throat and nearer the wall, by number.
        beyond_wall: share centred outside of the throat, by number.
        nearer_axis_volume: as `nearer_axis`, by the volume in the throat.
        nearer_wall_volume: as `nearer_wall`, by volume.
        beyond_wall_volume: as `beyond_wall`, by volume.
        wall_low: low end of the 95 % interval of `nearer_wall` + `beyond_wall`. It takes the fines
            as independent, which fines of one throat are not quite.
        wall_high: high end of that interval.
        law: the thesis's rule: "deposition" where that sum is above 1/2, else "clogging"; empty
            without fines.
        decided: whether the interval leaves out 1/2.
        nearer: "axis" or "wall", what the thesis's share is of; empty without one.
        thesis: the thesis's share; nan without one.
        sense: "about", "at least" and the like, of the thesis's share.
        source: figure or section of the thesis.
    """

    id: str
    seed: int
    low: float
    high: float
    whole: bool
    throats: float
    fines: float
    nearer_axis: float
    nearer_wall: float
    beyond_wall: float
    nearer_axis_volume: float
    nearer_wall_volume: float
    beyond_wall_volume: float
    wall_low: float
    wall_high: float
    law: str
    decided: bool
    nearer: str
    thesis: float
    sense: str
    source: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ThroatFines:
    """K pairs of a fine and a throat that it reaches into.

    Attributes:
        distance: (K,) distance of the fine's centre from the axis over the throat's radius.
        volume: (K,) m3, volume of the fine within the throat.
        weight: (K,) weight of the throat.
        throat: (K,) index of the throat.
    """

    distance: Array
    volume: Array
    weight: Array
    throat: Array


def deposition(examined: Examined, *, whole: bool = True) -> list[DepositionRow]:
    """One row for each class of throat porosity; `whole` as in `FirstMillimetre`."""
    section = first_millimetre(examined, whole=whole)
    number = specimen_number(examined.id)
    return [
        _row(examined, section, claim, compare=number == DEPOSITION_SPECIMEN)
        for claim in thesis_values().deposition
    ]


def fines_in_class(section: FirstMillimetre, between: tuple[float, float]) -> ThroatFines:
    """The fines in the section's throats of porosity [low, high), as in Figures 56 and 57."""
    occupancy = section.occupancy
    chosen = within(occupancy.throat_porosity, between) & (section.throat_weight > 0)
    use = chosen[occupancy.pair_throat]
    throat = occupancy.pair_throat[use]
    return ThroatFines(
        distance=occupancy.pair_distance[use],
        volume=occupancy.pair_volume[use],
        weight=section.throat_weight[throat],
        throat=throat,
    )


def write_deposition(path: Path, rows: Sequence[DepositionRow]) -> Path:
    """Write deposition.csv, one line for each run and class."""
    return write_flat(path, DepositionRow, rows)


def _row(
    examined: Examined, section: FirstMillimetre, claim: DepositionClaim, *, compare: bool
) -> DepositionRow:
    fines = fines_in_class(section, claim.throat_porosity)
    by_number = _shares(fines.distance, fines.weight)
    by_volume = _shares(fines.distance, fines.weight * fines.volume)
    total = float(np.sum(fines.weight))
    wall = 1.0 - by_number[0]
    interval = wilson_interval(wall * total, total)
    law = "" if not total else DEPOSITION if wall > HALFWAY else CLOGGING
    return DepositionRow(
        id=examined.id,
        seed=examined.seed,
        low=claim.throat_porosity[0],
        high=claim.throat_porosity[1],
        whole=section.whole,
        throats=float(np.sum(section.throat_weight[np.unique(fines.throat)])),
        fines=total,
        nearer_axis=by_number[0],
        nearer_wall=by_number[1],
        beyond_wall=by_number[2],
        nearer_axis_volume=by_volume[0],
        nearer_wall_volume=by_volume[1],
        beyond_wall_volume=by_volume[2],
        wall_low=interval[0],
        wall_high=interval[1],
        law=law,
        decided=interval[0] > HALFWAY or interval[1] < HALFWAY,
        nearer=claim.nearer if compare else "",
        thesis=claim.value if compare else math.nan,
        sense=claim.sense if compare else "",
        source=claim.source,
    )


def _shares(distance: Array, weight: Array) -> tuple[float, float, float]:
    """Shares nearer the axis, nearer the wall, and centred beyond the wall."""
    axis, beyond = distance < HALFWAY, distance > WALL
    return share(axis, weight), share(~axis & ~beyond, weight), share(beyond, weight)
