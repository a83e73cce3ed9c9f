"""Periodic packs of known permeability, as the project keeps them, and packs tiled from them."""

import re
from pathlib import Path

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Array, Snapshot, resting

MM = 1e-3
RADIUS = 0.5
"""Grain radius of the packs, mm."""
PROJECT = Path(__file__).resolve().parents[2]
PACKS, OWN_TRUTH = Path("tests/data/truth"), Path("docs/validation/truth_own.csv")


def truth_folder() -> Path:
    """Folder of the packs. Raises CaseError where fdnet runs without the project around it."""
    return _in_project(PACKS)


def truth_tables() -> list[Path]:
    """The tables of their permeabilities: the shared one and fdnet's own. Raises CaseError without the project."""
    return [truth_folder() / "truth.csv", _in_project(OWN_TRUTH)]


def _in_project(path: Path) -> Path:
    found = PROJECT / path
    if not found.exists():
        raise CaseError(
            f"study: {found} is not there; this study reads the packs of the Stokes truth, which are part of the "
            "project and not of an installed fdnet: run it from a checkout (pip install -e .)"
        )
    return found


def read_pack(path: Path) -> tuple[Snapshot, float]:
    """A pack file and its edge (mm). Raises CaseError when its first line does not give the edge."""
    found = re.match(r"# periodic cube, edge ([0-9.]+) mm", path.read_text())
    if not found:
        raise CaseError(f"{path}:1: expected '# periodic cube, edge NUMBER mm'")
    edge = float(found[1])
    spheres = read_spheres(path, units="mm")
    return snapshot(spheres.position / MM, spheres.radius / MM, edge, spheres.kind), edge


def snapshot(position: Array, radius: Array, edge: float, kind: Array) -> Snapshot:
    """Spheres of a periodic cube, lengths in mm."""
    return resting(position * MM, radius * MM, np.array([[0.0, edge * MM]] * 3), kind)


def tiled(pack: Snapshot, times: Array) -> Snapshot:
    """`times` (3,) copies of a periodic pack along each axis."""
    size = np.ptp(pack.box, axis=1)
    steps = np.stack(np.meshgrid(*map(np.arange, times), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    position = (pack.position + steps * size).reshape(-1, 3)
    box = pack.box[:, :1] + np.stack([np.zeros(3), times * size], axis=1)
    return resting(position, np.tile(pack.radius, len(steps)), box, np.tile(pack.kind, len(steps)))


def shaken(pack: Snapshot, share: float, rng: np.random.Generator) -> Snapshot:
    """The grains of a periodic pack, each moved by up to `share` of its radius along each axis."""
    moved = pack.position + share * pack.radius[:, None] * rng.uniform(-1, 1, pack.position.shape)
    low, size = pack.box[:, 0], np.ptp(pack.box, axis=1)
    return resting(low + (moved - low) % size, pack.radius, pack.box, pack.kind)
