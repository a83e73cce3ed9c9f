"""What an engineer knows of a sand, a mud and a well, as it is written: with its units."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from fdnet.case.units import converted
from fdnet.errors import CaseError
from fdnet.scales.design.questions import QUESTIONS, Question

DIAMETERS = ("D10", "D50", "D90")


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A curve of sizes as it is given.

    Attributes:
        diameters: texts such as "0.25 mm" by the names of `DIAMETERS`.
        file: path of a CSV file instead, as seen from the case file; empty without one.
    """

    diameters: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    file: str = ""

    @property
    def table(self) -> dict[str, Any]:
        """The keys of the table `sizes`."""
        return {"file": self.file} if self.file else dict(self.diameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """A sand, a mud and a well. Every value is a text with its unit.

    Attributes:
        name: of the case.
        sand: sizes of the grains.
        porosity: of the sand.
        mud: sizes of the solids.
        assumed_spread: whether D10 and D90 of the mud were made up from its D50.
        solids: by volume, "5 %", or in mass a volume of mud, "25 lb/bbl".
        solids_density: of the solids.
        viscosity: of the liquid.
        liquid_density: of the liquid.
        overbalance: pressure of the mud above that of the formation.
        well_radius: to the formation face.
        drainage_radius: at which the pressure is that of the formation.
        formation_permeability: of the formation; empty: that of the pack.
    """

    name: str
    sand: Curve
    porosity: str
    mud: Curve
    assumed_spread: bool
    solids: str
    solids_density: str
    viscosity: str
    liquid_density: str
    overbalance: str
    well_radius: str
    drainage_radius: str
    formation_permeability: str = ""

    @property
    def solids_key(self) -> str:
        """The key of the case that takes the solids: a share, or a mass."""
        return "concentration" if self.solids.rstrip().endswith("%") else "solids"


def filled(
    given: Mapping[str, str], ask: Callable[[Question, str], str | None] | None
) -> dict[str, str]:
    """The answers with what is missing asked for, or with defaults.

    Args:
        given: texts by the keys of `QUESTIONS`, and "sand_file" and "mud_file".
        ask: shows why the last answer was none and a question, returns the answer; None at the
            end of all answers, and where nobody can be asked.

    Raises:
        CaseError: answers are missing or cannot be read, and nobody can be asked; it names all.
    """
    answers, missing, problems = dict(given), [], []
    for question in QUESTIONS:
        if answers.get(f"{question.group}_file"):
            continue
        text = _read(question, answers.get(question.key, ""))
        problem = question.problem(text) if text else ""
        while ask is not None and (problem or not text):
            reply = ask(question, problem)
            if reply is None:
                ask = None
                break
            text = _read(question, reply or question.default or "")
            problem = question.problem(text) if text else ""
            if not reply and question.default is not None:
                break
        answers[question.key] = text or question.default or ""
        if problem:
            problems.append(problem)
        elif not text and question.default is None:
            missing.append(f'{question.option} "{question.example}"')
    if missing:
        problems.append(
            f"{len(missing)} answer{'s are' if len(missing) > 1 else ' is'} missing: "
            f"{', '.join(missing)} (sizes also as "
            "--sand-file or --mud-file with a CSV table); on a terminal they are asked for"
        )
    if problems:
        raise CaseError(" | ".join(problems))
    return answers


def _read(question: Question, text: str) -> str:
    """An answer as it is read: shares also as a number between 0 and 1."""
    return _share(text.strip()) if "%" in question.unit else text.strip()


def answers_of(name: str, texts: Mapping[str, str]) -> Answers:
    """The answers from texts that `filled` has read."""
    mud, assumed = _mud(texts)
    return Answers(
        name=name,
        sand=_curve("sand", texts),
        porosity=texts["porosity"],
        mud=mud,
        assumed_spread=assumed,
        solids=texts["solids"],
        **{
            key: texts[key]
            for key in (
                *("solids_density", "viscosity", "liquid_density", "overbalance"),
                *("well_radius", "drainage_radius", "formation_permeability"),
            )
        },
    )


def _curve(group: str, texts: Mapping[str, str]) -> Curve:
    file = texts.get(f"{group}_file", "")
    return Curve(
        file=file,
        diameters={} if file else {name: texts[f"{group}_{name.lower()}"] for name in DIAMETERS},
    )


def _mud(texts: Mapping[str, str]) -> tuple[Curve, bool]:
    """The solids; a D10 or D90 that is not given is half or twice the D50."""
    if texts.get("mud_file"):
        return _curve("mud", texts), False
    made_up = {
        question.key: factor
        for question, factor in zip(QUESTIONS[5:7], (0.5, 2.0), strict=True)
        if texts[question.key] == question.default
    }
    median = converted(texts["mud_d50"], "_um")
    spread = {key: f"{factor * median:g} um" for key, factor in made_up.items()}
    return _curve("mud", {**texts, **spread}), bool(made_up)


def _share(text: str) -> str:
    """A share between 0 and 1 as a percentage, "0.38" as "38 %"; anything else as it is."""
    try:
        return f"{100 * float(text):g} %" if 0 < float(text) < 1 else text
    except ValueError:
        return text
