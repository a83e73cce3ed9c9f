"""The deck of an invasion, and the decks of a case.

What the fluid does to each fine, and how it is handed to LIGGGHTS: files of one value an atom.

The force on a fine of velocity v is F = C (u - v) + P: C its drag coefficient, u the velocity of
the fluid at it, and P a force that does not depend on v, such as its volume times the fall of
pressure. LIGGGHTS is given C and w = u + P / C, since F = C (w - v).
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.dem.checkpoint import (
    Checkpoint,
    chunks_of,
    empty_chunks,
    plug_allowance,
    quiet_chunks,
    watch_left_out,
    watch_variables,
    write_watch_parts,
)
from fdnet.dem.deck import (
    BELOW_ZERO,
    Deck,
    LeftOut,
    box_of,
    contact_variables,
    drag_variables,
    forces_left_out,
    gravity_variables,
    header_variables,
    left_out_of_contacts,
    number,
    render_text,
    wall_variables,
    write_data,
)
from fdnet.dem.packing import write_pack_inputs
from fdnet.dem.supply import AT_ONCE, batches_of, densities, place_batches, place_fines, slab_end
from fdnet.errors import CaseError
from fdnet.files import expanded, refuse_folder_name, write_text
from fdnet.names import LIGGGHTS_STAGES
from fdnet.scales.pack import grain_count
from fdnet.scales.scales import InvasionScales, invasion_scales, scales_of
from fdnet.spheres.dump import COLUMNS, FORMAT, Frame, read_binary_frame
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting

STATE = "post/fluid.bin"
"""File in which LIGGGHTS shows the spheres when it asks for the fluid, all digits of them."""
_FILES = ("cd", "ux", "uy", "uz")
_GIVEN = ("f_uf[1]", "f_uf[2]", "f_uf[3]")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FluidForces:
    """What acts on N fines until they are looked at again.

    Attributes:
        coefficient: (N,) N s/m, C; above 0.
        velocity: (N, 3) m/s, u.
        push: (N, 3) N, P.
        pace: m/s, speed with which the fines move on; it decides when they are looked at again.
        measures: what the record of updates keeps, by the names of `Fluid.measured`.
    """

    coefficient: Array
    velocity: Array
    push: Array
    pace: float
    measures: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Moment:
    """When the fines are looked at.

    Attributes:
        step: of the simulation.
        time: s, since the start.
        before: the row of the update before this one; None for the first.
        first: the row of the first update; None for the first.
        fresh: whether a chunk begins. What is answered then must follow from the spheres and the
            two rows alone, so that a run that was cut gives the same.
        left: s, until the chunk ends, when they are looked at again in any case.
        given: (N,) m/s, speed w at which each of the N fines would go by the forces that it has
            now, in their order; 0 where it has none yet. None where it is not known.
        density: (N,) kg/m3 of each of the N fines, in their order. None where all have that of the
            case.
    """

    step: int
    time: float
    before: Mapping[str, float] | None
    first: Mapping[str, float] | None
    fresh: bool
    left: float = math.inf
    given: Array | None = None
    density: Array | None = None


def shown_columns(case: InvasionCase) -> str:
    """The columns that LIGGGHTS shows; where the flow follows the deposit with the w given."""
    given = _GIVEN if case.drag.field == "network" else ()
    return " ".join((COLUMNS, "density", *given))


def read_state(folder: Path, case: InvasionCase) -> Frame:
    """The spheres that LIGGGHTS shows. Raises DumpError when it did not write all of them."""
    return read_binary_frame(folder / STATE, tuple(shown_columns(case).split()))


def given_speed(frame: Frame) -> Array | None:
    """The speed w (N,) m/s that each sphere of a state was given, None where that is not shown."""
    if _GIVEN[0] not in frame.columns:
        return None
    return np.linalg.norm([frame.column(name) for name in _GIVEN], axis=0)


def fine_density(frame: Frame) -> Array:
    """The density (N,) kg/m3 of each fine of a state."""
    return frame.column("density")[frame.column("type") == Kind.FINE]


class Fluid(Protocol):
    """A fluid that answers for all fines of a state."""

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of the measures, in the order of the columns."""

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""


def write_forces(folder: Path, spheres: Snapshot, forces: FluidForces) -> None:
    """Write the files that the deck reads: the number of rows, then id and value of a fine each.

    Values have twelve digits. To LIGGGHTS the value of a fine that has no row is 0.
    """
    fines = spheres.fines()
    carried = forces.velocity + forces.push / forces.coefficient[:, None]
    for name, value in zip(_FILES, (forces.coefficient, *carried.T), strict=True):
        some = value != 0.0
        form = f"{np.sum(some)}\n" + "".join([f"{one} %.12g\n" for one in fines.id[some].tolist()])
        (folder / "post" / f"fluid.{name}").write_text(form % tuple(value[some].tolist()))


def largest_share(spheres: Snapshot, forces: FluidForces, density: Array, time: float) -> float:
    """`time` s over the shortest relaxation time m / C of a fine of `density` (N,) kg/m3."""
    if not len(forces.coefficient):
        return 0.0
    return float(np.max(drag_rate(spheres.fines(), forces.coefficient, density))) * time


def drag_rate(fines: Snapshot, coefficient: Array, density: Array | float) -> Array:
    """C / m (N,) 1/s, at which drag takes up the slip of N `fines`.

    `coefficient` (N,) N s/m is C. `density` kg/m3 is that of each fine (N,), or of all.
    """
    return coefficient / (density * 4.0 / 3.0 * np.pi * fines.radius**3)


# ------------------------------------------------------------------------------------------------
# The files of a coupled deck that LIGGGHTS includes as the invasion goes on.


def write_coupled_parts(case: InvasionCase, scales: InvasionScales, folder: Path) -> None:
    """Write the files that a coupled deck is continued by."""
    for name, text in coupled_parts(case, scales).items():
        write_text(folder / name, text)


def coupled_parts(case: InvasionCase, scales: InvasionScales) -> dict[str, str]:
    """Name and text of each file that a coupled deck is continued by; empty when it is not."""
    if not case.drag.coupled:
        return {}
    shown = {"dump_columns": COLUMNS, "dump_group": dumped_group(case)}
    coefficient = "Ksl" if case.drag.scheme == "implicit" else "cd"
    drag = drag_variables(case, scales)
    parts = {
        "ask.in": render_text(
            "ask.in.j2", shown | {"dump_columns": shown_columns(case), "state": STATE}
        ),
        "fluid.in": render_text("fluid.in.j2", {"coefficient": coefficient}),
        "checkpoint.in": render_text(
            "checkpoint.in.j2",
            shown | {"dump_format": FORMAT, "allowance": plug_allowance(case, scales)},
        ),
    }
    if drag["hold_steps"]:
        parts["held.in"] = render_text("held.in.j2", {"drag": drag})
    return parts


def dumped_group(case: InvasionCase) -> str:
    """The group of spheres that move, which dumps hold."""
    return "all" if case.grains.motion == "mobile" else "fines"


# ------------------------------------------------------------------------------------------------
# The files by which a batch of fines enters LIGGGHTS.


SUPPLY = "supply"
"""Folder of the batches."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchFiles:
    """The files of the batches of an invasion.

    Attributes:
        case: what is run.
        folder: of the invasion.
        counts: number of fines in each batch.
        first: id of the first fine.
        bounds: (3, 2) m, of the simulation box.
        drag: variables of the drag in a deck.
    """

    case: InvasionCase
    folder: Path
    counts: Sequence[int]
    first: int
    bounds: Array
    drag: Mapping[str, Any]

    @cached_property
    def density(self) -> Array:
        """(N,) kg/m3, of the fines of all batches in the order of their ids."""
        return densities(self.case, self.counts)

    def write(self, which: int, fines: Snapshot, velocity: float) -> str:
        """Write supply/batch_N.data and .in of batch `which` (from 0), which moves at `velocity`.

        Returns the name of the second in the folder of the invasion.
        """
        name = f"{SUPPLY}/batch_{which}"
        (self.folder / SUPPLY).mkdir(exist_ok=True)
        density = self.density[fines.id.astype(int) - self.first]
        path = self.folder / f"{name}.data"
        write_data(path, fines, bounds=self.bounds, density=density, types=3)
        values = {
            "name": name,
            "first": int(fines.id[0]),
            "last": int(fines.id[-1]),
            "start_velocity": number(velocity),
            "drag": self.drag,
        }
        write_text(self.folder / f"{name}.in", render_text("batch.in.j2", values))
        return f"{name}.in"


# ------------------------------------------------------------------------------------------------
# The invasion deck and its data file.


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


# ------------------------------------------------------------------------------------------------
# Decks without LIGGGHTS.


def render_decks(case: Case, out: Path, *, ranks: int = 1) -> list[Path]:
    """Write the decks of a case without LIGGGHTS: the pack with its data file, and the invasion.

    The data file of the invasion needs a finished pack, so `fdnet run` writes it. The deck of the
    invasion is written for grains that stand out beyond the face as those of a dense pack do. It
    leaves out the watch of overlaps, which depends on the contacts of the grains.

    Raises CaseError when a file that would be written is there already.
    """
    scales, out = scales_of(case), expanded(out)
    refuse_folder_name(out)
    decks = {
        stage: out / stage / f"in.{stage}" for stage in case.stages if stage in LIGGGHTS_STAGES
    }
    texts = _invasion_files(case, ranks) if isinstance(case, InvasionCase) else {}
    invasion = {out / "invade" / name: text for name, text in texts.items()}
    files = (decks["pack"], out / "pack" / "pack.data", *invasion)
    there = [path for path in files if os.path.lexists(path)]
    if there:
        raise CaseError(f"{there[0]}: is there already; give another --out (nothing was changed)")
    for path in decks.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    folder = decks["pack"].parent
    write_pack_inputs(case, scales, folder, count=grain_count(case), ranks=ranks)
    for path, text in invasion.items():
        path.write_text(text, encoding="utf-8")
    return list(decks.values())


def _invasion_files(case: InvasionCase, ranks: int) -> dict[str, str]:
    """Name and text of the invasion's deck and of the files that it is continued by."""
    scales = invasion_scales(case)
    deck = render_invade(case, scales, _expected_grains(case), ranks=ranks, packed=False)
    return {"in.invade": deck.text, **coupled_parts(case, scales)}


def _expected_grains(case: Case) -> Snapshot:
    """One grain that stands out beyond the face as those of a dense pack do; only that matters."""
    radius = case.grains.radius_range_m[1]
    box = box_of(case)
    return resting(np.array([[0.7 * radius, *(box[1:, 1] / 2)]]), radius, box)
