"""Small cases, built in code."""

from typing import Any

from fdnet.case import Case
from fdnet.case_file import case_from, set_keys

TINY: dict[str, Any] = {
    "name": "tiny",
    "seed": 1,
    "box": {"size_mm": [3.0, 1.6, 1.6]},
    "grains": {"radius_mm": 0.25, "count": 66},
    "fines": {"radius_mm": 0.05, "count": 300},
    "analysis": {"sections": 3},
}


def tiny(*assignments: str) -> Case:
    """Some 70 grains and 300 fines: a run through the real binary takes a second or two."""
    return case_from(set_keys(TINY, list(assignments)))
