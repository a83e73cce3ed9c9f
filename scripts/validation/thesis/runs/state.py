"""The state at the end of an invasion: all spheres, the case, and how it ended.

A state is small enough to be kept with the project.
"""

import json
import tomllib
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, recorded_case
from fdnet.dem.checkpoint import read_history, state_at
from fdnet.dem.deck import snapshot_of, specimen_box
from fdnet.dem.packing import check_radii
from fdnet.errors import CaseError
from fdnet.files import write_bytes
from fdnet.run.folder import CASE, check_files, read_record
from fdnet.run.records import PACK_DUMP
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Array, Kind, Snapshot

ENDING = (
    "supplied",
    "passed",
    "upstream",
    "stop_reason",
    "seconds",
    "pack_seconds",
    "steps",
    "dt_s",
    "max_overlap",
    "warnings",
)

RUN_ANEW = "put the file back, or remove the run folder to run it anew"
BROKEN = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)
"""The errors that reading a damaged npz raises."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class State:
    """A specimen before and after its invasion.

    Attributes:
        case: the case of the run.
        grains: the grains as packed.
        damaged: the grains and all remaining fines at the end, those upstream too.
        history: (C, 4) time in s and numbers of fines upstream, invaded and passed, one row a
            checkpoint.
        ending: by the keys of ENDING: numbers of fines supplied, passed and upstream;
            `stop_reason`; computing times `seconds` of the invasion and `pack_seconds`; number of
            `steps` and their length `dt_s`; `max_overlap` over the smaller diameter; `warnings`.
    """

    case: InvasionCase
    grains: Snapshot
    damaged: Snapshot
    history: Array
    ending: Mapping[str, Any]


def state_of_run(folder: Path) -> State:
    """The end of a finished invasion in a run folder.

    Raises CaseError when the folder holds none or a file is not what the stage made, DumpError
    when a dump is cut.
    """
    case = with_fines(recorded_case(folder / CASE))
    pack, invasion = read_record(folder, "pack"), read_record(folder, "invade")
    if pack is None or invasion is None:
        raise CaseError(
            f"{folder}: holds no finished invasion; run it to its end first (--resume)"
        )
    check_files(folder / "pack", pack, RUN_ANEW)
    check_files(folder / "invade", invasion, RUN_ANEW)
    scales, history = invasion_scales(case), read_history(folder / "invade")
    dump = folder / "pack" / PACK_DUMP
    grains = snapshot_of(read_frame(dump), case, time_s=0.0)
    check_radii(grains, case, dump)
    last = history[-1]
    return State(
        case=case,
        grains=grains,
        damaged=state_at(folder / "invade", last, case, scales, grains),
        history=np.array(
            [[r.step * scales.time_step, r.upstream, r.invaded, r.passed] for r in history]
        ),
        ending={
            name: invasion[name]
            for name in ("stop_reason", "seconds", "steps", "dt_s", "max_overlap")
        }
        | {"supplied": invasion["supplied"], "passed": last.passed, "upstream": last.upstream}
        | {"pack_seconds": pack["seconds"], "warnings": invasion["warnings"]},
    )


def write_state(path: Path, state: State) -> None:
    """Keep a state in one compressed file of single precision (0.5 nm at 8 mm)."""
    text = json.dumps(
        {"case": state.case.toml(), "ending": dict(state.ending), "step": state.damaged.step}
    )
    arrays = {"text": np.frombuffer(text.encode(), np.uint8), "history": state.history}
    for name, spheres in (("grains", state.grains), ("damaged", state.damaged)):
        arrays[f"{name}_place"] = np.column_stack([spheres.position, spheres.radius]).astype(
            np.float32
        )
        arrays[f"{name}_kind"] = spheres.kind.astype(np.uint8)
        arrays[f"{name}_id"] = spheres.id.astype(np.uint32)
    write_bytes(path, packed_bytes(arrays))


def packed_bytes(arrays: Mapping[str, Array]) -> bytes:
    """The arrays as a compressed npz."""
    buffer = BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def read_state(path: Path) -> State:
    """Read a state that `write_state` kept; velocities are not kept and are 0.

    Raises CaseError when the file is no state.
    """
    try:
        with np.load(path) as file:
            arrays = dict(file)
        text = json.loads(arrays["text"].tobytes())
        case = with_fines(case_from(tomllib.loads(text["case"]), source=str(path)))
        return State(
            case=case,
            grains=_spheres(arrays, "grains", case, 0, 0.0),
            damaged=_spheres(
                arrays, "damaged", case, text["step"], text["step"] * text["ending"]["dt_s"]
            ),
            history=arrays["history"],
            ending={name: text["ending"][name] for name in ENDING},
        )
    except BROKEN as error:
        raise CaseError(
            f"{path}: is no state of an invasion ({error}); run the study anew to write it"
        ) from error


def _spheres(
    arrays: Mapping[str, Array], name: str, case: InvasionCase, step: int, time_s: float
) -> Snapshot:
    place = arrays[f"{name}_place"].astype(float)
    kind = arrays[f"{name}_kind"].astype(int)
    return Snapshot(
        step=step,
        time_s=time_s,
        box=specimen_box(case),
        id=arrays[f"{name}_id"],
        kind=np.where(kind == Kind.GRAIN, Kind.GRAIN, Kind.FINE),
        position=place[:, :3],
        radius=_exact_radius(place[:, 3], kind, case),
        velocity=np.zeros((len(place), 3)),
    )


def _exact_radius(radius: Array, kind: Array, case: InvasionCase) -> Array:
    """Radii of spheres of a single size, as the case gives them, in full precision."""
    for spheres, which in ((case.grains, Kind.GRAIN), (case.fines, Kind.FINE)):
        if spheres.one_size:
            radius = np.where(kind == which, spheres.mean_radius_m, radius)
    return radius
