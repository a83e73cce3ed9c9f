"""Compiling of the hot loops ahead of their use: `python -m fdnet.network.warm_up`.

A run starts it next to LIGGGHTS where this version has compiled nothing yet, so that the compiled
code lies in the cache when the run's own analysis asks for it.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from fdnet.names import ALL_SPHERES, DEFAULT_LAW, SECTION_ARCHIE


@contextmanager
def compiling(sides: str, *, wanted: bool) -> Iterator[Callable[[], object]]:
    """Compile meanwhile for packs with these periodic `sides`; call what it yields to wait.

    Nothing is started where it is not `wanted`, or where this version has compiled something.
    """
    from fdnet.network.compiled import COLD, say_compiling

    if not wanted or not COLD:
        yield lambda: None
        return
    say_compiling()
    command = [sys.executable, "-P", "-m", "fdnet.network.warm_up", sides]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet) as process:
        try:
            yield process.wait  # the analysis compiles what is left
        finally:
            process.terminate()


def warm_up(sides: str) -> None:
    """Analyse a small pack with fines by the default laws."""
    import numpy as np

    from fdnet.network.permeability import compare
    from fdnet.spheres.snapshot import Snapshot

    draw = np.random.default_rng(1)
    places = 5e-4 * (np.indices((5, 5, 5)).reshape(3, -1).T + 0.5)
    places = places + draw.uniform(-2e-5, 2e-5, places.shape)
    small = draw.uniform(0.0, 2.5e-3, (60, 3))
    small = small[np.linalg.norm(small[:, None] - places, axis=2).min(axis=1) > 2.8e-4]
    radii = np.concatenate([draw.uniform(2.3e-4, 2.5e-4, len(places)), np.full(len(small), 4e-5)])
    kinds = ["grain"] * len(places) + ["fine"] * len(small)
    place, box = np.concatenate([places, small]), [[0.0, 2.5e-3]] * 3
    spheres = Snapshot.from_arrays(place, radii, box=box, kind=kinds)
    pairs = [(DEFAULT_LAW, ALL_SPHERES), (DEFAULT_LAW, SECTION_ARCHIE)]
    for _ in compare(spheres, periodic=sides, sections=2, laws=pairs):
        pass


if __name__ == "__main__":
    warm_up(sys.argv[1])
