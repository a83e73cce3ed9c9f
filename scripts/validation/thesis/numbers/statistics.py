"""What the thesis reports of pores and throats of the first section, measured on our runs.

The thesis's numbers are those of its Figures 42 to 63 (Shi 2011).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Array
from validation.engine.csv_rows import write_flat
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.first_millimetre import FirstMillimetre, first_millimetre
from validation.thesis.numbers.grains_alone import sizes_of_grains_alone
from validation.thesis.numbers.pore_sizes import PoreSizes
from validation.thesis.numbers.values import Statistic, specimen_number, thesis_values

WHOLE = "pores of four grains, throats between two such"
CUT = "with those cut by a face, by the part inside"
ALONE = "tessellation of the section's grains alone, as the thesis"


@dataclass(frozen=True, slots=True, kw_only=True)
class StatisticRow:
    """One quantity of one run; each field is a column of statistics.csv.

    Attributes:
        id: name of the run.
        seed: seed of the run.
        source: figure, table or section of the thesis; empty when it has no number.
        quantity: what is measured, with its range.
        ours: our value in `unit`; nan where there is nothing to measure it on.
        thesis: the thesis's value in `unit`; nan when it has none for this specimen.
        sense: "exact", "about", "at least" or "at most", of the thesis's value.
        unit: unit of both values.
        note: which pores and throats were counted.
    """

    id: str
    seed: int
    source: str
    quantity: str
    ours: float
    thesis: float
    sense: str
    unit: str
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """A size of each pore or throat.

    Attributes:
        unit: "mm" or "mm3".
        values: gives the sizes in that unit and their weights.
    """

    unit: str
    values: Callable[[PoreSizes], tuple[Array, Array]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Single:
    """A quantity of the section as one number.

    Attributes:
        unit: unit of the number.
        value: gives the number.
    """

    unit: str
    value: Callable[[FirstMillimetre], float]


def statistics(examined: Examined) -> list[StatisticRow]:
    """Every quantity that the thesis has for any specimen, measured in several ways.

    Each is measured over whole pores, and over those cut by a face as well; sizes also in the
    tessellation of the section's grains alone.
    """
    rows = []
    wanted = dict.fromkeys((one.quantity, one.between) for one in thesis_values().statistics)
    for section, note in (
        (first_millimetre(examined, whole=True), WHOLE),
        (first_millimetre(examined, whole=False), CUT),
    ):
        for quantity, between in wanted:
            rows.append(
                _row(examined, (quantity, between), measure(section, quantity, between), note)
            )
    alone = sizes_of_grains_alone(examined)
    for quantity, between in wanted:
        if quantity in SIZES and between is not None:
            measured = share_of_sizes(alone, quantity, between), "share"
            rows.append(_row(examined, (quantity, between), measured, ALONE))
    return rows


def measure(
    section: FirstMillimetre, quantity: str, between: tuple[float, float] | None
) -> tuple[float, str]:
    """The value of a quantity of the section, and its unit.

    Args:
        section: pores and throats of the first millimetre.
        quantity: a name in SIZES or SINGLES, or POROSITY.
        between: (low, high), mm or mm3, for the share of the quantity in [low, high).

    Raises:
        KeyError: the quantity is not known.
    """
    if between is None:
        return SINGLES[quantity].value(section), SINGLES[quantity].unit
    if quantity in SIZES:
        return share_of_sizes(section.sizes, quantity, between), "share"
    if quantity != POROSITY:
        raise KeyError(quantity)
    return share(within(section.occupancy.throat_porosity, between), _with_fines(section)), "share"


def share_of_sizes(sizes: PoreSizes, quantity: str, between: tuple[float, float]) -> float:
    """Share of one of SIZES in the range [low, high), mm or mm3."""
    values, weights = SIZES[quantity].values(sizes)
    return share(within(values, between), weights)


def within(values: Array, between: tuple[float, float]) -> Array:
    """Whether each value (N,) lies in [low, high).

    A low end of 0 also takes in what overlap puts below it; a high end of 1, a porosity's, also
    takes in what is at it.
    """
    low, high = between[0] or -math.inf, between[1] if between[1] != 1.0 else math.inf
    return np.asarray((values >= low) & (values < high))


def share(part: Array, weights: Array) -> float:
    """Share of the weights (N,) where `part` (N,) is true; nan when the weights sum to 0."""
    total = float(np.sum(weights))
    return float(np.sum(weights[part])) / total if total > 0 else math.nan


def write_statistics(path: Path, rows: Sequence[StatisticRow]) -> Path:
    """Write statistics.csv."""
    return write_flat(path, StatisticRow, rows)


def _label(quantity: str, between: tuple[float, float] | None) -> str:
    if between is None:
        return quantity
    unit = f" {SIZES[quantity].unit}" if quantity in SIZES else ""
    return f"{quantity} {between[0]:g} to {between[1]:g}{unit}"


def _row(
    examined: Examined,
    wanted: tuple[str, tuple[float, float] | None],
    measured: tuple[float, str],
    note: str,
) -> StatisticRow:
    thesis = _thesis_number(examined.id, *wanted)
    return StatisticRow(
        id=examined.id,
        seed=examined.seed,
        source=thesis.source if thesis else "",
        quantity=_label(*wanted),
        ours=measured[0],
        thesis=thesis.value if thesis else math.nan,
        sense=thesis.sense if thesis else "",
        unit=measured[1],
        note=f"{note}; {thesis.note}" if thesis and thesis.note else note,
    )


def _thesis_number(
    run: str, quantity: str, between: tuple[float, float] | None
) -> Statistic | None:
    """The thesis's number for the run's specimen."""
    wanted = specimen_number(run), quantity, between
    for one in thesis_values().statistics:
        if (one.specimen, one.quantity, one.between) == wanted:
            return one
    return None


def _with_fines(section: FirstMillimetre) -> Array:
    return section.throat_weight * section.has_fines


def _mean_porosity(section: FirstMillimetre) -> float:
    weight = _with_fines(section)
    return (
        float(np.average(section.occupancy.throat_porosity, weights=weight))
        if weight.any()
        else math.nan
    )


def _fines_in_throats(section: FirstMillimetre) -> float:
    """Volume in mm3; a fine counts in every throat it reaches into, for throats overlap."""
    return 1e9 * float(np.sum(section.throat_weight * section.occupancy.throat_solid_volume))


def _fines_in_bodies(section: FirstMillimetre) -> float:
    """Volume in mm3; each fine counts once, for the pore bodies are the tetrahedra."""
    return 1e9 * float(np.sum(section.pore_weight * section.occupancy.pore_solid_volume))


def _overall_throat_porosity(section: FirstMillimetre) -> float:
    tube = 1e9 * float(np.sum(section.throat_weight * section.tube))
    return 1.0 - _fines_in_throats(section) / tube if tube > 0 else math.nan


def _overall_body_porosity(section: FirstMillimetre) -> float:
    """1 - fines / void; over whole tetrahedra it could not exceed the specimen's 0.40."""
    void = 1e9 * float(np.sum(section.pore_weight * section.network.pore_volume))
    return 1.0 - _fines_in_bodies(section) / void if void > 0 else math.nan


def _throat_share(section: FirstMillimetre) -> float:
    both = _fines_in_throats(section) + _fines_in_bodies(section)
    return _fines_in_throats(section) / both if both > 0 else math.nan


SIZES: Mapping[str, Size] = {
    "pore radius": Size(unit="mm", values=lambda s: (1e3 * s.pore_radius, s.sphere_weight)),
    "throat radius": Size(unit="mm", values=lambda s: (1e3 * s.throat_radius, s.throat_weight)),
    "throat length": Size(unit="mm", values=lambda s: (1e3 * s.throat_length, s.throat_weight)),
    "pore volume": Size(unit="mm3", values=lambda s: (1e9 * s.pore_volume, s.pore_weight)),
    "volume of the inscribed sphere of a pore": Size(
        unit="mm3", values=lambda s: (4e9 / 3.0 * np.pi * s.pore_radius**3, s.sphere_weight)
    ),
}
POROSITY = "porosity of throats with fines"
SINGLES: Mapping[str, Single] = {
    "throats without fines": Single(
        unit="share", value=lambda s: share(~s.has_fines, s.throat_weight)
    ),
    "throats with fines": Single(
        unit="share", value=lambda s: share(s.has_fines, s.throat_weight)
    ),
    "throats blocked": Single(
        unit="share", value=lambda s: share(s.occupancy.blocked, s.throat_weight)
    ),
    "throats of radius 0": Single(
        unit="count",
        value=lambda s: float(np.sum((s.throat_weight > 0) & (s.network.throat_radius == 0))),
    ),
    "mean porosity of throats with fines": Single(unit="", value=_mean_porosity),
    "overall throat porosity": Single(unit="", value=_overall_throat_porosity),
    "overall pore-body porosity": Single(unit="", value=_overall_body_porosity),
    "volume of fines in throats": Single(unit="mm3", value=_fines_in_throats),
    "volume of fines in pore bodies": Single(unit="mm3", value=_fines_in_bodies),
    "share of throats in the volume of fines": Single(unit="share", value=_throat_share),
}
