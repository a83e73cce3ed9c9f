"""The stage clean_up of a run: the flow is turned back, and what it gives is measured."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import HISTORY, UPDATES, Cleaned, overlap_in, read_history, state_at
from fdnet.dem.clean_up import CleanUpStage, Start, clean_up, fines_inside
from fdnet.errors import explained
from fdnet.run.dem_stages import invaded, invasion_record, is_done, packed_grains
from fdnet.run.fluid import Mirrored, fluid_of, mirrored
from fdnet.run.folder import START_OVER, check_files, digests_of
from fdnet.run.progress import Progress
from fdnet.run.records import Session, run_record
from fdnet.scales.scales import back_flow
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

STAGE = "clean_up"


def clean_up_stage(session: Session, case: InvasionCase) -> None:
    """Turn the flow back, unless that is done. Raises what `clean_up` raises."""
    if is_done(session, STAGE):
        return
    folder, flow = session.path / STAGE, back_flow(case)
    grains = packed_grains(session.path, case)
    start = Start(
        grains=grains,
        invaded=invaded(session, case, grains, invasion_record(session, case)).damaged,
        invasion=session.path / "invade",
        digest=case.digest(STAGE),
    )
    progress = Progress("clean_up", flow.chunks * flow.scales.checkpoint_steps, show=False)
    with session.timed(STAGE), progress:
        ahead = fluid_of(flow.case, flow.scales, mirrored(grains))
        fluid = None if ahead is None else Mirrored(fluid=ahead)
        result = clean_up(flow, start, folder, session.launch(progress), fluid=fluid)
    known, last = set(session.scales.warnings), result.history[-1]
    doubts = [f"clean-up: {explained(text)}" for text in flow.scales.warnings if text not in known]
    dumps = (f"post/clean_{row.step}.dump" for row in result.history)
    steps = last.chunk * flow.scales.checkpoint_steps
    record = {
        "stop_reason": result.stop_reason,
        "out": last.out,
        "max_overlap": overlap_in(case, result.state).fraction,
        "steps": last.step,
        "dt_s": flow.step,
        "physical_time_s": steps * flow.step * flow.scales.force_factor,
        "warnings": [*doubts, *map(explained, result.warnings)],
        "ranks": result.ranks,
        "files": digests_of(folder, [CleanUpStage.deck, HISTORY, UPDATES, *dumps]),
        "runs": [run_record(run) for run in result.runs],
        "left_out": [str(item) for item in result.left_out],
    }
    session.finish(STAGE, record)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Returned:
    """What a clean-up gave."""

    state: Snapshot  # grains and remaining fines at the end
    analysis: "Analysis"  # of this state, with the damage law that the invasion was measured by
    before: Array  # (N,) depth of the fines inside before, m
    stayed: Array  # (N,) whether each of them is still inside


def returned(session: Session, case: InvasionCase, grains: Snapshot) -> Snapshot:
    """The state at the end of the finished clean-up.

    Raises CaseError when a file is not what the stage made, DumpError or LiggghtsError when one
    cannot be read.
    """
    folder = session.path / STAGE
    record = session.folder.record(STAGE) or {}
    check_files(folder, record, START_OVER, may_lack=lambda name: name.endswith(".dump"))
    flow, last = back_flow(case), read_history(folder, Cleaned)[-1]
    return state_at(folder, last, flow.case, flow.scales, grains)


def compared(damaged: Snapshot, state: Snapshot, analysis: "Analysis") -> Returned:
    """The fines of two states, matched by their id; `analysis` is of the second `state`."""
    inside, fines = fines_inside(damaged), damaged.fines()
    return Returned(
        state=state,
        analysis=analysis,
        before=fines.position[inside, 0] - damaged.box[0, 0],
        stayed=np.isin(fines.id[inside], state.fines().id[fines_inside(state)]),
    )


def clean_up_rows(first: "Analysis", after: Returned) -> list[dict[str, Any]]:
    """The sections as clean_up.csv names their values.

    `first` is the analysis after the invasion. A ratio is None where the intact value is 0.
    """
    rows = []
    for damaged, back in zip(first.sections, after.analysis.sections, strict=True):
        within = (after.before >= damaged.x_lo) & (after.before < damaged.x_hi)
        rows.append(
            {
                "section": damaged.section,
                "x_lo_m": damaged.x_lo,
                "x_hi_m": damaged.x_hi,
                "porosity_initial": damaged.porosity_initial,
                "porosity_damaged": damaged.porosity_damaged,
                "porosity_returned": back.porosity_damaged,
                "k_initial_m2": damaged.k_initial,
                "k_damaged_m2": damaged.k_damaged,
                "k_returned_m2": back.k_damaged,
                "k_initial_inplace_m2": damaged.k_initial_inplace,
                "k_damaged_inplace_m2": damaged.k_damaged_inplace,
                "k_returned_inplace_m2": back.k_damaged_inplace,
                "damaged_k_over_k0": _over(damaged.k_damaged, damaged.k_initial),
                "return_k_over_k0": _over(back.k_damaged, back.k_initial),
                "fines_before": int(within.sum()),
                "fines_left_it": int(np.sum(within & ~after.stayed)),
                "fines_after": back.fines_count,
            }
        )
    return rows


def _over(part: float, whole: float) -> float | None:
    """`part` over `whole`; None where `whole` is 0."""
    return part / whole if whole > 0 else None


def clean_up_summary(first: "Analysis", after: Returned, record: dict[str, Any]) -> dict[str, Any]:
    """The keys that a clean-up adds to summary.json."""
    stayed = int(after.stayed.sum())
    return {
        "return_k_over_k0": _over(after.analysis.k_damaged, after.analysis.k_initial),
        "k_returned_m2": after.analysis.k_damaged,
        "clean_up": {
            "stop_reason": record["stop_reason"],
            "physical_time_s": record["physical_time_s"],
            "inside_before": len(after.before),
            "came_out": len(after.before) - stayed,
            "stayed": stayed,
            "damaged_k_over_k0": _over(first.k_damaged, first.k_initial),
            "damage_law_used": after.analysis.damage_law_used,
            "sections": clean_up_rows(first, after),
        },
    }
