"""The packs of the Stokes truth, and the seconds of short work, for the studies of the network."""

import time
from collections.abc import Callable
from functools import cache
from typing import TypeVar

from fdnet.spheres.snapshot import Snapshot
from validation.truth.cases import Case, read_cases
from validation.truth.packs import read_pack, truth_folder, truth_tables

Result = TypeVar("Result")
ENOUGH, LONG = 1.0, 10.0
"""Seconds after which a second, and no second, run is made."""


@cache
def truth_cases() -> dict[str, Case]:
    """The packs of known permeability by name."""
    return {case.name: case for case in read_cases(truth_tables(), [truth_folder()])[0]}


@cache
def truth_pack(name: str) -> Snapshot:
    """One of the packs of the truth, by the name of its spheres."""
    return read_pack(truth_folder() / f"{name}.csv")[0]


def least_time(work: Callable[[], Result], *, times: int = 3) -> tuple[Result, float]:
    """What `work` returns, and the core seconds of the quickest of `times` runs.

    The first run may compile or load. There are only two runs when they take more than a second,
    and only one when it takes more than ten.
    """
    took: list[float] = []
    while True:
        start = time.process_time()
        result = work()
        took.append(time.process_time() - start)
        if len(took) == times or sum(took) > (ENOUGH if len(took) > 1 else LONG):
            return result, min(took)
