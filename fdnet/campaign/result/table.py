"""table.csv, table.parquet and summary.json of a comparison."""

import csv
import json
import math
import os
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fdnet.campaign.result.comparison import Comparison, is_number
from fdnet.campaign.result.entry import Entry
from fdnet.campaign.result.pairs import Pair
from fdnet.files import replacing, write_text
from fdnet.statistics.bands import Band

TABLE, PARQUET, SUMMARY = "table.csv", "table.parquet", "summary.json"


def rows_of(comparison: Comparison) -> list[dict[str, Any]]:
    """One row for each run: name, variant, varied keys, seed, status, and every number."""
    numbers = dict.fromkeys(key for entry in comparison.done for key in entry.numbers)
    return [
        {
            "run": entry.name,
            "variant": entry.variant,
            **{key: _plain(entry.keys.get(key)) for key in comparison.keys},
            "seed": entry.seed,
            "status": entry.status,
            "reason": entry.reason,
            "folder": os.path.relpath(entry.folder, comparison.path),
            **{key: entry.numbers.get(key) for key in numbers},
        }
        for entry in comparison.entries
    ]


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, int | float | str) else json.dumps(value)


def write_table(comparison: Comparison) -> list[Path]:
    """Write table.csv, and table.parquet where pyarrow is installed; returns the paths."""
    rows = rows_of(comparison)
    columns = list(rows[0])
    path = comparison.path / TABLE
    with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            writer.writerow(["" if row[name] is None else row[name] for name in columns])
    return [path, *_write_parquet(comparison.path / PARQUET, rows)]


def _write_parquet(path: Path, rows: list[dict[str, Any]]) -> list[Path]:
    if find_spec("pyarrow") is None:
        return []
    import pyarrow as pa
    from pyarrow import parquet

    columns = {name: _one_type([row[name] for row in rows]) for name in rows[0]}
    with replacing(path) as part:
        parquet.write_table(pa.table(columns), part)
    return [path]


def _one_type(values: list[Any]) -> list[Any]:
    """A column of one type: numbers, yes or no, or else texts."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) <= 1 or kinds <= {bool}:
        return values
    if kinds <= {int, float}:
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(value) for value in values]


def summary_of(comparison: Comparison) -> dict[str, Any]:
    """The mapping of summary.json.

    Each quantity has its mean and 95 % band over the seeds; with several variants, the mean over
    the variants and, under `variants`, that of each.
    """
    result: dict[str, Any] = {
        "title": comparison.title,
        "runs": len(comparison.entries),
        "done": len(comparison.done),
        "failed": len(comparison.failed),
        "failures": [_failure(comparison, entry) for entry in comparison.failed],
        "left_out": list(comparison.left_out),
        "ranked_by": comparison.ranked_by,
        "ranking": comparison.ranking(),
        "variants": [_variant(comparison, name) for name in comparison.variants],
        "pairs": [pair_row(pair) for pair in comparison.pairs()],
    }
    for quantity in comparison.quantities:
        band, seeds = comparison.overall(quantity)
        result.setdefault(quantity, {**band_row(band), "seeds": seeds})
    return result


def write_summary(comparison: Comparison, more: Mapping[str, Any]) -> dict[str, Any]:
    """Write summary.json, with `more` keys; returns its mapping."""
    summary = summary_of(comparison) | dict(more)
    text = json.dumps(summary, indent=1, allow_nan=False, default=str)
    write_text(comparison.path / SUMMARY, text + "\n")
    return summary


def band_row(band: Band) -> dict[str, Any]:
    """Mean, low and high, null where there is none; and the bounds that the band was cut at."""
    ends = {"mean": band.mean, "low": band.low, "high": band.high}
    row = {name: None if math.isnan(value) else value for name, value in ends.items()}
    return row | ({"cut_at": list(band.cut)} if band.cut else {})


def pair_row(pair: Pair) -> dict[str, Any]:
    """A difference as summary.json shows it."""
    return {
        "one": pair.one,
        "other": pair.other,
        "difference": band_row(pair.difference),
        "paired": pair.paired,
        "p_value": pair.p_value if is_number(pair.p_value) else None,
        "apart": pair.apart,
        "seeds_needed": pair.seeds_needed,
    }


def _failure(comparison: Comparison, entry: Entry) -> dict[str, Any]:
    folder = os.path.relpath(entry.folder, comparison.path)
    return {"run": entry.name, "status": entry.status, "reason": entry.reason, "folder": folder}


def _variant(comparison: Comparison, name: str) -> dict[str, Any]:
    of_variant = [entry for entry in comparison.entries if entry.variant == name]
    done = [entry for entry in of_variant if entry.status == "done"]
    return {
        "name": name,
        "keys": dict(comparison.keys_of(name)),
        "runs": len(of_variant),
        "failed": len(of_variant) - len(done),
        **dict(_bands(comparison, name)),
    }


def _bands(comparison: Comparison, variant: str) -> Iterator[tuple[str, Any]]:
    for quantity in comparison.quantities:
        values = list(comparison.values(variant, quantity).values())
        if values:
            lowest, highest = min(values), max(values)
            row = band_row(comparison.band(variant, quantity))
            yield quantity, {**row, "seeds": len(values), "least": lowest, "most": highest}
