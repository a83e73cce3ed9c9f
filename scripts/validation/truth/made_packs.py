"""Packs for the Stokes truth, made in code from their seeds.

Grains are placed at random and relaxed from overlap; fines are seated one by one and relaxed.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array, Kind, Snapshot
from validation.truth.packs import MM, RADIUS, read_pack, snapshot

FINE_RADIUS = 0.1
BRIDGE_SHARE = 0.3
REFUSALS = 1000
PACKS: dict[str, dict[str, Any]] = {
    "packE_80_eps30": {"seed": 301, "grains": 80, "porosity": 0.30, "push": 0.4},
    "packF_80_eps45": {"seed": 451, "grains": 80, "porosity": 0.45},
    "packG_100_radii12_eps38": {"seed": 381, "grains": 100, "porosity": 0.38, "ratio": 2.0},
    "packH_40_eps40": {"seed": 401, "grains": 40, "porosity": 0.40},
    "packH_r5_d13": {"seed": 402, "intact": "packH_40_eps40", "lost": 0.13},
    "packH_r5_d17": {"seed": 403, "intact": "packH_40_eps40", "lost": 0.17, "push": 0.4},
    "packH_r5_d20": {"seed": 404, "intact": "packH_40_eps40", "lost": 0.20, "push": 0.4},
    "packI_80_eps45": {"seed": 452, "grains": 80, "porosity": 0.45},
    "packJ_80_eps42": {"seed": 421, "grains": 80, "porosity": 0.42},
    "packK_80_eps33": {"seed": 331, "grains": 80, "porosity": 0.33, "push": 0.4},
    "packL_80_eps30": {"seed": 302, "grains": 80, "porosity": 0.30, "push": 0.4},
    "packM_100_radii12_eps35": {"seed": 351, "grains": 100, "porosity": 0.35, "ratio": 2.0},
    "packN_100_radii13_eps40": {"seed": 402, "grains": 100, "porosity": 0.40, "ratio": 3.0},
    "packF_r5_d10": {"seed": 453, "intact": "packF_80_eps45", "lost": 0.10},
    "packE_r5_d4": {"seed": 303, "intact": "packE_80_eps30", "lost": 0.04},
    "packG_r5_d8": {"seed": 382, "intact": "packG_100_radii12_eps38", "lost": 0.08},
    "packH_r5_half": {"seed": 405, "intact": "packH_40_eps40", "lost": 0.08, "layer": 0.5},
    "packH_r5_d1": {"seed": 406, "intact": "packH_40_eps40", "lost": 0.005},
    "packH_r10_d10": {"seed": 407, "intact": "packH_40_eps40", "lost": 0.10, "fine": 0.05},
}
"""The packs by name, each with its seed.

Packs of grains have a number of `grains` and a `porosity`; radii are uniform between 1 and `ratio`
(1 if not given) times the smallest, with a mean of 0.5 mm. Deposits name the `intact` pack and the
porosity `lost` to fines of radius `fine` (0.1 mm if not given), all of them in the first `layer`
of the edge along x (all of it if not given). `push` is explained in `relaxed`.
"""


def relaxed(
    radius: Array, edge: float, position: Array, *, fixed: int = 0, push: float = 1.0
) -> Array:
    """Overlapping spheres pushed apart until no overlap exceeds 1e-5 mm, or 1500 times.

    Args:
        radius: (N,) mm.
        edge: edge of the periodic cube, mm.
        position: (N, 3) mm, changed in place.
        fixed: so many spheres, the first ones, stay where they are.
        push: share of its overlap by which a pair is moved apart each time.

    Returns:
        Positions (N, 3) mm within the cube.
    """
    moves = np.arange(len(radius)) >= fixed
    for _ in range(1500):
        pairs = cKDTree(position % edge, boxsize=edge).query_pairs(
            2.0 * radius.max(), output_type="ndarray"
        )
        apart = position[pairs[:, 0]] - position[pairs[:, 1]]
        apart -= edge * np.round(apart / edge)
        distance = np.linalg.norm(apart, axis=1)
        overlap = radius[pairs].sum(axis=1) - distance
        pushed = (overlap > 0.0) & moves[pairs].any(axis=1)
        if not np.any(overlap[pushed] > 1e-5):
            break
        share = moves[pairs[pushed]] / moves[pairs[pushed]].sum(axis=1, keepdims=True)
        move = push * (overlap / distance)[pushed, None] * apart[pushed]
        np.add.at(position, pairs[pushed, 0], share[:, :1] * move)
        np.add.at(position, pairs[pushed, 1], -share[:, 1:] * move)
    return position % edge


def made_grains(name: str) -> tuple[Snapshot, float]:
    """Grains relaxed from random places, and the edge of their cube, mm.

    The edge is set so that the porosity, overlap counted once, is the stated one.
    """
    wish = PACKS[name]
    rng = np.random.default_rng(wish["seed"])
    radius = 1.0 + (wish.get("ratio", 1.0) - 1.0) * rng.random(wish["grains"])
    radius *= RADIUS / radius.mean()
    volume = 4.0 / 3.0 * np.pi * np.sum(radius**3)
    edge = (volume / (1.0 - wish["porosity"])) ** (1.0 / 3.0)
    position = relaxed(
        radius, edge, rng.random((len(radius), 3)) * edge, push=wish.get("push", 1.0)
    )
    kind = np.full(len(radius), Kind.GRAIN)

    def excess(scale: float) -> float:
        pack = snapshot(position * scale, radius, edge * scale, kind)
        return measure_porosity(pack, periodic=(True,) * 3).mean - wish["porosity"]

    scale = brentq(excess, 0.95, 1.02, xtol=1e-6)
    return snapshot(position * scale, radius, edge * scale, kind), edge * scale


def made_deposit(wish: dict[str, Any], folder: Path) -> tuple[Snapshot, float]:
    """The intact pack that `wish` names (as in `PACKS`) with its fines, and its edge, mm.

    The fines are placed one by one without overlap: a share of 0.3 of them touches three spheres
    (fines may be among these), the others lie uniformly over the surface of the grains. After
    `REFUSALS` refusals in a row the remaining fines are put at random into the void, and all fines
    are relaxed from overlap while the grains stay fixed.
    """
    rng = np.random.default_rng(wish["seed"])
    grains, edge = read_pack(folder / f"{wish['intact']}.csv")
    position, radius = grains.position / MM, grains.radius / MM
    fine, layer = wish.get("fine", FINE_RADIUS), wish.get("layer", 1.0) * edge
    total = len(grains) + round(wish["lost"] * edge**3 / (4.0 / 3.0 * np.pi * fine**3))
    refused = 0
    while len(radius) < total:
        relaxing = refused >= REFUSALS
        centre = (
            rng.random(3) * edge
            if relaxing
            else seat(position, radius, len(grains), edge, fine, rng)
        )
        least = -fine if relaxing else -1e-7
        if (
            centre is None
            or centre[0] % edge >= layer
            or np.any(gaps(centre, position, radius, edge, fine) < least)
        ):
            refused += 1
            continue
        refused = refused if relaxing else 0
        position, radius = np.vstack([position, centre % edge]), np.append(radius, fine)
    position = relaxed(radius, edge, position, fixed=len(grains), push=wish.get("push", 1.0))
    kind = np.where(np.arange(total) < len(grains), Kind.GRAIN, Kind.FINE)
    return snapshot(position, radius, edge, kind), edge


def gaps(centre: Array, position: Array, radius: Array, edge: float, fine: float) -> Array:
    """Free distances (N,) mm from a fine of radius `fine` at `centre` to every sphere."""
    apart = position - centre
    apart -= edge * np.round(apart / edge)
    return np.linalg.norm(apart, axis=1) - radius - fine


def seat(
    position: Array, radius: Array, grains: int, edge: float, fine: float, rng: np.random.Generator
) -> Array | None:
    """A place (3,) mm for a fine: on a grain, or in contact with that grain and the two spheres
    nearest to the place; None when no such place exists."""
    grain = rng.integers(grains)
    direction = rng.normal(size=3)
    centre = position[grain] + (radius[grain] + fine) * direction / np.linalg.norm(direction)
    if rng.random() > BRIDGE_SHARE:
        return centre
    others = np.argsort(gaps(centre, position, radius, edge, fine))
    three = np.array([grain, *[i for i in others[:4] if i != grain][:2]])
    corners = position[three] - edge * np.round((position[three] - centre) / edge)
    return touching_three(corners, radius[three] + fine, rng)


def touching_three(corner: Array, reach: Array, rng: np.random.Generator) -> Array | None:
    """One of the two points at distances `reach` (3,) from `corner` (3, 3), by trilateration."""
    u, v = corner[1] - corner[0], corner[2] - corner[0]
    normal = np.cross(u, v)
    if np.linalg.norm(normal) < 1e-9:
        return None
    right = 0.5 * np.array(
        [u @ u + reach[0] ** 2 - reach[1] ** 2, v @ v + reach[0] ** 2 - reach[2] ** 2, 0.0]
    )
    foot = np.linalg.solve(np.array([u, v, normal]), right)
    height = reach[0] ** 2 - foot @ foot
    if height < 0.0:
        return None
    return (
        corner[0]
        + foot
        + rng.choice([-1.0, 1.0]) * np.sqrt(height) * normal / np.linalg.norm(normal)
    )


def write_pack(path: Path, pack: Snapshot, edge: float, note: str) -> None:
    """Writes a pack file in mm with 7 significant digits; `note` stands in its first line."""
    names = {Kind.GRAIN: "grain", Kind.FINE: "fine"}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        file.write(
            f"# periodic cube, edge {edge:.9g} mm; lengths in mm; {note}\nx,y,z,radius,kind\n"
        )
        for place, radius, kind in zip(
            pack.position / MM, pack.radius / MM, pack.kind, strict=True
        ):
            file.write(
                ",".join(f"{value:.7g}" for value in (*place, radius))
                + f",{names[Kind(int(kind))]}\n"
            )
