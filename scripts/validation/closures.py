"""What the laws of the size classes are measured on, from finished runs of spheres.

    python scripts/validation.py closures RUN... --closure classes_closure.csv
    python scripts/validation.py closures RUN... --arrivals classes_arrivals.csv

`--closure` cuts runs into slabs of a
millimetre and gives their permeability with fines by the network of all spheres, the reference,
and, on that of the grains, by the resistance a deposit adds, by sections and by the thesis's law.
`--arrivals` follows fines of one size and counts which throats wider than they are stop them; it
wants states about a fine's diameter of travel apart (`run.checkpoint_ms`).
"""

import argparse
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

import fdnet
from fdnet.errors import NetworkError
from fdnet.files import path_option
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws.damage import thesis_damage
from fdnet.network.laws.deposit_resistances import grain_resistances
from fdnet.network.laws.section_archie import section_archie_damage
from fdnet.network.network import Network, build_network
from fdnet.network.states import all_conductances, cut_out
from fdnet.report.tables import write_rows
from fdnet.run.bridging import wilsons_band
from fdnet.run.finished import FinishedRun
from fdnet.spheres.geometry import neighbour_tree, wrapped
from fdnet.spheres.snapshot import Array

ADDED = 1210.0
"""Factor of the added resistance; fitted on 108 slabs of specimens 1 and 5."""
SLAB, FEWEST = 1e-3, 3
"""Thickness of a slab, m, and how many fines it holds at least to count."""
RATIOS = (0.0, 0.33, 0.4, 0.5, 0.65, 0.8, 1.0)
LOADS = (0.0, 1e-9, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, np.inf)
"""Edges of the classes of d over the throat, and of the filled share of its two pores."""
DETOUR, AT_REST = 20.0, 3
"""Throats that a way takes rather than one of half the fine's size; states in which it rests."""


def added_resistance(network: Network, occupancy: Occupancy, *, factor: float = ADDED) -> Array:
    """Resistance (T, 2) 1/m3 that the fines add to the two halves of each throat.

    It is factor s^2 / (d V^(1/3))^(3/2) in a pore of the void V, the share s of which fines of
    the mean diameter d (6 times volume over surface) fill.
    """
    volume, surface = occupancy.pore_solid_volume, occupancy.pore_solid_surface
    held = (volume > 0) & (network.pore_volume > 0)
    added, void = np.zeros(len(volume)), network.pore_volume[held]
    size = 6.0 * volume[held] / surface[held]
    added[held] = factor * (volume[held] / void) ** 2 / (size * np.cbrt(void)) ** 1.5
    return added[network.throat_pores]


def closure_rows(run: FinishedRun) -> Iterator[dict[str, Any]]:
    """One row a slab that fines damage: its permeability with fines over that without."""
    spheres, around = run.spheres(), (False, *run.case.periodic[1:])
    grains, fines = spheres.grains(), spheres.fines()
    fines = fines.where(fines.position[:, 0] > -fines.radius)
    for low in np.arange(0.0, float(spheres.box[0, 1]) - 0.5 * SLAB, SLAB):
        span = (float(low), float(low) + SLAB)
        inside = int(np.sum((fines.position[:, 0] >= span[0]) & (fines.position[:, 0] < span[1])))
        if inside < FEWEST:
            continue
        try:
            network, both = (
                build_network(cut_out(one, span, around), periodic=around)
                for one in (grains, grains.joined(fines))
            )
        except NetworkError:  # too few grains for a network of their own: no slab to compare
            continue
        halves, occupancy = grain_resistances(network), measure_occupancy(network, fines)
        clean = 1.0 / halves.sum(axis=1)
        added = halves + added_resistance(network, occupancy)
        sections = section_archie_damage(network, occupancy, clean).conductance
        laws = {
            "all_spheres": (both, all_conductances(both)),
            "added_resistance": (network, 1.0 / added.sum(axis=1)),
            "section_archie": (network, sections),
            "thesis": (network, thesis_damage(network, occupancy, clean).conductance),
        }
        initial = whole_permeability(network, clean)[0]
        shares = {name: whole_permeability(*law)[0] / initial for name, law in laws.items()}
        first = {"case": run.case.name, "seed": run.summary["seed"], "from_mm": 1e3 * span[0]}
        ratios = {f"k_over_k0_{name}": value for name, value in shares.items()}
        yield first | {"fines": inside, "k0_m2": initial} | ratios


def arrivals(run: FinishedRun) -> Iterator[dict[str, Any]]:
    """One row for each time that a fine passes a throat, or stops for good before it.

    A fine is in the pore whose place is nearest, and rests once it stays there to the end. Between
    two pores it takes the way of fewest throats, and narrower ones where no other leads there. It
    stops at the throat of its pore that the clean flow leaves by and whose middle is nearest.
    """
    network, fine = run.network(), run.spheres().fines()
    box, sides = network.box, (False, *run.case.periodic[1:])
    size, group, width = np.ptp(box, axis=1), network.pore_group, 2.0 * network.throat_radius
    diameter = 2.0 * float(fine.radius.mean())
    flux = whole_permeability(network, 1.0 / grain_resistances(network).sum(axis=1))[1].throat_flux
    void = np.bincount(group, network.pore_volume * network.pore_share)
    ends, middle = group[network.throat_pores], network.throat_corner.mean(axis=1)
    widest: dict[tuple[int, int], int] = {}
    for throat in np.argsort(width):
        if width[throat] > 0 and ends[throat, 0] != ends[throat, 1]:
            for pair in (tuple(ends[throat]), tuple(ends[throat][::-1])):
                widest[pair] = throat
    cost = [1 + DETOUR * max(diameter / width[t] - 1, 0) for t in widest.values()]
    graph = coo_matrix((cost, np.transpose(list(widest))), shape=(len(void),) * 2).tocsr()
    before = dijkstra(graph, return_predecessors=True)[1]
    tree = neighbour_tree(network.pore_position, box, periodic=sides)
    seen: dict[int, list[tuple[int, int, Array]]] = {}
    states = [*(run.path / "invade" / "post").glob("*.dump")]
    for number, path in enumerate(sorted(states, key=lambda one: int(one.stem.split("_")[1]))):
        fines = fdnet.read_spheres(path).fines()
        fines = fines.where((fines.position[:, 0] > 0) & (fines.position[:, 0] < box[0, 1]))
        where = group[tree.query(wrapped(fines.position, box, sides) - box[:, 0])[1]]
        for name, pore, place in zip(fines.id, where, fines.position, strict=True):
            seen.setdefault(int(name), []).append((number, int(pore), place))
    events, resting = [], []
    for way in seen.values():
        for (_, start, _), (number, pore, _) in pairwise(way):
            while pore != start and before[start, pore] >= 0:
                events.append((number, False, widest[before[start, pore], pore]))
                pore = int(before[start, pore])
        number, pore, place = way[-1]
        stay = next((k for k, one in enumerate(way[::-1]) if one[1] != pore), len(way))
        if number < len(states) - 1 or stay <= AT_REST:
            continue
        forth = np.where(flux > 0, ends[:, 0], ends[:, 1])
        own = np.flatnonzero((forth == pore) & (width > 0) & (ends[:, 0] != ends[:, 1]))
        if len(own):
            apart = middle[own] - place
            apart[:, 1:] -= size[1:] * np.round(apart[:, 1:] / size[1:])
            nearest = own[np.argmin(np.linalg.norm(apart, axis=1))]
            events.append((way[-stay][0], True, nearest))
            resting.append((way[-stay][0], pore))
    held, one = np.array(resting).reshape(-1, 2), np.pi / 6.0 * diameter**3
    for number, stopped, throat in events:
        if diameter < width[throat]:
            there = (held[:, 0] < number - 1) & np.isin(held[:, 1], ends[throat])
            yield {
                "diameter_um": round(1e6 * diameter),
                "concentration": run.case.model_dump()["fines"]["concentration"],
                "ratio": diameter / width[throat],
                "load": there.sum() * one / void[ends[throat]].sum(),
                "stopped": stopped,
            }


def arrival_table(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Arrivals and stops by class of ratio and load, with Wilson's 95 % band of the share."""
    table = pd.DataFrame(rows)
    for name, edges in (("ratio", RATIOS), ("load", LOADS)):
        number = np.searchsorted(edges, table.pop(name), side="right") - 1
        table[f"{name}_lo"] = np.array(edges)[number]
        table[f"{name}_hi"] = np.array(edges)[number + 1]
    keys = ["diameter_um", "concentration", "ratio_lo", "ratio_hi", "load_lo", "load_hi"]
    counts = table.groupby(keys)["stopped"].agg(arrivals="size", stopped="sum").reset_index()
    bands = [
        wilsons_band(*pair) for pair in zip(counts["stopped"], counts["arrivals"], strict=True)
    ]
    counts["share"] = counts["stopped"] / counts["arrivals"]
    return counts.assign(share_low=[b[0] for b in bands], share_high=[b[1] for b in bands])


def main(arguments: Sequence[str]) -> int:
    """The command `validation.py closures`."""
    parser = argparse.ArgumentParser(prog="validation.py closures", description=__doc__)
    parser.add_argument("runs", nargs="+", type=path_option, metavar="RUN_DIR")
    tables = {"closure": closure_rows, "arrivals": arrivals}
    for name in tables:
        parser.add_argument(f"--{name}", type=path_option, help="write this table")
    given = parser.parse_args(arguments)
    for name, rows_of in tables.items():
        if path := getattr(given, name):
            rows = [row for run in given.runs for row in rows_of(fdnet.open_run(run))]
            write_rows(path, arrival_table(rows) if name == "arrivals" else rows)
    return 0
