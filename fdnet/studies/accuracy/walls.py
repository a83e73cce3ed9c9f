"""Walls that hold the fluid against resolved Stokes flow: random packs between plane side walls.

The packs are periodic along x. A wall is a sheet of small overlapping spheres in the periodic cell
of the resolved flow, flat to 0.007 grain radii. Truth is extrapolated from two grids (2 to 4
minutes a pack); rows hold k over truth of the default law for both kinds of wall.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.network.flow.slabs import whole_permeability
from fdnet.network.laws.named import DEFAULT_LAW, LAWS
from fdnet.network.network import WALLS, build_network
from fdnet.network.stokes.stokes import extrapolate, solve_stokes
from fdnet.spheres.porosity import measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot, resting

CELL = 10.0
SHEET = CELL / 48
ROUNDS = 3000
SETTLED = 2e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """A pack between walls, lengths in grain radii.

    Attributes:
        name: of the pack.
        count: number of grains.
        sides: axes that have walls, of 0, 1 and 2.
        cells: size of the periodic cell of the resolved flow along y and z, over `CELL`.
        spread: radii are uniform in 1 - spread to 1 + spread.
    """

    name: str
    count: int
    sides: tuple[int, ...]
    cells: tuple[float, float] = (1.0, 1.0)
    spread: float = 0.0


PACKS = (
    Pack(name="wide", count=128, sides=(1,)),
    Pack(name="narrow", count=57, sides=(1,), cells=(0.5, 1.0)),
    Pack(name="duct", count=115, sides=(1, 2)),
    Pack(name="radii 1:2", count=118, sides=(1,), spread=1 / 3),
    Pack(name="loose", count=105, sides=(1,)),
)


def relaxed(pack: Pack, seed: int) -> Snapshot:
    """Random grains pushed apart until overlaps are below `SETTLED`, lengths in grain radii."""
    rng = np.random.default_rng(seed)
    radius = 1.0 + pack.spread * (2.0 * rng.random(pack.count) - 1.0)
    size = CELL * np.array([1.0, *pack.cells])
    walled = np.isin(range(3), pack.sides)
    size = size - 2.0 * SHEET * walled
    position = rng.random((pack.count, 3)) * size
    for _ in range(ROUNDS):
        apart = position[:, None] - position
        apart -= np.where(walled, 0.0, size * np.round(apart / size))
        distance = np.linalg.norm(apart, axis=2) + np.eye(pack.count)
        overlap = np.maximum(radius[:, None] + radius - distance, 0.0) * (1.0 - np.eye(pack.count))
        push = np.sum((overlap / distance)[:, :, None] * apart, axis=1)
        moved = position + 0.5 * push
        position = np.where(
            walled, np.clip(moved, radius[:, None], size - radius[:, None]), moved % size
        )
        if np.abs(push).max() < SETTLED:
            break
    return spheres(position, radius, size)


def spheres(position: Array, radius: Array, size: Array) -> Snapshot:
    """Grains in a box of `size` (3,) at the origin."""
    return resting(position, radius, np.stack([np.zeros(3), size], axis=1))


def with_sheets(pack: Pack, grains: Snapshot) -> Snapshot:
    """The grains, and a sheet of spheres beyond the high wall of every walled side."""
    size = CELL * np.array([1.0, *pack.cells])
    position, radius = [grains.position], [grains.radius]
    for side in pack.sides:
        steps = [np.arange(0.0, edge - 1e-9, SHEET / 2) for edge in size]
        steps[side] = np.array([size[side] - SHEET])
        sheet = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        position.append(sheet)
        radius.append(np.full(len(sheet), SHEET))
    return spheres(np.concatenate(position), np.concatenate(radius), size)


def wall_rows(seed: int, grids: Sequence[int]) -> Iterator[dict[str, object]]:
    """The row of each of `PACKS`; `grids` are two numbers of cells along x, the second finer."""
    return (wall_row(pack, seed, grids) for pack in PACKS)


def wall_row(pack: Pack, seed: int, grids: Sequence[int]) -> dict[str, object]:
    """k of the resolved flow through the open box, grain radii squared, and model over it."""
    grains = relaxed(pack, seed)
    resolved = with_sheets(pack, grains)
    flows = [solve_stokes(resolved, cells=cells, axis=0) for cells in grids]
    truth = extrapolate(*flows)
    share = np.prod(np.ptp(grains.box[1:], axis=1)) / np.prod(np.ptp(resolved.box[1:], axis=1))
    periodic = (True, 1 not in pack.sides, 2 not in pack.sides)
    row: dict[str, object] = {
        "pack": pack.name,
        "grains": pack.count,
        "seed": seed,
        "walls": " ".join("xyz"[side] for side in pack.sides),
        "width_diameters": min(np.ptp(grains.box, axis=1)[list(pack.sides)]) / 2.0,
        "porosity": measure_porosity(grains, periodic=periodic).mean,
        **{f"k_{flow.cells}": flow.k / share for flow in flows},
        "k_truth": truth.k / share,
        "truth_error": truth.relative_error,
    }
    for walls in WALLS:
        network = build_network(grains, periodic=periodic, walls=walls)
        k = whole_permeability(network, LAWS[DEFAULT_LAW](network))[0]
        row[f"{walls.replace('-', '_')}_over_truth"] = k / (truth.k / share)
    return row
