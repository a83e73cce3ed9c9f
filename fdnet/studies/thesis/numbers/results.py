"""results.csv: what each run came to under each pair of laws, the thesis's numbers beside it."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.analysis import Analysis
from fdnet.network.flow.sections import reduction
from fdnet.spheres.porosity import measure_porosity
from fdnet.spheres.snapshot import Array
from fdnet.studies.engine.csv_rows import parsed, read_csv, write_csv
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.values import ThesisSpecimen, thesis_of
from fdnet.studies.thesis.runs.plan import QUICK
from fdnet.studies.thesis.runs.state import State

SECTIONS = 8
FIRST, FIRST_BIN, SHALLOW = 1e-3, 0.25e-3, 0.5e-3
SPREAD = {
    "k_reductions": "k_reduction",
    "k_reductions_inplace": "k_reduction_inplace",
    "thesis_k_reductions": "thesis_k_reduction",
}
"""Fields of SECTIONS values, and the name of their columns before `_1` to `_8`."""

TOLD = {
    "thesis_depth_mm": "invaded_depth_mm",
    "thesis_invaded_count": "invaded_count",
    "thesis_fraction_first_bin": "fraction_first_bin",
    "thesis_fraction_beyond_0p5mm": "fraction_beyond_0p5mm",
    "thesis_face_porosity_loss": "face_porosity_loss",
    "thesis_count_first_mm": "count_first_mm",
}
"""Fields with one number of the thesis, and its name in `values.ThesisSpecimen`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """One run under one pair of laws; nan where there is no value. `digest` is its case's.

    Porosity counts overlap once, `porosity_loss_first_mm` is its loss between x = 0 and 1 mm; fractions are of the
    invaded fines by number, `fraction_deep_near_wall` of those beyond 1 mm, the ones less than a grain radius from a
    side wall; `k_reduction` of the whole, `k_reductions` (8) of the slabs cut out, `k_reductions_inplace` (8) of the
    slabs in the whole specimen; `time_ms` simulated, `seconds` and `pack_seconds` of the computer; `max_overlap` over
    the smaller diameter. `thesis_*`: see `values.ThesisSpecimen`.
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
        [f"{SPREAD[one.name]}_{section}" for section in range(1, SECTIONS + 1)]
        if one.name in SPREAD
        else [one.name]
    )
)


def result_rows(examined: Examined) -> list[ResultRow]:
    """One row for each pair of laws. Raises CaseError on more than 8 sections."""
    shared: dict[str, Any] = {
        **_porosities(examined.state, examined.thesis),
        **_invasion(examined.state, examined.thesis),
        **_ending(examined.state),
        **_told(thesis_of(examined.id), counted=not examined.id.startswith(QUICK)),
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
    """The rows as CSV, COLUMNS, what is not known left empty."""
    return write_csv(path, COLUMNS, (list(_cells(row)) for row in rows))


def read_results(path: Path) -> list[ResultRow]:
    """The rows of such a CSV. Raises CaseError when it is not one."""
    return [_row(dict(zip(COLUMNS, line, strict=True))) for line in read_csv(path, COLUMNS)]


def invaded_depth(state: State) -> Array:
    """Depth (F,) m of the fines centred in the specimen."""
    low, high = state.damaged.box[0]
    x = state.damaged.fines().position[:, 0]
    return x[(x >= low) & (x < high)] - low


def deep_near_wall(state: State) -> float:
    """Share of the fines beyond 1 mm that are centred within a mean grain radius of a side wall; nan without either."""
    fines, reach = state.damaged.fines(), state.case.grains.mean_radius_m
    (low, high), *sides = state.damaged.box
    deep = (fines.position[:, 0] >= low + FIRST) & (fines.position[:, 0] < high)
    if any(state.case.periodic) or not deep.any():
        return math.nan
    to_wall = [
        np.minimum(fines.position[deep, i] - a, b - fines.position[deep, i])
        for i, (a, b) in enumerate(sides, 1)
    ]
    return float(np.mean(np.minimum(*to_wall) < reach))


def porosity_loss(state: State, analysis: Analysis, depth: float) -> float:
    """Loss of porosity between the face and `depth` m (the whole specimen when it is shorter): pooled from the
    profile's bins or the sections where they have a cut there, else measured anew."""
    low, high = state.damaged.box[0]
    end = min(float(low) + depth, float(high))
    profile, sections = analysis.profile, analysis.sections
    cuts = np.array([sections[0].x_lo, *(one.x_hi for one in sections)])
    losses = np.array([one.porosity_initial - one.porosity_damaged for one in sections])
    for edges, loss in (
        (profile.edges, profile.porosity_initial - profile.porosity_damaged),
        (cuts, losses),
    ):
        count = int(np.argmin(np.abs(edges - end)))
        if abs(edges[count] - end) <= 1e-9 * (high - low):
            return float(np.average(loss[:count], weights=np.diff(edges)[:count]))
    span = np.array([low, end])
    before, after = (
        measure_porosity(spheres, periodic=state.case.periodic, edges=span).profile[0]
        for spheres in (state.grains, state.damaged)
    )
    return float(before - after)


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
            f"{run}: analysis.sections: {len(sections)} sections, results.csv has columns for {SECTIONS}"
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


def _told(thesis: ThesisSpecimen | None, *, counted: bool) -> dict[str, Any]:
    """The thesis's numbers; counts only when `counted`, for specimens of its size."""
    told: dict[str, Any] = {
        name: _known(getattr(thesis, field, None)) if counted or "count" not in name else math.nan
        for name, field in TOLD.items()
    }
    return told | {
        "thesis_damaged_porosity": thesis.damaged_porosity[0] if thesis else math.nan,
        "thesis_k_reductions": _filled(thesis.reductions if thesis else ()),
    }


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _filled(values: Sequence[float | None]) -> tuple[float, ...]:
    """SECTIONS values, nan where there is none."""
    return tuple(_known(value) for value in [*values, *[None] * SECTIONS][:SECTIONS])


def _cells(row: ResultRow) -> Iterator[object]:
    for one in fields(row):
        value = getattr(row, one.name)
        yield from value if one.name in SPREAD else (value,)


def _row(cells: dict[str, str]) -> ResultRow:
    values: dict[str, Any] = {}
    for one in fields(ResultRow):
        if one.name in SPREAD:
            names = [f"{SPREAD[one.name]}_{section}" for section in range(1, SECTIONS + 1)]
            values[one.name] = tuple(parsed(cells[name], float) for name in names)
        else:
            values[one.name] = parsed(cells[one.name], one.type)
    return ResultRow(**values)
