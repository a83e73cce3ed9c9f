"""Which permeabilities are by resolved flow, in words."""

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
            of = f"of section{'s' * (len(numbers) > 1)} {_listed(numbers)} " * (len(rows) > 1)
            parts.append(f"{of}{state}")
    if not parts:
        return ""
    return f"By resolved flow on coarse grids: the permeability {' and '.join(parts)}."


def run_flags(row: Mapping[str, Any]) -> dict[str, Any]:
    """What the run itself took from resolved flow, of a row of `fdnet stokes`."""
    return {"section": row["section"]} | {key: row.get(f"network_{key}", 0) for key in STATES}


def _listed(numbers: Sequence[str]) -> str:
    *some, last = numbers
    return f"{', '.join(some)} and {last}" if some else last
