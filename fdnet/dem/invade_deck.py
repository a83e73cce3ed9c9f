"""The decks of an invasion and of a clean-up, and what a coupled one hands to LIGGGHTS.

What the fluid does to each fine is handed over in files of one value an atom. The force on a fine
of velocity v is F = C (u - v) + P: C its drag coefficient, u the velocity of the fluid at it, and
P a force that does not depend on v, such as its volume times the fall of pressure. LIGGGHTS is
given C and w = u + P / C, since F = C (w - v).
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.dem import checkpoint, deck
from fdnet.dem.checkpoint import Checkpoint
from fdnet.dem.deck import BELOW_ZERO, Deck, LeftOut, number
from fdnet.dem.packing import write_pack_inputs
from fdnet.dem.supply import AT_ONCE, batches_of, densities, place_batches, slab_end
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
SUPPLY = "supply"  # Folder of the batches
SCRATCH = "post/contacts.restart"
"""File that a continued deck writes only to store the contacts with the spheres."""
GIVEN = ("f_uf[1]", "f_uf[2]", "f_uf[3]")
"""Columns with the w that each fine was given; shown where the flow follows the deposit."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FluidForces:
    """What acts on N fines until they are looked at again."""

    coefficient: Array  # (N,) N s/m, C; above 0
    velocity: Array  # (N, 3) m/s, u
    push: Array  # (N, 3) N, P
    # m/s, speed with which the fines move on; it decides when they are looked at again
    pace: float
    # what the record of updates keeps, by the names of `DrivingFluid.measured`
    measures: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Moment:
    """When the fines are looked at."""

    step: int
    time: float  # s, since the start
    before: Mapping[str, float] | None  # the row of the update before this one; None for the first
    # whether a chunk begins. What is answered then must follow from the spheres and the row before
    # alone, so that a run that was cut gives the same.
    fresh: bool
    left: float = math.inf  # s, until the chunk ends, when they are looked at again in any case
    # (N,) m/s, speed w at which each fine would go by the forces that it has now; 0 where it has
    # none yet. None where it is not known.
    given: Array | None = None
    density: Array | None = None  # (N,) kg/m3 of each fine. None where all have that of the case.


class DrivingFluid(Protocol):
    """A fluid that answers for all fines of a state."""

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of the measures, in the order of the columns."""

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""

    def keep(self, path: Path) -> None:
        """Write what the next answer needs and spheres and rows do not say, if there is any."""

    def recall(self, path: Path | None) -> None:
        """Read it back; begin anew without a path."""


SHOWN_COLUMNS = " ".join((COLUMNS, "density", *GIVEN))  # Columns of the state that LIGGGHTS shows


def read_state(folder: Path) -> Frame:
    """The spheres that LIGGGHTS shows. Raises DumpError when it did not write all of them."""
    return read_binary_frame(folder / STATE, tuple(SHOWN_COLUMNS.split()))


def fine_density(frame: Frame) -> Array:
    """The density (N,) kg/m3 of each fine of a state."""
    return frame.column("density")[frame.column("type") == Kind.FINE]


def write_forces(folder: Path, spheres: Snapshot, forces: FluidForces) -> None:
    """Write the files that the deck reads: the number of rows, then id and value of a fine each.

    Values have twelve digits. To LIGGGHTS the value of a fine that has no row is 0.
    """
    fines = spheres.fines()
    carried = forces.velocity + forces.push / forces.coefficient[:, None]
    values = zip(("cd", "ux", "uy", "uz"), (forces.coefficient, *carried.T), strict=True)
    for name, value in values:
        some = value != 0.0
        form = f"{np.sum(some)}\n" + "".join([f"{one} %.12g\n" for one in fines.id[some].tolist()])
        (folder / "post" / f"fluid.{name}").write_text(form % tuple(value[some].tolist()))


def drag_rate(fines: Snapshot, coefficient: Array, density: Array | float) -> Array:
    """C / m (N,) 1/s, at which drag takes up the slip of N `fines`.

    `coefficient` (N,) N s/m is C. `density` kg/m3 is that of each fine (N,), or of all.
    """
    return coefficient / (density * 4.0 / 3.0 * np.pi * fines.radius**3)


def coupled_parts(case: InvasionCase, scales: InvasionScales) -> dict[str, str]:
    """Name and text of each file that a coupled deck is continued by; empty when it is not."""
    if not case.drag.coupled:
        return {}
    shown = dump_variables(case)
    asked = {"dump_columns": SHOWN_COLUMNS, "dump_group": shown["dump_group"], "state": STATE}
    counted = shown | {"allowance": checkpoint.plug_allowance(case, scales), "follows": True}
    return {
        "ask.in": deck.render_text("ask.in.j2", asked),
        "fluid.in": deck.render_text("fluid.in.j2", {}),
        "checkpoint.in": deck.render_text("checkpoint.in.j2", counted),
    }


def dump_variables(case: InvasionCase) -> dict[str, str]:
    """What dumps hold: the spheres that move."""
    group = "all" if case.grains.motion == "mobile" else "fines"
    return {"dump_group": group, "dump_columns": COLUMNS, "dump_format": FORMAT}


# ------------------------------------------------------------------------------------------------
# The files that a deck of an invasion reads: the first fines, and the batches that come later.


@dataclass(frozen=True, eq=False)
class InvadeInputs:
    """What the files of an invasion follow from, and their folder."""

    case: InvasionCase
    scales: InvasionScales
    grains: Snapshot
    folder: Path

    def write(self, *, ranks: int = 1) -> Deck:
        """Write in.invade, invade.data (grains and the first fines) and the batches that follow.

        Raises CaseError when the slab cannot hold its fines.
        """
        case, scales, grains, folder = self.case, self.scales, self.grains, self.folder
        spheres = grains.joined(self.write_batches())
        pairs, _ = touching_pairs(spheres, case.periodic)
        if np.any(spheres.kind[pairs] == Kind.FINE):
            raise CaseError(
                "fines: a fine would start in contact; this is an fdnet fault, please report the "
                "case and seed"
            )
        made = render_invade(case, scales, grains, ranks=ranks)
        write_text(folder / "in.invade", made.text)
        write_parts(case, scales, grains, folder)
        self._write_data("invade", spheres)
        return made

    def write_batches(self) -> Snapshot:
        """Write the batches that are read before later chunks; the fines that are there at first.

        Where the deposit slows the mud down they are written when they are due (`later_batch`).
        """
        batches = place_batches(self.case, self.scales, self.grains)
        first = list(islice(batches, AT_ONCE))
        if not self.case.drag.slowed:
            for which, fines in enumerate(batches, AT_ONCE):
                self.write_batch(which, fines, self.scales.upstream_velocity)
        return reduce(Snapshot.joined, first)

    def write_batch(self, which: int, fines: Snapshot, velocity: float) -> str:
        """Write supply/batch_N.data and .in of batch N (from 0); it moves at `velocity` m/s.

        Returns the name of the second file.
        """
        name = f"{SUPPLY}/batch_{which}"
        (self.folder / SUPPLY).mkdir(exist_ok=True)
        self._write_data(name, fines)
        values = {
            "name": name,
            "first": int(fines.id[0]),
            "last": int(fines.id[-1]),
            "start_velocity": number(velocity),
            "drag": deck.drag_variables(self.case, self.scales),
        }
        write_text(self.folder / f"{name}.in", deck.render_text("batch.in.j2", values))
        return f"{name}.in"

    def _write_data(self, name: str, spheres: Snapshot) -> None:
        fine, grains = spheres.kind == Kind.FINE, self.grains
        density = np.full(len(spheres), self.case.grains.density_kg_m3)
        density[fine] = self._fine_density[spheres.id[fine] - (int(grains.id.max()) + 1)]
        bounds, path = _bounds(self.case, self.scales, grains), self.folder / f"{name}.data"
        deck.write_data(path, spheres, bounds=bounds, density=density, types=3)

    @cached_property
    def _fine_density(self) -> Array:
        return densities(self.case, batches_of(self.case, self.scales).counts)


def write_parts(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path
) -> None:
    """Write the files that a deck of the invasion includes, apart from the batches."""
    for name, text in coupled_parts(case, scales).items():
        write_text(folder / name, text)
    checkpoint.write_watch_parts(case, grains, folder)


# ---- The decks in which fines move among grains.
def _margin(case: InvasionCase, scales: InvasionScales) -> float:
    """How far a fine could go in one chunk at twice its free velocity, plus two diameters, m."""
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
    gravity, left_out = deck.gravity_variables(case, scales)
    left_out += [*deck.forces_left_out(case), *_left_out(case, scales, ranks, packed)]
    batches = len(batches_of(case, scales).counts)
    behind = _bounds(case, scales, grains)[0, 0] + _margin(case, scales)
    sides = "INF INF INF INF"
    text = deck.render_text(
        "invade.in.j2",
        deck.header_variables(case, "invade", left_out, ranks)
        | moving_variables(case, scales)
        | {
            "gravity": gravity,
            "resume": resume and {"restart": f"post/invade_{resume.step}.restart"},
            "scratch": SCRATCH,
            "start_velocity": number(scales.upstream_velocity),
            "drag": deck.drag_variables(case, scales),
            "overlap": checkpoint.watch_variables(case, scales, grains) if packed else None,
            "regions": specimen_regions(case)
            | {
                "upstream": f"{number(np.nextafter(behind, 0))} {number(BELOW_ZERO)} {sides}",
                "behind": f"INF {number(behind)} {sides}",
            },
            "quiet_checkpoints": checkpoint.quiet_chunks(scales),
            "empty_checkpoints": checkpoint.empty_chunks(case, scales),
            "allowance": checkpoint.plug_allowance(case, scales),
            "start": resume._replace(chunk=resume.chunk + 1)
            if resume
            else Checkpoint(1, *[0] * 7),
            # the chunks that take in a batch of mud of constant velocity; in mud that slows down
            # they follow from the distance that it has moved
            "feeding": {"first": AT_ONCE, "last": batches - 1} if batches > AT_ONCE else None,
            "slowed": case.drag.slowed,
            "follows": case.drag.coupled,
            "supply": SUPPLY,
            "chunks": checkpoint.chunks_of(case, scales),
            "stop_when_plugged": case.run.duration_s is None,
        },
    )
    return Deck(text, tuple(left_out))


def moving_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any]:
    """The variables of any deck in which fines move among grains."""
    mobile = case.grains.motion == "mobile"
    # a skin of 0.3 to 0.8 of the diameter of the smallest fine was measured to be fastest, and
    # where the flow follows the deposit, of 0.35 (0.15 takes a fifth longer in a large specimen)
    skin = (0.7 if case.drag.coupled else 1.0) * case.fines.radius_range_m[0]
    walls = _friction(case, scales, walls_only=True)
    return dump_variables(case) | {
        "skin": number(skin),
        "contacts": deck.contact_variables(
            case, scales, "invade", friction=_friction(case, scales)
        ),
        "time_step": number(scales.time_step),
        "walls": deck.wall_variables(case, "invade", friction=walls),
        "fixed_grains": not mobile,
        "moving": "all" if mobile else "fines",
        "thermo_steps": max(1, scales.checkpoint_steps // 4),
        "chunk_steps": scales.checkpoint_steps,
    }


def specimen_regions(case: InvasionCase) -> dict[str, str]:
    """The specimen, 0 <= x < length, and what lies beyond its outlet."""
    length, sides = case.size_m[0], "INF INF INF INF"
    return {
        "specimen": f"0.0 {number(np.nextafter(length, 0))} {sides}",
        "beyond": f"{number(length)} INF {sides}",
    }


def _friction(case: InvasionCase, scales: InvasionScales, *, walls_only: bool = False) -> bool:
    """Whether any contact that can slip has friction, of all pairs or of those with a wall."""
    mobile = case.grains.motion == "mobile"
    slipping = [c for name, c in scales.contacts.items() if "fine" in name or mobile]
    return any(c.friction > 0 for c in slipping if "wall" in c.pair or not walls_only)


def _left_out(
    case: InvasionCase, scales: InvasionScales, ranks: int, packed: bool
) -> list[LeftOut]:
    contact, unasked = case.contact, "not asked for"
    batches = "they come in batches, each when it is about to arrive"
    unseen = "" if packed else "which grains touch is known once they are packed"
    unseen = unseen if case.fines.one_size else "fines are of unequal size"
    unseen = unseen if case.grains.motion == "fixed" else "pairs of grains overlap too"
    reasons = [
        ("motion of grains, end planes", "grains are fixed", case.grains.motion == "fixed"),
        ("tangential history", "no pair has friction", not _friction(case, scales)),
        ("loss of rebound in the liquid", unasked, contact.restitution != "liquid"),
        ("rolling resistance", unasked, contact.rolling_friction is None),
        ("cohesion", unasked, contact.cohesion_J_m3 is None),
        ("side walls", "sides are periodic", case.box.sides == "periodic"),
        ("fines far upstream", batches, case.fines.supply == "batches"),
        ("MPI processor grid", "one rank", ranks == 1),
        ("overlap between checkpoints", unseen, bool(unseen)),
    ]
    return [LeftOut(what, why) for what, why, left in reasons if left]


# ---- Decks without LIGGGHTS.
def render_decks(case: Case, out: Path, *, ranks: int = 1) -> list[Path]:
    """Write the decks of a case without LIGGGHTS: the pack with its data file, and the invasion.

    The data file of the invasion needs a finished pack, so `fdnet run` writes it. The deck of the
    invasion is written for one grain that stands out beyond the face as those of a dense pack do;
    only that matters. It leaves out the watch of overlaps, which depends on contacts of grains.

    Raises CaseError when a file that would be written is there already.
    """
    out = expanded(out)
    scales_of(case)  # refuses what no deck can be written for
    refuse_folder_name(out)
    decks = {
        stage: out / stage / f"in.{stage}" for stage in case.stages if stage in LIGGGHTS_STAGES
    }
    invasion = {}
    if isinstance(case, InvasionCase):
        radius, box = case.grains.radius_range_m[1], deck.specimen_box(case)
        grain = resting(np.array([[0.7 * radius, *(box[1:, 1] / 2)]]), radius, box)
        flow = invasion_scales(case)
        made = render_invade(case, flow, grain, ranks=ranks, packed=False)
        invasion = {"in.invade": made.text, **coupled_parts(case, flow)}
    texts = {out / "invade" / name: text for name, text in invasion.items()}
    files = (decks["pack"], out / "pack" / "pack.data", *texts)
    there = [path for path in files if os.path.lexists(path)]
    if there:
        raise CaseError(f"{there[0]}: is there already; give another --out (nothing was changed)")
    for path in decks.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    folder = decks["pack"].parent
    write_pack_inputs(case, folder, count=grain_count(case))
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")
    return list(decks.values())
