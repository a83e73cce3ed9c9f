"""The comparison of an invasion by fdnet and by Yade: a row for each specimen, seed and tool."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.network.analysis import Analysis
from fdnet.network.permeability import compare
from fdnet.spheres.snapshot import Snapshot
from fdnet.studies.benchmark.yade_exchange import HISTORY
from fdnet.studies.benchmark.yade_invasion import Pair
from fdnet.studies.engine.csv_rows import write_named
from fdnet.studies.engine.markdown import markdown_table

COLUMNS = (
    "fines",
    "seed",
    "tool",
    "grains",
    "steps",
    "share_done",
    "time_ms",
    "updates",
    "cpu_s",
    "wall_s",
    "peak_MB",
    "cpu_s_for_all",
    "invaded",
    "passed",
    "mean_depth_mm",
    "p95_depth_mm",
    "overlap",
    "rate_over_first",
    "k_initial_m2",
    "k_over_k0",
    "k_over_k0_all_spheres",
    "k_initial_yade_m2",
    "k_over_k0_yade",
)
LAWS = (("lubrication", "side-kozeny"), ("lubrication", "all-spheres"))
"""fdnet's laws by which both deposits are judged; the first also gives the profile by depth."""
LAST = 10
"""Meshes at the end whose median is Yade's rate, since single steps jump."""
Row = dict[str, Any]


def rows_of(pair: Pair) -> Iterator[Row]:
    """The rows of one invasion: fdnet's and Yade's, and fdnet's then where Yade was cut."""
    yield _shared(pair, "fdnet", pair.run.spheres()) | _fdnet(pair)
    if pair.then:
        step, spheres = pair.then
        yield _shared(pair, "fdnet then", spheres) | _then(pair, step)
    yield _shared(pair, "Yade", pair.yade_end) | _yade(pair)


def judged(pair: Pair, end: Snapshot) -> list[Analysis]:
    """fdnet's analysis of a deposit by each of `LAWS`, with the sections of the run's case."""
    run = pair.run
    return list(
        compare(
            run.spheres("initial"),
            end,
            periodic=run.case.periodic,
            options=run.case.analysis,
            laws=LAWS,
        )
    )


def _shared(pair: Pair, tool: str, end: Snapshot) -> Row:
    """What is judged in the same way for both tools."""
    first, whole = judged(pair, end)
    depth = end.fines().position[:, 0]
    inside = depth[(depth >= 0) & (depth < pair.job.length)]
    flux = pair.flux
    area = float(np.prod(pair.job.box[1:, 1] - pair.job.box[1:, 0]))
    per_flux = pair.job.viscosity * pair.job.length / (pair.job.pressure * area)
    return {
        "fines": pair.fines,
        "seed": pair.seed,
        "tool": tool,
        "grains": len(end.grains()),
        "invaded": first.invaded_count,
        "mean_depth_mm": 1e3 * float(np.mean(inside)) if len(inside) else 0.0,
        "p95_depth_mm": 1e3 * first.invasion_depth_p95,
        "k_initial_m2": first.k_initial,
        "k_over_k0": first.k_damaged / first.k_initial,
        "k_over_k0_all_spheres": whole.k_damaged / whole.k_initial,
        "k_initial_yade_m2": flux["intact"] * per_flux,
        "k_over_k0_yade": flux[tool] / flux["intact"],
    }


def _fdnet(pair: Pair) -> Row:
    """What is fdnet's own."""
    summary, record = pair.run.summary, pair.run.manifest["invade"]
    return {
        "steps": record["steps"],
        "share_done": 1.0,
        "time_ms": 1e3 * record["steps"] * record["dt_s"],
        "updates": record["updates"]["count"],
        "cpu_s": pair.cost.cpu_s,
        "wall_s": pair.cost.wall_s,
        "peak_MB": pair.cost.peak_MB,
        "cpu_s_for_all": pair.cost.cpu_s,
        "passed": summary["passed_count"],
        "overlap": summary["max_overlap_fraction"],
        "rate_over_first": summary["rate_over_initial"],
    }


def _then(pair: Pair, step: int) -> Row:
    """What is fdnet's own at a checkpoint; its cost until then is not known."""
    record, history = pair.run.manifest["invade"], pair.run.history
    row = history[history["step"] == step].iloc[0]
    return {
        "steps": step,
        "share_done": step / record["steps"],
        "time_ms": 1e3 * step * record["dt_s"],
        "passed": int(row["passed"]),
        "rate_over_first": float(row["rate_over_initial"]),
    }


def _yade(pair: Pair) -> Row:
    """What is Yade's own; `cpu_s_for_all` extends the CPU time in proportion to the steps."""
    answer, job = pair.answer, pair.job
    history = dict(zip(HISTORY, answer.history.T, strict=True))
    share, rate = answer.steps / job.steps, history["rate_m3_s"]
    return {
        "steps": answer.steps,
        "share_done": share,
        "time_ms": 1e3 * answer.steps * job.time_step,
        "updates": len(answer.history) - 1,
        "cpu_s": answer.cpu_s,
        "wall_s": answer.wall_s,
        "peak_MB": answer.peak_MB,
        "cpu_s_for_all": answer.cpu_s / share,
        "passed": int(history["passed"][-1]),
        "overlap": float(np.max(history["overlap"])),
        "rate_over_first": float(np.median(rate[-LAST:]) / rate[0]),
    }


def write_rows(path: Path, rows: Sequence[Row]) -> Path:
    """The rows as CSV."""
    return write_named(path, rows, columns=COLUMNS, digits=4)


def comparison_table(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table; values are texts or numbers, such as those of the CSV."""
    head = (
        "fines, seed",
        "tool",
        "invaded",
        "passed",
        "mean depth, mm",
        "95 % above, mm",
        "k/k0",
        "all spheres",
        "by Yade",
        "rate",
        "CPU s",
        "MB",
    )
    return markdown_table(
        list(head),
        [
            [
                f"{row['fines']}, {row['seed']}",
                f"{row['tool']}, {float(row['time_ms']):.2f} ms",
                f"{int(row['invaded'])}",
                f"{int(row['passed'])}",
                f"{float(row['mean_depth_mm']):.2f}",
                f"{float(row['p95_depth_mm']):.2f}",
                f"{float(row['k_over_k0']):.2f}",
                f"{float(row['k_over_k0_all_spheres']):.2f}",
                f"{float(row['k_over_k0_yade']):.2f}",
                f"{float(row['rate_over_first']):.2f}",
                *(
                    f"{float(row[name]):.0f}" if row.get(name) else ""
                    for name in ("cpu_s", "peak_MB")
                ),
            ]
            for row in rows
        ],
    )
