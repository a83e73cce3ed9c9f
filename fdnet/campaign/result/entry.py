"""One run of a comparison: what was varied, how it ended, and every number of its summary."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fdnet.report.tables import read_summary

TEXTS = ("law", "damage_law_used", "stop_reason")
"""Texts of a summary that a table shows next to the numbers."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Entry:
    """A run of a comparison.

    Attributes:
        name: of the run.
        variant: of what it is a sample; runs of one variant differ by the seed alone.
        seed: of the run.
        keys: varied keys with their values.
        folder: the run folder.
        status: "done", "failed" or "missing".
        reason: why it is not done; "" when it is.
        pack: digest of the case's pack: two runs with the same have the same grains.
        numbers: every number of summary.json, by dotted key; {} of a run that is not done.
    """

    name: str
    variant: str
    seed: int
    keys: Mapping[str, Any]
    folder: Path
    status: str = "done"
    reason: str = ""
    pack: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)


def numbers_of(folder: Path) -> dict[str, Any]:
    """Every number of the summary of a run, by dotted key, and a few of its texts.

    Sections are numbered from 1: `sections.1.k_damaged_m2`. Of the lists of sentences it gives the
    number of sentences. Raises CaseError when the summary cannot be read.
    """
    summary = read_summary(folder / "summary.json")
    result = dict(_flat("", summary))
    return {key: value for key, value in result.items() if key != "seed"}


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _flat(f"{prefix}.{key}" if prefix else str(key), one)
    elif isinstance(value, list):
        if any(isinstance(one, Mapping) for one in value):
            for number, one in enumerate(value, start=1):
                yield from _flat(f"{prefix}.{number}", one)
        else:
            yield prefix, len(value)
    elif isinstance(value, int | float) or value is None or prefix in TEXTS:
        yield prefix, value
