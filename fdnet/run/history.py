"""The invasion over time as rows: the table history.csv of a run folder."""

from collections.abc import Mapping, Sequence

from fdnet.case.case import InvasionCase
from fdnet.dem.batches import batches_of
from fdnet.dem.checkpoint import Checkpoint, entered_by
from fdnet.scales.scales import InvasionScales

FLOW_COLUMNS = (
    "rate_m3_s",
    "rate_over_initial",
    "k_over_k0",
    "filtrate_m3",
    "cake_thickness_m",
    "pressure_cake_Pa",
    "pressure_pack_Pa",
    "momentum_defect",
    "fines_share",
    "crowd_over_network",
)
"""What the record of updates holds of the flow, where it follows the deposit."""


def history_rows(
    case: InvasionCase,
    scales: InvasionScales,
    checkpoints: Sequence[Checkpoint],
    updates: Sequence[Mapping[str, float]] = (),
) -> list[dict[str, float]]:
    """One row a checkpoint: times in s, and numbers of fines.

    `time_s` is the time of the simulation, `physical_time_s` that of the fluid. They differ where
    the case drives the fines faster than the fluid moves (`drag.drive_velocity_m_s`). Where the
    flow follows the deposit the row holds what the last of the `updates` before it measured.
    """
    batches = batches_of(case, scales)
    return [
        {
            "time_s": row.step * scales.time_step,
            "physical_time_s": row.step * scales.time_step * scales.force_factor,
            "supplied_count": batches.supplied(entered_by(case, batches, row)),
            "invaded_count": row.invaded,
            "passed_count": row.passed,
            "upstream_count": row.upstream,
            "step": row.step,
            **_flow_before(updates, row.step),
        }
        for row in checkpoints
    ]


def _flow_before(updates: Sequence[Mapping[str, float]], step: int) -> dict[str, float]:
    """The columns of the flow from the last update before `step`; none without a flow."""
    row = next((row for row in reversed(updates) if row["step"] < step), {})
    return {name: row[name] for name in FLOW_COLUMNS if name in row}
