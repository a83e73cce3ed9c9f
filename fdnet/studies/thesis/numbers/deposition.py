"""Where fines sit in the throats of the first section, which decides between the two laws (Shi 2011, Figures 56, 57).

The distance of a fine's centre from the throat's axis over the throat's radius, for every fine that fills some of the
throat's cylinder: below 1/2 it is nearer the axis, above nearer the wall, above 1 its centre is outside. Note that an
even spread over the section has 3/4 of its centres nearer the wall.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.network.laws.damage import CLOGGING, DEPOSITION
from fdnet.spheres.snapshot import Array
from fdnet.studies.engine.csv_rows import write_flat
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.first_section import FirstSection, first_section
from fdnet.studies.thesis.numbers.statistics import share, within
from fdnet.studies.thesis.numbers.values import DepositionTold, specimen_number, thesis_values

HALFWAY, WALL = 0.5, 1.0
Z_95 = 1.959963984540054
TOLD_OF = "5"
"""The specimen Figures 56 and 57 are of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepositionRow:
    """Fines of the throats of porosity [`low`, `high`), 0 taking in those below and 1 those at it.

    `throats` with fines and `fines` in them (a fine once in each throat; a throat cut by a face by its part inside);
    shares by number and by the volume in the throat: nearer the axis, nearer the wall, centred beyond it. `law` is
    "deposition" where most, of the two latter together, are nearer the wall, else "clogging", empty without fines (the
    thesis's rule: an even spread, 3/4 of it nearer the wall, is deposition by it);
    `wall_low`, `wall_high` the 95 % interval of their share, and `decided` when it leaves out 1/2. It takes the fines
    as independent, which those of one throat are not quite. `thesis`: its share `nearer` the axis or the wall.
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
    """Fines in throats (K,): `distance` from the axis over the radius, `volume` m3 in the throat, `weight` of the
    throat, `throat` index."""

    distance: Array
    volume: Array
    weight: Array
    throat: Array


def deposition(examined: Examined, *, whole: bool = True) -> list[DepositionRow]:
    """One row for each class of throat porosity; `whole` as in `first_section`."""
    section = first_section(examined, whole=whole)
    number = specimen_number(examined.id)
    return [
        _row(examined, section, told, compare=number == TOLD_OF)
        for told in thesis_values().deposition
    ]


def fines_in_class(section: FirstSection, between: tuple[float, float]) -> ThroatFines:
    """The fines of the section's throats of porosity [low, high), as Figures 56 and 57 plot them."""
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


def wilson_interval(part: float, total: float) -> tuple[float, float]:
    """95 % interval of the share `part` / `total` of a binomial (Wilson 1927, J. Am. Stat. Assoc. 22, 209); nan
    without trials."""
    if total <= 0:
        return math.nan, math.nan
    square = Z_95**2 / total
    share, spread = (
        part / total,
        Z_95 * math.sqrt(part * (total - part) / total + 0.25 * Z_95**2) / total,
    )
    return (share + 0.5 * square - spread) / (1.0 + square), (share + 0.5 * square + spread) / (
        1.0 + square
    )


def write_deposition(path: Path, rows: Sequence[DepositionRow]) -> Path:
    """One line for each run and class."""
    return write_flat(path, DepositionRow, rows)


def _row(
    examined: Examined, section: FirstSection, told: DepositionTold, *, compare: bool
) -> DepositionRow:
    fines = fines_in_class(section, told.throat_porosity)
    by_number, by_volume = (
        _shares(fines.distance, fines.weight),
        _shares(fines.distance, fines.weight * fines.volume),
    )
    total = float(np.sum(fines.weight))
    wall = 1.0 - by_number[0]
    interval = wilson_interval(wall * total, total)
    law = "" if not total else DEPOSITION if wall > HALFWAY else CLOGGING
    return DepositionRow(
        id=examined.id,
        seed=examined.seed,
        low=told.throat_porosity[0],
        high=told.throat_porosity[1],
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
        nearer=told.nearer if compare else "",
        thesis=told.value if compare else math.nan,
        sense=told.sense if compare else "",
        source=told.source,
    )


def _shares(distance: Array, weight: Array) -> tuple[float, float, float]:
    """Nearer the axis, nearer the wall, beyond it."""
    axis, beyond = distance < HALFWAY, distance > WALL
    return share(axis, weight), share(~axis & ~beyond, weight), share(beyond, weight)
