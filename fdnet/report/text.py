"""Results in words: the answer of a run for a terminal, a notebook and the page, and its parts.

Every sentence and every headline number of a run is worded here, once.
"""

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.case.tables import Run
from fdnet.errors import SHOWN, Doubt
from fdnet.names import FLOW_LAW, STAGES
from fdnet.report.tables import (
    AGREES,
    MILLIDARCY,
    SHOWS,
    in_millidarcy,
    millimetres,
    percent,
    two_digits,
)
from fdnet.scales.clock import REST
from fdnet.scales.pack import SHARES
from fdnet.scales.scales import InvasionScales

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

UM, MM, PSI = 1e6, 1e3, 6894.757
"""Micrometres and millimetres in a metre, and pascals in a pound-force per square inch."""


# ---- The case in sentences: sand, mud, drive and specimen, in the units of the field.
def case_words(case: Case, scales: object = None) -> Iterator[str]:
    """Some sentences that say what was run; `scales` adds the velocity of the fluid."""
    porosity = case.grains.porosity
    packed = f"packed to a porosity of {100 * porosity:.3g} %" if porosity else "packed by number"
    yield f"Sand: grains of {_size_words(case.grains)}, {packed}."
    if isinstance(case, InvasionCase):
        solids, viscosity = 100 * case.fines.volume_fraction, 1e3 * case.fluid.viscosity_Pa_s
        mud = f"{solids:.3g} % of solids by volume, in a liquid of {viscosity:.3g} cP"
        yield f"Mud: fines of {_size_words(case.fines)}, {mud}."
        yield _drive(case, scales)
    else:
        yield "No mud."
    sides = " x ".join(f"{MM * side:.3g}" for side in case.size_m)
    held = {"walls": "between walls", "periodic": "periodic across the flow"}[case.box.sides]
    yield f"Specimen: {sides} mm, {held}; the flow goes along the first side. Seed {case.seed}."


def _size_words(spheres: Spheres) -> str:
    """Sizes; of measured ones D10, D50 and D90 as the case gives them, and of what is placed."""
    if spheres.one_size:
        return f"{2 * MM * spheres.mean_radius_m:.3g} mm ({2 * UM * spheres.mean_radius_m:.4g} µm)"
    if not spheres.measured:
        low, high = (2 * UM * radius for radius in spheres.radius_range_m)
        return f"{low:.3g} to {high:.3g} µm"

    def three(sizes: Mapping[float, float]) -> str:
        return ", ".join(f"D{100 * share:.0f} {UM * sizes[share]:.3g}" for share in SHARES) + " µm"

    placed = three({share: spheres.curve.size_at(share) for share in SHARES})
    asked = dict(spheres.sizes.asked or {}) if spheres.sizes is not None else {}
    if set(asked) >= set(SHARES):
        return f"{three(asked)} (of what is placed: {placed})"
    return f"{placed} (of what is placed)"


def _drive(case: InvasionCase, scales: object) -> str:
    fluid, well = case.fluid, case.well
    pressure = f"{fluid.overbalance_Pa / 1e6:.3g} MPa ({fluid.overbalance_Pa / PSI:.3g} psi)"
    if fluid.velocity_m_s is not None:
        text = "Drive: a given velocity of the fluid"
    elif well is not None:
        text = (
            f"Drive: an overbalance of {pressure} around a well of {MM * well.radius_m:.3g} mm "
            f"radius with a drainage radius of {well.drainage_radius_m:.3g} m"
        )
    else:
        length = MM * (fluid.darcy_length_m or case.size_m[0])
        text = f"Drive: an overbalance of {pressure}, lost over {length:.3g} mm"
    if not isinstance(scales, InvasionScales):
        return f"{text}."
    speed = scales.interstitial_velocity
    return f"{text}; between the grains the fluid moves at {speed:.2g} m/s."


# ---- The answer of a run: one sentence to act on, how the run ended, how sure it is.
SMALL, LARGE = 0.02, 0.2
"""Shares of the flow that a skin costs, below and above which words call it small and large."""
ENDS = {
    "supply_exhausted": "the supply of fines ran out (the face is still open)",
    "duration": "the set time or volume was over (the face may still be open)",
    "cap": "the run reached its cap before anything else ended it",
    "mud_cut_off": "the most mud that may come was used up before the face plugged",
}


def end_words(summary: Mapping[str, Any], control: Run) -> str:
    """Why the invasion ended, as a part of a sentence; the case's `control` has the rules."""
    reason, rate = summary["stop_reason"], summary.get("rate_over_initial")
    if reason == "unfinished":
        done = percent(summary["share_done"])
        return f"the invasion was cut at {done} % of the steps that it is expected to take"
    if reason != "plugged":
        return ENDS[reason]
    method = summary.get("method")
    least = control.stop_rate or (control.plug_rate if method == "both" else None)
    if least is not None and rate is not None and rate <= least:
        return f"the rate of flow fell below {percent(least)} % of the first"
    most = "no fine"
    if control.plug_rate:
        most = f"at most {percent(control.plug_rate)} % of the fines of the undisturbed mud"
    if rate is None or method == "network":
        return f"the face plugged: {most} crossed it for the set time"
    rest = f"{percent(max(REST, control.plug_rate))} % of the fluid's first velocity"
    moving = f"those inside moved at no more than {rest} on average"
    return f"the face plugged: {most} entered or left for the set time, and {moving}"


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


CAKE_LAWS = {
    "beetstra": "by Beetstra's law of drag",
    "carman-kozeny": "by Carman and Kozeny of the classes in it",
    "given": "as the case gives it",
}
"""Where the permeability of a cake is from, by the name in the summary."""


def cake_words(summary: Mapping[str, Any]) -> str:
    """How the cake lets the fluid through; `summary` has the keys of `cake_summary`."""
    cake, share = summary["cake"], percent(summary["cake_resistance_share"])
    if cake is None:
        return "no cake yet: no fine stands before the face"
    own = cake["no_cake_yet"] or (
        f"{in_millidarcy(cake['k_m2'])} mD {CAKE_LAWS[cake['law']]} at a porosity of "
        f"{cake['porosity']:.2f}"
    )
    return f"{cake['fines']} fines, {own}; {share} % of the resistance of cake and specimen"


def answer_sentence(summary: Mapping[str, Any]) -> str:
    """One sentence to act on; `summary` has the keys of the answer where there are fines."""
    if "damage" not in summary:
        k, porosity = in_millidarcy(summary["k_initial_m2"]), 100 * summary["porosity_initial"]
        return f"The intact sand has {k} mD at a porosity of {porosity:.1f} %."
    if not summary["invaded_count"]:
        return "No fine entered the sand, so it keeps its permeability."
    depth = _depth_words(summary, summary["damage"])
    return f"{depth} {_skin_words(summary)}" if "skin" in summary else depth


TWICE = 2.0  # Standard deviations of seeds that are added to a depth before it is acted on


def _safe_depth(summary: Mapping[str, Any]) -> float | None:
    """The 95 % depth and two standard deviations of seeds, m; None if the specimen ends before."""
    end, spread = summary["sections"][-1]["x_hi_m"], summary["scatter"]["depth_p95_relative"]
    depth = summary["invasion_depth_p95_m"] * (1.0 + TWICE * spread)
    return None if summary["damage"]["reaches_the_end"] or depth > end else float(depth)


def _depth_words(summary: Mapping[str, Any], damage: Mapping[str, Any]) -> str:
    p95 = (
        f"95 % of the fines that entered lie within {millimetres(summary['invasion_depth_p95_m'])}"
    )
    limit = two_digits(damage["lost_from"])
    safe, short = _safe_depth(summary), "The specimen is too short to say how deep the damage goes"
    if summary["final"] is False:
        if summary["stop_reason"] == "unfinished":
            do = "Continue the run with --resume before you use these numbers."
            return (
                f"Provisional, at {percent(summary['share_done'])} % of the invasion: so far "
                f"{p95}. {do if safe else f'{short}: lengthen the box.'}"
            )
        cut, more = "the run was cut at its cap", "raise run.cap_ms"
        if summary["stop_reason"] == "mud_cut_off":
            cut, more = "the mud was cut off", "give a longer fines.slab_mm"
        return (
            f"So far {p95}, but {cut} and this is not final: {more} and run it again (--force) "
            "before you use these numbers."
        )
    if not damage["zone_depth_m"]:
        return f"{p95}, and no layer loses {limit} of its permeability: the damage is negligible."
    law = f" by the law {_law_of(summary)}" if followed(summary) is not None else ""
    scatter, depth = summary["scatter"], millimetres(damage["face_depth_m"])
    spread = scatter["depth_p95_relative"]
    face = (
        f"The first {'millimetre' if depth == '1 mm' else depth} lost "
        f"{two_digits(damage['face_lost'])} "
        f"of the permeability{law} (from seed to seed ± {100 * scatter['first_mm_loss']:.2g} "
        f"points), and {p95} (± {two_digits(spread)})."
    )
    if safe is None:
        return f"{face} {short}, or a perforation, a cut or a wash must reach: lengthen the box."
    return (
        f"{face} Let a perforation, a cut or a wash reach deeper than {1e3 * safe:.2g} mm: that "
        "is the 95 % depth and two standard deviations of seeds."
    )


def _skin_words(summary: Mapping[str, Any]) -> str:
    lost, skin = summary["skin_flow_lost"], summary["skin"]
    if skin is None or math.isinf(skin):
        return "Nothing flows through the plugged layer, so the skin is infinite."
    well = f"a well of {millimetres(summary['skin_well_radius_m'])} radius"
    if skin <= 0:
        return f"For {well} this is no skin."
    if _safe_depth(summary) is None:
        return f"For {well} the skin is {skin:.2g} or more."
    size = "small" if lost < SMALL else "large" if lost > LARGE else "moderate"
    return (
        f"For {well} this is a {size} skin of {skin:.2g}, which costs {two_digits(lost)} of the "
        "flow."
    )


def certainty(summary: Mapping[str, Any]) -> Iterator[str]:
    """How the run ended, whether that is final, and what one seed is worth; sentences."""
    if summary.get("stop_reason") is None:
        return
    final = "final" if summary["final"] else "not final"
    yield f"The result is {final}, because {summary['words']['end']}."
    if "method_error" in summary:
        what = "It is" if summary["method"] == "network" else "What is finer than the cut is"
        yield f"{what} by the fast model of size classes: {summary['method_error']}."
    scatter = summary.get("scatter")
    if scatter and summary.get("invaded_count") and summary["final"]:
        own = "" if summary["case"] in scatter["source"] else ", and not of this case"
        by = ", with spheres in LIGGGHTS alone" if "method_error" in summary else ""
        yield (
            f"This is one run with one seed ({summary['seed']}); the ± are one standard deviation "
            f"of {scatter['runs']} seeds of {scatter['source']}{by}{own}. `fdnet ensemble CASE "
            "--seeds 8` gives the band of your own case."
        )


# ---- A run in lines of text, and the same in a notebook; the page shows the same facts.
WIDTH = 96  # Letters in a line of running text
_HEAD = (
    "depth mm", "porosity", "with fines", "k mD", "with fines", "lost %", "in place %", "fines"
)  # fmt: skip


class Fact(NamedTuple):
    """A headline number: its name, the number with its unit, and what belongs to it."""

    name: str
    value: str
    remark: str = ""

    @property
    def text(self) -> str:
        """Number and remark in one line."""
        return f"{self.value} {self.remark}".rstrip(" :,")


def followed(summary: Mapping[str, Any]) -> float | None:
    """k over k0 at the last update of a flow that followed the deposit; None without one."""
    return (summary.get("drag_last_update") or {}).get("k_over_k0")


def _law_of(summary: Mapping[str, Any]) -> str:
    return str(summary.get("damage_law_used") or summary.get("damage_law"))


def facts(summary: Mapping[str, Any]) -> Iterator[Fact]:
    """The headline numbers of a run; where the flow followed, each names the law of its damage."""
    before, after = summary["k_initial_m2"], summary["k_damaged_m2"]
    damaged, flow = summary["supplied_count"] or summary["invaded_count"], followed(summary)
    k, si = in_millidarcy(before), f"({before:.3g}"
    if damaged:
        lost = f"{percent(summary['k_reduction'])} % lost"
        lost += "" if flow is None else f" by the law {_law_of(summary)}"
        k, si = f"{k} -> {in_millidarcy(after)}", f"{si} -> {after:.3g} m2), {lost}"
    yield Fact("permeability", f"{k} mD", si if damaged else f"{si} m2)")
    other = summary.get("k_damaged_other_m2")
    if other is not None:
        law = f"({other:.3g} m2) with fines by {summary['damage_law_other']}"
        yield Fact("other law", f"{in_millidarcy(other)} mD", law)
    if flow is not None:
        law = f"as the simulated flow met it last: {FLOW_LAW} (k_over_k0 of history.csv)"
        yield Fact("k of the flow", f"{percent(1 - flow)} % lost", law)
    porosity = f"{summary['porosity_initial']:.4f}"
    porosity += f" -> {summary['porosity_damaged']:.4f}" if damaged else ""
    yield Fact("porosity", porosity)
    if damaged:
        yield from _facts_of_fines(summary)
    else:
        yield Fact("fines", "none supplied")
    used = _law_of(summary)
    yield Fact("laws", f"{summary['law']} and {used} (damage);", f"seed {summary['seed']}")


def _facts_of_fines(summary: Mapping[str, Any]) -> Iterator[Fact]:
    words, damage = summary.get("words", {}), summary.get("damage")
    passed, upstream, of = (summary[f"{n}_count"] for n in ("passed", "upstream", "supplied"))
    said = f"{passed} passed, {upstream} upstream of {of} supplied"
    yield Fact("fines", f"{summary['invaded_count']} invaded,", said)
    end, colon, why = (words.get("end") or str(summary["stop_reason"])).partition(": ")
    yield Fact("end", f"{end}{colon.strip()}", why)
    p95, deepest = (millimetres(summary[f"invasion_depth{end}_m"]) for end in ("_p95", ""))
    yield Fact("depth", f"95 % above {p95},", f"deepest {deepest}")
    if damage and damage["zone_depth_m"]:
        kept = f"which keeps {percent(damage['zone_k_over_k0'])} % of its permeability"
        yield Fact("damaged zone", f"{millimetres(damage['zone_depth_m'])},", kept)
    if "skin" in summary:
        skin = "infinite" if summary["skin"] is None else f"{summary['skin']:.2g}"
        lost, well = two_digits(summary["skin_flow_lost"]), summary["skin_well_radius_m"]
        said = f"costs {lost} of the flow of a well of {millimetres(well)} radius"
        yield Fact("skin", f"{skin},", said)
    yield Fact("cake", f"{millimetres(summary['cake_thickness_m'])}:", words.get("cake", ""))


def summary_lines(summary: Mapping[str, Any]) -> Iterator[str]:
    """The answer, headline numbers, the table of sections, rules of thumb, warnings."""
    for text in filter(None, (summary.get("answer"), *summary.get("certainty", ()))):
        yield from textwrap.wrap(text, WIDTH)
    yield ""
    for one in facts(summary):
        yield from textwrap.wrap(f"{one.name:<14}{one.text}", WIDTH, subsequent_indent=14 * " ")
    yield ""
    for cells in (_HEAD, *map(section_cells, summary["sections"])):
        yield " ".join(f"{cell:>11}" for cell in cells)
    yield from textwrap.wrap(summary.get("words", {}).get("in_place", ""), WIDTH)
    yield ""
    if summary.get("rules"):
        yield f"rules of thumb (the run {SHOWS[summary['run_shows']]}):"
        for rule in summary["rules"]:
            author, agrees = rule["source"].split(",")[0], AGREES[rule["agrees"]]
            said = f"  {author:<22} {rule['value']:>6.3g}  {rule['says']:<8} {agrees:<12}"
            yield f"{said} ({rule['limit']})"
        yield ""
    warnings = summary["warnings"]
    for warning in warnings[:SHOWN]:
        yield from textwrap.wrap(f"warning: {warning}", WIDTH, subsequent_indent="    ")
    if (more := len(warnings) - SHOWN) > 0:
        yield f"{more} more warning{'s' if more > 1 else ''} in report.html and summary.json"


def seconds_line(summary: Mapping[str, Any]) -> str:
    """What the run took."""
    seconds = summary["seconds"]
    outside = sum(seconds.get(stage, 0.0) for stage in STAGES) - seconds["liggghts"]
    cut = ", without the invasion so far" if summary["stop_reason"] == "unfinished" else ""
    return f"seconds       {seconds['liggghts']:.1f} in LIGGGHTS, {outside:.1f} outside{cut}"


def text_lines(path: Path, summary: Mapping[str, Any]) -> Iterator[str]:
    """The whole text of a finished run in the folder `path`."""
    yield f"fdnet run {summary['case']} in {path}"
    yield from summary_lines(summary)
    yield seconds_line(summary)


def section_cells(row: Mapping[str, Any]) -> Iterator[str]:
    """A section as the cells of `_HEAD`."""
    before, after = row["k_initial_inplace_m2"], row["k_damaged_inplace_m2"]
    yield f"{1e3 * row['x_lo_m']:.2f}-{1e3 * row['x_hi_m']:.2f}"
    yield from (f"{row[f'porosity_{state}']:.4f}" for state in ("initial", "damaged"))
    yield from (in_millidarcy(row[f"k_{state}_m2"]) for state in ("initial", "damaged"))
    yield percent(row["k_reduction"])
    yield percent(1 - after / before if before else None)
    yield str(row["fines_count"])


# ---- The answer of `fdnet permeability` as lines for a terminal.
def thesis_law_warning(chosen: "Analysis", default: "Analysis") -> str:
    """What laws that are off by factors give, with what fdnet's default laws give of the same."""
    own = " and ".join(filter(None, (default.law, default.damage_law_used)))
    return Doubt(
        "laws-of-the-thesis",
        f"the laws {chosen.law} and {chosen.damage_law} are kept to compare with the thesis, and "
        f"those of the thesis are wrong by factors: they give {_states(chosen)}, where fdnet's "
        f"default laws ({own}) give {_states(default)}",
    )


def _states(analysis: "Analysis") -> str:
    before = f"{in_millidarcy(analysis.k_initial)} mD"
    if analysis.damage_law_used is None or analysis.k_reduction is None:
        return f"{before} without fines"
    after = f"{in_millidarcy(analysis.k_damaged)} mD"
    return f"{before} before and {after} after ({100 * analysis.k_reduction:z.1f} % lost)"


def permeability_lines(
    results: Sequence[Mapping[str, Any]], *, sections: bool, fines: bool
) -> Iterator[str]:
    """The laws as a table, then with `sections` those of the box, and warnings.

    `results` is one row for each pair of laws, the chosen pair first; without `fines` nothing is
    damaged.
    """
    first = results[0]
    porosity = f"porosity {first['porosity_initial']:.5f}"
    if fines:
        porosity += f" -> {first['porosity_damaged']:.5f}"
    yield f"{porosity}, {first['pores']} pores, {first['throats']} throats"
    axes = "xyz" if "k_x_m2" in first else ""
    pairs = fines or len({row["damage_law"] for row in results}) > 1
    names = f"{'k m2':>12} {'k mD':>12}"
    names += f" {'k damaged m2':>13} {'k damaged mD':>13} {'k/k0':>8}" if fines else ""
    head = f"{'law':<11} " + (f"{'damage law':<14} " if pairs else "") + ("axis " if axes else "")
    yield head + names
    for row in results:
        laws = f"{row['law']:<11} " + (f"{row['damage_law']:<14} " if pairs else "")
        for axis in axes:
            values = row[f"k_{axis}_m2"], row[f"k_{axis}_damaged_m2"]
            yield f"{laws}{axis:<4} {_values(*values, fines=fines)}"
        if not axes:
            yield laws + _values(row["k_initial_m2"], row["k_damaged_m2"], fines=fines)
    if first.get("damage_law_used") not in (None, first["damage_law"]):
        yield f"{first['damage_law']}: the damage law {first['damage_law_used']} was taken"
    if first.get("k_damaged_other_m2") is not None:
        other = first["k_damaged_other_m2"]
        both = f"{other:.5g} m2, {other / MILLIDARCY:.5g} mD"
        law = first["damage_law_other"]
        yield f"with fines by {law}: {both}; the difference is a measure of the error"
    if sections:
        used = first.get("damage_law_used") or first["damage_law"]
        laws = f"{first['law']} and {used}" if fines else first["law"]
        yield f"sections cut out{' along x' if axes else ''}, {laws}:"
        damaged = f"{'damaged':>9} " if fines else ""
        yield f"{'from m':>10} {'to m':>10} {'porosity':>9} {damaged}{names}"
        for row in first["sections"]:
            place = (
                f"{row['x_lo_m']:>10.4g} {row['x_hi_m']:>10.4g} {row['porosity_initial']:>9.5f}"
            )
            damaged = f" {row['porosity_damaged']:>9.5f}" if fines else ""
            k = _values(row["k_initial_m2"], row["k_damaged_m2"], fines=fines)
            yield f"{place}{damaged} {k}"
    yield from (f"assumed: {fact}" for fact in first.get("assumptions", ()))
    yield from (f"warning: {warning}" for warning in first["warnings"])


def _values(before: float, after: float, *, fines: bool) -> str:
    text = f"{before:>12.5g} {before / MILLIDARCY:>12.5g}"
    if not fines:
        return text
    ratio = "-" if before == 0 else f"{after / before:.4f}"
    return f"{text} {after:>13.5g} {after / MILLIDARCY:>13.5g} {ratio:>8}"
