"""A sweep file: which keys of which cases are varied, and how.

case = "sand.toml"            # or cases = ["one.toml", "other.toml"]
seeds = 4                     # or [1, 2, 5]
[set]                         # for every run
analysis.sections = 2
[grid]                        # every combination of these values
fines.radius_mm = [0.04, 0.05]
[[variants]]                  # and of these, each with a name
name = "thin"
fluid.viscosity = "10 cP"
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fdnet.campaign.plan.job import NAME, Plan, Variant, named, safe
from fdnet.case.file import read_case, toml_tables
from fdnet.errors import CaseError
from fdnet.files import expanded

MOST_JOBS = 1000
"""Most runs of a plan that are accepted without a word of confirmation."""
TABLES = ("name", "case", "cases", "seeds", "set", "grid", "variants", "targets")
_SEEDS = 1
_MOST_PROBLEMS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What a sweep file asks for.

    Attributes:
        name: of the campaign.
        cases: paths of the case files.
        fixed: keys with the same value in every run.
        grid: keys with the values of which every combination is run.
        variants: named sets of keys; every one meets every combination of the grid.
        seeds: their number, or the seeds themselves.
        targets: of a design, by name.
    """

    name: str
    cases: tuple[Path, ...]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    grid: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    variants: tuple[tuple[str, Mapping[str, Any]], ...] = ()
    seeds: int | tuple[int, ...] = _SEEDS
    targets: Mapping[str, Any] = field(default_factory=dict)

    @property
    def variant_count(self) -> int:
        """Number of variants."""
        grid = math.prod(len(values) for values in self.grid.values())
        return len(self.cases) * max(1, len(self.variants)) * grid


def read_sweep(path: str | Path) -> Sweep:
    """The sweep in the TOML file at `path`; the paths of cases are relative to the file.

    Raises CaseError, which lists what is wrong in it.
    """
    place = expanded(path)
    data = toml_tables(path, "a sweep file")
    problems = list(_problems(data))
    if problems:
        raise CaseError(f"{path}: {' | '.join(problems)}")
    cases = data["cases"] if "cases" in data else [data["case"]]
    seeds = data.get("seeds", _SEEDS)
    return Sweep(
        name=data.get("name") or safe(place.stem),
        cases=tuple(place.parent / expanded(case) for case in cases),
        fixed=dotted(data.get("set", {})),
        grid={key: tuple(values) for key, values in dotted(data.get("grid", {})).items()},
        variants=tuple(_named_keys(table) for table in data.get("variants", [])),
        seeds=seeds if isinstance(seeds, int) else tuple(seeds),
        targets=data.get("targets", {}),
    )


def dotted(table: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a case with their values: `fines.radius_mm` in quotes, or as a table of a table."""
    result: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, Mapping) and "." not in name:
            result |= {f"{name}.{key}": one for key, one in value.items()}
        else:
            result[name] = value
    return result


def _named_keys(table: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    keys = dotted({key: value for key, value in table.items() if key != "name"})
    return str(table.get("name") or label_of(keys)), keys


def _problems(data: Mapping[str, Any]) -> Iterator[str]:
    for key in data.keys() - set(TABLES):
        yield f"{key}: unknown key, expected some of {', '.join(TABLES)}"
    if ("case" in data) == ("cases" in data):
        yield 'case: give one case file as case = "a.toml", or several as cases = [...]'
    cases = data.get("cases", [data.get("case", "")])
    if not isinstance(cases, list) or not cases or not all(isinstance(c, str) for c in cases):
        yield f"cases: {cases!r}, expected paths of case files"
    name = data.get("name", "unnamed")
    if not isinstance(name, str) or not NAME.fullmatch(name):
        yield (
            f"name: {name!r}, expected letters, digits, dots, underscores and hyphens, a letter "
            "or a digit first"
        )
    yield from _seed_problems(data.get("seeds", _SEEDS))
    for name in ("set", "grid", "targets"):
        if not isinstance(data.get(name, {}), dict):
            yield f"{name}: {data[name]!r}, expected a table, [{name}]"
    variants = data.get("variants", [])
    if not isinstance(variants, list) or not all(isinstance(one, dict) for one in variants):
        yield "variants: expected tables, [[variants]]"
        return
    for one in variants:
        name = one.get("name", "unnamed")
        if not isinstance(name, str) or not name or not name.isprintable():
            yield f"variants.name: {name!r}, expected one line of text without control characters"
    yield from _key_problems(data)


def _seed_problems(seeds: Any) -> Iterator[str]:
    numbers = seeds if isinstance(seeds, list) else [seeds]
    whole = all(isinstance(one, int) and not isinstance(one, bool) for one in numbers)
    if not numbers or not whole or min(numbers) < (0 if isinstance(seeds, list) else 1):
        yield f"seeds: {seeds!r}, expected their number, 1 or more, or a list of seeds"
    elif len(set(numbers)) < len(numbers):
        yield f"seeds: {seeds!r} names a seed twice"
    elif max(numbers) >= 2**31:
        yield f"seeds: {max(numbers)}, expected less than {2**31}"


def _key_problems(data: Mapping[str, Any]) -> Iterator[str]:
    tables = [data.get("set", {}), data.get("grid", {}), *data.get("variants", [])]
    if not all(isinstance(table, dict) for table in tables):
        return
    grid = dotted(data.get("grid", {}))
    for key, values in grid.items():
        if not isinstance(values, list) or not values:
            yield f"grid.{key}: {values!r}, expected a list of values"
    places = [("set", dotted(data.get("set", {}))), ("grid", grid)]
    places += [("variants", _named_keys(one)[1]) for one in data.get("variants", [])]
    for place, keys in places:
        for key in keys.keys() & {"seed", "name"}:
            advice = "give seeds = ..." if key == "seed" else "the runs get names of their own"
            yield f"{place}.{key}: cannot be varied; {advice}"
    for place, keys in places[2:] + places[:1]:
        for key in keys.keys() & grid.keys():
            yield f"{key}: stands in [grid] and in {place}; give it in one of them"


def plan_of(
    sweep: Sweep, *, limit: int = MOST_JOBS, ranks: int = 1, stages: Sequence[str] | None = None
) -> Plan:
    """Every combination of a sweep, each a checked case.

    Raises CaseError for more than `limit` runs, with their number, and for keys or values that a
    case does not take; the message names the variant.
    """
    seeds = sweep.seeds if isinstance(sweep.seeds, int) else len(sweep.seeds)
    refuse_many(sweep.variant_count, seeds, limit)
    variants, problems = [], []
    for path, (name, own), values in itertools.product(
        sweep.cases, sweep.variants or (("", {}),), _combinations(sweep.grid)
    ):
        keys = {**own, **values}
        label = "+".join(filter(None, (name, label_of(values)))) or path.stem
        try:
            case = read_case(path, values={**sweep.fixed, **keys})
        except CaseError as error:
            problems.append(f"{label}: {error}")
            if len(problems) == _MOST_PROBLEMS:
                break
            continue
        several = len(sweep.cases) > 1
        label = f"{case.name}-{label}" if several and keys else label if keys else case.name
        shown = ({"case_file": path.name} if several else {}) | keys
        variants.append(Variant(name=label, keys=shown, case=case))
    if problems:
        raise CaseError(" || ".join(problems))
    return Plan(
        name=sweep.name,
        variants=named(variants),
        seeds=seeds_of(sweep.seeds, variants[0].case.seed),
        ranks=ranks,
        **({} if stages is None else {"stages": tuple(stages)}),
    )


def seeds_of(seeds: int | tuple[int, ...], first: int) -> tuple[int, ...]:
    """The seeds themselves: `first`, the next and so on, where only their number is given."""
    return tuple(range(first, first + seeds)) if isinstance(seeds, int) else seeds


def refuse_many(variants: int, seeds: int, limit: int) -> None:
    """Raises CaseError for more runs than `limit`."""
    if variants * seeds > limit:
        raise CaseError(
            f"{variants} variants with {seeds} seeds are {variants * seeds:,} runs, more than "
            f"{limit:,}; give fewer values, or confirm with --jobs-limit {variants * seeds}"
        )


def _combinations(grid: Mapping[str, tuple[Any, ...]]) -> Iterator[dict[str, Any]]:
    for values in itertools.product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def label_of(keys: Mapping[str, Any]) -> str:
    """Short name of a set of keys: `radius_mm=0.04+viscosity=10 cP`."""
    return "+".join(f"{key.rsplit('.', 1)[-1]}={_short(value)}" for key, value in keys.items())


def _short(value: Any) -> str:
    if isinstance(value, Mapping):
        return ",".join(f"{key}={_short(one)}" for key, one in value.items())
    return str(value)
