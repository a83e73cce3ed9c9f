"""The numbers of the thesis (Shi 2011), read from published.toml.

Lengths are in mm, volumes in mm3; everything else is a fraction or a count.
"""

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

Between = tuple[float, float] | None  # a range [low, high); None for a quantity itself


def rows_in(name: str) -> list[Any]:
    """The rows of a table next to this module, with a column of texts as an attribute each."""
    table = pd.read_csv(Path(__file__).with_name(name), dtype=str, keep_default_na=False)
    return [*table.itertuples(index=False)]


@cache
def published() -> Mapping[str, Any]:
    """All numbers: `first_section_mm`, `specimens` by name, `statistic` and `deposition`."""
    tables = tomllib.loads(Path(__file__).with_name("published.toml").read_text(encoding="utf-8"))
    specimens = {f"specimen{one['id']}": one for one in tables["specimen"]}
    specimens["table3"] = tables["table3"]
    for one in specimens.values():
        one["porosity_loss"] = one["porosity"] - one["damaged_porosity"][0]
    return tables | {"specimens": specimens}


def specimen_of(run: str) -> str:
    """The specimen of a run, such as "quick-specimen5", "specimen5-5to6" or "specimen5 set=1"."""
    return run.removeprefix("quick-").split(" ")[0].split("-")[0]


def thesis_of(run: str) -> Mapping[str, Any]:
    """The thesis's numbers of the run's specimen."""
    return published()["specimens"][specimen_of(run)]


def reductions(one: Mapping[str, Any]) -> Sequence[float]:
    """1 - k/k0 by section of 1 mm: all eight of a table, or the first of a figure, or none."""
    first = [one["first_section_reduction"]] if "first_section_reduction" in one else []
    return one.get("section_reduction", first)


def statistics_of(run: str) -> Mapping[tuple[str, Between], Mapping[str, Any]]:
    """Numbers on pores and throats of the run's specimen, by quantity and range."""
    number = specimen_of(run).removeprefix("specimen")
    return {key_of(one): one for one in published()["statistic"] if one["specimen"] == number}


def key_of(statistic: Mapping[str, Any]) -> tuple[str, Between]:
    """Quantity and range of a statistic."""
    low_high = statistic.get("between")
    return statistic["quantity"], low_high and (low_high[0], low_high[1])


def in_words(sense: str, value: float, scale: float = 1.0) -> str:
    """A number of the thesis, such as "about 70" or an exact one alone."""
    return f"{sense.removeprefix('exact')} {round(scale * value, 6):.6g}".strip()
