"""What the thesis tells of pores and throats of the first section (Figures 42 to 63), measured here."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Array
from fdnet.studies.engine.csv_rows import write_flat
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.first_section import FirstSection, first_section
from fdnet.studies.thesis.numbers.sizes import Sizes, sizes_of_grains_alone
from fdnet.studies.thesis.numbers.values import Statistic, specimen_number, thesis_values

WHOLE = "pores of four grains, throats between two such"
CUT = "with those cut by a face, by the part inside"
ALONE = "tessellation of the section's grains alone, as the thesis"


@dataclass(frozen=True, slots=True, kw_only=True)
class StatisticRow:
    """`ours` beside the `thesis`'s number (nan: it has none for this specimen) and its `sense`; nan where there is
    nothing to measure it on. `note` tells which pores and throats were counted."""

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
    """A size in `unit`: `values` of each pore or throat and their weights."""

    unit: str
    values: Callable[[Sizes], tuple[Array, Array]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Single:
    """A quantity of the section as one number in `unit`."""

    unit: str
    value: Callable[[FirstSection], float]


def statistics(examined: Examined) -> list[StatisticRow]:
    """Every quantity the thesis has for any specimen, twice: over whole pores and over those cut by faces as well;
    sizes also in the tessellation of the section's grains alone."""
    rows = []
    asked = dict.fromkeys((one.quantity, one.between) for one in thesis_values().statistics)
    for section, note in (
        (first_section(examined, whole=True), WHOLE),
        (first_section(examined, whole=False), CUT),
    ):
        for quantity, between in asked:
            rows.append(
                _row(examined, (quantity, between), measure(section, quantity, between), note)
            )
    alone = sizes_of_grains_alone(examined)
    for quantity, between in asked:
        if quantity in SIZES and between is not None:
            found = share_of_sizes(alone, quantity, between), "share"
            rows.append(_row(examined, (quantity, between), found, ALONE))
    return rows


def measure(
    section: FirstSection, quantity: str, between: tuple[float, float] | None
) -> tuple[float, str]:
    """The value and unit of `quantity`; with `between` the share of it in [low, high), sizes in mm, volumes in mm3."""
    if between is None:
        return SINGLES[quantity].value(section), SINGLES[quantity].unit
    if quantity in SIZES:
        return share_of_sizes(section.sizes, quantity, between), "share"
    if quantity != POROSITY:
        raise KeyError(quantity)
    return share(within(section.occupancy.throat_porosity, between), _with_fines(section)), "share"


def share_of_sizes(sizes: Sizes, quantity: str, between: tuple[float, float]) -> float:
    """Share of one of SIZES in [low, high), mm or mm3."""
    values, weights = SIZES[quantity].values(sizes)
    return share(within(values, between), weights)


def within(values: Array, between: tuple[float, float]) -> Array:
    """True (N,) in [low, high); low 0 takes in what overlap puts below it, high 1 (a porosity's) what is at it."""
    low, high = between[0] or -math.inf, between[1] if between[1] != 1.0 else math.inf
    return np.asarray((values >= low) & (values < high))


def share(part: Array, weights: Array) -> float:
    """Share of `part` (N,) true, by `weights` (N,); nan when they sum to nothing."""
    total = float(np.sum(weights))
    return float(np.sum(weights[part])) / total if total > 0 else math.nan


def write_statistics(path: Path, rows: Sequence[StatisticRow]) -> Path:
    """statistics.csv."""
    return write_flat(path, StatisticRow, rows)


def _label(quantity: str, between: tuple[float, float] | None) -> str:
    if between is None:
        return quantity
    unit = f" {SIZES[quantity].unit}" if quantity in SIZES else ""
    return f"{quantity} {between[0]:g} to {between[1]:g}{unit}"


def _row(
    examined: Examined,
    asked: tuple[str, tuple[float, float] | None],
    found: tuple[float, str],
    note: str,
) -> StatisticRow:
    told = _told(examined.id, *asked)
    return StatisticRow(
        id=examined.id,
        seed=examined.seed,
        source=told.source if told else "",
        quantity=_label(*asked),
        ours=found[0],
        thesis=told.value if told else math.nan,
        sense=told.sense if told else "",
        unit=found[1],
        note=f"{note}; {told.note}" if told and told.note else note,
    )


def _told(run: str, quantity: str, between: tuple[float, float] | None) -> Statistic | None:
    """The thesis's number for the run's specimen."""
    asked = specimen_number(run), quantity, between
    told = thesis_values().statistics
    return next((one for one in told if (one.specimen, one.quantity, one.between) == asked), None)


def _with_fines(section: FirstSection) -> Array:
    return section.throat_weight * section.has_fines


def _mean_porosity(section: FirstSection) -> float:
    weight = _with_fines(section)
    return (
        float(np.average(section.occupancy.throat_porosity, weights=weight))
        if weight.any()
        else math.nan
    )


def _fines_in_throats(section: FirstSection) -> float:
    """mm3, a fine counted in every throat it reaches into (throats overlap)."""
    return 1e9 * float(np.sum(section.throat_weight * section.occupancy.throat_solid_volume))


def _fines_in_bodies(section: FirstSection) -> float:
    """mm3, each fine once: the bodies are the tetrahedra."""
    return 1e9 * float(np.sum(section.pore_weight * section.occupancy.pore_solid_volume))


def _overall_throat_porosity(section: FirstSection) -> float:
    tube = 1e9 * float(np.sum(section.throat_weight * section.tube))
    return 1.0 - _fines_in_throats(section) / tube if tube > 0 else math.nan


def _overall_body_porosity(section: FirstSection) -> float:
    """1 - fines / void; over whole tetrahedra it could not exceed the specimen's porosity, 0.40."""
    void = 1e9 * float(np.sum(section.pore_weight * section.network.pore_volume))
    return 1.0 - _fines_in_bodies(section) / void if void > 0 else math.nan


def _throat_share(section: FirstSection) -> float:
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
