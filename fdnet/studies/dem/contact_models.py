"""Contact models and options on the quick specimens 1 and 5: counts, depth, permeability, cost.

Seed by seed all options run on one after the other, so that the load of the machine is the same
for all of them.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, read_case
from fdnet.studies.dem.runs import invasion_run
from fdnet.studies.engine.markdown import markdown_table

HOOKE, HERTZ, WET = "hooke", "hertz", "rebound in the liquid"
OPTIONS: Mapping[str, Mapping[str, Any]] = {
    HOOKE: {},
    HERTZ: {"model": "hertz"},
    WET: {"restitution": "liquid"},
    "rolling friction 0.1": {"rolling_friction": 0.1},
    "rolling friction 0.3": {"rolling_friction": 0.3},
    "hertz, cohesion 2e7 J/m3": {"model": "hertz", "cohesion_J_m3": 2e7},
}
"""The table [contact] of each option. The cohesion bears a pull about as large as the drag."""
TRIED: Mapping[str, Sequence[str]] = {"specimen1": (HOOKE, HERTZ), "specimen5": tuple(OPTIONS)}
SEEDS = (1, 2, 3)
TWO_SEEDS = tuple(option for option in OPTIONS if option not in (HOOKE, HERTZ, WET))
"""Options that run with the first two seeds only."""
SEEN = ("invaded", "mean_depth", "k_ratio_first", "k_ratio", "max_overlap", "steps", "core_s")
"""What is kept of each run; depth in m, `core_s` in seconds of one core."""


def points() -> list[tuple[str, int, str]]:
    """Specimen, seed and option of every run."""
    return [
        (specimen, seed, option)
        for seed in SEEDS
        for specimen, options in TRIED.items()
        for option in options
        if seed <= 2 or option not in TWO_SEEDS
    ]


def case_of(cases: Path, specimen: str, seed: int, option: str) -> InvasionCase:
    """A quick case of the folder `cases` with an option.

    Hertz contacts take the materials' default moduli instead of the springs that the case names.
    """
    data = read_case(cases / "quick" / f"{specimen}.toml").data() | {"seed": seed}
    data["contact"] = dict(OPTIONS[option])
    if data["contact"].get("model") == "hertz":
        for name in ("grains", "fines"):
            for key in ("normal_stiffness_N_m", "shear_stiffness_N_m"):
                data[name].pop(key, None)
    return with_fines(case_from(data, source=f"{specimen}, {option}"))


def rows(cases: Path, work: Path, done: Sequence[Mapping[str, str]]) -> Iterator[dict[str, Any]]:
    """The rows of the table, in order; those in `done` are not run again.

    Args:
        cases: folder of the shipped cases.
        work: folder of the runs.
        done: rows of an earlier session.
    """
    kept = {(row["specimen"], int(row["seed"]), row["option"]): row for row in done}
    for number, (specimen, seed, option) in enumerate(points()):
        names: dict[str, Any] = {"specimen": specimen, "seed": seed, "option": option}
        earlier = kept.get((specimen, seed, option))
        if earlier is not None:
            yield names | {name: float(earlier[name]) for name in SEEN}
            continue
        seen = invasion_run(case_of(cases, specimen, seed, option), work, f"run_{number}")
        yield names | {name: seen[name] for name in SEEN}


def summary(table: Sequence[Mapping[str, Any]]) -> str:
    """Markdown: mean, least and largest value over the seeds; the cost over hooke's."""
    heads = (
        "specimen",
        "contacts",
        "seeds",
        "invaded",
        "mean depth, mm",
        "k/k0, first mm",
        "k/k0",
        "largest overlap, %",
        "steps per second over hooke's",
        "run time over hooke's",
    )
    lines = []
    for specimen, options in TRIED.items():
        for option in options:
            own = _of(table, specimen, option)
            seeds = {str(row["seed"]) for row in own}
            plain = [row for row in _of(table, specimen, HOOKE) if str(row["seed"]) in seeds]
            if len(own) == len(plain) > 0:
                values = (str(len(own)), *_values(own), *_costs(own, plain))
                lines.append((specimen, option, *values))
    return markdown_table(heads, lines)


def _of(table: Sequence[Mapping[str, Any]], specimen: str, option: str) -> list[Mapping[str, Any]]:
    return [row for row in table if (row["specimen"], row["option"]) == (specimen, option)]


def _values(own: Sequence[Mapping[str, Any]]) -> list[str]:
    scaled = (
        ("invaded", 1.0),
        ("mean_depth", 1e3),
        ("k_ratio_first", 1.0),
        ("k_ratio", 1.0),
        ("max_overlap", 100.0),
    )
    texts = []
    for name, factor in scaled:
        values = [factor * float(row[name]) for row in own]
        texts.append(f"{mean(values):.3g} ({min(values):.3g} to {max(values):.3g})")
    return texts


def _costs(own: Sequence[Mapping[str, Any]], plain: Sequence[Mapping[str, Any]]) -> list[str]:
    """Ratios of the sums over the seeds."""
    steps, core = (_sum(own, name) / _sum(plain, name) for name in ("steps", "core_s"))
    return [f"{steps / core:.2f}", f"{core:.2f}"]


def _sum(own: Sequence[Mapping[str, Any]], name: str) -> float:
    return sum(float(row[name]) for row in own)
