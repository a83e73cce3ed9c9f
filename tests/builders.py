"""Small cases, built in code."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fdnet.case.case import Case
from fdnet.case.file import case_from, set_keys
from fdnet.cli import main
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting

TINY: dict[str, Any] = {
    "name": "tiny",
    "seed": 1,
    "box": {"size_mm": [3.0, 1.6, 1.6], "sides": "walls", "wall_friction": 0.0},
    "grains": {"radius_mm": 0.25, "count": 66},
    "fines": {"radius_mm": 0.05, "count": 300, "supply": "slab"},
    "fluid": {"darcy_law": "darcy"},
    "drag": {"field": "uniform", "inertia": "none", "scheme": "held"}
    | {"upstream": "interstitial", "pressure_gradient": False},
    "contact": {"restitution": "dry"},
    "run": {"time_step_factor": 0.1, "stiffness_N_m": 1e4, "plug_rate": 0.0},
    "analysis": {"sections": 3},
}


def tiny(*assignments: str) -> Case:
    """Some 70 grains and 300 fines: a run through the real binary takes a second or two."""
    return case_from(set_keys(TINY, list(assignments)))


def resting_spheres(
    position: list[list[float]], radius: float, box: Array, *, kind: Kind, first: int = 1
) -> Snapshot:
    """Equal spheres at `position` (N, 3) m, at rest, numbered from `first`; `box` (3, 2) m."""
    made = resting(np.array(position), radius, box, kind)
    return replace(made, id=made.id + (first - 1))


def followed(*more, way="fluid.velocity_m_s=5.0"):
    """A flow that follows its deposit: 15 grains, 150 fines, five checkpoints with updates."""
    spheres = ("grains.count=15", "fines.count=150", "fines.concentration=0.2")
    box = ("box.sides=periodic", "box.size_mm=[1.6,1.0,1.0]")
    times = ("run.time_step_factor=0.2", "run.cap_ms=0.5", "run.checkpoint_ms=0.1")
    return tiny('drag={field = "network"}', way, *box, *spheres, *times, *more)


def answer(capsys: Any, *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of one command."""
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, *capsys.readouterr()


@contextmanager
def disk_of(size: str, place: Path) -> Iterator[Path]:
    """A small file system at `place`; `size` such as "8k"."""
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small file system needs root")
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


@contextmanager
def naming(*case: object) -> Iterator[None]:
    """Names the `case` of a loop where it fails."""
    try:
        yield
    except BaseException as error:
        error.add_note(f"case: {', '.join(map(repr, case))}")
        raise
