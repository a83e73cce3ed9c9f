"""The dense pack of grains (thesis, appendix A).

Small spheres are put at random, grown in stages, and relaxed until they are at rest.
"""

import json
import math
import os
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.deck import LeftOut
from fdnet.dem.liggghts import Launch, Run, run_deck
from fdnet.dem.pack_deck import RELAX_RUN_STEPS, REST_RUNS, check_radii, write_pack_inputs
from fdnet.dem.scene import (
    snapshot_of,
)
from fdnet.errors import CaseError, LiggghtsError
from fdnet.scales.densest import densest_porosity, reach_text, within_limit
from fdnet.scales.grain_pack import (
    PACK_STEP,
    grain_count,
)
from fdnet.scales.scales import Scales
from fdnet.spheres.contacts import max_overlap
from fdnet.spheres.dump import read_frame
from fdnet.spheres.porosity import measure_porosity
from fdnet.spheres.snapshot import Snapshot

POROSITY_TOLERANCE = 0.003
"""Accepted difference to the porosity of the case."""
ATTEMPTS = 8
"""Most packs with different numbers of grains that are tried."""
PLACES = 4
"""Most sets of random places from which the same grains are packed, when they do not come to
rest."""
MOST_CREEP = 1e-5
"""Root-mean-square speed, in grain diameters per sqrt(m/k), up to which a creeping pack is
accepted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """A pack at rest, or nearly.

    Attributes:
        grains: as packed.
        porosity: overlaps counted once.
        porosity_error: standard error of `porosity`.
        porosity_sum: porosity by the plain sum of the spheres' volumes.
        max_overlap: largest overlap of two grains over the smaller diameter.
        steps: of the last attempt.
        step_s: s, time step.
        attempts: one row for each number of grains that was tried.
        restless: packs that did not come to rest, before others from the next random places did.
        left_out: what the deck does without.
        run: the execution of LIGGGHTS that made it.
        creep: m/s, root-mean-square speed of grains that never came to rest; 0 for a pack at rest.
    """

    grains: Snapshot
    porosity: float
    porosity_error: float
    porosity_sum: float
    max_overlap: float
    steps: int
    step_s: float
    attempts: tuple[dict[str, Any], ...]
    left_out: tuple[LeftOut, ...]
    run: Run
    creep: float
    restless: int = 0


class RestlessError(LiggghtsError):
    """The grains never came to rest."""


def make_pack(case: Case, scales: Scales, folder: Path, launch: Launch) -> Pack:
    """Pack with different numbers of grains until the porosity is within 0.003 of the target.

    Raises CaseError when the porosity cannot be reached, LiggghtsError when a run fails or does
    not come to rest.
    """
    folder.mkdir(parents=True, exist_ok=True)
    counts, tried = [grain_count(case)], []
    while True:
        attempt = folder / f"attempt_{len(counts)}"
        pack = _at_rest(case, scales, attempt, launch, count=counts[-1])
        tried.append(
            {
                "grains": len(pack.grains),
                "porosity": pack.porosity,
                "porosity_error": pack.porosity_error,
                "max_overlap": pack.max_overlap,
                "restless": pack.restless,
                "liggghts_s": pack.run.seconds,
            }
        )
        _refuse_overlap(case, pack)
        if case.grains.count is not None or _is_met(scales.porosity, pack):
            return _accept(folder, attempt, pack, tried)
        counts.append(_next_count(case, scales.porosity, tried))
        shutil.rmtree(attempt)


def _refuse_overlap(case: Case, pack: Pack) -> None:
    if pack.max_overlap > case.grains.max_overlap:
        key = "grains.porosity" if case.grains.count is None else "grains.count"
        value = case.grains.porosity if case.grains.count is None else case.grains.count
        raise CaseError(
            f"{key}: {value} needs grains that overlap by {100 * pack.max_overlap:.1f} % of a "
            f"diameter (limit grains.max_overlap {case.grains.max_overlap:g}); "
            f"{_what_can_be(case, pack)}take a looser pack or raise the limit"
        )


def _what_can_be(case: Case, pack: Pack) -> str:
    """The porosities that these grains can have, in words; empty where the pack is loose."""
    rigid = densest_porosity(case.grains)
    if pack.porosity >= rigid:
        return ""
    limit = within_limit(rigid, pack.porosity, pack.max_overlap, case.grains.max_overlap)
    return f"{reach_text(rigid)}, and about {limit:.2f} within the limit: "


def _is_met(target: float, pack: Pack) -> bool:
    return abs(pack.porosity - target) + pack.porosity_error <= POROSITY_TOLERANCE


def _next_count(case: Case, target: float, tried: list[dict[str, Any]]) -> int:
    """The number of grains to try next.

    First one step of Newton's method on the plain sum of volumes, then the secant through the two
    attempts that are nearest to the target.
    """
    grain = case.grains.mean_volume_m3 / math.prod(case.size_m)
    nearest = sorted(tried, key=lambda row: abs(row["porosity"] - target))
    slope = -grain
    if len(nearest) > 1 and nearest[0]["grains"] != nearest[1]["grains"]:
        secant = (nearest[0]["porosity"] - nearest[1]["porosity"]) / (
            nearest[0]["grains"] - nearest[1]["grains"]
        )
        slope = min(max(secant, -1.5 * grain), -0.4 * grain)
    guess = round(nearest[0]["grains"] + (target - nearest[0]["porosity"]) / slope)
    done = {row["grains"] for row in tried}
    around = [
        count
        for count in (guess, guess + 1, guess - 1, guess + 2, guess - 2)
        if count > 0 and count not in done
    ]
    if not around or len(tried) >= ATTEMPTS:
        raise CaseError(
            f"grains.porosity: {target} not met within {POROSITY_TOLERANCE} after {len(tried)} "
            f"packs, nearest {nearest[0]['porosity']:.4f} with {nearest[0]['grains']} grains (one "
            f"grain is {grain:.4f}); use a larger box, another seed, or give grains.count"
        )
    return around[0]


def _accept(folder: Path, attempt: Path, pack: Pack, tried: list[dict[str, Any]]) -> Pack:
    for path in attempt.iterdir():
        target = folder / path.name
        if target.is_dir():
            shutil.rmtree(target)
        os.replace(path, target)
    attempt.rmdir()
    (folder / "attempts.json").write_text(json.dumps(tried, indent=1) + "\n")
    return replace(pack, attempts=tuple(tried), run=replace(pack.run, directory=folder))


def _at_rest(case: Case, scales: Scales, folder: Path, launch: Launch, *, count: int) -> Pack:
    """A pack of `count` grains, from the next random places where it does not come to rest.

    Raises RestlessError when it does not after `PLACES` of them.
    """
    for places in range(PLACES):
        try:
            pack = _attempt(case, scales, folder, launch, count=count, places=places)
        except RestlessError as error:
            last = error
        else:
            return replace(pack, restless=places)
    raise RestlessError(f"{last} (tried {PLACES} times from other places)") from last


def _attempt(
    case: Case, scales: Scales, folder: Path, launch: Launch, *, count: int, places: int
) -> Pack:
    if folder.exists():
        shutil.rmtree(folder)
    (folder / "post").mkdir(parents=True)
    deck = write_pack_inputs(case, scales, folder, count=count, ranks=launch.ranks, places=places)
    run = _run(case, folder, count, launch)
    frame = read_frame(folder / "post" / "pack.dump")
    screen = (folder / "screen.txt").read_text(encoding="utf-8", errors="replace")
    grains = snapshot_of(frame, case, time_s=0.0)
    creep = _creep(case, scales, folder, grains) if "FDNET restless" in screen else 0.0
    if len(grains) != count:
        raise LiggghtsError(
            f"{folder}/post/pack.dump: {len(grains)} grains, expected {count}: some were lost"
        )
    check_radii(grains, case, folder / "post" / "pack.dump")
    porosity = measure_porosity(grains, periodic=case.periodic)
    return Pack(
        grains=grains,
        porosity=porosity.mean,
        porosity_error=porosity.standard_error,
        porosity_sum=porosity.sum,
        max_overlap=max_overlap(grains, case.periodic),
        steps=frame.step,
        step_s=scales.pack_step,
        attempts=(),
        left_out=deck.left_out,
        run=run,
        creep=creep,
    )


def _creep(case: Case, scales: Scales, folder: Path, grains: Snapshot) -> float:
    """Root-mean-square speed, m/s, of grains that never came to rest.

    A pack that is barely jammed has such soft modes. Raises RestlessError above `MOST_CREEP` grain
    diameters per sqrt(m/k).
    """
    speed = float(np.sqrt(np.mean(np.sum(grains.velocity**2, axis=1))))
    natural = 2 * case.grains.mean_radius_m * PACK_STEP / scales.pack_step
    if speed > MOST_CREEP * natural:
        raise RestlessError(
            f"{folder}: the pack did not come to rest in {REST_RUNS * RELAX_RUN_STEPS} steps, its "
            f"grains still move at {speed:.3g} m/s (limit {MOST_CREEP * natural:.3g}); take "
            "another seed or porosity"
        )
    return speed


def _run(case: Case, folder: Path, count: int, launch: Launch) -> Run:
    try:
        return run_deck(folder, "in.pack", launch)
    except LiggghtsError as error:
        if "Lost atoms" not in str(error):
            raise
        key = "grains.porosity" if case.grains.count is None else "grains.count"
        raise CaseError(
            f"{key}: {count} grains needs more room than the box has, some were pushed out of it "
            "while growing; raise the porosity, lower the count or enlarge the box"
        ) from error
