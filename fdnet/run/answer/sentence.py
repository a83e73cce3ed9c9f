"""The answer of a run in words: one sentence to act on, how the run ended, how sure it is."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from fdnet.case.control import Run
from fdnet.report.units import in_millidarcy, millimetres, percent, two_digits
from fdnet.run.answer.skin import size_words

ENDS = {
    "supply_exhausted": "the supply of fines ran out (the face is still open)",
    "duration": "the set time or volume was over (the face may still be open)",
    "cap": "the run reached its cap before anything else ended it",
}


def end_words(summary: Mapping[str, Any], control: Run) -> str:
    """Why the invasion ended, as a part of a sentence; the case's `control` has the rules."""
    reason, rate = summary["stop_reason"], summary.get("rate_over_initial")
    if reason != "plugged":
        return ENDS[reason]
    if control.stop_rate is not None and rate is not None and rate <= control.stop_rate:
        return f"the rate of flow fell below {percent(control.stop_rate)} % of the first"
    if control.plug_rate:
        most = f"at most {percent(control.plug_rate)} % of the fines of the undisturbed mud"
        return f"the face plugged: {most} crossed it for the set time"
    return "the face plugged: no fine crossed it for the set time"


def in_place_words(counts: Mapping[str, int]) -> str:
    """Why values in place are above the intact ones, a sentence; "" where none is."""
    sections, layers = counts["sections_inplace_above_intact"], counts["layers_above_intact"]
    if not sections and not layers:
        return ""
    return (
        f"In place, {sections} of the sections and {layers} of the thin layers seem to gain: they "
        "take less of the pressure than before, because the fines turn the flow aside, and "
        "because the pores that say the pressure are wider than a thin layer. Fines never raise "
        "the permeability of the specimen or of a slab cut out."
    )


def answer_sentence(summary: Mapping[str, Any]) -> str:
    """One sentence to act on; `summary` has the keys of the answer where there are fines."""
    if "damage" not in summary:
        k, porosity = summary["k_initial_m2"], 100 * summary["porosity_initial"]
        return f"The intact sand has {in_millidarcy(k)} mD at a porosity of {porosity:.1f} %."
    return " ".join(filter(None, (_depth(summary), _skin_words(summary))))


def _depth(summary: Mapping[str, Any]) -> str:
    damage, invaded = summary["damage"], summary["invaded_count"]
    if not invaded:
        return "No fine entered the sand, so it keeps its permeability."
    depth = millimetres(summary["invasion_depth_p95_m"])
    p95 = f"95 % of the fines that entered lie within {depth}"
    if summary["final"] is False:
        return (
            f"So far {p95}, but the run was cut at its cap and this is not final: raise "
            "run.cap_ms and run it again (--force) before you use these numbers."
        )
    if not damage["zone_depth_m"]:
        limit = two_digits(damage["lost_from"])
        return f"{p95}, and no layer loses {limit} of its permeability: the damage is negligible."
    share = f"{two_digits(damage['zone_k_over_k0'])} of the permeability"
    if damage["reaches_the_end"]:
        return (
            f"{p95}, and the damage reaches the end of the specimen, which keeps {share}: "
            "lengthen the box before you rely on the depth."
        )
    zone = millimetres(damage["zone_depth_m"])
    return (
        f"{p95} and the first {zone} keep {share}, so a perforation, a cut or a wash that reaches "
        f"deeper than {zone} meets sand that lost less than {two_digits(damage['lost_from'])}."
    )


def _skin_words(summary: Mapping[str, Any]) -> str:
    if "skin" not in summary or not summary["invaded_count"]:
        return ""
    lost, skin = summary["skin_flow_lost"], summary["skin"]
    if skin is None or math.isinf(skin):
        return "Nothing flows through the plugged layer, so the skin is infinite."
    well = f"a well of {millimetres(summary['skin_well_radius_m'])} radius"
    if skin <= 0:
        return f"For {well} this is no skin."
    return (
        f"For {well} this is a {size_words(lost)} skin of {skin:.2g}, which costs "
        f"{two_digits(lost)} of the flow."
    )


def certainty(summary: Mapping[str, Any]) -> Iterator[str]:
    """How the run ended, whether that is final, and what one seed is worth; sentences."""
    if summary.get("stop_reason") is None:
        return
    final = "final" if summary["final"] else "not final"
    yield f"The result is {final}, because {summary['words']['end']}."
    scatter = summary.get("scatter")
    if scatter and summary.get("invaded_count"):
        yield (
            f"This is one run with one seed ({summary['seed']}). Repeated seeds of such "
            f"specimens differ by {two_digits(scatter['depth_p95_relative'])} in the depth and by "
            f"{100 * scatter['first_mm_loss']:.2g} points in the loss of the first millimetre "
            f"(one standard deviation, {scatter['runs']} runs; {scatter['source']})."
        )
