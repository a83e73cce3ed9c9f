"""Work on several processor cores at once, in the threads of this process."""

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from fdnet.network.compiled import cores_of_numba

Part = TypeVar("Part")
MOST_CORES = 8
"""More would hardly help, for some of the work runs on one core, and each takes some 80 MB."""


def on_all_cores(work: Callable[[Part], None], parts: Iterable[Part]) -> None:
    """Does `work` on each of the `parts`, on up to `MOST_CORES` of the cores that numba may use.

    These are all cores, or as many as the environment variable NUMBA_NUM_THREADS says. Only
    functions that are `compiled_for_loops` run side by side, so most of the work should be in
    them. No part may write to what another one reads or writes, so the result does not depend on
    the number of cores. The first error of a part is raised.
    """
    cores = min(cores_of_numba(), MOST_CORES)
    if cores <= 1:
        for part in parts:
            work(part)
        return
    begun: deque[Future[None]] = deque()
    with ThreadPoolExecutor(cores) as pool:
        for part in parts:  # made one by one, as they are needed
            begun.append(pool.submit(work, part))
            if len(begun) > cores:
                begun.popleft().result()
        for one in begun:
            one.result()
