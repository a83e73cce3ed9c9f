"""The invasion over time as rows: the table history.csv of a run folder."""

from collections.abc import Sequence

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import Checkpoint
from fdnet.dem.supply import batches_of
from fdnet.scales.scales import InvasionScales


def history_rows(
    case: InvasionCase, scales: InvasionScales, checkpoints: Sequence[Checkpoint]
) -> list[dict[str, float]]:
    """One row a checkpoint: times in s, and numbers of fines.

    `time_s` is the time of the simulation, `physical_time_s` that of the fluid. They differ where
    the case drives the fines faster than the fluid moves (`drag.drive_velocity_m_s`).
    """
    batches = batches_of(case, scales)
    return [
        {
            "time_s": row.step * scales.time_step,
            "physical_time_s": row.step * scales.time_step * scales.force_factor,
            "supplied_count": batches.supplied_at(row.chunk),
            "invaded_count": row.invaded,
            "passed_count": row.passed,
            "upstream_count": row.upstream,
            "step": row.step,
        }
        for row in checkpoints
    ]
