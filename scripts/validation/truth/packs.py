"""Periodic packs of known permeability, which come with fdnet, and packs tiled from them."""

import re
from pathlib import Path

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Array, Snapshot, resting

MM = 1e-3
RADIUS = 0.5
"""Grain radius of the packs, mm."""
DATA = Path(__file__).with_name("data")
INDEPENDENT_TRUTH, OWN_TRUTH, OWN_GRIDS = "truth.csv", "own_truth.csv", "own_grids.csv"
LARGE_FINES_TRUTH = "large_fines_truth.csv"


def truth_folder() -> Path:
    """Folder of the packs and of the tables of their permeabilities.

    Raises:
        CaseError: the folder is missing, so the installation is not complete.
    """
    if not DATA.exists():
        raise CaseError(
            f"study: {DATA} is not there; it holds the packs of known permeability that come with "
            "fdnet, which this study reads: install fdnet again"
        )
    return DATA


def truth_tables() -> list[Path]:
    """The tables of the permeabilities: the independent one and fdnet's own.

    Raises:
        CaseError: the folder of the packs is missing.
    """
    return [truth_folder() / INDEPENDENT_TRUTH, truth_folder() / OWN_TRUTH]


def read_pack(path: Path) -> tuple[Snapshot, float]:
    """A pack file and the edge of its periodic cube, mm.

    Raises:
        CaseError: the first line of the file does not give the edge.
    """
    first_line = re.match(r"# periodic cube, edge ([0-9.]+) mm", path.read_text())
    if not first_line:
        raise CaseError(f"{path}:1: expected '# periodic cube, edge NUMBER mm'")
    spheres, edge = read_spheres(path, units="mm"), float(first_line[1])
    return snapshot(spheres.position / MM, spheres.radius / MM, edge, spheres.kind), edge


def snapshot(position: Array, radius: Array, edge: float, kind: Array) -> Snapshot:
    """Spheres of a periodic cube, given in mm: `position` (N, 3), `radius` (N,), its `edge`."""
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
