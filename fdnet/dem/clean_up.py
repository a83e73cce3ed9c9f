"""The clean-up: after the invasion the flow is turned back, and what is loose comes out.

It begins with the restart of the invasion's last checkpoint: the same spheres, contacts and
velocities.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fdnet.dem import deck, invade_deck
from fdnet.dem.checkpoint import HISTORY, Checkpoints, Cleaned, read_history, state_at
from fdnet.dem.deck import BELOW_ZERO, Deck, number
from fdnet.dem.invasion import ChunkedStage, EndedStage
from fdnet.dem.liggghts import Launch
from fdnet.errors import CaseError, Doubt, LiggghtsError
from fdnet.files import write_text
from fdnet.scales.scales import BackFlow
from fdnet.spheres.snapshot import Array, Snapshot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Start:
    """What a clean-up begins with."""

    grains: Snapshot  # of the pack
    invaded: Snapshot  # grains and all fines at the end of the invasion
    invasion: Path  # folder of the invasion
    digest: str  # of the case's clean-up


def cleaned_points(folder: Path, digest: str) -> Checkpoints:
    """The checkpoints of a clean-up in `folder`."""
    return Checkpoints(folder=folder, digest=digest, stage="clean", kind=Cleaned)


def render_clean_up(
    flow: BackFlow, digest: str, restart: str, last: Cleaned | None, *, ranks: int = 1
) -> Deck:
    """The deck of a clean-up, at the end of the invasion or continued from a checkpoint.

    `restart` is the path of the restart file that it begins with, from the folder of the deck.
    """
    case, scales = flow.case, flow.scales
    gravity, left_out = deck.gravity_variables(case, scales)
    left_out += deck.forces_left_out(case)
    text = deck.render_text(
        "clean_up.in.j2",
        deck.header_variables(case, "invade", left_out, ranks)
        | invade_deck.moving_variables(case, scales)
        | {
            "stage": "clean_up",
            "digest": digest,
            "going_on": last is not None,
            "restart": restart,
            "gravity": gravity,
            "drag": turned_drag(flow),
            "resume": False,
            "regions": invade_deck.specimen_regions(case)
            | {"out": f"INF {number(BELOW_ZERO)} INF INF INF INF"},
            "start": last._replace(chunk=last.chunk + 1) if last else Cleaned(1, *[0] * 5),
            "chunks": flow.chunks,
            "quiet_chunks": flow.quiet_chunks,
        },
    )
    return Deck(text, tuple(left_out))


def turned_drag(flow: BackFlow) -> dict[str, Any]:
    """The variables of `_drag.in.j2` with the velocities and the gradient below 0.

    What depends on the size of a slip alone is that of the flow ahead.
    """
    scales, push = flow.scales, flow.scales.push
    turned = replace(
        scales,
        drive_velocity=-scales.drive_velocity,
        upstream_velocity=-scales.upstream_velocity,
        push=replace(push, velocity=-push.velocity, gradient=-push.gradient, reynolds_slope=0.0),
    )
    ahead, back = deck.drag_variables(flow.case, scales), deck.drag_variables(flow.case, turned)
    return back | {"inertia": ahead["inertia"]} if "inertia" in ahead else back


@dataclass(frozen=True, eq=False, kw_only=True)
class CleanUpStage(ChunkedStage):
    """A clean-up as it is run: the flow that is turned back, and what it begins with."""

    flow: BackFlow
    start: Start

    deck = "in.clean_up"
    mark = "FDNET cleaned"

    def write(self, last: Cleaned | None) -> Deck:
        """Write the inputs of a start, or of a restart from `last`.

        Raises CaseError where the restart of the invasion is missing or changed.
        """
        start, name, case = self.start, self.deck, self.flow.case
        if last is None:
            before = Checkpoints(folder=start.invasion, digest=case.digest("invade"))
            path = before.path(self.first_step, "restart")
            if not before.holds(self.first_step, "restart"):
                raise CaseError(
                    f"{path}: the clean-up begins with this file, and it is missing or is not the "
                    "one that the invasion wrote; put it back, or run the invasion again with "
                    "--stages invade,clean_up,analyse,report --force"
                )
            restart = f"../{start.invasion.name}/post/{path.name}"
        else:
            restart, name = f"post/clean_{last.step}.restart", f"{name}.resume"
        made = render_clean_up(self.flow, start.digest, restart, last, ranks=self.launch.ranks)
        write_text(self.folder / name, made.text)
        parts = invade_deck.coupled_parts(case, self.flow.scales)
        if parts:
            parts["checkpoint.in"] = deck.render_text(
                "cleaned.in.j2", invade_deck.dump_variables(case)
            )
        for part, text in parts.items():
            write_text(self.folder / part, text)
        return made

    def over(self, last: Cleaned) -> bool:
        """Whether the checkpoint `last` is the end."""
        quiet = self.flow.quiet_chunks and last.quiet >= self.flow.quiet_chunks
        return last.chunk >= self.flow.chunks or bool(quiet) or last.inside == 0

    def ending(self, last: Cleaned) -> tuple[str, list[str]]:
        """The stop reason, and warnings."""
        if last.inside == 0:
            return "empty", []
        if not self.flow.quiet_chunks:
            return "duration", []
        if last.quiet >= self.flow.quiet_chunks:
            return "quiet", []
        text = (
            "the clean-up stopped at its cap while fines still came out: give clean_up.duration_ms"
        )
        return "cap", [Doubt("clean-up-at-its-cap", text)]


def fines_inside(spheres: Snapshot) -> Array:
    """Which fines (N,) lie inside the specimen; these take part in a clean-up."""
    x, (low, high) = spheres.fines().position[:, 0], spheres.box[0]
    return (x >= low) & (x < high)


def clean_up(
    flow: BackFlow,
    start: Start,
    folder: Path,
    launch: Launch,
    *,
    fluid: invade_deck.DrivingFluid | None = None,
) -> EndedStage:
    """Turn the flow back; continues from the last whole checkpoint when `folder` holds one.

    A coupled case needs the `fluid` that answers for its fines. The `stop_reason` is also "quiet"
    (nothing came out any more) or "empty". Raises LiggghtsError when a run fails or fines are
    lost, CaseError when the restart of the invasion is not there.
    """
    stage = CleanUpStage(
        case=flow.case,
        scales=flow.scales,
        grains=start.grains,
        points=cleaned_points(folder, start.digest),
        launch=launch,
        fluid=fluid,
        first_step=start.invaded.step,
        flow=flow,
        start=start,
    )
    made, runs = stage.drive()
    history = read_history(folder, Cleaned)
    last = history[-1]
    state = state_at(folder, last, flow.case, flow.scales, start.grains)
    before, inside = int(fines_inside(start.invaded).sum()), fines_inside(state)
    if inside.sum() != last.inside or len(inside) != last.inside:
        raise LiggghtsError(
            f"{folder}: the last dump holds {len(inside)} fines, {inside.sum()} of them inside; "
            f"expected {last.inside} as in {HISTORY}; start over with --force"
        )
    if before != last.inside + last.out + last.passed:
        raise LiggghtsError(
            f"{folder}: {last.inside} fines inside, {last.out} come out and "
            f"{last.passed} at the other end are not the {before} before: fines were lost; "
            "lower run.time_step_factor"
        )
    reason, warnings = stage.ending(last)
    return EndedStage(
        state=state,
        history=history,
        stop_reason=reason,
        warnings=tuple(warnings),
        left_out=made.left_out,
        runs=runs,
        ranks=launch.ranks,
        step_s=flow.step,
    )
