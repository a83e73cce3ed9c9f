"""CPU seconds and memory of the velocity field of a finished run's pack."""

import resource
import time
from pathlib import Path

import numpy as np

from fdnet.network.field.field import VelocityField, velocity_field
from fdnet.run.finished import open_run
from fdnet.spheres.snapshot import Array


def measure_field(run: Path, *, cells: float, points: int, seed: int = 1) -> dict[str, float]:
    """Solve the field of the intact pack of `run` and ask it for the flow at random points.

    The field is solved and asked in a small part of the pack first, so that no compiling counts.

    Args:
        run: folder of a finished run.
        cells: of the grid across a mean grain.
        points: number of places, even over the box.
        seed: of the places.

    Returns:
        "solve_s", "velocity_s" and "gradient_s" in CPU seconds, and "peak_MB" of the process.

    Raises CaseError when the folder holds no finished run.
    """
    finished = open_run(run)
    grains, periodic = finished.spheres().grains(), finished.case.periodic
    box = grains.box
    place = box[:, 0] + np.random.default_rng(seed).random((points, 3)) * np.ptp(box, axis=1)
    _asked(velocity_field(grains.where(grains.id < 50), periodic=periodic, cells=4.0), place)
    start = time.process_time()
    field = velocity_field(grains, periodic=periodic, cells=cells)
    _asked(field, place)
    solved = time.process_time()
    field.at(place)
    moved = time.process_time()
    field.pressure_gradient_at(place)
    return {
        "solve_s": solved - start,
        "velocity_s": moved - solved,
        "gradient_s": time.process_time() - moved,
        "peak_MB": 1e-3 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }


def _asked(field: VelocityField, place: Array) -> None:
    """Ask a field for the first time, when it smooths what it has on its grid."""
    field.at(place[:10])
    field.pressure_gradient_at(place[:10])
