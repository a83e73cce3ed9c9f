"""What a mud is asked for: a depth, a loss of permeability, bridging; and which muds reach it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fdnet.campaign.result.comparison import Comparison, is_number
from fdnet.campaign.result.entry import Entry
from fdnet.campaign.result.pairs import MOST_SEEDS, seeds_for_width, student_band
from fdnet.campaign.result.words import value_text
from fdnet.case.units import converted, share_of
from fdnet.errors import CaseError
from fdnet.statistics.bands import Band

MET, OPEN, MISSED = "met", "open", "missed"
"""The 95 % band lies below the limit, across it, or above it."""
_ORDER = (MET, OPEN, MISSED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A quantity that a target limits from above.

    Attributes:
        words: the quantity in words.
        quantity: name that gives its unit to a reader.
        of_run: its value in one finished run; None where the run has none.
        read: the limit from the text of a design file.
    """

    words: str
    quantity: str
    of_run: Callable[[Entry], float | None]
    read: Callable[[str], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How a mud stands against one target.

    Attributes:
        goal: name of the target.
        limit: in SI, a share for percent.
        band: mean over the seeds and its 95 % band.
        state: "met", "open" or "missed".
        seeds_needed: seeds that are expected to decide an open one; None where nothing can say.
    """

    goal: str
    limit: float
    band: Band
    state: str
    seeds_needed: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A mud with its verdicts; `worst` is the largest mean over its limit."""

    name: str
    verdicts: tuple[Verdict, ...]
    worst: float

    @property
    def state(self) -> str:
        """The worst state of its targets."""
        return max((v.state for v in self.verdicts), key=_ORDER.index)


def _number(key: str) -> Callable[[Entry], float | None]:
    def of_run(entry: Entry) -> float | None:
        value: Any = entry.numbers.get(key)
        return float(value) if is_number(value) else None

    return of_run


def _passed(entry: Entry) -> float | None:
    passed: Any = entry.numbers.get("passed_count")
    supplied: Any = entry.numbers.get("supplied_count")
    return passed / supplied if is_number(passed) and supplied else None


GOALS: Mapping[str, Goal] = {
    "depth": Goal(
        words="depth above which 95 % of the fines lie",
        quantity="invasion_depth_p95_m",
        of_run=_number("invasion_depth_p95_m"),
        read=lambda text: converted(text, "_mm") / 1e3,
    ),
    "k_loss": Goal(
        words="permeability lost",
        quantity="k_reduction",
        of_run=_number("k_reduction"),
        read=share_of,
    ),
    "bridging": Goal(
        words="share of the fines that pass through the specimen unbridged",
        quantity="passed_fraction",
        of_run=_passed,
        read=share_of,
    ),
}
"""The targets of a design by name; each is a largest value that is accepted."""


def read_targets(targets: Mapping[str, Any]) -> dict[str, float]:
    """The limits of the table [targets], SI. Raises CaseError for unknown or unreadable ones."""
    problems, limits = [], {}
    for name, text in targets.items():
        if name not in GOALS:
            problems.append(f"targets.{name}: unknown, expected some of {', '.join(GOALS)}")
            continue
        try:
            limits[name] = GOALS[name].read(str(text))
        except ValueError as error:
            problems.append(f"targets.{name}: {text!r}: {error}")
    if not targets:
        problems.append('targets: missing; give the table [targets], e.g. k_loss = "30 %"')
    if problems:
        raise CaseError(" | ".join(problems))
    return limits


def candidates(comparison: Comparison, limits: Mapping[str, float]) -> list[Candidate]:
    """The muds by their verdicts: all met first, then by the mean nearest to its limit."""
    muds = [_candidate(comparison, name, limits) for name in comparison.variants]
    having = [mud for mud in muds if mud is not None]
    return sorted(having, key=lambda mud: (_ORDER.index(mud.state), mud.worst))


def _candidate(comparison: Comparison, name: str, limits: Mapping[str, float]) -> Candidate | None:
    runs = [entry for entry in comparison.done if entry.variant == name]
    if not runs:
        return None
    verdicts = tuple(_verdict(goal, limit, comparison, runs) for goal, limit in limits.items())
    worst = max(v.band.mean / v.limit if v.limit else math.inf for v in verdicts)
    return Candidate(name=name, verdicts=verdicts, worst=worst)


def _verdict(goal: str, limit: float, comparison: Comparison, runs: list[Entry]) -> Verdict:
    values = [v for v in map(GOALS[goal].of_run, runs) if v is not None]
    band = student_band(values).within(*comparison.bounds(GOALS[goal].quantity))
    if len(values) < 2 or math.isnan(band.low):
        return Verdict(goal=goal, limit=limit, band=band, state=OPEN)
    state = MET if band.high <= limit else MISSED if band.low > limit else OPEN
    gap = abs(band.mean - limit)
    needed = seeds_for_width(values, gap, MOST_SEEDS) if state == OPEN and gap else None
    return Verdict(goal=goal, limit=limit, band=band, state=state, seeds_needed=needed)


def candidate_lines(muds: list[Candidate]) -> list[str]:
    """The ranking of the muds, a sentence each with its reason."""
    heads = {MET: "meets every target", OPEN: "may meet its targets", MISSED: "misses a target"}
    return [
        f"{number}. {mud.name} {heads[mud.state]}: {'; '.join(map(_reason, mud.verdicts))}."
        for number, mud in enumerate(muds, start=1)
    ]


def _reason(verdict: Verdict) -> str:
    from fdnet.campaign.result.words import band_text

    goal = GOALS[verdict.goal]
    limit = value_text(goal.quantity, verdict.limit)
    text = f"{goal.words} {band_text(goal.quantity, verdict.band)}, at most {limit}: "
    more = f", some {verdict.seeds_needed} seeds would decide it" if verdict.seeds_needed else ""
    return text + verdict.state + (more if verdict.state == OPEN else "")
