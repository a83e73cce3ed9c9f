"""Which sections have their permeability from resolved flow, in words."""

from collections.abc import Mapping, Sequence
from typing import Any

STATES = {"k_initial_resolved": "without fines", "k_damaged_resolved": "with fines"}


def resolved_words(rows: Sequence[Mapping[str, Any]]) -> str:
    """One sentence on the rows of sections.csv; empty where all are by the network.

    Runs of an earlier version lack the columns.
    """
    parts = []
    for key, state in STATES.items():
        numbers = [str(row["section"]) for row in rows if row.get(key)]
        if numbers:
            parts.append(f"section{'s' * (len(numbers) > 1)} {_listed(numbers)} {state}")
    if not parts:
        return ""
    every = all(row.get(key) for row in rows for key in STATES)
    rest = "" if every else " The others are by the network."
    return f"By resolved flow on coarse grids: {'; '.join(parts)}.{rest}"


def _listed(numbers: Sequence[str]) -> str:
    *some, last = numbers
    return f"{', '.join(some)} and {last}" if some else last
