"""A case from a sand, a mud and a well (`fdnet init`): its sizes, and its file with reasons."""

import json
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, sizes_from
from fdnet.case.spheres import Sizes
from fdnet.case.units import converted, share_of
from fdnet.errors import CaseError
from fdnet.scales.clock import spoken_time
from fdnet.scales.cost import cost_of
from fdnet.scales.drag import throat_width
from fdnet.scales.flow import carman_kozeny
from fdnet.scales.pack import grain_count
from fdnet.scales.questions import QUESTIONS, Question, by_options
from fdnet.scales.scales import InvasionScales, invasion_scales
from fdnet.sizes import SizeCurve

Answers = Mapping[str, str]
ASSUMED = {"mud_d10": 0.5, "mud_d90": 2.0}
"""Diameters of the mud over its median where they are not given."""
DEFAULTS = {question.key: question.default for question in QUESTIONS}


def filled(given: Answers, ask: Callable[[Question, str], str | None] | None) -> dict[str, str]:
    """The answers with what is missing asked for, or with defaults.

    `given` are texts by the keys of `QUESTIONS`, "sand_file" and "mud_file". `ask` shows why the
    last answer was none and a question, and returns the answer; None where there are no more.
    Raises CaseError that names all answers that are missing or cannot be read.
    """
    answers, missing, problems = dict(given), [], []
    for question in QUESTIONS:
        if answers.get(f"{question.group}_file"):
            continue
        text, problem = question.read(answers.get(question.key, ""))
        while ask is not None and (problem or not text):
            reply = ask(question, problem)
            if reply is None:
                ask = None
            elif not reply and question.default is not None:
                text, problem = question.default, ""
                break
            else:
                text, problem = question.read(reply)
                if not text:
                    problem = f"it needs an answer, as {question.example}"
        answers[question.key] = text or question.default or ""
        if problem:
            problems.append(problem)
        elif not text and question.default is None:
            missing.append(f'{question.option} "{question.example}"')
    if missing:
        problems.append(
            f"{len(missing)} answer{'s are' if len(missing) > 1 else ' is'} missing: "
            f"{', '.join(missing)} (sizes also as --sand-file or --mud-file with a CSV table); on "
            "a terminal they are asked for"
        )
    if problems:
        raise CaseError(" | ".join(problems))
    return answers


def _assumed(answers: Answers) -> dict[str, float]:
    """The diameters of the mud that are made up from its median, and their factors."""
    if answers.get("mud_file"):
        return {}
    return {key: factor for key, factor in ASSUMED.items() if answers[key] == DEFAULTS[key]}


def _curve(group: str, answers: Answers) -> dict[str, Any]:
    """The table `sizes` of the sand or the mud."""
    if answers.get(f"{group}_file"):
        return {"file": answers[f"{group}_file"]}
    texts = dict(answers)
    if group == "mud":
        for key, factor in _assumed(answers).items():
            texts[key] = f"{factor * converted(answers['mud_d50'], '_um'):g} um"
    return {name: texts[f"{group}_{name.lower()}"] for name in ("D10", "D50", "D90")}


# ---- What fdnet chooses for a case, and the tables of the case file.
class Budget(NamedTuple):
    """How large a specimen may be, and how long it may take."""

    name: str  # as --size takes it
    width: float  # in mean grain diameters (by volume over surface)
    length: float  # likewise
    seconds: float  # of one core


BUDGETS = {
    "quick": Budget("quick", width=5.0, length=8.0, seconds=600.0),
    "standard": Budget("standard", width=8.0, length=10.0, seconds=4 * 3600.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What fdnet chose for a case."""

    width: float  # m
    length: float  # m
    sections: int
    sand_cut: float  # percent of the sand left out at the fine end
    mud_cut: float  # percent of the solids below the coarse cut
    cut: float  # m, diameter from which solids are spheres in LIGGGHTS; 0 where all are
    passing: float = 0.0  # m, diameter up to which solids pass the throats
    method: str = "liggghts"  # of the invasion, as the case names it


class Design(NamedTuple):
    """A case with the reasons for its sizes."""

    answers: Answers  # what was given, by key
    choice: Choice  # what fdnet chose
    case: InvasionCase  # the two together
    scales: InvasionScales  # of the case
    budget: Budget  # that the case was fitted to
    seconds: float  # expected on one core


def tables_of(answers: Answers, choice: Choice) -> dict[str, Any]:
    """The tables of the case file."""
    kept = {"cut_percent": [1.0, choice.mud_cut]} if choice.mud_cut != 99.0 else {}
    sand = {"cut_percent": [choice.sand_cut, 99.0]} if choice.sand_cut != 1.0 else {}
    known, outer = answers["formation_permeability"], answers["drainage_radius"]
    solids = "concentration" if answers["solids"].rstrip().endswith("%") else "solids"
    return {
        "name": answers["name"],
        "seed": 1,
        "box": {"size": [mm(choice.length), mm(choice.width), mm(choice.width)]},
        "grains": {"sizes": _curve("sand", answers) | sand, "porosity": answers["porosity"]},
        "fines": {
            "sizes": _curve("mud", answers) | kept,
            **({"cut": um(choice.cut)} if choice.cut else {}),
            solids: answers["solids"],
            "density": answers["solids_density"],
        },
        "fluid": {
            "viscosity": answers["viscosity"],
            "density": answers["liquid_density"],
            "overbalance": answers["overbalance"],
        },
        "well": {
            "radius": answers["well_radius"],
            **({} if outer == DEFAULTS["drainage_radius"] else {"drainage_radius": outer}),
            **({"formation_permeability": known} if known else {}),
        },
        "invasion": {"method": choice.method} if choice.method != "liggghts" else {},
        "analysis": {"sections": choice.sections},
    }


def mm(length: float) -> str:
    """A length in m as a text in mm."""
    return f"{1e3 * length:.3g} mm"


def um(length: float) -> str:
    """A length in m as a text in um."""
    return f"{1e6 * length:.3g} um"


# ---- How large a specimen and how much mud a sand and a mud need, and what of them fits a budget.
SECTION = 2.0  # Thickness of a section in mean grain diameters
SAND_CUTS = (1.0, 2.0, 5.0, 10.0)
"""Shares of the finest sand, percent, that may be left out to clear the coarsest mud."""
LEAST_SPHERES = 0.05
"""Share of the solids that spheres must be at least: for fewer the network takes all."""
FINEST_OF_THROAT = 1 / 7
"""Fines below this part of the throats pass (Barkman and Davidson 1972, J. Pet. Tech. 24)."""
GAP = 0.95  # Largest fine over smallest grain
MOST_COARSE = 0.35  # Share of the coarsest solids that may be left out
USUAL_SIZES = {"sand_d10": "0.3 mm", "sand_d50": "0.5 mm", "sand_d90": "0.7 mm"}
USUAL_SIZES |= {"mud_d10": "60 um", "mud_d50": "80 um", "mud_d90": "100 um"}
USUAL_SIZES |= {"sand_file": "", "mud_file": ""}
USUAL_CHOICE = Choice(width=5e-3, length=5e-3, sections=1, sand_cut=1.0, mud_cut=99.0, cut=0.0)
"""Sizes and a specimen in which answers that are not about sizes are looked at."""


def designed(
    answers: Answers,
    budget: Budget,
    *,
    folder: Path,
    refusals: Callable[[InvasionCase, InvasionScales], Iterable[str]],
) -> Design:
    """The case of the answers within a budget; `folder` is where files of sizes are looked for.

    The width and length follow from the grains, the supply from what plugs the face. LIGGGHTS
    takes the solids down to the finest that the budget allows, the network what is finer; where
    even the coarsest take too long, it takes all. A choice that makes no case, or one for which
    `fdnet run` has `refusals`, does not fit.

    Raises CaseError where the answers make no case; it says which, by their options.
    """
    sand, mud = _sizes(answers, folder)
    first = _first_choice(answers, budget, sand, mud)
    ends = (mud.cut_percent[0], min(first.mud_cut, mud.cut_percent[1]))  # none as coarse as sand
    curve = mud.model_copy(update={"cut_percent": ends}).curve()
    choices = list(_candidates(first, curve))
    low, high, why = 0, len(choices) - 1, ""
    while low < high:
        middle = (low + high) // 2
        try:
            fits = _design(answers, choices[middle], budget, folder).seconds <= budget.seconds
        except CaseError:
            fits = False
        low, high = (low, middle) if fits else (middle + 1, high)
    for choice in choices[low:]:
        try:
            design = _design(answers, choice, budget, folder)
            why = next(iter(refusals(design.case, design.scales)), "")
        except CaseError as error:
            why = str(error)
        if not why:
            return design
    reason = re.split(r"; |: (?=take|lower|raise)", _spoken(why))[0]
    what = "" if reason.startswith("--") else "no specimen of this sand and mud can be run: "
    raise CaseError(f"{what}{reason}; change it, or take --size quick")


def _sizes(answers: Answers, folder: Path) -> tuple[Sizes, Sizes]:
    """The curves of sand and mud.

    Raises CaseError that names every answer that makes no case, by its option. What is not about
    sizes is seen in a case of usual ones.
    """
    curves, problems = [], []
    for group in ("sand", "mud"):
        try:
            curves.append(sizes_from(_curve(group, answers), source=f"--{group}", folder=folder))
        except CaseError as error:
            problems.append(str(error))
    try:
        _case({**answers, **USUAL_SIZES}, USUAL_CHOICE, folder)
    except CaseError as error:
        problems.append(_spoken(str(error)))
    if problems:
        raise CaseError(" | ".join(problems))
    return curves[0], curves[1]


def _spoken(problem: str) -> str:
    """A problem of a case by the options of `fdnet init`, without their number in front."""
    return by_options(re.sub(r"^fdnet init: \d+ problems?: ", "", problem))


def _first_choice(answers: Answers, budget: Budget, sand: Sizes, mud: Sizes) -> Choice:
    """The specimen that the sand and the mud ask for, with all solids that matter."""
    sand_cut, mud_cut = _clear_cuts(sand, mud)
    grains = _cut(sand, low=sand_cut).curve()
    mean = grains.mean(3) / grains.mean(2)
    width = _up(max(budget.width * mean, 2.02 * grains.high))
    length = _up(max(budget.length * mean, 2 * grains.high))
    porosity = share_of(answers["porosity"])
    throat = throat_width(porosity, carman_kozeny(porosity, mean))
    return Choice(
        width=width,
        length=length,
        sections=max(1, int(length / (SECTION * mean))),
        sand_cut=sand_cut,
        mud_cut=mud_cut,
        cut=0.0,
        passing=FINEST_OF_THROAT * throat,
    )


def _clear_cuts(sand: Sizes, mud: Sizes) -> tuple[float, float]:
    """Percent of the finest sand left out, and of the mud that stays, so that the sizes differ.

    Raises CaseError when the mud is as coarse as the sand.
    """
    whole = mud.curve()
    best: tuple[float, float, float] | None = None
    for cut in SAND_CUTS:
        most = GAP * _cut(sand, low=cut).curve().low
        above = 1 - whole.below - _share_below(whole, most)
        lost = above + cut / 100
        if above <= MOST_COARSE and (best is None or lost < best[0] - 1e-9):
            best = (lost, cut, max(1.0, 100 * above))
    if best is None:
        raise CaseError(
            f"--mud-d90: more than {100 * MOST_COARSE:.0f} % of the solids are as coarse as the "
            f"finest sand grains (mud up to {um(whole.high)}, sand from {um(sand.curve().low)}): "
            "nothing of them can invade; check the units of both curves"
        )
    return best[1], min(99.0, round(100 - best[2] - 0.05, 1))


def _candidates(first: Choice, curve: SizeCurve) -> Iterator[Choice]:
    """From spheres down to what passes the throats to none; the network takes the others."""
    finest = max(curve.low, first.passing)
    while curve.kept - _share_below(curve, finest) >= LEAST_SPHERES:
        cut = float(f"{finest:.2g}") if finest > curve.low else 0.0
        yield replace(first, cut=cut, method="both" if cut else "liggghts")
        finest *= 1.1
    yield replace(first, method="network")


def _design(answers: Answers, choice: Choice, budget: Budget, folder: Path) -> Design:
    """The candidate as a case, with its time."""
    case = _case(answers, choice, folder)
    scales = invasion_scales(case)
    return Design(answers, choice, case, scales, budget, seconds=cost_of(case, scales).seconds)


def _case(answers: Answers, choice: Choice, folder: Path) -> InvasionCase:
    return with_fines(case_from(tables_of(answers, choice), source="fdnet init", folder=folder))


def _cut(sizes: Sizes, *, low: float) -> Sizes:
    return sizes.model_copy(update={"cut_percent": (low, sizes.cut_percent[1])})


def _share_below(curve: SizeCurve, diameter: float) -> float:
    """Share of all solids between the fine end of the curve and a diameter, m."""
    return curve.kept * float(curve.share_finer(np.array(min(diameter, curve.high))))


def _up(length: float) -> float:
    """A length, m, rounded up to two digits."""
    step = 10.0 ** (math.floor(math.log10(length)) - 1)
    return step * math.ceil(length / step - 1e-9)


# ---- The case file of a design, with the reason next to each value.
def case_text(design: Design) -> str:
    """A case file that reads as the case of the design."""
    tables, notes = tables_of(design.answers, design.choice), _notes(design)
    lines = [
        *_comment(_top(design)),
        *(f"{key} = {_value(tables[key])}" for key in ("name", "seed")),
    ]
    for name, table in tables.items():
        if isinstance(table, dict) and table:
            lines += ["", f"[{name}]"]
            for key, value in table.items():
                lines += _comment(notes.get(f"{name}.{key}", ""))
                lines.append(f"{key} = {_value(value)}")
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    return json.dumps(value, ensure_ascii=False)


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, 96)]


def _top(design: Design) -> str:
    answers, curve = design.answers, design.case.fines.curve
    half = answers.get("mud_d50", "")
    if curve.below < 0.5:
        half = um(curve.size_at((0.5 - curve.below) / curve.kept))
    return (
        f"A mud of {answers['solids']} solids{f' (half of them below {half})' * bool(half)} at a "
        f"sand of {answers['porosity']} porosity, {answers['overbalance']} over the formation. "
        f"Written by fdnet init, size {design.budget.name}: the run is expected to take "
        f"{spoken_time(design.seconds)} on one core. fdnet check looks at it, fdnet run runs it."
    )


def _notes(design: Design) -> dict[str, str]:
    """The reasons, by dotted key."""
    case, choice, scales = design.case, design.choice, design.scales
    grains, mean = case.grains.curve, case.grains.sauter_diameter_m
    throat = throat_width(scales.porosity, scales.permeability)
    notes = {
        "box.size": f"Depth, width, width. The width is {choice.width / mean:.2g} mean grains "
        f"({mm(mean)}), and above two of the largest ({mm(grains.high)}), so that no grain meets "
        f"itself across the periodic sides. It holds about {grain_count(case)} grains. The depth "
        f"is {choice.length / mean:.2g} grains.",
        "analysis.sections": f"Slabs by depth of {mm(choice.length / choice.sections)}, "
        f"about {SECTION:g} grains each: thinner ones show single throats.",
        "well.radius": "The overbalance is lost in radial flow around the well, from its face to "
        f"the drainage radius ({design.answers['drainage_radius']}): the mud moves at "
        f"{scales.interstitial_velocity:.2g} m/s in the pores.",
        "fines.sizes": f"The throats of the sand are some {um(throat)} wide.",
    }
    if choice.sand_cut > 1.0:
        notes["grains.sizes"] = (
            f"The finest {choice.sand_cut:g} % of the sand are left out, because the coarsest "
            "solids of the mud must stay below the smallest grain."
        )
    if _assumed(design.answers):
        notes["fines.sizes"] += (
            " The spread is assumed, half and twice the median: give D10 and D90 if you know them."
        )
    if choice.mud_cut < 99.0:
        notes["fines.sizes"] += (
            f" The coarsest {100 * case.fines.curve.above:.2g} % are left out: they are as large "
            "as the smallest grains and would only lie in the cake."
        )
    fits = f"the run fits its time ({spoken_time(design.budget.seconds)} for the size "
    fits += f"{design.budget.name})"
    if choice.cut:
        notes["fines.cut"] = (
            "Coarser solids are spheres in LIGGGHTS, and "
            f"{100 * case.fines.curve.below:.0f} % of the solids are finer: the pore network "
            f"carries these as size classes in the same flow. So {fits}. Lower it when you can "
            f"wait; below {um(FINEST_OF_THROAT * throat)}, a seventh of a throat, they pass."
        )
    if choice.method == "network":
        notes["invasion.method"] = (
            f"The pore network carries all solids as size classes. So {fits}; spheres in LIGGGHTS "
            'would not: method = "both" moves those above fines.cut as spheres.'
        )
    return notes


def taken(design: Design) -> Iterator[str]:
    """What LIGGGHTS takes of the mud, what the network takes, and what neither does."""
    choice, curve = design.choice, design.case.fines.curve
    if choice.sand_cut > 1.0:
        yield f"left out: the finest {choice.sand_cut:g} % of the sand"
    if choice.method == "network":
        yield (
            "the network takes all solids, as size classes: spheres in LIGGGHTS take longer than "
            f"the {spoken_time(design.budget.seconds)} of --size {design.budget.name}, or are "
            "hardly any"
        )
        return
    yield f"LIGGGHTS takes {100 * curve.kept:.2g} % of the solids, as spheres from {um(curve.low)}"
    if curve.below > 0.0:
        finer = "the network takes" if choice.method == "both" else "left out:"
        yield f"{finer} {100 * curve.below:.2g} % of the solids, finer than {um(curve.low)}"
    if curve.above > 0.0:
        yield f"left out: {100 * curve.above:.2g} % of the solids, coarser than {um(curve.high)}"
