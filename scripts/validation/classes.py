"""What the network model of size classes is held to, from finished runs of spheres.

    python scripts/validation.py classes RUN... --references classes_reference.csv
    python scripts/validation.py classes RUN... --closure classes_closure.csv

`--references` writes one row a case, seed and quantity. `--closure` cuts each run into slabs of a
millimetre and compares their permeability with fines by four laws: the network of all spheres,
which is the reference, and, on the network of the grains alone, the resistance that a deposit adds
by its volume and size, the law of sections, and that of the thesis.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

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
from fdnet.run.finished import FinishedRun
from fdnet.spheres.snapshot import Array

ADDED = 1210.0
"""Factor of the added resistance; fitted on 108 slabs of specimens 1 and 5."""
SLAB, FEWEST, LEAST_LOSS = 1e-3, 3, 0.03
"""Thickness of a slab, m; fines and loss of permeability from which on it counts."""


def added_resistance(network: Network, occupancy: Occupancy, *, factor: float = ADDED) -> Array:
    """Resistance (T, 2) 1/m3 that the fines add to the two halves of each throat.

    In a pore with the void V, the share s of which fines of the mean diameter d fill, it is
    factor s^2 / (d V^(1/3))^(3/2). Fitted (`ADDED`); d is 6 times volume over surface.
    """
    volume, surface = occupancy.pore_solid_volume, occupancy.pore_solid_surface
    held = (volume > 0) & (network.pore_volume > 0)
    added, void = np.zeros(len(volume)), network.pore_volume[held]
    size = 6.0 * volume[held] / surface[held]
    added[held] = factor * (volume[held] / void) ** 2 / (size * np.cbrt(void)) ** 1.5
    return added[network.throat_pores]


def reference_rows(run: FinishedRun) -> Iterator[dict[str, Any]]:
    """One row a quantity of a run."""
    summary, profile = run.summary, run.profile
    first = {"case": run.case.name, "seed": int(summary["seed"])}
    values = {
        name.removesuffix("_count"): summary[name]
        for name in ("supplied_count", "invaded_count", "passed_count", "upstream_count")
    }
    values |= {
        "k_over_k0": 1.0 - summary["k_reduction"],
        "depth_p95_mm": 1e3 * summary["invasion_depth_p95_m"],
        "depth_mm": 1e3 * summary["invasion_depth_m"],
        "cake_mm": 1e3 * summary["cake_thickness_m"],
        "rate_over_initial": summary["rate_over_initial"],
        "filtrate_mm3": 1e9 * summary["filtrate_m3"],
        "physical_time_s": summary["physical_time_s"],
        "liggghts_cpu_s": summary["cpu_seconds"]["liggghts"],
        "python_cpu_s": summary["cpu_seconds"]["python"],
    }
    for section in summary["sections"]:
        number = section["section"]
        values[f"k0_m2_section_{number}"] = section["k_initial_m2"]
        values[f"k_over_k0_section_{number}"] = 1.0 - section["k_reduction"]
        values[f"fines_section_{number}"] = section["fines_count"]
    bins = zip(profile["x_hi_m"], profile["fines_fraction"], strict=True)
    for deep, share in bins:
        values[f"fines_to_{1e3 * float(deep):.2f}_mm"] = round(share * summary["invaded_count"])
    for name, value in values.items():
        yield first | {"quantity": name, "value": value}


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
        laws = {
            "all_spheres": (both, all_conductances(both)),
            "added_resistance": (
                network,
                1.0 / (halves + added_resistance(network, occupancy)).sum(axis=1),
            ),
            "section_archie": (
                network,
                section_archie_damage(network, occupancy, clean).conductance,
            ),
            "thesis": (network, thesis_damage(network, occupancy, clean).conductance),
        }
        initial = whole_permeability(network, clean)[0]
        shares = {name: whole_permeability(*law)[0] / initial for name, law in laws.items()}
        if shares["all_spheres"] < 1.0 - LEAST_LOSS:
            yield {
                "case": run.case.name,
                "seed": int(run.summary["seed"]),
                "from_mm": 1e3 * span[0],
                "fines": inside,
                "k0_m2": initial,
            } | {f"k_over_k0_{name}": value for name, value in shares.items()}


def main(arguments: Sequence[str]) -> int:
    """The command `validation.py classes`."""
    parser = argparse.ArgumentParser(prog="validation.py classes", description=__doc__)
    parser.add_argument("runs", nargs="+", type=path_option, metavar="RUN_DIR")
    parser.add_argument("--references", type=path_option, help="write this table")
    parser.add_argument("--closure", type=path_option, help="write this table")
    given = parser.parse_args(arguments)
    tables: tuple[tuple[Path | None, Any], ...] = (
        (given.references, reference_rows),
        (given.closure, closure_rows),
    )
    for path, rows_of in tables:
        if path is not None:
            write_rows(path, [row for run in given.runs for row in rows_of(fdnet.open_run(run))])
    if given.closure:
        table = pd.read_csv(given.closure)
        for name in ("added_resistance", "section_archie", "thesis"):
            share = table[f"k_over_k0_{name}"] / table["k_over_k0_all_spheres"]
            error = pd.Series(np.log(share), name=name)
            by_case = error.groupby(table["case"]).agg(["count", "mean", "std"])
            print(f"{name}: ln of k over that of all spheres\n{by_case.round(3).to_string()}")
    return 0
