"""How the packs and slabs of known permeability are made and solved: the chapter `truth`.

Packs are periodic cubes. Grains are placed at random and pushed apart; fines are seated on them
one by one. Slabs are cut out of specimens that fdnet's own chain packs and invades: grains in a
box whose sides y and z are periodic, and fines that the drag or the flow drives in. Both are
solved by `fdnet.network.stokes` on several grids and extrapolated to zero spacing.

`--cakes FILE.csv` solves the cakes of cakes.npz, whose table `cakes` has the commands that made
them: docs/validation/cakes.csv.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.files import path_option
from fdnet.network.stokes import Estimate, estimate, solve_slab, solve_stokes
from fdnet.run.cake import standing_cake
from fdnet.run.pipeline import run_case
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting
from validation import truth
from validation.truth import DEPOSIT, GRAINS, MM, RADIUS, read_pack, read_table

BRIDGE_SHARE, REFUSALS = 0.3, 1000
"""Share of the fines that touch three spheres; and after so many refused places in a row the
remaining fines go to the void."""

# Packs, in mm.


class Recipe(NamedTuple):
    """A pack of `grains` with a `porosity`, or the pack `intact` with fines of radius `fine`, mm.

    Radii of grains are uniform between 1 and `ratio` times the smallest. Fines fill `lost` of the
    porosity, all in the first `layer` of the edge along x. `push`: see `relaxed`.
    """

    seed: int
    grains: int = 0
    porosity: float = 0.0
    ratio: float = 1.0
    intact: str = ""
    lost: float = 0.0
    fine: float = 0.1
    layer: float = 1.0
    push: float = 1.0


def made_pack(name: str) -> Snapshot:
    """A pack made anew from its stored recipe."""
    row = next(dict(row) for row in read_table("recipes") if row.pop("name") == name)
    kinds: dict[str, Any] = {"seed": int, "grains": int, "intact": str}
    recipe = Recipe(**{key: kinds.get(key, float)(text) for key, text in row.items() if text})
    return _deposit(recipe) if recipe.intact else random_grains(recipe)


def _cube(position: Array, radius: Array, edge: float, kind: Array | Kind) -> Snapshot:
    return resting(position * MM, radius * MM, np.array([[0.0, edge * MM]] * 3), kind)


def random_grains(recipe: Recipe) -> Snapshot:
    """Grains relaxed from random places, scaled until the porosity is the stated one."""
    rng = np.random.default_rng(recipe.seed)
    radius = 1.0 + (recipe.ratio - 1.0) * rng.random(recipe.grains)
    radius *= RADIUS / radius.mean()
    edge = float((4.0 / 3.0 * np.pi * np.sum(radius**3) / (1.0 - recipe.porosity)) ** (1.0 / 3.0))
    position = relaxed(radius, edge, rng.random((len(radius), 3)) * edge, push=recipe.push)

    def at(scale: float) -> Snapshot:
        return _cube(position * scale, radius, edge * scale, Kind.GRAIN)

    def excess(scale: float) -> float:
        return measure_porosity(at(scale), periodic=(True,) * 3).mean - recipe.porosity

    return at(brentq(excess, 0.95, 1.02, xtol=1e-6))


def relaxed(
    radius: Array, edge: float, position: Array, *, fixed: int = 0, push: float = 1.0
) -> Array:
    """Positions (N, 3) of spheres pushed apart until no overlap exceeds 1e-5 mm, or 1500 times.

    The cube of edge `edge` is periodic; all in mm. The first `fixed` spheres stay where they are,
    and a pair is moved apart by the share `push` of its overlap each time.
    """
    moves = np.arange(len(radius)) >= fixed
    for _ in range(1500):
        tree = cKDTree(position % edge, boxsize=edge)
        pairs = tree.query_pairs(2.0 * radius.max(), output_type="ndarray")
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


def _deposit(recipe: Recipe) -> Snapshot:
    """The intact pack with its fines.

    Fines are seated one by one without overlap (`seat`). After `REFUSALS` the rest are put at
    random into the void, and all fines are relaxed from overlap while the grains stay fixed.
    """
    rng, fine = np.random.default_rng(recipe.seed), recipe.fine
    grains = read_pack(recipe.intact)
    position, radius = grains.position / MM, grains.radius / MM
    edge = float(np.round(grains.box[0, 1] / MM, 9))
    total = len(grains) + round(recipe.lost * edge**3 / (4.0 / 3.0 * np.pi * fine**3))
    refused = 0
    while len(radius) < total:
        relaxing = refused >= REFUSALS
        centre = (
            rng.random(3) * edge
            if relaxing
            else seat(position, radius, len(grains), edge, fine, rng)
        )
        if (
            centre is None
            or centre[0] % edge >= recipe.layer * edge
            or np.any(_gaps(centre, position, radius, edge) < fine - (fine if relaxing else 1e-7))
        ):
            refused += 1
            continue
        refused = refused if relaxing else 0
        position, radius = np.vstack([position, centre % edge]), np.append(radius, fine)
    position = relaxed(radius, edge, position, fixed=len(grains), push=recipe.push)
    kind = np.where(np.arange(total) < len(grains), Kind.GRAIN, Kind.FINE)
    return _cube(position, radius, edge, kind)


def _gaps(place: Array, position: Array, radius: Array, edge: float) -> Array:
    """Distances (N,) mm from a place to the surface of every sphere."""
    apart = position - place
    apart -= edge * np.round(apart / edge)
    return np.asarray(np.linalg.norm(apart, axis=1) - radius)


def seat(
    position: Array, radius: Array, grains: int, edge: float, fine: float, rng: np.random.Generator
) -> Array | None:
    """A place (3,) mm for a fine on a grain; for some, on the two nearest spheres as well.

    None where no place touches all three.
    """
    grain = rng.integers(grains)
    direction = rng.normal(size=3)
    centre = position[grain] + (radius[grain] + fine) * direction / np.linalg.norm(direction)
    if rng.random() > BRIDGE_SHARE:
        return np.asarray(centre)
    others = np.argsort(_gaps(centre, position, radius, edge))
    three = np.array([grain, *[i for i in others[:4] if i != grain][:2]])
    corners = position[three] - edge * np.round((position[three] - centre) / edge)
    return touching_three(corners, radius[three] + fine, rng)


def touching_three(corner: Array, reach: Array, rng: np.random.Generator) -> Array | None:
    """One of the two points at distances `reach` (3,) from `corner` (3, 3), by trilateration."""
    u, v = corner[1] - corner[0], corner[2] - corner[0]
    normal = np.cross(u, v)
    if np.linalg.norm(normal) < 1e-9:
        return None
    square = reach**2
    right = [u @ u + square[0] - square[1], v @ v + square[0] - square[2], 0.0]
    foot = np.linalg.solve(np.array([u, v, normal]), 0.5 * np.array(right))
    height = square[0] - foot @ foot
    if height < 0.0:
        return None
    side = rng.choice([-1.0, 1.0]) * np.sqrt(height)
    return np.asarray(corner[0] + foot + side * normal / np.linalg.norm(normal))


# Specimens, which LIGGGHTS makes.

UNIFORM = {"field": "uniform", "inertia": "none", "upstream": "interstitial"} | {
    "pressure_gradient": False
}
FOLLOWED = {"field": "network", "update_travel": 0.5}
"""The flow follows the deposit; the contacts are ten times as stiff for its larger forces."""


def case_of(name: str) -> Case:
    """The case of a stored specimen, with the default of every key that is not named here."""
    row = next(row for row in read_table("specimens") if row["name"] == name)
    followed, friction = row["followed"] == truth.YES, float(row["friction"])
    grains, fines = (
        {"radius_mm": _radius(row[key]), "friction": friction} for key in ("grain_mm", "fine_mm")
    )
    pack = {"count": int(row["grains"])} if row["grains"] else {"porosity": float(row["porosity"])}
    return case_from(
        {
            "name": name,
            "seed": int(row["seed"]),
            "box": {"size_mm": [2.5, 1.2, 1.2], "sides": "periodic", "wall_friction": 0.0},
            "grains": grains | pack,
            "fines": fines | {"count": int(row["supplied"]), "supply": "slab"},
            "fluid": {"darcy_length_mm": 8.0, "darcy_law": "darcy"},
            "contact": {"restitution": "dry"},
            "drag": FOLLOWED if followed else UNIFORM,
            "run": {"time_step_factor": 0.1} | {"stiffness_N_m": 1e5 if followed else 1e4},
            "analysis": {"sections": 5},
        }
    )


def _radius(cell: str) -> float | list[float]:
    numbers = [float(number) for number in cell.split()]
    return numbers[0] if len(numbers) == 1 else numbers


def made_anew(name: str, runs: Path) -> float:
    """The largest distance, m, between the spheres of a pack or specimen made anew and stored.

    A specimen is run by LIGGGHTS in a folder below `runs`.
    """
    if any(row["name"] == name for row in read_table("recipes")):
        made = made_pack(name)
    else:
        stages = ("pack", "invade", "analyse")
        made = run_case(case_of(name), runs / name, stages=stages).spheres()
    return float(np.abs(made.position - read_pack(name).position).max())


# Grids and their limit.

SLAB_TOLERANCE = 5e-4
"""Of the solves of slabs: k ends 2.2e-4 too high."""


def limit(grids: Mapping[int, float]) -> Estimate:
    """The permeability at zero spacing from k (m2) by the number of cells, two grids or more.

    It is where k0 + C h^2, fitted to the three finest grids by least squares, meets h = 0. The
    error is twice the largest change of k when one of these grids is left out, and at least twice
    the tolerance of the solves; of two grids it is a third of the step of the extrapolation.
    """
    finest = sorted(grids.items())[-3:]
    pairs = combinations(finest, 2)
    ends = [fine + (fine - coarse) / ((n / m) ** 2 - 1.0) for (m, coarse), (n, fine) in pairs]
    if len(finest) == 2:
        return Estimate(k=ends[0], error=abs(1.0 - finest[1][1] / ends[0]) / 3.0)
    cells, k = np.array(finest).T
    best = float(np.polyfit(cells**-2.0, k, 1)[1])
    change = max(abs(end - best) for end in ends)
    return Estimate(k=best, error=max(2.0 * change / best, 2.0 * SLAB_TOLERANCE))


def stored_grids(name: str, solid: str = "") -> dict[int, float]:
    """k (m2) by cells of a pack (along x), or of a slab's `GRAINS` or `DEPOSIT`."""
    table, key = ("slab_grids", "slab") if solid else ("pack_grids", "case")
    return {
        int(row["cells"]): float(row["k_mm2"]) * MM**2
        for row in read_table(table)
        if (row[key], row.get("solid", ""), row.get("axis", "x")) == (name, solid, "x")
    }


def solved_anew(name: str, *, quick: bool = False) -> Iterator[dict[str, Any]]:
    """The three finest stored grids of a pack or slab, or its coarsest, solved anew.

    The rows hold the share by which k differs from the stored one, also at the limit.
    """
    slab = next(truth.slabs([name]), None)
    for solid in (GRAINS, DEPOSIT) if slab else ("",):
        stored = sorted(stored_grids(name, solid).items())
        if not stored:
            raise CaseError(f"truth: {name} is no slab or pack with stored grids")
        kept = dict(stored[:1] if quick else stored[-3:])
        spheres = read_pack(slab.specimen if slab else name)
        spheres = spheres.grains() if solid == GRAINS else spheres
        solve = partial(solve_stokes, spheres)
        if slab:
            solve = partial(solve_slab, spheres, slab.planes, tolerance=SLAB_TOLERANCE)
        new = {cells: solve(cells=cells).k for cells in kept}
        rows = [(str(cells), new[cells], kept[cells]) for cells in kept]
        if not quick:
            rows.append(("limit", limit(new).k, limit(kept).k))
        for cells, k, old in rows:
            row: dict[str, Any] = {"name": name, "solid": solid, "cells": cells, "k_m2": k}
            yield row | {"difference": k / old - 1.0}


# Cakes that LIGGGHTS made, with the fines in flight before them.

CAKES = Path(__file__).with_name("cakes.npz")
CAKE_SIDES = (False, True, True)
CAKE_CELLS = (3.0, 4.5)
"""Cells of the two grids across the Sauter mean radius of the fines."""


def cake_solved(name: str) -> dict[str, Any]:
    """A stored cake between its front and the face by resolved flow, and by the law of fdnet.

    Fines in flight are left out. `error` is the relative error of the resolved resistance.
    """
    spheres = read_pack(name, CAKES)
    fines, resistance, thickness = standing_cake(spheres, CAKE_SIDES)
    solid = spheres.where(spheres.position[:, 0] >= 0.0).joined(fines)
    edge = max(thickness, *np.ptp(spheres.box[1:], axis=1))
    radius = np.sum(fines.radius**3) / np.sum(fines.radius**2)
    grids = [round(across * edge / radius) for across in CAKE_CELLS]
    flows = [solve_slab(solid, (-thickness, 0.0), cells=n, tolerance=1e-3) for n in grids]
    end, law = estimate(*flows, with_fines=True), float(resistance.sum())
    row = {"cake": name, "fines": len(fines), "thickness_mm": thickness / MM}
    row |= {f"grid_{n:g}_1_m": thickness / one.k for n, one in zip(CAKE_CELLS, flows, strict=True)}
    resolved = thickness / end.k
    row |= {"resolved_1_m": resolved, "error": end.error, "law_1_m": law}
    return row | {"law_over_resolved": law / resolved}


# Tables.


def slabs_by_size() -> pd.DataFrame:
    """Number, range of k/k0 and error (%) of the slabs by the size ratio in their names."""
    rows = pd.DataFrame(read_table("slabs"))
    size = rows["slab"].str.extract(r"_r(\d+)")[0].astype(int).rename("grain over fine")
    k, error = rows["k_over_k0"].astype(float), 100.0 * rows["relative_error"].map(truth.percent)
    by = {"slabs": k.groupby(size).size(), "least k/k0": k.groupby(size).min()}
    by |= {"largest k/k0": k.groupby(size).max(), "error, median": error.groupby(size).median()}
    return pd.DataFrame(by | {"error, largest": error.groupby(size).max()})


def main(arguments: Sequence[str]) -> int:
    """The command `python scripts/validation.py truth`."""
    about = "Packs and slabs of known permeability, made or solved anew."
    parser = argparse.ArgumentParser("validation.py truth", description=about)
    parser.add_argument("names", nargs="*", default=["slabO_r5_light"], metavar="NAME")
    parser.add_argument("--quick", action="store_true", help="the coarsest stored grid alone")
    parser.add_argument("--make", action="store_true", help="make the spheres, solve nothing")
    parser.add_argument("--cakes", type=path_option, metavar="FILE.csv", help="the cakes alone")
    parser.add_argument("--runs", type=path_option, default=Path("runs"), help="of LIGGGHTS")
    asked = parser.parse_args(arguments)
    pd.set_option("display.width", 120, "display.precision", 3)
    if asked.cakes:
        table = pd.DataFrame([cake_solved(name) for name in truth.names(CAKES)])
        table.to_csv(asked.cakes, index=False, float_format="%.4g")
        print(table.to_string(index=False))
        return 0
    if asked.make:
        for name in asked.names:
            print(f"{name}: spheres at most {made_anew(name, asked.runs):.2g} m from the stored")
        return 0
    print(slabs_by_size().to_string(), "\n", flush=True)
    rows = [row for name in asked.names for row in solved_anew(name, quick=asked.quick)]
    print(pd.DataFrame(rows).to_string(index=False))
    return 0
