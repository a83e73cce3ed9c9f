"""The fast model against LIGGGHTS on the same packs: runs of ensembles, one row a run.

python scripts/validation.py size-classes runs/specimen1 runs/specimen5 --csv size_classes.csv
python scripts/validation.py size-classes --cost --csv class_costs.csv

With --cost it measures time and memory against grains and classes. Else each folder is
that of `fdnet ensemble`, whose runs follow the deposit with spheres. The grains of each run are
taken, and its mud is let in as size classes.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fdnet.case.case import InvasionCase
from fdnet.case.file import case_path, read_case
from fdnet.classes.invasion import ClassInvasion, invade_classes
from fdnet.files import path_option
from fdnet.network.flow.sections import FIRST, inplace_permeability
from fdnet.report.tables import write_rows
from fdnet.run.by_classes import class_model, spheres_at_the_end
from fdnet.run.finished import FinishedRun, open_run
from fdnet.scales.scales import invasion_scales
from validation.benchmark import grains_of
from validation.benchmark_child import timed

QUANTITIES = ("first_mm_k_over_k0", "k_over_k0", "depth_p95_m", "fines_inside", "share_passed")


def both(run: FinishedRun) -> dict[str, Any]:
    """The numbers of a run with spheres, and those of the fast model on its grains."""
    case, summary = run.case, run.summary
    assert isinstance(case, InvasionCase)
    layers, entered = run.layers, summary["invaded_count"] + summary["passed_count"]
    thick = (layers.x_hi_m - layers.x_lo_m).to_numpy()
    before, after = (
        float(np.sum(thick / layers[f"k_{one}_m2"])) for one in ("initial", "damaged")
    )
    spheres = (
        before / after,
        summary["k_damaged_m2"] / summary["k_initial_m2"],
        summary["invasion_depth_p95_m"],
        summary["invaded_count"],
        summary["passed_count"] / max(entered, 1),
    )
    start = time.process_time()
    model = class_model(case, invasion_scales(case), run.spheres("initial"))
    end = invade_classes(model.sieve, model.classes, model.course, model.flow)
    seconds = time.process_time() - start
    counts = model.counted(end.by_class)
    x = spheres_at_the_end(case, model, end).position[:, 0]
    edges = np.array([0.0, min(FIRST, case.size_m[0])])
    clean, flow = (model.flow(one, None).flow for one in (np.ones_like(end.kept), end.kept))
    intact = inplace_permeability(model.network, clean, edges, model.sieve.halves)
    damaged = inplace_permeability(model.network, flow, edges, model.sieve.halves / end.kept)
    passed, number = counts.history[-1].passed, counts.history[-1].invaded
    fast = (
        float(damaged[0] / intact[0]),
        end.rows[-1]["k_over_k0"],
        float(np.quantile(x[x >= 0], 0.95)) if number else 0.0,
        number,
        passed / max(number + passed, 1),
    )
    cost = summary["cpu_seconds"]
    return {
        "case": case.name,
        "seed": case.seed,
        **{f"liggghts_{name}": value for name, value in zip(QUANTITIES, spheres, strict=True)},
        **{f"network_{name}": value for name, value in zip(QUANTITIES, fast, strict=True)},
        "liggghts_cpu_s": cost["liggghts"] + cost["python"],
        "network_cpu_s": seconds,
    }


def bands(rows: pd.DataFrame) -> Iterator[str]:
    """By case: means of both, the 95 % band of LIGGGHTS's seeds (two deviations), the ratio."""
    for case, some in rows.groupby("case", sort=False):
        yield f"{case}, {len(some)} seeds:"
        for name in QUANTITIES:
            own, fast = some[f"liggghts_{name}"], some[f"network_{name}"]
            mean, spread = float(own.mean()), 2.0 * float(own.std())
            within = abs(float(fast.mean()) - mean) <= spread
            yield (
                f"  {name:<20} LIGGGHTS {mean:.4g} +- {spread:.2g}, network {fast.mean():.4g} "
                f"({fast.mean() / mean if mean else np.nan:.2f} times; "
                f"{'within' if within else 'outside of'} the band)"
            )
        cost = some["liggghts_cpu_s"].mean() / some["network_cpu_s"].mean()
        yield f"  time: 1/{cost:.0f} of the CPU seconds"


COSTS = ((2_000, 8), (2_000, 20), (10_000, 20), (100_000, 20))
"""Grains and classes."""
MUD = 'fines={sizes={D10="5 um",D50="25 um",D90="70 um"},concentration="5 %"}'
GRAIN = 0.2e-3
"""Radius, m."""


def cost(grains: int, classes: int) -> dict[str, Any]:
    """CPU seconds and memory of the whole mud in a pack made by `benchmark.grains_of`.

    It may bring as much solids as the pores hold.
    """
    pack = grains_of(grains, np.random.default_rng(1))
    scale = GRAIN / float(pack.radius.max())
    pack = replace(
        pack, position=scale * pack.position, radius=scale * pack.radius, box=scale * pack.box
    )
    size = ",".join(f'"{1e3 * side:.9g} mm"' for side in np.ptp(pack.box, axis=1))
    keys = [f"box.size=[{size}]", f'grains={{radius="{1e3 * GRAIN} mm",porosity="40 %"}}', MUD]
    keys.append(f"invasion={{method='network',classes={classes}}}")
    case = read_case(case_path("quick"), assignments=keys)
    assert isinstance(case, InvasionCase)

    def let_in() -> ClassInvasion:
        model = class_model(case, invasion_scales(case), pack)
        course = replace(model.course, supply=float(model.sieve.void.sum()))
        return invade_classes(model.sieve, model.classes, course, model.flow)

    row, end = timed("invade", let_in)
    return {
        "grains": len(pack),
        "classes": classes,
        "pores": len(end.solids.in_pores),
        "steps": len(end.rows) - 1,
        "stop_reason": end.stop_reason,
        "k_over_k0": end.rows[-1]["k_over_k0"],
        "mass_missing": float(np.abs(end.solids.missing).max()),
        "cpu_s": row["cpu_s"],
        "peak_GB": row["peak_MB"] / 1024,
    }


def main(arguments: Sequence[str]) -> int:
    """Compares the runs of the folders that `arguments` name."""
    parser = argparse.ArgumentParser(prog="validation.py size-classes", description=__doc__)
    parser.add_argument("ensembles", nargs="*", type=path_option, metavar="ENSEMBLE")
    parser.add_argument("--cost", action="store_true", help="measure time and memory")
    parser.add_argument("--csv", type=path_option, required=True, metavar="FILE")
    options = parser.parse_args(arguments)
    if options.cost == bool(options.ensembles):
        parser.error("give the folders of ensembles, or --cost")
    if options.cost:
        costs: list[dict[str, Any]] = []
        for grains, classes in COSTS:
            costs.append(cost(grains, classes))
            write_rows(options.csv, costs)
            print(costs[-1], flush=True)
        return 0
    runs = [run for one in options.ensembles for run in finished_in(one)]
    if not runs:
        parser.error("no finished run in runs/ of these folders: give those of ensembles")
    rows = [both(open_run(one)) for one in runs]
    write_rows(options.csv, rows)
    print("\n".join(bands(pd.DataFrame(rows))))
    return 0


def finished_in(ensemble: Path) -> list[Path]:
    """The finished runs of an ensemble."""
    return sorted(one.parent for one in ensemble.glob("runs/*/manifest.json"))
