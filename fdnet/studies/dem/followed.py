"""The specimens of the thesis with a flow that follows the deposit, next to the uniform flow.

The uniform runs are those of `fdnet study thesis`, whose table is read.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.case.file import case_path, read_case
from fdnet.run.finished import FinishedRun
from fdnet.run.pipeline import run_case
from fdnet.studies.engine.csv_rows import read_named, write_named

SUPPLIED = {
    "specimen1": 3000,
    "specimen3": 25_000,
    "specimen5": 12_000,
    "specimen6": 25_000,
    "specimen7": 12_000,
    "specimen8": 12_000,
}
"""Fines supplied to each specimen. The more there are, the thicker the cake and the slower the
flow at the end, so a run is compared with a uniform one of the same supply."""
FEWER = ("specimen3", "specimen6", "specimen7", "specimen8")
"""Specimens with fewer fines here than in their uniform runs, which are run uniform as well."""
SAME_SUPPLY = "uniform, same supply"
SEEDS, ONE = {"specimen1": (1, 2, 3), "specimen5": (1, 2, 3)}, (1,)
"""Seeds of the specimens that take minutes, and of the others."""
FLOW = (
    "drag.field=network",
    "drag.upstream=darcy",
    "drag.crowd=beetstra",
    "drag.scheme=implicit",
    "drag.pressure_gradient=true",
    "run.stiffness_N_m=auto",
    "run.plug_rate=0.02",
)
"""What makes the flow of a case of the thesis follow the deposit."""
LAWS = ("analysis.law=lubrication", "analysis.damage_law=auto")
"""The laws by which all of these runs are analysed."""
SECTIONS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedRow:
    """One run of a specimen. Losses of k are 1 - k/k0.

    Attributes:
        specimen: name of the case.
        seed: of the case.
        flow: "uniform", "followed" or `SAME_SUPPLY`.
        invaded: number of fines inside at the end.
        first_mm: number of them in the first millimetre.
        mean_depth_mm: of their centres.
        p95_depth_mm: depth above which 95 % of them lie.
        porosity_loss_first_mm: porosity that the first millimetre lost.
        k_lost: by the whole specimen.
        k_lost_by_mm: by each millimetre, cut out of the specimen.
        rate: last rate over the first; 1 in the uniform flow.
        stop_reason: why the run ended.
        time_ms: simulated time.
        overlap: largest overlap of a fine, over the smaller diameter.
    """

    specimen: str
    seed: int
    flow: str
    invaded: int
    first_mm: int
    mean_depth_mm: float
    p95_depth_mm: float
    porosity_loss_first_mm: float
    k_lost: float
    k_lost_by_mm: tuple[float, ...]
    rate: float
    stop_reason: str
    time_ms: float
    overlap: float


def followed_rows(
    specimens: Iterable[str], seeds: Sequence[int] | None, folder: Path
) -> list[FollowedRow]:
    """Run specimens with each seed, those of `SEEDS` by default; finished runs are read.

    Those of `FEWER` run in the uniform flow too, with the same number of fines.

    Raises what `run_case` raises.
    """
    rows = []
    for name in specimens:
        for seed in SEEDS.get(name, ONE) if seeds is None else seeds:
            run = f"{name}-followed-{seed}"
            rows.append(_read_or_run(name, seed, "followed", folder / run))
            if name in FEWER:
                run = f"{name}-uniform-{seed}"
                rows.append(_read_or_run(name, seed, SAME_SUPPLY, folder / run))
    return rows


def _read_or_run(name: str, seed: int, flow: str, out: Path) -> FollowedRow:
    keys = [*LAWS, f"fines.count={SUPPLIED[name]}", f"seed={seed}"]
    if flow == "followed":
        keys += FLOW
    case = read_case(case_path(name), assignments=keys)
    stages = ("pack", "invade", "analyse")
    run = run_case(case, out, stages=stages, resume=out.exists(), progress=False)
    return _row(case, flow, run)


def _row(case: Case, flow: str, run: FinishedRun) -> FollowedRow:
    summary, record, fines = run.summary, run.manifest["invade"], run.spheres().fines()
    depth = fines.position[:, 0]
    inside = depth[(depth >= 0) & (depth < case.size_m[0])]
    parts = summary["sections"]
    return FollowedRow(
        specimen=case.name,
        seed=case.seed,
        flow=flow,
        invaded=summary["invaded_count"],
        first_mm=int(np.sum(inside < 1e-3)),
        mean_depth_mm=1e3 * float(np.mean(inside)) if len(inside) else 0.0,
        p95_depth_mm=1e3 * summary["invasion_depth_p95_m"],
        porosity_loss_first_mm=parts[0]["porosity_initial"] - parts[0]["porosity_damaged"],
        k_lost=summary["k_reduction"],
        k_lost_by_mm=tuple(part["k_reduction"] for part in parts),
        rate=1.0 if flow == SAME_SUPPLY else summary["rate_over_initial"],
        stop_reason=summary["stop_reason"],
        time_ms=1e3 * record["steps"] * record["dt_s"],
        overlap=summary["max_overlap_fraction"],
    )


def uniform_rows(table: Path, specimens: Iterable[str]) -> list[FollowedRow]:
    """The rows of specimens in the table of `fdnet study thesis`, by fdnet's own laws."""
    rows = [row for row in read_named(table) if row["law"] == "lubrication"]
    return [_uniform(row) for name in specimens for row in rows if row["id"] == name]


def _uniform(row: Mapping[str, str]) -> FollowedRow:
    return FollowedRow(
        specimen=row["id"],
        seed=int(row["seed"]),
        flow="uniform",
        invaded=int(row["invaded_count"]),
        first_mm=int(row["count_first_mm"]),
        mean_depth_mm=float(row["mean_depth_mm"]),
        p95_depth_mm=float(row["invasion_depth_p95_mm"]),
        porosity_loss_first_mm=float(row["porosity_loss_first_mm"]),
        k_lost=float(row["k_reduction"]),
        k_lost_by_mm=tuple(float(row[f"k_reduction_{k + 1}"]) for k in range(SECTIONS)),
        rate=1.0,
        stop_reason=row["stop_reason"],
        time_ms=float(row["time_ms"]),
        overlap=float(row["max_overlap"]),
    )


def write_followed(path: Path, rows: Sequence[FollowedRow]) -> None:
    """Write the rows as CSV, numbers with four digits; each millimetre has a column."""
    write_named(path, [_named(row) for row in rows], digits=4)


def _named(row: FollowedRow) -> dict[str, object]:
    """The values of a row by column."""
    values: dict[str, object] = {}
    for name, value in asdict(row).items():
        if name == "k_lost_by_mm":
            values |= {f"k_lost_{k + 1}": lost for k, lost in enumerate(value)}
        else:
            values[name] = value
    return values
