"""results.csv: the results of each run under each pair of laws, with the thesis's numbers."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.file import QUICK
from fdnet.errors import CaseError
from fdnet.network.flow.sections import reduction
from fdnet.network.permeability import Analysis
from validation.engine.csv_rows import parsed, read_csv, write_csv
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.invasion import (
    FIRST,
    FIRST_BIN,
    SHALLOW,
    deep_near_wall,
    invaded_depth,
    porosity_loss,
)
from validation.thesis.numbers.values import ThesisSpecimen, thesis_of
from validation.thesis.runs.state import State

SECTIONS = 8
SECTION_COLUMNS = {
    "k_reductions": "k_reduction",
    "k_reductions_inplace": "k_reduction_inplace",
    "thesis_k_reductions": "thesis_k_reduction",
}
"""Fields of SECTIONS values, and the names of their columns before "_1" to "_8"."""

THESIS_FIELDS = {
    "thesis_depth_mm": "invaded_depth_mm",
    "thesis_invaded_count": "invaded_count",
    "thesis_fraction_first_bin": "fraction_first_bin",
    "thesis_fraction_beyond_0p5mm": "fraction_beyond_0p5mm",
    "thesis_face_porosity_loss": "face_porosity_loss",
    "thesis_count_first_mm": "count_first_mm",
}
"""Fields with one number of the thesis, and the name of that number in `ThesisSpecimen`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """One run under one pair of laws; nan where there is no value.

    Porosity counts overlap once. Fractions of fines are by number. Reductions are 1 - k/k0.

    Attributes:
        id: name of the run.
        seed: seed of the run.
        digest: digest of its case.
        law: name of the conductance law.
        damage_law: name of the damage law.
        porosity_initial: porosity of the specimen before the invasion.
        porosity_damaged: porosity of the specimen after it.
        porosity_loss_first_mm: porosity lost between the face and 1 mm.
        invaded_count: fines centred in the specimen.
        count_first_mm: fines centred in its first millimetre.
        invasion_depth_mm: depth of the deepest fine.
        invasion_depth_p95_mm: depth above which 95 % of the invaded fines lie.
        mean_depth_mm: mean depth of the invaded fines.
        fraction_first_0p25mm: share of the invaded fines in the first 0.25 mm.
        fraction_first_mm: share in the first millimetre.
        fraction_beyond_0p5mm: share deeper than 0.5 mm.
        fraction_deep_near_wall: of the fines deeper than 1 mm, the share less than a mean grain
            radius from a side wall.
        k_reduction: reduction of the whole specimen.
        k_reductions: (8,) reductions of the slabs of 1 mm, cut out of the specimen.
        k_reductions_inplace: (8,) the same from the pressures of the whole specimen.
        k_initial_m2: m2, permeability of the whole specimen before the invasion.
        k_damaged_m2: m2, permeability after it.
        throats: number of throats.
        throats_blocked: number of throats that a fine blocks.
        supplied_count: fines supplied.
        passed_count: fines that left through the outlet.
        cake_thickness_mm: thickness of the deposit upstream of the face.
        stop_reason: why the run ended: "plugged", "supply_exhausted", "duration" or "cap".
        time_ms: simulated time.
        seconds: computing time of the invasion.
        pack_seconds: computing time of the packing.
        max_overlap: largest overlap over the smaller diameter.
        thesis_damaged_porosity: see `ThesisSpecimen`, as for all that follow.
        thesis_depth_mm: `invaded_depth_mm` there.
        thesis_invaded_count: `invaded_count` there.
        thesis_k_reductions: (8,) `reductions` there.
        thesis_fraction_first_bin: `fraction_first_bin` there.
        thesis_fraction_beyond_0p5mm: `fraction_beyond_0p5mm` there.
        thesis_face_porosity_loss: `face_porosity_loss` there.
        thesis_count_first_mm: `count_first_mm` there.
    """

    id: str
    seed: int
    digest: str
    law: str
    damage_law: str
    porosity_initial: float
    porosity_damaged: float
    porosity_loss_first_mm: float
    invaded_count: int
    count_first_mm: int
    invasion_depth_mm: float
    invasion_depth_p95_mm: float
    mean_depth_mm: float
    fraction_first_0p25mm: float
    fraction_first_mm: float
    fraction_beyond_0p5mm: float
    fraction_deep_near_wall: float
    k_reduction: float
    k_reductions: tuple[float, ...]
    k_reductions_inplace: tuple[float, ...]
    k_initial_m2: float
    k_damaged_m2: float
    throats: int
    throats_blocked: int
    supplied_count: int
    passed_count: int
    cake_thickness_mm: float
    stop_reason: str
    time_ms: float
    seconds: float
    pack_seconds: float
    max_overlap: float
    thesis_damaged_porosity: float
    thesis_depth_mm: float
    thesis_invaded_count: float
    thesis_k_reductions: tuple[float, ...]
    thesis_fraction_first_bin: float
    thesis_fraction_beyond_0p5mm: float
    thesis_face_porosity_loss: float
    thesis_count_first_mm: float


COLUMNS = tuple(
    column
    for one in fields(ResultRow)
    for column in (
        [f"{SECTION_COLUMNS[one.name]}_{section}" for section in range(1, SECTIONS + 1)]
        if one.name in SECTION_COLUMNS
        else [one.name]
    )
)


def result_rows(examined: Examined) -> list[ResultRow]:
    """One row for each pair of laws. Raises CaseError on more than 8 sections."""
    shared: dict[str, Any] = {
        **_porosities(examined.state, examined.thesis),
        **_invasion(examined.state, examined.thesis),
        **_ending(examined.state),
        **_thesis_numbers(thesis_of(examined.id), counted=not examined.id.startswith(QUICK)),
    }
    return [
        ResultRow(
            id=examined.id,
            seed=examined.seed,
            digest=examined.state.case.digest(),
            **shared,
            **_permeabilities(examined.id, analysis),
        )
        for analysis in examined.analyses.values()
    ]


def write_results(path: Path, rows: Sequence[ResultRow]) -> Path:
    """Write the rows as CSV with the columns COLUMNS; unknown values are left empty."""
    return write_csv(path, COLUMNS, (list(_cells(row)) for row in rows))


def read_results(path: Path) -> list[ResultRow]:
    """The rows of a results.csv. Raises CaseError when its columns are others."""
    return [_row(dict(zip(COLUMNS, line, strict=True))) for line in read_csv(path, COLUMNS)]


def _porosities(state: State, analysis: Analysis) -> dict[str, Any]:
    return {
        "porosity_initial": analysis.porosity_initial,
        "porosity_damaged": analysis.porosity_damaged,
        "porosity_loss_first_mm": porosity_loss(state, analysis, FIRST),
    }


def _invasion(state: State, analysis: Analysis) -> dict[str, Any]:
    depth = invaded_depth(state)
    share = (lambda part: float(np.mean(part))) if len(depth) else (lambda part: math.nan)
    return {
        "invaded_count": analysis.invaded_count,
        "count_first_mm": int(np.sum(depth < FIRST)),
        "invasion_depth_mm": 1e3 * analysis.invasion_depth,
        "invasion_depth_p95_mm": 1e3 * analysis.invasion_depth_p95,
        "mean_depth_mm": 1e3 * share(depth),
        "fraction_first_0p25mm": share(depth < FIRST_BIN),
        "fraction_first_mm": share(depth < FIRST),
        "fraction_beyond_0p5mm": share(depth >= SHALLOW),
        "fraction_deep_near_wall": deep_near_wall(state),
        "cake_thickness_mm": 1e3 * analysis.cake_thickness,
    }


def _ending(state: State) -> dict[str, Any]:
    ending = state.ending
    return {
        "supplied_count": ending["supplied"],
        "passed_count": ending["passed"],
        "stop_reason": ending["stop_reason"],
        "time_ms": 1e3 * ending["steps"] * ending["dt_s"],
        "seconds": float(ending["seconds"]),
        "pack_seconds": float(ending["pack_seconds"]),
        "max_overlap": float(ending["max_overlap"]),
    }


def _permeabilities(run: str, analysis: Analysis) -> dict[str, Any]:
    sections = analysis.sections
    if len(sections) > SECTIONS:
        raise CaseError(
            f"{run}: analysis.sections: {len(sections)} sections, but results.csv has columns for "
            f"{SECTIONS}; ask for at most {SECTIONS}"
        )
    inplace = [reduction(one.k_initial_inplace, one.k_damaged_inplace) for one in sections]
    return {
        "law": analysis.law,
        "damage_law": analysis.damage_law,
        "k_reduction": _known(analysis.k_reduction),
        "k_reductions": _filled([one.k_reduction for one in sections]),
        "k_reductions_inplace": _filled(inplace),
        "k_initial_m2": analysis.k_initial,
        "k_damaged_m2": analysis.k_damaged,
        "throats": len(analysis.network.throat_radius),
        "throats_blocked": 0
        if analysis.occupancy is None
        else int(analysis.occupancy.blocked.sum()),
    }


def _thesis_numbers(thesis: ThesisSpecimen | None, *, counted: bool) -> dict[str, Any]:
    """The thesis's numbers; its counts only when `counted`, for specimens of its size."""
    numbers: dict[str, Any] = {
        name: _known(getattr(thesis, field, None)) if counted or "count" not in name else math.nan
        for name, field in THESIS_FIELDS.items()
    }
    return numbers | {
        "thesis_damaged_porosity": thesis.damaged_porosity[0] if thesis else math.nan,
        "thesis_k_reductions": _filled(thesis.reductions if thesis else ()),
    }


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _filled(values: Sequence[float | None]) -> tuple[float, ...]:
    """SECTIONS values, nan in place of those that are missing."""
    return tuple(_known(value) for value in [*values, *[None] * SECTIONS][:SECTIONS])


def _cells(row: ResultRow) -> Iterator[object]:
    for one in fields(row):
        value = getattr(row, one.name)
        yield from value if one.name in SECTION_COLUMNS else (value,)


def _row(cells: dict[str, str]) -> ResultRow:
    values: dict[str, Any] = {}
    for one in fields(ResultRow):
        if one.name in SECTION_COLUMNS:
            column = SECTION_COLUMNS[one.name]
            names = [f"{column}_{section}" for section in range(1, SECTIONS + 1)]
            values[one.name] = tuple(parsed(cells[name], float) for name in names)
        else:
            values[one.name] = parsed(cells[one.name], one.type)
    return ResultRow(**values)
