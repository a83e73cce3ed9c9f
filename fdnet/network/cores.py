"""Work on several processor cores at once, in the threads of this process."""

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from fdnet.network.compiled import cores_of_numba

Part = TypeVar("Part")
Result = TypeVar("Result")
MOST_CORES = 8
"""More would hardly help, for some of the work runs on one core, and each takes some 80 MB."""
_here = threading.local()


def on_all_cores(work: Callable[[Part], Result], parts: Iterable[Part]) -> list[Result]:
    """What `work` gives for each of the `parts`, on up to `MOST_CORES` of the cores.

    The cores are all of this process, or as many as the environment variable NUMBA_NUM_THREADS
    says. Only functions that are `compiled_for_loops` run side by side, so most of the work should
    be in them. No part may write to what another one reads or writes, so the result does not
    depend on the number of cores. Work that is such a part itself does its own parts one after
    the other. The first error of a part is raised.
    """
    every = list(parts)
    cores = min(cores_of_numba(), MOST_CORES, len(every))
    if cores <= 1 or getattr(_here, "is_part", False):
        return [work(part) for part in every]
    with ThreadPoolExecutor(cores, initializer=_mark) as pool:
        return list(pool.map(work, every))


def _mark() -> None:
    """Marks this thread as one of those that do parts."""
    _here.is_part = True
