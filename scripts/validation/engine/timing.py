"""Core seconds of short work."""

import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")
ENOUGH, LONG = 1.0, 10.0
"""Seconds after which a second, and no second, run is made."""


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
