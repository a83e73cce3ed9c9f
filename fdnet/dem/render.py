"""Decks without LIGGGHTS."""

import os
from pathlib import Path

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.case.stages import LIGGGHTS_STAGES
from fdnet.dem.coupled_parts import coupled_parts
from fdnet.dem.invade_deck import render_invade
from fdnet.dem.pack_deck import write_pack_inputs
from fdnet.dem.scene import box_of
from fdnet.errors import CaseError
from fdnet.files.paths import expanded, refuse_folder_name
from fdnet.scales.grain_pack import grain_count
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Snapshot, resting


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
    scales = scales_of(case)
    deck = render_invade(case, scales, _expected_grains(case), ranks=ranks, packed=False)
    return {"in.invade": deck.text, **coupled_parts(case, scales)}


def _expected_grains(case: Case) -> Snapshot:
    """One grain that stands out beyond the face as those of a dense pack do; only that matters."""
    radius = case.grains.radius_range_m[1]
    box = box_of(case)
    return resting(np.array([[0.7 * radius, *(box[1:, 1] / 2)]]), radius, box)
