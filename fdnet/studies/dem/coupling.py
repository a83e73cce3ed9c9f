"""The same invasion with different fluids: one row for each fluid and seed of a case.

It is not a study with a knee: it shows what a coupled drag changes and what it costs.
"""

import math
import re
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fdnet.case.file import read_case
from fdnet.run.folder import MANIFEST
from fdnet.run.pipeline import run_case
from fdnet.studies.engine.csv_rows import write_named
from fdnet.studies.engine.runner import child_core_seconds

LAWS = ("analysis.law=lubrication", "analysis.damage_law=section-archie")
SHARED = (
    "fines.supply=slab",
    "drag.upstream=darcy",
    "fluid.velocity_m_s=5.4",
    "run.duration_ms=2.0",
)
"""The supply at the Darcy velocity, and the pressure that drives it, over the specimen alone."""
CROWD = ("drag.scheme=implicit", "drag.crowd=beetstra")
NETWORK = ("drag.field=network", "drag.pressure_gradient=true")
FLUIDS: dict[str, tuple[str, ...]] = {
    "as the case is": ("drag.scheme=implicit",),
    "uniform": (*SHARED, "drag.scheme=held"),
    "uniform, crowd": (*SHARED, *CROWD),
    "network": (*SHARED, *CROWD, *NETWORK),
    "network, stiffer": (*SHARED, *CROWD, *NETWORK, "run.stiffness_N_m=6.8e4"),
}
"""Settings of each fluid, by its name in the table. The stiffness is the one that fdnet's warning
asks for in the quick specimen 5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplingRow:
    """One run.

    Attributes:
        case: name of the case.
        fluid: name of the fluid.
        seed: of the case.
        invaded: number of fines inside at the end.
        mean_depth_mm: of their centres.
        p95_depth_mm: depth above which 95 % of them lie.
        k_over_k0: damaged over intact permeability.
        stop_reason: why it ended.
        time_ms: simulated time.
        overlap: largest overlap of a fine, over the smaller diameter.
        rate: last rate over the first; 1 in the uniform field.
        updates: number of updates.
        liggghts_core_s: CPU seconds of LIGGGHTS, packing included; nan where the run was read.
        fdnet_core_s: CPU seconds of fdnet, from the case to the analysis; nan likewise.
    """

    case: str
    fluid: str
    seed: int
    invaded: int
    mean_depth_mm: float
    p95_depth_mm: float
    k_over_k0: float
    stop_reason: str
    time_ms: float
    overlap: float
    rate: float
    updates: int
    liggghts_core_s: float
    fdnet_core_s: float


def coupling_rows(
    case: Path, fluids: Iterable[str], seeds: Iterable[int], folder: Path
) -> list[CouplingRow]:
    """Run a case with each fluid and seed; runs that are finished in `folder` are read.

    Raises what `run_case` raises.
    """
    return [
        _row(case, fluid, seed, folder / f"{case.stem}-{re.sub('[^a-z]+', '-', fluid)}-{seed}")
        for seed in seeds
        for fluid in fluids
    ]


def _row(path: Path, fluid: str, seed: int, out: Path) -> CouplingRow:
    case = read_case(path, assignments=[*LAWS, *FLUIDS[fluid], f"seed={seed}"])
    liggghts = fdnet = math.nan
    known, before = (out / MANIFEST).exists(), (child_core_seconds(), time.process_time())
    stages = ("pack", "invade", "analyse")
    run = run_case(case, out, stages=stages, resume=out.exists(), progress=False)
    if not known:
        liggghts, fdnet = child_core_seconds() - before[0], time.process_time() - before[1]
    summary, fines = run.summary, run.spheres().fines()
    depth = fines.position[:, 0]
    inside = depth[(depth >= 0) & (depth < case.size_m[0])]
    record = run.manifest["invade"]
    return CouplingRow(
        case=case.name,
        fluid=fluid,
        seed=seed,
        invaded=summary["invaded_count"],
        mean_depth_mm=1e3 * float(np.mean(inside)) if len(inside) else 0.0,
        p95_depth_mm=1e3 * summary["invasion_depth_p95_m"],
        k_over_k0=summary["k_damaged_m2"] / summary["k_initial_m2"],
        stop_reason=summary["stop_reason"],
        time_ms=1e3 * record["steps"] * record["dt_s"],
        overlap=summary["max_overlap_fraction"],
        rate=summary.get("rate_over_initial", 1.0),
        updates=record.get("updates", {}).get("count", 0),
        liggghts_core_s=liggghts,
        fdnet_core_s=fdnet,
    )


def write_rows(path: Path, rows: Sequence[CouplingRow]) -> None:
    """Write the rows as CSV, numbers with four digits."""
    write_named(path, [asdict(row) for row in rows], digits=4)
