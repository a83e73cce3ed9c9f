"""Decks without LIGGGHTS."""

from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.invade_deck import render_invade
from fdnet.dem.packing import write_pack_inputs
from fdnet.dem.scene import box_of
from fdnet.errors import CaseError
from fdnet.scales.scales import grain_count, scales_of
from fdnet.spheres.snapshot import Snapshot, resting


def render_decks(case: Case, out: Path, *, ranks: int = 1) -> list[Path]:
    """Write the decks of a case without LIGGGHTS: the pack with its data file, and the invasion.

    The invasion's data file needs a finished pack, so `fdnet run` writes it; the deck is shown for grains that stand
    beyond the face as those of a dense pack do. Raises CaseError when a deck is there already.
    """
    scales = scales_of(case)
    decks = [out / "pack" / "in.pack"] + ([out / "invade" / "in.invade"] if case.fines else [])
    there = [deck for deck in decks if deck.exists()]
    if there:
        raise CaseError(f"{there[0]}: is there already; give another --out (nothing was changed)")
    for deck in decks:
        deck.parent.mkdir(parents=True, exist_ok=True)
    write_pack_inputs(case, scales, decks[0].parent, count=grain_count(case), ranks=ranks)
    if case.fines:
        grains = _expected_grains(case)
        decks[1].write_text(render_invade(case, scales, grains, ranks=ranks).text)
    return decks


def _expected_grains(case: Case) -> Snapshot:
    """One grain that stands beyond the face as far as those of a dense pack do: only its reach matters."""
    radius = case.grains.radius_range_m[1]
    box = box_of(case)
    return resting(np.array([[0.7 * radius, *(box[1:, 1] / 2)]]), radius, box)
