"""Permeability by depth of a variant, from the sections of its runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fdnet.campaign.result.comparison import Comparison, is_number
from fdnet.campaign.result.pairs import student_band
from fdnet.report.tables import MILLIDARCY
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DepthCurve:
    """Means over the seeds of a variant, one for each slab.

    Attributes:
        edges: (S + 1,) m.
        intact: (S,) mD.
        damaged: (S,) mD.
        low: (S,) mD, lower end of the 95 % band of `damaged`, 0 or more; None for a single run.
        high: (S,) mD, its upper end.
    """

    edges: Array
    intact: Array
    damaged: Array
    low: Array | None
    high: Array | None


def depth_curves(comparison: Comparison, variant: str) -> DepthCurve | None:
    """The curve of a variant; None where its runs have no sections in common."""
    runs = [sections_of(e.numbers) for e in comparison.done if e.variant == variant]
    runs = [rows for rows in runs if rows]
    if not runs or any(_edges(rows) != _edges(runs[0]) for rows in runs):
        return None
    damaged = _values(runs, "k_damaged_inplace_m2")
    bands = [
        student_band(list(column[~np.isnan(column)])).within(0.0, np.inf) for column in damaged.T
    ]
    several = len(runs) > 1
    return DepthCurve(
        edges=np.array(_edges(runs[0])),
        intact=np.mean(_values(runs, "k_initial_inplace_m2"), axis=0),
        damaged=np.array([band.mean for band in bands]),
        low=np.array([band.low for band in bands]) if several else None,
        high=np.array([band.high for band in bands]) if several else None,
    )


def sections_of(numbers: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The sections in the flat numbers of a run, by depth."""
    rows: list[dict[str, Any]] = []
    while (prefix := f"sections.{len(rows) + 1}.") + "x_lo_m" in numbers:
        row = {k.removeprefix(prefix): v for k, v in numbers.items() if k.startswith(prefix)}
        rows.append(row)
    return rows


def _edges(rows: list[dict[str, Any]]) -> list[float]:
    return [*(row["x_lo_m"] for row in rows), rows[-1]["x_hi_m"]]


def _values(runs: list[list[dict[str, Any]]], key: str) -> Array:
    """(R, S) mD; nan where a run has none."""
    return np.array(
        [
            [row[key] / MILLIDARCY if is_number(row.get(key)) else np.nan for row in rows]
            for rows in runs
        ]
    )
