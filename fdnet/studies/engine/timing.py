"""Core seconds of short work."""

import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")
ENOUGH, LONG = 1.0, 10.0


def least_time(work: Callable[[], Found], *, times: int = 3) -> tuple[Found, float]:
    """What `work` returns, and the core seconds of the quickest of `times` runs (two after a second, one after ten).

    The first may compile or load.
    """
    took: list[float] = []
    while True:
        start = time.process_time()
        found = work()
        took.append(time.process_time() - start)
        if len(took) == times or sum(took) > (ENOUGH if len(took) > 1 else LONG):
            return found, min(took)
