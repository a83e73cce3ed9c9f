"""What a run says about the well: keys of summary.json that follow from its other results."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.run.answer.damage import DAMAGED_FROM, Zone, steps_of, zone_of
from fdnet.run.answer.rules import Sizes, rules_of, run_shows
from fdnet.run.answer.scatter import scatter_of
from fdnet.run.answer.sentence import answer_sentence, certainty, end_words, in_place_words
from fdnet.run.answer.skin import Step, flow_lost, layered_skin
from fdnet.run.bridging import Throats, open_throats, width_rows
from fdnet.run.cake import cake_words
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

LARGEST = 0.99
"""Share of the open throats between grains, by number, that are narrower than the "largest"."""


def with_answer(
    summary: Mapping[str, Any], case: Case, analysis: "Analysis", spheres: Snapshot
) -> dict[str, Any]:
    """`summary` with the keys of the answer; `spheres` are those at the end.

    Adds `answer` and `certainty` (sentences) always; with fines also `words` (parts of
    sentences), `damage`, `throats_bridged`, `rules`, `scatter`, and `skin` and `skin_flow_lost`
    where the case has a well. Infinite skins are null.
    """
    result = dict(summary)
    if isinstance(case, InvasionCase) and analysis.occupancy is not None:
        throats = open_throats(analysis)
        result |= _damage_keys(case, analysis, spheres)
        result["throats_bridged"] = width_rows(throats)
        result["run_shows"] = run_shows(summary)
        result["rules"] = rules_of(_sizes(case, throats), result["run_shows"])
        result["words"] = {
            "end": end_words(summary, case.run),
            "cake": cake_words(summary),
            "in_place": in_place_words(summary["network_counts"]),
        }
    return {**result, "answer": answer_sentence(result), "certainty": list(certainty(result))}


def _damage_keys(case: InvasionCase, analysis: "Analysis", spheres: Snapshot) -> dict[str, Any]:
    steps = steps_of(analysis)
    return {
        "damage": _zone_keys(zone_of(steps)),
        **_skin_keys(case, steps),
        "scatter": _scatter_keys(len(spheres.grains())),
    }


def _zone_keys(zone: Zone) -> dict[str, Any]:
    return {
        "zone_depth_m": zone.depth,
        "zone_k_over_k0": zone.ratio,
        "zone_k_initial_m2": zone.before,
        "zone_k_damaged_m2": zone.after,
        "lost_from": DAMAGED_FROM,
        "reaches_the_end": zone.open_end,
    }


def _skin_keys(case: Case, steps: list[Step]) -> dict[str, float | None]:
    if case.well is None:
        return {}
    radius, drainage = case.well.radius_m, case.well.drainage_radius_m
    skin = layered_skin(steps, radius)
    return {
        "skin": None if math.isinf(skin) else skin,
        "skin_flow_lost": flow_lost(skin, well=radius, drainage=drainage),
        "skin_well_radius_m": radius,
    }


def _scatter_keys(grains: int) -> dict[str, Any]:
    one = scatter_of(grains)
    return {
        "depth_p95_relative": one.depth,
        "first_mm_loss": one.loss,
        "runs": one.runs,
        "source": one.source,
    }


def _sizes(case: InvasionCase, throats: Throats) -> Sizes:
    """Of throats between grains; where all are at walls or end faces, of those."""
    width = throats.width[throats.between | ~throats.between.any()]
    middle, largest = np.quantile(width, (0.5, LARGEST))
    fines = case.fines.curve
    return Sizes(
        fines={f"D{share}": fines.size_at(share / 100) for share in (50, 85, 90)},
        throat_median=float(middle),
        throat_largest=float(largest),
        grain_d15=case.grains.curve.size_at(0.15),
        concentration=case.fines.volume_fraction,
    )
