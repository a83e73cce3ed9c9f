"""The invasion deck and its data file."""

from functools import reduce
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.batch_files import SUPPLY, BatchFiles
from fdnet.dem.batches import AT_ONCE, batches_of
from fdnet.dem.checkpoint import Checkpoint, chunks_of, empty_chunks, plug_allowance, quiet_chunks
from fdnet.dem.contact_lines import contact_variables, left_out_of_contacts
from fdnet.dem.coupled_parts import dumped_group, write_coupled_parts
from fdnet.dem.deck import Deck, LeftOut, number, render_text
from fdnet.dem.drag import BELOW_ZERO, drag_variables, forces_left_out
from fdnet.dem.gravity import gravity_variables
from fdnet.dem.measured_fines import densities
from fdnet.dem.overlap import watch_left_out, watch_variables, write_watch_parts
from fdnet.dem.scene import header_variables, wall_variables, write_data
from fdnet.dem.supply import place_batches, place_fines, slab_end
from fdnet.errors import CaseError
from fdnet.files.atomic import write_text
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.contacts import touching_pairs
from fdnet.spheres.dump import COLUMNS, FORMAT
from fdnet.spheres.snapshot import Array, Kind, Snapshot

SCRATCH = "post/contacts.restart"
"""File that a continued deck writes only to store the contacts with the spheres."""


def write_invade_inputs(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path, *, ranks: int = 1
) -> Deck:
    """Write in.invade, invade.data (grains and the first fines) and the batches that follow.

    Raises CaseError when the slab cannot hold its fines.
    """
    batched = case.fines.supply == "batches"
    spheres = grains.joined(
        write_batches(case, scales, grains, folder)
        if batched
        else place_fines(case, scales, grains)
    )
    pairs, _ = touching_pairs(spheres, case.periodic)
    if np.any(spheres.kind[pairs] == Kind.FINE):
        raise CaseError(
            "fines: a fine would start in contact; this is an fdnet fault, please report the case "
            "and seed"
        )
    density = np.concatenate(
        [
            np.full(len(grains), case.grains.density_kg_m3),
            densities(case, batches_of(case, scales).counts)[: len(spheres) - len(grains)],
        ]
    )
    write_data(
        folder / "invade.data",
        spheres,
        bounds=_bounds(case, scales, grains),
        density=density,
        types=3,
    )
    deck = render_invade(case, scales, grains, ranks=ranks)
    write_text(folder / "in.invade", deck.text)
    write_parts(case, scales, grains, folder)
    return deck


def write_parts(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path
) -> None:
    """Write the files that a deck of the invasion includes, apart from the batches."""
    write_coupled_parts(case, scales, folder)
    write_watch_parts(case, grains, folder)


def write_batches(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path
) -> Snapshot:
    """Write the batches that are read before later chunks.

    Where the deposit slows the mud down they are written when they are due (`later_batch`).
    Returns the fines that are there from the start.
    """
    batches, files = place_batches(case, scales, grains), batch_files(case, scales, grains, folder)
    first = list(islice(batches, AT_ONCE))
    if not case.drag.slowed:
        for number, fines in enumerate(batches, AT_ONCE):
            files.write(number, fines, scales.upstream_velocity)
    return reduce(Snapshot.joined, first)


def batch_files(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path
) -> BatchFiles:
    """The files of the batches of an invasion in `folder`."""
    return BatchFiles(
        case=case,
        folder=folder,
        counts=batches_of(case, scales).counts,
        first=int(grains.id.max()) + 1,
        bounds=_bounds(case, scales, grains),
        drag=drag_variables(case, scales),
    )


def _feeding(case: InvasionCase, scales: InvasionScales) -> dict[str, int] | None:
    """First and last chunk that take in a batch; None when all fines are there from the start.

    They hold for mud of constant velocity. In mud that slows down only whether there are any
    matters: the chunks follow from the distance that the mud has moved.
    """
    count = len(batches_of(case, scales).counts)
    return {"first": AT_ONCE, "last": count - 1} if count > AT_ONCE else None


def _margin(case: InvasionCase, scales: InvasionScales) -> float:
    """How far a fine could go in one chunk at twice its free velocity, plus two diameters."""
    travel = 2 * scales.drift_velocity * scales.checkpoint_steps * scales.time_step
    return travel + 4 * case.fines.radius_range_m[1]


def _bounds(case: InvasionCase, scales: InvasionScales, grains: Snapshot) -> Array:
    """The simulation box (3, 2) m.

    It extends beyond the outlet and upstream of the slab, where fines are removed.
    """
    batches = batches_of(case, scales)
    start = slab_end(case, grains) - batches.reach
    if case.drag.slowed and len(batches.counts) > 1:
        # a batch enters a chunk early, and may be twice as long (`later_batch`)
        start -= batches.travel + batches.length
    margin = _margin(case, scales)
    size = case.size_m
    return np.array([[start - 2 * margin, size[0] + 2 * margin], [0.0, size[1]], [0.0, size[2]]])


def render_invade(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    *,
    ranks: int = 1,
    resume: Checkpoint | None = None,
    packed: bool = True,
) -> Deck:
    """The invasion deck, fresh or continued from a checkpoint's restart.

    Grains that are not `packed` stand for those of a pack that is not made yet.
    """
    friction = _friction(case, scales)
    gravity, left_out = gravity_variables(case, scales)
    left_out += [*forces_left_out(case), *_left_out(case, friction=friction, ranks=ranks)]
    left_out += watch_left_out(case, packed=packed)
    text = render_text(
        "invade.in.j2",
        header_variables(case, "invade", left_out, ranks)
        | moving_variables(case, scales)
        | {
            "gravity": gravity,
            "resume": _restart(resume) if resume else None,
            "dump_group": dumped_group(case),
            "start_velocity": number(scales.upstream_velocity),
            "drag": drag_variables(case, scales),
            "overlap": watch_variables(case, scales, grains) if packed else None,
            "regions": _regions(case, scales, grains),
            "quiet_checkpoints": quiet_chunks(scales),
            "empty_checkpoints": empty_chunks(case, scales),
            "allowance": plug_allowance(case, scales),
            "start": _start(resume),
            "feeding": _feeding(case, scales),
            "slowed": case.drag.slowed,
            "supply": SUPPLY,
            "chunks": chunks_of(case, scales),
            "chunk_steps": scales.checkpoint_steps,
            "stop_when_plugged": case.run.duration_s is None,
            "dump_columns": COLUMNS,
            "dump_format": FORMAT,
        },
    )
    return Deck(text=text, stage="invade", digest=case.digest("invade"), left_out=tuple(left_out))


def moving_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any]:
    """The variables of any deck in which fines move among grains: contacts, walls, neighbours."""
    mobile = case.grains.motion == "mobile"
    walls = _friction(case, scales, walls_only=True)
    return {
        "skin": number(_neighbour_skin(case)),
        "neighbour_bin": number(case.run.neighbour_bin_m) if case.run.neighbour_bin_m else "",
        "contacts": contact_variables(case, scales, "invade", friction=_friction(case, scales)),
        "time_step": number(scales.time_step),
        "walls": wall_variables(case, "invade", friction=walls),
        "fixed_grains": not mobile,
        "moving": "all" if mobile else "fines",
        "thermo_steps": max(1, scales.checkpoint_steps // 4),
    }


def _friction(case: InvasionCase, scales: InvasionScales, *, walls_only: bool = False) -> bool:
    """Whether any contact that can slip has friction, of all pairs or of those with a wall."""
    mobile = case.grains.motion == "mobile"
    slipping = [c for name, c in scales.contacts.items() if "fine" in name or mobile]
    return any(c.friction > 0 for c in slipping if "wall" in c.pair or not walls_only)


def _neighbour_skin(case: InvasionCase) -> float:
    """The neighbour skin, m: given, or the radius of the smallest fine.

    A skin of 0.3 to 0.8 of its diameter was measured to be fastest.
    """
    return case.fines.radius_range_m[0] if case.run.skin_m is None else case.run.skin_m


def _restart(resume: Checkpoint) -> dict[str, str]:
    return {"restart": f"post/invade_{resume.step}.restart", "scratch": SCRATCH}


def _start(resume: Checkpoint | None) -> dict[str, int]:
    if resume is None:
        return {"chunk": 1, "passed": 0, "behind": 0, "most": 0, "quiet": 0}
    return {
        "chunk": resume.chunk + 1,
        "passed": resume.passed,
        "behind": resume.removed_upstream,
        "most": resume.most_crossed,
        "quiet": resume.quiet,
    }


def _regions(case: InvasionCase, scales: InvasionScales, grains: Snapshot) -> dict[str, str]:
    bounds, length, margin = _bounds(case, scales, grains), case.size_m[0], _margin(case, scales)
    behind = bounds[0, 0] + margin
    sides = "INF INF INF INF"
    return {
        "specimen": f"0.0 {number(np.nextafter(length, 0))} {sides}",
        "upstream": f"{number(np.nextafter(behind, 0))} {number(BELOW_ZERO)} {sides}",
        "beyond": f"{number(length)} INF {sides}",
        "behind": f"INF {number(behind)} {sides}",
    }


def _left_out(case: InvasionCase, *, friction: bool, ranks: int) -> list[LeftOut]:
    left_out = []
    if case.grains.motion == "fixed":
        left_out.append(LeftOut(what="motion of grains, end planes", why="grains are fixed"))
    if not friction:
        left_out.append(LeftOut(what="tangential history", why="no pair has friction"))
    left_out += left_out_of_contacts(case)
    if case.box.sides == "periodic":
        left_out.append(LeftOut(what="side walls", why="sides are periodic"))
    if case.fines.supply == "batches":
        left_out.append(
            LeftOut(
                what="fines far upstream",
                why="they come in batches, each when it is about to arrive",
            )
        )
    if ranks == 1:
        left_out.append(LeftOut(what="MPI processor grid", why="one rank"))
    return left_out
