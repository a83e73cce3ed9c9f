"""How large a specimen and how much mud a sand and a mud need, and what of them fits a budget."""

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, sizes_from
from fdnet.case.sizes import Sizes
from fdnet.case.units import share_of
from fdnet.errors import CaseError
from fdnet.scales.cost import cost_of
from fdnet.scales.darcy import carman_kozeny
from fdnet.scales.design.answers import Answers, Curve
from fdnet.scales.design.choice import Budget, Choice, Design, tables_of, um
from fdnet.scales.design.questions import by_options
from fdnet.scales.forces.reynolds import MOST_REYNOLDS
from fdnet.scales.forces.throat import throat_width
from fdnet.scales.forces.warnings import STOKES_REYNOLDS
from fdnet.scales.scales import InvasionScales, scales_of
from fdnet.scales.supply import PLUG_SOLIDS
from fdnet.sizes.curve import SizeCurve

SECTION = 2.0
"""Thickness of a section in mean grain diameters."""
STIFFNESSES = (30.0, 60.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4)
SAND_CUTS = (1.0, 2.0, 5.0, 10.0)
"""Shares of the finest sand, percent, that may be left out to clear the coarsest mud."""
LEAST_KEPT = 0.5
"""Share of the solids that must stay when the finest are left out."""
LEAST_LEFT = 0.05
"""Share of the solids above a seventh of a throat from which the finer ones are left out."""
FINEST_OF_THROAT = 1 / 7
"""Fines below this part of the throats pass (Barkman and Davidson 1972, J. Pet. Tech. 24)."""
GAP = 0.95
"""Largest fine over smallest grain."""
MOST_COARSE = 0.35
"""Share of the coarsest solids that may be left out."""
PATIENCE = 1.5
"""Cap over the expected time, and over that in which all of the mud arrives."""
USUAL_SAND = Curve(diameters={"D10": "0.3 mm", "D50": "0.5 mm", "D90": "0.7 mm"})
USUAL_MUD = Curve(diameters={"D10": "60 um", "D50": "80 um", "D90": "100 um"})
USUAL_CHOICE = Choice(
    width=5e-3,
    length=5e-3,
    sections=1,
    sand_cut=1.0,
    mud_cut=99.0,
    cut=0.0,
    slab=1e-3,
    supply_share=1.0,
    stiffness=STIFFNESSES[-1],
)
"""A specimen in which answers that are not about sizes are looked at."""


def designed(
    answers: Answers,
    budget: Budget,
    *,
    folder: Path,
    refusals: Callable[[InvasionCase, InvasionScales], Iterable[str]],
) -> Design:
    """The case of the answers within a budget; `folder` is where files of sizes are looked for.

    The width and length follow from the grains, the supply from what plugs the face. Then the
    finest solids are left out as far as the budget asks, and only then is the supply shortened.
    A choice that makes no case, or one for which `fdnet run` has `refusals`, does not fit.

    Raises:
        CaseError: the answers make no case; it says which, by their options.
    """
    sand, mud = _sizes(answers, folder)
    first = _first_choice(answers, budget, sand, mud)
    choices = list(_candidates(first, _mud_curve(mud, first.mud_cut)))
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
    raise CaseError(_no_specimen(why, _mud_curve(mud, first.mud_cut), choices[0]))


def _no_specimen(why: str, solids: SizeCurve, first: Choice) -> str:
    """That no choice makes a case that is run, with the reason and the options to change."""
    reason = re.split(r"; |: (?=take|lower|raise)", _spoken(why))[0]
    if reason.startswith("--"):
        return f"{reason}: change it"
    key, _, words = reason.partition(": ")
    reason = {"run.max_hours": "at most ", "run.time_step_s": "a time step of "}.get(
        key, ""
    ) + words
    passing = ""
    if _kept_above(solids, first.passing) < LEAST_KEPT * solids.kept:
        passing = (
            f" (most of the solids, {um(solids.low)} to {um(solids.high)}, are finer than a "
            f"seventh of a throat, {um(first.passing)}, and pass)"
        )
    return (
        "no specimen of this sand and mud can be run, with as much of the finest "
        f"solids and of the mud left out as may be{passing}: {reason}; give coarser or fewer "
        "solids (--mud-d10, --mud-d50, --mud-d90, --solids), a finer sand (--sand-d10, "
        "--sand-d50, --sand-d90), or another flow (--overbalance, --viscosity)"
    )


def _sizes(answers: Answers, folder: Path) -> tuple[Sizes, Sizes]:
    """The curves of sand and mud.

    Raises CaseError that names every answer that makes no case, by its option. What is not about
    sizes is seen in a case of usual ones.
    """
    curves, problems = [], []
    for source, given in (("--sand", answers.sand), ("--mud", answers.mud)):
        try:
            curves.append(sizes_from(given.table, source=source, folder=folder))
        except CaseError as error:
            problems.append(str(error))
    try:
        _case(replace(answers, sand=USUAL_SAND, mud=USUAL_MUD), USUAL_CHOICE, folder)
    except CaseError as error:
        problems.append(_spoken(str(error)))
    if problems:
        raise CaseError(" | ".join(problems))
    return curves[0], curves[1]


def _spoken(problem: str) -> str:
    """A problem of a case by the options of `fdnet init`, without their number in front."""
    return by_options(re.sub(r"^fdnet init: \d+ problems?: ", "", problem))


def _mud_curve(mud: Sizes, coarsest: float) -> SizeCurve:
    """The solids without those that are as coarse as the sand; `coarsest` is in percent."""
    ends = (mud.cut_percent[0], min(coarsest, mud.cut_percent[1]))
    return mud.model_copy(update={"cut_percent": ends}).curve()


def _first_choice(answers: Answers, budget: Budget, sand: Sizes, mud: Sizes) -> Choice:
    """The specimen that the sand and the mud ask for, with all solids that matter."""
    sand_cut, mud_cut = _clear_cuts(sand, mud)
    grains = _cut(sand, low=sand_cut).curve()
    mean = grains.mean(3) / grains.mean(2)
    width = _up(max(budget.width * mean, 2.02 * grains.high))
    length = _up(max(budget.length * mean, 2 * grains.high))
    porosity = share_of(answers.porosity)
    throat = throat_width(porosity, carman_kozeny(porosity, mean))
    return Choice(
        width=width,
        length=length,
        sections=max(1, int(length / (SECTION * mean))),
        sand_cut=sand_cut,
        mud_cut=mud_cut,
        cut=0.0,
        slab=_mud_curve(mud, mud_cut).high,
        supply_share=1.0,
        stiffness=STIFFNESSES[-1],
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
    """From all solids that matter to half of them, and then with less mud.

    Solids that pass are left out, unless hardly any others are there.
    """
    passing = first.passing if _kept_above(curve, first.passing) >= LEAST_LEFT else 0.0
    finest = max(curve.low, passing)
    choice = replace(first, cut=finest if finest > curve.low else 0.0)
    yield choice
    while _kept_above(curve, finest := 1.1 * finest) >= LEAST_KEPT:
        choice = replace(first, cut=_tidy(finest))
        yield choice
    while choice.supply_share > 0.3:
        choice = replace(choice, supply_share=0.85 * choice.supply_share)
        yield choice


def _design(answers: Answers, choice: Choice, budget: Budget, folder: Path) -> Design:
    """The candidate with its supply, contacts, drag and cap."""
    choice = replace(choice, slab=_slab(_case(answers, choice, folder), choice.supply_share))
    choice = _softest(answers, choice, folder)
    choice = _with_drag(answers, choice, folder)
    case = _case(answers, choice, folder)
    scales = scales_of(case)
    cost = cost_of(case, scales)
    arrival = scales.slab_length / scales.upstream_velocity
    cap = _up(PATIENCE * max(cost.duration, arrival) * scales.force_factor)
    choice = replace(choice, cap=cap)
    case = _case(answers, choice, folder)
    return Design(
        answers=answers,
        choice=choice,
        case=case,
        scales=scales_of(case),
        budget=budget,
        seconds=cost.seconds,
    )


def _softest(answers: Answers, choice: Choice, folder: Path) -> Choice:
    """The softest contacts whose predicted overlaps stay below run.max_overlap."""
    for stiffness in STIFFNESSES:
        trial = replace(choice, stiffness=stiffness)
        try:
            warnings = scales_of(_case(answers, trial, folder)).warnings
        except CaseError:
            continue
        of_fines = [one for one in warnings if not one.startswith("grains.")]
        if not any("overlap" in one or "may lock" in one for one in of_fines):
            return trial
    return choice


def _with_drag(answers: Answers, choice: Choice, folder: Path) -> Choice:
    """Drag of finite Reynolds numbers where they are, fines that are driven where they may be."""
    scales = scales_of(_case(answers, choice, folder))
    inertia = STOKES_REYNOLDS < scales.reynolds < MOST_REYNOLDS
    choice = replace(choice, inertia=inertia)
    driven = replace(choice, driven=True)
    try:
        faster = scales_of(_case(answers, driven, folder)).force_factor > 1.1
    except CaseError:
        return choice
    return driven if faster else choice


def _slab(case: InvasionCase, share: float) -> float:
    """Length of mud, m, whose fines are `share` of what plugs the face."""
    median = case.grains.curve.size_at(0.5)
    return _up(share * PLUG_SOLIDS * median / case.fines.placed_fraction)


def _case(answers: Answers, choice: Choice, folder: Path) -> InvasionCase:
    return with_fines(case_from(tables_of(answers, choice), source="fdnet init", folder=folder))


def _cut(sizes: Sizes, *, low: float) -> Sizes:
    return sizes.model_copy(update={"cut_percent": (low, sizes.cut_percent[1])})


def _share_below(curve: SizeCurve, diameter: float) -> float:
    """Share of all solids between the fine end of the curve and a diameter, m."""
    return curve.kept * float(curve.share_finer(np.array(min(diameter, curve.high))))


def _kept_above(curve: SizeCurve, diameter: float) -> float:
    """Share of all solids between a diameter, m, and the coarse end of the curve."""
    return curve.kept - _share_below(curve, diameter)


def _up(length: float) -> float:
    """A length, m, rounded up to two digits."""
    step = 10.0 ** (math.floor(math.log10(length)) - 1)
    return step * math.ceil(length / step - 1e-9)


def _tidy(length: float) -> float:
    """Two digits of a length."""
    return float(f"{length:.2g}")
