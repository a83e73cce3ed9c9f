"""The stages of a run that need LIGGGHTS: the pack and the invasion."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fdnet.case.case import Case, InvasionCase
from fdnet.dem.checkpoint import read_history, read_updates, state_at
from fdnet.dem.deck import snapshot_of
from fdnet.dem.invasion import invade, invasion_so_far
from fdnet.dem.packing import check_radii, make_pack
from fdnet.errors import CaseError, Doubt
from fdnet.names import LIGGGHTS_STAGES
from fdnet.run import records
from fdnet.run.by_classes import class_model, write_class_invasion
from fdnet.run.fluid import fluid_of
from fdnet.run.folder import START_OVER, check_files, may_be_gone, read_record
from fdnet.run.progress import Forecast, Progress
from fdnet.scales.cost import expected_duration
from fdnet.scales.pack import PACK_RELAX_STEPS, PACK_STAGE_STEPS, PACK_STAGES
from fdnet.scales.scales import InvasionScales, invasion_scales
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Snapshot


def pack_stage(session: records.Session) -> None:
    """Make the pack, unless it is made. Raises what `make_pack` raises."""
    if is_done(session, "pack"):
        return
    if session.options.pack_from is not None:
        records.take_pack(session, session.options.pack_from)
        return
    case, folder = session.case, session.path / "pack"
    expected = PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS // 2
    progress = Progress("pack", Forecast(expected=expected), show=session.options.show_progress)
    with session.timed("pack"), progress:
        pack = make_pack(case, folder, session.launch(progress))
    session.finish("pack", records.pack_record(pack, folder, assumed=session.scales.porosity))


def invade_stage(session: records.Session, case: InvasionCase) -> None:
    """Drive the fines in, unless that is done. Raises what `invade` raises."""
    if is_done(session, "invade"):
        return
    scales, grains = invasion_scales(case), packed_grains(session.path, case)
    folder = session.path / "invade"
    if case.by_classes:
        with session.timed("invade"):
            model = class_model(case, scales, grains)
            record = write_class_invasion(model, folder)
        session.finish("invade", record)
        return
    progress = Progress("invade", _forecast(case, scales), show=session.options.show_progress)
    with session.timed("invade"), progress:
        launch, fluid = session.launch(progress), fluid_of(case, scales, grains)
        result = invade(case, scales, grains, folder, launch, fluid=fluid)
    session.finish("invade", records.invade_record(case, result, folder))


def _forecast(case: InvasionCase, scales: InvasionScales) -> Forecast:
    step = scales.time_step
    arrivals = scales.supplied_count * scales.upstream_velocity / scales.slab_length
    return Forecast(
        expected=round(expected_duration(case, scales) / step),
        plug=0 if case.run.duration_s is not None else round(scales.plug_time / step),
        cap=math.ceil(scales.cap_time / step),
        allowed=case.run.plug_rate * arrivals * step,
        chunk=scales.checkpoint_steps,
    )


def invasion_record(session: records.Session, case: InvasionCase) -> dict[str, Any]:
    """The record of the invasion; of one that was cut, what it is at its last whole checkpoint.

    That one has the key `share_done`: time done over that which it is expected to take. Raises
    CaseError where there is no whole checkpoint yet.
    """
    record = session.folder.record("invade")
    if record is not None:
        return record
    scales, folder = invasion_scales(case), session.path / "invade"
    result = invasion_so_far(case, scales, packed_grains(session.path, case), folder)
    if result is None:
        raise CaseError(f"{folder}: has no whole checkpoint yet; go on with --resume")
    # chunks take one time; where springs grow, in more steps
    seen = [
        (row.chunk * scales.checkpoint_steps, row.invaded + row.passed) for row in result.history
    ]
    share = seen[-1][0] / _forecast(case, scales).end(seen)
    return records.invade_record(case, result, folder) | {"share_done": share}


def is_done(session: records.Session, stage: str) -> bool:
    """Whether a stage of this case is done, its files as they were.

    Raises CaseError when it belongs to another case or a file of it is not what it made.
    """
    record = session.folder.record(stage)
    if record is None:
        return False
    if record["digest"] != session.case.digest(stage):
        raise CaseError(
            f"{session.path / stage}: belongs to another case; give another --out, or --force to "
            "replace it"
        )
    if stage == "pack":
        packed_grains(session.path, session.case)
    else:
        check_files(session.path / stage, record, START_OVER, may_lack=may_be_gone)
    return True


def packed_grains(folder: Path, case: Case) -> Snapshot:
    """The grains of the finished pack in the run `folder`.

    Raises DumpError when the dump cannot be read or holds other radii than the case asks for,
    CaseError when it is not what the stage made.
    """
    dump = folder / "pack" / records.PACK_DUMP
    frame = read_frame(dump)
    check_files(folder / "pack", read_record(folder, "pack") or {}, START_OVER)
    grains = snapshot_of(frame, case, time_s=0.0)
    check_radii(grains, case, dump)
    return grains


def invaded(
    session: records.Session, case: InvasionCase, grains: Snapshot, record: Mapping[str, Any]
) -> records.FinishedInvasion:
    """The invasion of this `record`, as it is on disk.

    Raises CaseError when a file is not what the stage made, DumpError or LiggghtsError when one
    cannot be read.
    """
    folder, scales = session.path / "invade", invasion_scales(case)
    check_files(folder, record, START_OVER, may_lack=may_be_gone)
    history = tuple(row for row in read_history(folder) if row.step <= record["steps"])
    return records.FinishedInvasion(
        case=case,
        scales=scales,
        history=history,
        damaged=state_at(folder, history[-1], case, scales, grains),
        updates=tuple(row for row in read_updates(folder) if row["step"] < record["steps"]),
    )


def file_warnings(session: records.Session) -> Iterator[str]:
    """Dumps that are gone, one sentence a stage."""
    for stage in LIGGGHTS_STAGES:
        record = session.folder.record(stage) if stage in session.case.stages else None
        names = record["files"] if record else {}
        lost = [name for name in names if not (session.path / stage / name).exists()]
        if lost:
            yield Doubt(
                "dumps-are-gone",
                f"{len(lost)} checkpoint dumps are gone, the first is {stage}/{lost[0]}: they are "
                "missing from invasion.pvd",
            )
