"""The stages of a run that need LIGGGHTS: the pack and the invasion."""

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import read_history, state_at
from fdnet.dem.invasion import invade
from fdnet.dem.packing import make_pack
from fdnet.dem.scene import snapshot_of
from fdnet.errors import CaseError
from fdnet.run.outputs import Invaded
from fdnet.run.progress import Progress
from fdnet.run.records import invade_record, pack_record
from fdnet.run.session import Session
from fdnet.scales.grain_pack import PACK_RELAX_STEPS, PACK_STAGE_STEPS, PACK_STAGES
from fdnet.scales.scales import InvasionScales, scales_of
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Snapshot


def pack_stage(session: Session) -> None:
    """Make the pack, unless it is made. Raises what `make_pack` raises."""
    if _is_done(session, "pack"):
        return
    case, scales = session.case, session.scales
    expected = PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS // 2
    progress = Progress("pack", expected, show=session.options.show_progress)
    with session.timed("pack"), progress:
        pack = make_pack(case, scales, session.path / "pack", session.launch(progress))
    record = pack_record(case, pack, scales.porosity, session.seconds["pack"])
    session.folder.finish("pack", record)


def invade_stage(session: Session, case: InvasionCase) -> None:
    """Drive the fines in, unless that is done. Raises what `invade` raises."""
    if _is_done(session, "invade"):
        return
    scales, grains = scales_of(case), packed_grains(session)
    expected = _expected_steps(scales)
    progress = Progress("invade", expected, show=session.options.show_progress)
    with session.timed("invade"), progress:
        result = invade(case, scales, grains, session.path / "invade", session.launch(progress))
    session.folder.finish("invade", invade_record(case, result, session.seconds["invade"]))


def _expected_steps(scales: InvasionScales) -> int:
    feeding = scales.slab_length / scales.upstream_velocity
    return round(min(scales.cap_time, feeding + 2 * scales.plug_time) / scales.time_step)


def _is_done(session: Session, stage: str) -> bool:
    record = session.folder.record(stage)
    if record is None:
        return False
    if record["digest"] != session.case.digest(stage):
        raise CaseError(
            f"{session.path / stage}: belongs to another case; give another --out, or --force to "
            "replace it"
        )
    return True


def packed_grains(session: Session) -> Snapshot:
    """The grains of the finished pack."""
    frame = read_frame(session.path / "pack" / "post" / "pack.dump")
    return snapshot_of(frame, session.case, time_s=0.0)


def invaded(session: Session, case: InvasionCase, grains: Snapshot) -> Invaded:
    """The finished invasion, as it is on disk."""
    folder, scales = session.path / "invade", scales_of(case)
    history = read_history(folder)
    damaged = state_at(folder, history[-1], case, scales, grains)
    return Invaded(case=case, scales=scales, history=history, damaged=damaged)
