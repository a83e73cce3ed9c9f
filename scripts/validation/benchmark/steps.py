"""fdnet's network half on one pack, step by step, in this process.

`validation.benchmark.network` runs it as a program:

    steps.py GRAINS FINES FOLDER      a tiled pack; spheres and networks for the peers go to FOLDER
    steps.py --pack PACK.csv FOLDER   k of a truth pack, periodic all round
    steps.py --walled GRAINS FOLDER   grains of a tiled pack in a box of walls
    steps.py --spheres COUNT FOLDER   grains and fines of a tiled truth pack in one network

It prints one line `RESULT {json}`.
"""

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from fdnet.names import ALL_SPHERES, DEFAULT_LAW, SECTION_ARCHIE
from fdnet.network import network as tessellation
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.permeability import analyse
from fdnet.network.states import all_conductances
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting
from validation.benchmark.clock import Clock
from validation.truth import packs
from validation.truth.packs import read_pack, shaken, truth_folder

TILE, TILE_WITH_FINES = "packH_40_eps40.csv", "packH_r5_d13.csv"
SHAKE = 0.02
FINE = 0.1
SIDES, BOX = (False, True, True), (False, False, False)
"""Sides of the periodic packs, and of the same in a box of walls."""
SECTIONS = 8
"""Sections of the analysis by `all-spheres`, those of a case by default."""
DECADES, CLOSED = 12, 0.1
MOST_GRAINS_STIFF = 200_000
COMPILING = 600
"""Grains of a pack for which the compiled tessellation is used."""


def tiled(grains: int, rng: np.random.Generator) -> Snapshot:
    """About `grains` grains: the tile repeated, each grain moved by up to 2 % of its radius."""
    pack, _ = read_pack(truth_folder() / TILE)
    across = max(round((grains / len(pack)) ** (1 / 3)), 1)
    times = np.array([max(round(grains / len(pack) / across**2), 1), across, across])
    return shaken(packs.tiled(pack, times), SHAKE, rng)


def seated(grains: Snapshot, count: int, rng: np.random.Generator) -> Snapshot:
    """`count` fines on the surfaces of equal grains, in no other grain."""
    size, big, small = (
        grains.box[:, 1],
        float(grains.radius.max()),
        FINE * float(grains.radius.max()),
    )
    tree = cKDTree(np.minimum(grains.position, size * (1 - 1e-15)), boxsize=size)
    centres = np.zeros((0, 3))
    while len(centres) < count:
        host = rng.integers(len(grains), size=2 * (count - len(centres)) + 10)
        normal = rng.normal(size=(len(host), 3))
        normal = (big + small) * normal / np.linalg.norm(normal, axis=1)[:, None]
        place = grains.position[host] + normal
        place = np.minimum(place % size, size * (1 - 1e-15))
        centres = np.concatenate([centres, place[tree.query(place)[0] > big + 0.999 * small]])
    return resting(centres[:count], small, grains.box, Kind.FINE)


def _timed_call(clock: Clock, work: Callable[..., Any], *given: Any, **named: Any) -> Any:
    return clock.timed("tessellate", lambda: work(*given, **named))


def build_timed(clock: Clock, grains: Snapshot, sides: tuple[bool, ...]) -> tessellation.Network:
    """build_network with the tessellation apart from the rest.

    In a box of walls the walls hold the fluid.
    """
    spent, work = Clock(), tessellation.tessellate
    tessellation.tessellate = partial(_timed_call, spent, work)
    walls = "slip" if any(sides) else "no-slip"
    network = clock.timed(
        "geometry", lambda: tessellation.build_network(grains, periodic=sides, walls=walls)
    )
    tessellation.tessellate = work
    clock.steps = {"tessellate": spent.steps["tessellate"], **clock.steps}
    for name in ("cpu_s", "wall_s"):
        clock.steps["geometry"][name] -= spent.steps["tessellate"][name]
    return network


def run_intact(
    clock: Clock, grains: Snapshot, sides: tuple[bool, ...]
) -> tuple[tessellation.Network, Array, float]:
    """The steps without fines; the network, its conductances and its inflow."""
    network = build_timed(clock, grains, sides)
    intact = clock.timed("conductance", lambda: LAWS[DEFAULT_LAW](network))
    return network, intact, clock.timed("solve", lambda: solve_flow(network, intact)).inflow


def run_walled(grains: Snapshot) -> Clock:
    """The steps without fines in a box of walls."""
    clock = Clock()
    run_intact(clock, grains, BOX)
    clock.steps["total intact"] = clock.total(list(clock.steps))
    return clock


def run_steps(
    grains: Snapshot, fines: Snapshot | None
) -> tuple[Clock, tessellation.Network, Array, float]:
    """All steps of an analysis on default laws; also the intact conductances and their inflow."""
    clock = Clock()
    network, intact, inflow = run_intact(clock, grains, SIDES)
    if fines is not None:
        occupancy = clock.timed("occupancy", lambda: measure_occupancy(network, fines))
        damage = clock.timed(
            "damage", lambda: DAMAGE_LAWS[SECTION_ARCHIE](network, occupancy, intact)
        )
        clock.timed("solve damaged", lambda: solve_flow(network, damage.conductance))
        clock.timed("porosity", lambda: measure_porosity(grains.joined(fines), periodic=SIDES))
    clock.timed("porosity", lambda: measure_porosity(grains, periodic=SIDES))
    every, first = list(clock.steps), ["tessellate", "geometry", "conductance", "solve"]
    clock.steps |= {"total": clock.total(every), "total intact": clock.total(first)}
    return clock, network, intact, inflow


def leave(
    folder: Path, network: tessellation.Network, states: dict[str, Array], inflow: dict[str, float]
) -> None:
    """Networks of the given conductances and their inflow, in `folder` for the peers."""
    x, (low, high) = network.pore_position[:, 0], network.box[0]
    tolerance = 1e-9 * (high - low)
    for state, conductance in states.items():
        np.savez(
            folder / f"{state}.npz",
            pairs=network.throat_pores,
            position=network.pore_position,
            conductance=conductance * network.throat_share * 1e9,
            inlet=x <= low + tolerance,
            outlet=x >= high - tolerance,
        )
    (folder / "inflow.json").write_text(
        json.dumps({state: 1e9 * value for state, value in inflow.items()})
    )


def leave_spheres(folder: Path, pack: Snapshot) -> None:
    """Spheres in mm, in `folder` for the peers."""
    np.savez(
        folder / "spheres.npz",
        position=pack.position * 1e3,
        radius=pack.radius * 1e3,
        size=np.ptp(pack.box, axis=1) * 1e3,
    )


def tiled_result(wanted: int, fine_count: int, folder: Path) -> dict[str, Any]:
    """Seconds and memory of every step on a tiled pack."""
    rng = np.random.default_rng(1)
    for grains in (tiled(40, rng), tiled(COMPILING, rng)):  # compiles and loads
        run_steps(grains, seated(grains, 100, rng))
        run_walled(grains)
    grains = tiled(wanted, rng)
    fines = seated(grains, fine_count, rng) if fine_count else None
    clock, network, intact, flux = run_steps(grains, fines)
    states, inflow = {"intact": intact}, {"intact": flux}
    if len(grains) <= MOST_GRAINS_STIFF:
        stiff = intact * 10.0 ** rng.uniform(-DECADES, 0, len(intact))
        states |= {"stiff": stiff, "clogged": stiff * (rng.random(len(intact)) >= CLOSED)}
    for state in list(states)[1:]:
        work = partial(solve_flow, network, states[state])
        inflow[state] = clock.timed(f"solve {state}", work).inflow
    leave(folder, network, states, inflow)
    leave_spheres(folder, grains)
    count = len(network.pore_share)
    del network, intact, states
    walled = run_walled(grains).steps
    return {"grains": len(grains), "pores": count, "steps": clock.steps, "walled": walled}


def walled_result(wanted: int, folder: Path) -> dict[str, Any]:
    """Seconds and memory of every step on a tiled pack in a box of walls."""
    rng = np.random.default_rng(1)
    for count in (40, 4 * COMPILING):  # compiles and loads
        run_walled(tiled(count, rng))
    grains = tiled(wanted, rng)
    leave_spheres(folder, grains)
    return {"grains": len(grains), "fines": 0, "steps": run_walled(grains).steps}


def run_spheres(spheres: Snapshot) -> tuple[Clock, int]:
    """The steps of the network of all `spheres`, and the number of its pores.

    Whole analyses by `section-archie`, on the network of the grains, and by `all-spheres` in
    `SECTIONS` sections come last.
    """
    clock = Clock()
    pores = _run_together(clock, spheres)
    whole = partial(analyse, spheres, periodic=SIDES)
    clock.timed(f"total {SECTION_ARCHIE}", partial(whole, damage_law=SECTION_ARCHIE))
    in_sections = partial(whole, damage_law=ALL_SPHERES, sections=SECTIONS)
    clock.timed(f"total {ALL_SPHERES}, {SECTIONS} sections", in_sections)
    return clock, pores


def _run_together(clock: Clock, spheres: Snapshot) -> int:
    """The steps of the network of all `spheres`; returns the number of its pores."""
    network = build_timed(clock, spheres, SIDES)
    conductance = clock.timed("conductance", lambda: all_conductances(network))
    clock.timed("solve", lambda: solve_flow(network, conductance))
    clock.steps["total spheres"] = clock.total(list(clock.steps))
    return len(network.pore_share)


def tiled_spheres(wanted: int, rng: np.random.Generator) -> Snapshot:
    """About `wanted` spheres: grains and fines of a truth pack, tiled and moved as in `tiled`."""
    pack, _ = read_pack(truth_folder() / TILE_WITH_FINES)
    across = max(round((wanted / len(pack)) ** (1 / 3)), 1)
    times = np.array([max(round(wanted / len(pack) / across**2), 1), across, across])
    return shaken(packs.tiled(pack, times), SHAKE, rng)


def spheres_result(wanted: int, folder: Path) -> dict[str, Any]:
    """Seconds and memory of every step of `all-spheres` and `section-archie` on a tiled pack."""
    rng = np.random.default_rng(1)
    run_spheres(tiled_spheres(COMPILING, rng))  # compiles and loads
    run_spheres(tiled_spheres(8 * COMPILING, rng))
    spheres = tiled_spheres(wanted, rng)
    clock, pores = run_spheres(spheres)
    leave_spheres(folder, spheres)
    counts = {"grains": len(spheres.grains()), "fines": len(spheres.fines())}
    return {**counts, "pores": pores, "steps": clock.steps}


def pack_result(path: Path, folder: Path) -> dict[str, Any]:
    """k (mm2) of one truth pack by the default laws."""
    pack, _ = read_pack(path)
    leave_spheres(folder, pack)
    fines = pack if len(pack.fines()) else None
    analysis = analyse(pack.grains(), fines, periodic=(True, True, True))
    counts = {
        "grains": len(pack.grains()),
        "fines": len(pack.fines()),
        "pores": len(analysis.network.pore_share),
    }
    return {"k": analysis.k_damaged * 1e6, **counts}


SIZED = {"--walled": walled_result, "--spheres": spheres_result}


def main() -> None:
    folder = Path(sys.argv[3])
    if sys.argv[1] == "--pack":
        result = pack_result(Path(sys.argv[2]), folder)
    elif sys.argv[1] in SIZED:
        result = SIZED[sys.argv[1]](int(sys.argv[2]), folder)
    else:
        result = tiled_result(int(sys.argv[1]), int(sys.argv[2]), folder)
    print("RESULT", json.dumps(result))


if __name__ == "__main__":
    main()
