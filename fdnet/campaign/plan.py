"""The plan of a campaign: a sweep file, its cases and seeds, and the folder that keeps it."""

import contextlib
import fcntl
import hashlib
import itertools
import json
import math
import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import pydantic
from pydantic import AfterValidator, BeforeValidator, Field

from fdnet.case.case import Case
from fdnet.case.file import read_case, toml_tables
from fdnet.errors import CaseError
from fdnet.files import expanded, refuse_folder_name, write_text
from fdnet.names import STAGES
from fdnet.report.tables import JsonObject, read_json, read_summary
from fdnet.run.folder import MANIFEST, check_finished
from fdnet.scales.clock import spoken_time
from fdnet.scales.cost import cost_of
from fdnet.scales.scales import scales_of

MOST_JOBS, FAST = 1000, {"invasion.method": "network"}
"""Most runs of a plan that are accepted without a confirmation, and the key of the fast model."""


# ---- The plan: which cases are run with which seeds, frozen before the first run.
class Variant(NamedTuple):
    """One case of a campaign, with the seed of its first run, and the keys that are varied."""

    name: str
    keys: Mapping[str, Any]
    case: Case


class Job(NamedTuple):
    """One run of a plan: the name of its folder below `runs/`, its variant, its case."""

    name: str
    variant: Variant
    case: Case


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Plan:
    """All runs of a campaign: every variant with every seed; `targets` rank them."""

    name: str
    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]
    ranks: int = 1
    stages: tuple[str, ...] = STAGES
    targets: Mapping[str, Any] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Hash of what is run, whatever the number of seeds."""
        what = [(v.name, v.case.model_copy(update={"seed": 0}).digest()) for v in self.variants]
        return _hash([sorted(what), self.ranks, sorted(self.stages)], 16)

    @property
    def jobs(self) -> tuple[Job, ...]:
        """Every run; those of one seed stand together, so that few seeds of all come first."""
        return tuple(
            Job(f"{one.name}-seed-{seed}", one, one.case.model_copy(update={"seed": seed}))
            for seed in self.seeds
            for one in self.variants
        )

    @property
    def packs(self) -> dict[str, str]:
        """The packs that several runs share: name of each such run, and digest of its pack."""
        digests = {job.name: job.case.digest("pack") for job in self.jobs}
        counts = Counter(digests.values())
        return {name: digest for name, digest in digests.items() if counts[digest] > 1}


def _hash(data: Any, length: int) -> str:
    text = json.dumps(data, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:length]


def ensemble_plan(case: Case, seeds: int, *, limit: int = MOST_JOBS, **more: Any) -> Plan:
    """`case` with `seeds` seeds, its own the first. Raises CaseError for none or too many."""
    if seeds < 1 or case.seed + seeds > 2**31:
        raise CaseError(f"seeds: {seeds}, expected 1 or more, and no seed above {2**31 - 1}")
    _refuse_many(1, seeds, limit)
    variants, own = _named([Variant(case.name, {}, case)]), range(case.seed, case.seed + seeds)
    return Plan(name=case.name, variants=variants, seeds=tuple(own), **more)


def _refuse_many(variants: int, seeds: int, limit: int) -> None:
    if (runs := variants * seeds) > limit:
        problem = f"{variants} variants with {seeds} seeds are {runs:,} runs, more than {limit:,}"
        raise CaseError(f"{problem}; give fewer values, or confirm with --jobs-limit {runs}")


def _named(variants: Sequence[Variant]) -> tuple[Variant, ...]:
    """The variants with names that are fit for folders, each its own."""
    result: dict[str, Variant] = {}
    for one in variants:
        name = _safe(one.name)
        if len(name) > 80 or name in result:
            name = f"{name[:71]}-{_hash([one.case.digest(), dict(one.keys)], 8)}"
        if variants.count(one) > 1:
            raise CaseError(f"variants: {one.name} is given twice; leave one out")
        result[name] = one._replace(name=name)
    return tuple(result.values())


def _safe(text: str) -> str:
    """`text` as the name of a folder: any other sign becomes an underscore."""
    return re.sub(r"[^A-Za-z0-9.=+_-]+", "_", text).strip("._") or "variant"


# ---- The sweep file.
def _dotted(table: Any) -> Any:
    """Keys of a case with their values: `fines.radius_mm` in quotes, or as a table of a table."""
    if not isinstance(table, Mapping):
        return table
    result: dict[str, Any] = {}
    for name, value in table.items():
        nested = isinstance(value, Mapping) and "." not in name
        result |= {f"{name}.{k}": one for k, one in value.items()} if nested else {name: value}
    return result


def _varied(keys: Mapping[str, Any]) -> Mapping[str, Any]:
    for key in keys.keys() & {"seed", "name"}:
        raise ValueError(f"{key} cannot be varied; give seeds = ..., and runs have own names")
    return keys


def _distinct(seeds: Any) -> Any:
    """A number of seeds, or a list of different seeds."""
    numbers, least = (seeds, 0) if isinstance(seeds, list) else ([seeds], 1)
    whole = all(type(one) is int for one in numbers)
    if not numbers or not whole or min(numbers) < least or max(numbers) >= 2**31:
        raise ValueError(f"expected their number, 1 or more, or a list of seeds below {2**31}")
    if len(set(numbers)) < len(numbers):
        raise ValueError("names a seed twice")
    return seeds


_Values = Annotated[list[Any], Field(min_length=1)]


class _SweepFile(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", strict=True)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")] | None = None
    case: str | None = None
    cases: Annotated[list[str], Field(min_length=1)] = []
    seeds: Annotated[Any, AfterValidator(_distinct)] = 1
    set: Annotated[dict[str, Any], BeforeValidator(_dotted), AfterValidator(_varied)] = {}
    grid: Annotated[dict[str, _Values], BeforeValidator(_dotted), AfterValidator(_varied)] = {}
    variants: list[dict[str, Any]] = []
    targets: dict[str, Any] = {}

    @pydantic.model_validator(mode="after")
    def _fits(self) -> "_SweepFile":
        if (self.case is None) == (not self.cases):
            raise ValueError('case: give one case file as case = "a.toml", or cases = [...]')
        for place, keys in (("set", self.set), *(("variants", k) for _, k in self.named_keys)):
            for key in keys.keys() & self.grid.keys():
                raise ValueError(f"{key}: stands in [grid] and in {place}; give it in one of them")
        return self

    @property
    def named_keys(self) -> list[tuple[str, dict[str, Any]]]:
        """Name and keys of each variant."""
        rows = []
        for table in self.variants:
            own = dict(_varied(_dotted({k: v for k, v in table.items() if k != "name"})))
            name = table.get("name", label_of(own))
            if not isinstance(name, str) or not name or not name.isprintable():
                raise ValueError(f"variants.name: {name!r}, expected one line of text")
            rows.append((name, own))
        return rows


def plan_lines(plan: Plan) -> Iterator[str]:
    """What runs take and leave out, from the cases alone: a line for each variant, one for all."""
    whole = 0.0
    for one in plan.variants:
        scales = scales_of(one.case)
        seconds = cost_of(one.case, scales).seconds
        whole += seconds * len(plan.seeds)
        gone = [text for text in scales.warnings if text.kind == "sizes-left-out"]
        yield "; ".join([f"{one.name}: {spoken_time(seconds)} a run", *gone])
    several = f"{len(set(plan.packs.values())) or 'no'} packs of grains serve several runs"
    time = f"{spoken_time(whole)} on one idle core, within a factor of 2"
    yield f"{len(plan.jobs)} runs: {time}; {several}"


def label_of(keys: Mapping[str, Any]) -> str:
    """Short name of a set of keys: `radius_mm=0.04+viscosity=10 cP`."""
    return "+".join(f"{key.rsplit('.', 1)[-1]}={value}" for key, value in keys.items())


def sweep_plan(
    path: str | Path, *, fast: bool = False, limit: int = MOST_JOBS, **more: Any
) -> Plan:
    """Every combination of the sweep file at `path`, each a checked case; the paths of cases are
    relative to the file. Raises CaseError for what is wrong in it, and for more runs than `limit`.
    """
    place = expanded(path)
    try:
        file = _SweepFile.model_validate(toml_tables(path, "a sweep file"))
    except pydantic.ValidationError as error:
        raise CaseError(f"{path}: {' | '.join(map(_problem, error.errors()))}") from error
    paths = [place.parent / expanded(case) for case in file.cases or [file.case or ""]]
    count = len(paths) * max(1, len(file.variants)) * math.prod(map(len, file.grid.values()))
    seeds = file.seeds if isinstance(file.seeds, list) else list(range(min(file.seeds, limit + 1)))
    _refuse_many(count, file.seeds if isinstance(file.seeds, int) else len(seeds), limit)
    variants, problems = [], []
    for case_path, (name, own), values in itertools.product(
        paths, file.named_keys or [("", {})], itertools.product(*file.grid.values())
    ):
        swept = dict(zip(file.grid, values, strict=True))
        keys = {**own, **swept}
        if fast and FAST.keys() & keys:
            raise CaseError(f"{path}: varies invasion.method; leave --fast out")
        label = "+".join(filter(None, (name, label_of(swept))))
        try:
            case = read_case(case_path, values=file.set | keys | (FAST if fast else {}))
        except CaseError as error:
            problems.append(f"{label}: {error}" if label else str(error))
            continue
        if len(paths) > 1:
            label = f"{case.name}-{label}" if keys else case.name
            keys = {"case_file": case_path.name} | keys
        variants.append(Variant(label or case.name, keys, case))
    if problems:
        raise CaseError(" || ".join(problems[:5]))
    if isinstance(file.seeds, int):
        seeds = [variants[0].case.seed + number for number in seeds]
    more |= {"name": file.name or _safe(place.stem), "targets": file.targets}
    return Plan(variants=_named(variants), seeds=tuple(seeds), **more)


def _problem(item: Any) -> str:
    key, message = ".".join(map(str, item["loc"])), item["msg"].removeprefix("Value error, ")
    if item["type"] == "extra_forbidden":
        return f"{key}: unknown key, expected some of {', '.join(_SweepFile.model_fields)}"
    return f"{key}: {item['input']!r:.60}, {message}" if key else message


# ---- The folder of a campaign: one plan, and the case of each of its runs.
PLAN, CASES, RUNS, PACKS, LOGS, LOCK = "plan.json", "cases", "runs", "packs", "logs", ".lock"


class _Row(JsonObject):
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9=+_-][A-Za-z0-9.=+_-]*$")]
    keys: Mapping[str, Any] = {}


class _PlanRecord(JsonObject):
    fdnet_campaign: Literal[1]
    name: str
    digest: str
    seeds: Annotated[list[Annotated[int, Field(ge=0, lt=2**31)]], Field(min_length=1)]
    ranks: Annotated[int, Field(ge=1)]
    stages: list[str]
    variants: Annotated[list[_Row], Field(min_length=1)]
    runs: Annotated[list[_Row], Field(min_length=1)]


def read_plan_record(folder: Path) -> dict[str, Any] | None:
    """plan.json of a folder, None where there is none. Raises CaseError where it is no plan."""
    path, words = folder / PLAN, {"noun": "plan of this fdnet", "advice": "give another folder"}
    return read_json(path, _PlanRecord, **words) if path.exists() else None


def kept_plan(folder: Path) -> Plan | None:
    """The plan that a folder keeps, from its plan.json and its cases; None where there is none."""
    record = read_plan_record(folder)
    if record is None:
        return None
    variants = []
    for one in record["variants"]:
        case = read_case(folder / CASES / f"{one['name']}-seed-{record['seeds'][0]}.toml")
        variants.append(Variant(one["name"], one.get("keys", {}), case))
    more: Any = {name: tuple(record[name]) for name in ("seeds", "stages")}
    return Plan(name=record["name"], variants=tuple(variants), ranks=record["ranks"], **more)


def refuse_foreign(path: Path, own: Collection[str], what: str) -> None:
    """Raises CaseError when `path` cannot be a folder of results, or holds more than `own`."""
    refuse_folder_name(path)
    if path.exists() and not path.is_dir():
        raise CaseError(f"{path}: is a file, expected a folder for --out")
    if path.is_dir() and any(child.name not in own for child in path.iterdir()):
        problem = f"is not empty and holds no {what} of fdnet"
        raise CaseError(f"{path}: {problem}; give another --out (nothing was changed)")


@contextlib.contextmanager
def campaign_folder(path: Path, plan: Plan) -> Iterator[tuple[Plan, int]]:
    """Hold the lock of the folder while the block runs; gives its plan, extended by further seeds,
    and the descriptor. Raises CaseError, with nothing changed, for a folder of another plan or of
    something else, and while another call works there."""
    if read_plan_record(path) is None:
        refuse_foreign(path, (LOCK, LOGS, CASES), "campaign")
    try:
        for below in (LOGS, CASES):
            (path / below).mkdir(parents=True, exist_ok=True)
        file = (path / LOCK).open("r+b" if (path / LOCK).exists() else "w+b", buffering=0)
    except OSError as error:
        problem = f"cannot be made or written: {error.strerror}"
        raise CaseError(f"{path}: {problem}; give another --out") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            holder = os.pread(file.fileno(), 500, 0).decode("utf-8", "replace")
            problem = holder or "another fdnet is running jobs here; wait for it"
            raise CaseError(f"{path}: {problem}, or give another --out") from error
        record = read_plan_record(path) or {"digest": plan.digest, "seeds": plan.seeds}
        if record["digest"] != plan.digest:
            names = ", ".join(one["name"] for one in record["variants"][:3])
            other = f"{record['name']}: {names}...; digest {record['digest']}"
            problem = f"holds another plan ({other}, this one {plan.digest})"
            raise CaseError(f"{path}: {problem}; give another --out (nothing was changed)")
        held = replace(plan, seeds=tuple(record["seeds"]))
        yield extended(path, held, plan.seeds), file.fileno()


def extended(path: Path, plan: Plan, seeds: Sequence[int]) -> Plan:
    """The plan with further seeds, written after its cases, of which those that stay are not
    written again: Snakemake repeats what is older than its case."""
    plan = replace(plan, seeds=tuple(dict.fromkeys([*plan.seeds, *seeds])))
    packs, rows = plan.packs, []
    for job in plan.jobs:
        file, text = path / CASES / f"{job.name}.toml", job.case.toml()
        if not file.is_file() or file.read_bytes() != text.encode():
            write_text(file, text)
        row = {"name": job.name, "variant": job.variant.name, "seed": job.case.seed}
        rows.append(row | {"pack": packs.get(job.name, "")})
    kept = ("name", "digest", "seeds", "ranks", "stages")
    record = {"fdnet_campaign": 1} | {name: getattr(plan, name) for name in kept}
    record["variants"] = [{"name": one.name, "keys": one.keys} for one in plan.variants]
    record["runs"] = rows
    write_text(path / PLAN, json.dumps(record, indent=1, default=str) + "\n")
    return plan


# ---- Which runs of a plan are done, and why the others are not.
class State(NamedTuple):
    """How a run stands: "done", "failed" or "missing", and why it is not done, in one line."""

    status: str
    reason: str = ""


def state_of(path: Path, plan: Plan, job: Job) -> State:
    """How a run stands; it has failed also where a file was changed, cut or removed afterwards."""
    folder = path / RUNS / job.name
    if not (folder / MANIFEST).exists():
        names = (job.name, f"pack-{job.case.digest('pack')}")
        reason = next(filter(None, (last_words(path / LOGS / f"{n}.txt") for n in names)), "")
        return State("failed", reason) if reason else State("missing", "not run yet")
    try:
        manifest, case = check_finished(folder)
        if case.digest() != job.case.digest():
            problem = "holds the run of another case than the plan has under this name"
            raise CaseError(f"{folder}: {problem}; remove the folder, and it is run again")
        read_summary(folder / "summary.json")
    except CaseError as error:
        return State("failed", str(error))
    lacking = sorted(set(plan.stages) & set(job.case.stages) - set(manifest["stages"]))
    return State("missing", f"not run yet: {', '.join(lacking)}") if lacking else State("done")


def last_words(path: Path) -> str:
    """The last line of a log that says something, without the name of the program."""
    text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("fdnet: ") and "warning:" not in line]
    return (errors or lines or [""])[-1].removeprefix("fdnet: ")
