"""The plan of a campaign: a sweep file, its cases and seeds, and the folder that keeps it."""

import contextlib
import difflib
import fcntl
import hashlib
import itertools
import json
import math
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from fdnet.case.case import Case
from fdnet.case.file import read_case, toml_tables
from fdnet.errors import CaseError
from fdnet.files import expanded, refuse_folder_name, write_text
from fdnet.names import STAGES
from fdnet.report.tables import JsonObject, Summary, SummarySection, read_json, read_summary
from fdnet.run.folder import MANIFEST, check_finished

MOST_JOBS = 1000
"""Most runs of a plan that are accepted without a word of confirmation."""


# ------------------------------------------------------------------------------------------------
# The plan: which cases are run with which seeds, frozen before the first run.


class Variant(NamedTuple):
    """One case of a campaign, whose runs differ by the seed alone, and the keys that are varied.

    Its name also begins the names of its run folders; its seed is that of the first run.
    """

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
    """All runs of a campaign: every variant with every seed.

    Attributes:
        name: of the campaign.
        variants: in the order in which they are shown.
        seeds: of each variant.
        ranks: MPI ranks of each run.
        stages: of each run.
        targets: of a design, as the sweep file gives them.
        judge: the table [judge] of the sweep file, {} without one.
    """

    name: str
    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]
    ranks: int = 1
    stages: tuple[str, ...] = STAGES
    targets: Mapping[str, Any] = field(default_factory=dict)
    judge: Mapping[str, Any] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Hash of what is run, whatever the number of seeds."""
        what = [(one.name, _with_seed(one.case, 0).digest()) for one in self.variants]
        return _hash([sorted(what), self.ranks, sorted(self.stages)], 16)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that are varied."""
        return tuple(dict.fromkeys(key for one in self.variants for key in one.keys))

    @property
    def jobs(self) -> tuple[Job, ...]:
        """Every run; those of one seed stand together, so that few seeds of all come first."""
        return tuple(
            Job(f"{one.name}-seed-{seed}", one, _with_seed(one.case, seed))
            for seed in self.seeds
            for one in self.variants
        )

    @property
    def packs(self) -> dict[str, str]:
        """The packs that several runs share: name of each such run, and digest of its pack."""
        digests = {job.name: job.case.digest("pack") for job in self.jobs}
        counts = Counter(digests.values())
        return {name: digest for name, digest in digests.items() if counts[digest] > 1}


def _with_seed(case: Case, seed: int) -> Case:
    return case.model_copy(update={"seed": seed})


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
    if variants * seeds > limit:
        raise CaseError(
            f"{variants} variants with {seeds} seeds are {variants * seeds:,} runs, more than "
            f"{limit:,}; give fewer values, or confirm with --jobs-limit {variants * seeds}"
        )


def _named(variants: Sequence[Variant]) -> tuple[Variant, ...]:
    """The variants with names that are fit for folders, each its own."""
    result: dict[str, Variant] = {}
    for one in variants:
        name = _safe(one.name)
        if len(name) > 80 or name in result:
            name = f"{name[:71]}-{_hash([one.case.digest(), dict(one.keys)], 8)}"
        number, base = 2, name
        while name in result:
            name, number = f"{base}-{number}", number + 1
        result[name] = one._replace(name=name)
    return tuple(result.values())


def _safe(text: str) -> str:
    """`text` as the name of a folder: any other sign becomes an underscore."""
    return re.sub(r"[^A-Za-z0-9.=+_-]+", "_", text).strip("._") or "variant"


# ------------------------------------------------------------------------------------------------
# The sweep file.


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
    advice = {"seed": "give seeds = ...", "name": "the runs get names of their own"}
    for key in keys.keys() & advice.keys():
        raise ValueError(f"{key} cannot be varied; {advice[key]}")
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


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class _Judge(_Table):
    """Against which variant the others are judged, and in which numbers of the summaries."""

    reference: Annotated[dict[str, Any], BeforeValidator(_dotted), Field(min_length=1)]
    quantities: Annotated[list[str], Field(min_length=1)]


_Values = Annotated[list[Any], Field(min_length=1)]


class _SweepFile(_Table):
    """What a sweep file holds."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")] | None = None
    case: str | None = None
    cases: Annotated[list[str], Field(min_length=1)] = []
    seeds: Annotated[Any, AfterValidator(_distinct)] = 1
    set: Annotated[dict[str, Any], BeforeValidator(_dotted), AfterValidator(_varied)] = {}
    grid: Annotated[dict[str, _Values], BeforeValidator(_dotted), AfterValidator(_varied)] = {}
    variants: list[dict[str, Any]] = []
    targets: dict[str, Any] = {}
    judge: _Judge | None = None

    @model_validator(mode="after")
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
            name = table.get("name", _label(own))
            if not isinstance(name, str) or not name or not name.isprintable():
                raise ValueError(f"variants.name: {name!r}, expected one line of text")
            rows.append((name, own))
        return rows


def _label(keys: Mapping[str, Any]) -> str:
    """Short name of a set of keys: `radius_mm=0.04+viscosity=10 cP`."""
    return "+".join(f"{key.rsplit('.', 1)[-1]}={_short(value)}" for key, value in keys.items())


def _short(value: Any) -> str:
    if isinstance(value, Mapping):
        return ",".join(f"{key}={_short(one)}" for key, one in value.items())
    return str(value)


def sweep_plan(path: str | Path, *, limit: int = MOST_JOBS, **more: Any) -> Plan:
    """Every combination of the sweep file at `path`, each a checked case.

    The paths of cases are relative to the file; `more` are ranks and stages. Raises CaseError,
    which lists what is wrong in the file, or names the variant whose keys a case does not take,
    or says how many runs more than `limit` it asks for.
    """
    place = expanded(path)
    try:
        file = _SweepFile.model_validate(toml_tables(path, "a sweep file"))
    except ValidationError as error:
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
        label = "+".join(filter(None, (name, _label(swept)))) or case_path.stem
        try:
            case = read_case(case_path, values={**file.set, **keys})
        except CaseError as error:
            problems.append(f"{label}: {error}")
            continue
        label = label if keys else case.name
        if len(paths) > 1:
            label = f"{case.name}-{label}" if keys else label
            keys = {"case_file": case_path.name} | keys
        variants.append(Variant(label, keys, case))
    if problems:
        raise CaseError(" || ".join(problems[:5]))
    if isinstance(file.seeds, int):
        seeds = [variants[0].case.seed + number for number in seeds]
    judge = file.judge.model_dump() if file.judge else {}
    _check_judge(f"{path}: judge", judge, variants)
    return Plan(
        name=file.name or _safe(place.stem),
        variants=_named(variants),
        seeds=tuple(seeds),
        targets=file.targets,
        judge=judge,
        **more,
    )


def _problem(item: Any) -> str:
    """One thing that is wrong in a sweep file, with its key and what was given."""
    key, message = ".".join(map(str, item["loc"])), item["msg"].removeprefix("Value error, ")
    if item["type"] == "extra_forbidden":
        known = _Judge if key.startswith("judge.") else _SweepFile
        return f"{key}: unknown key, expected some of {', '.join(known.model_fields)}"
    if item["type"] == "string_pattern_mismatch":
        message = "expected letters, digits, dots, underscores, hyphens, a letter or digit first"
    return f"{key}: {item['input']!r:.60}, {message}" if key else message


def _check_judge(place: str, judge: Mapping[str, Any], variants: Sequence[Variant]) -> None:
    """Raises CaseError for a reference that is no variant and for a misspelt quantity.

    Numbers that only some runs have, as those of a well, are known by their results alone.
    """
    reference = judge.get("reference", {})
    if not any(reference.items() <= dict(one.keys).items() for one in variants):
        keys = ", ".join(dict.fromkeys(key for one in variants for key in one.keys)) or "none"
        raise CaseError(f"{place}.reference: {reference} is no variant; the varied keys: {keys}")
    for name in judge.get("quantities", []):
        section = re.fullmatch(r"sections\.[1-9]\d*\.(\w+)", name)
        known, last = (SummarySection, section[1]) if section else (Summary, name)
        near = difflib.get_close_matches(last, known.model_fields, n=3, cutoff=0.8)
        further = re.fullmatch(r"\w+(\.\w+)*", name) and last.startswith(tuple(near) or "")
        if last not in known.model_fields and not further:
            raise CaseError(
                f"{place}.quantities: {name!r} is no number of the summaries; did you mean "
                f"{', '.join(near) or 'k_reduction'}?"
            )


# ------------------------------------------------------------------------------------------------
# The folder of a campaign: one plan, and the case of each of its runs.


PLAN, CASES, RUNS, PACKS, LOGS, LOCK = "plan.json", "cases", "runs", "packs", "logs", ".lock"
_Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9=+_-][A-Za-z0-9.=+_-]*$")]
_Seed = Annotated[int, Field(ge=0, lt=2**31)]


class _Row(JsonObject):
    name: _Name
    variant: _Name = "itself"
    keys: Mapping[str, Any] = {}
    seed: _Seed = 0


class _PlanRecord(JsonObject):
    """What plan.json holds."""

    fdnet_campaign: Literal[1]
    name: str
    digest: str
    seeds: Annotated[list[_Seed], Field(min_length=1)]
    ranks: Annotated[int, Field(ge=1)] = 1
    stages: Sequence[str] = STAGES
    targets: Mapping[str, Any] = {}
    judge: Mapping[str, Any] = {}
    variants: Annotated[list[_Row], Field(min_length=1)]
    runs: Annotated[list[_Row], Field(min_length=1)]


def read_plan_record(folder: Path) -> dict[str, Any] | None:
    """What plan.json of a folder says; None where there is none.

    Raises CaseError when it cannot be read.
    """
    path = folder / PLAN
    if not path.exists():
        return None
    return read_json(path, _PlanRecord, noun="plan of this fdnet", advice="give another folder")


def kept_plan(folder: Path) -> Plan | None:
    """The plan that a folder keeps, from its plan.json and its cases; None where there is none.

    Raises CaseError when they cannot be read.
    """
    record = read_plan_record(folder)
    if record is None:
        return None
    seeds, variants = tuple(record["seeds"]), []
    for one in record["variants"]:
        case = read_case(folder / CASES / f"{one['name']}-seed-{seeds[0]}.toml")
        variants.append(Variant(one["name"], one.get("keys", {}), case))
    rest = {key: record[key] for key in ("ranks", "targets", "judge") if key in record}
    stages = tuple(record.get("stages", STAGES))
    return Plan(name=record["name"], variants=tuple(variants), seeds=seeds, stages=stages, **rest)


@contextlib.contextmanager
def campaign_folder(path: Path, plan: Plan) -> Iterator[tuple[Plan, int]]:
    """Hold the lock of the folder while the block runs.

    Gives the plan with all its seeds and the descriptor of the locked file. A folder keeps its
    plan. The same plan with further seeds extends it, and seeds that are there already stay.

    Raises CaseError, with nothing changed, when the folder holds another plan or something else,
    or when another campaign is writing there.
    """
    refuse_folder_name(path)
    _refuse_foreign(path)
    try:
        for below in (LOGS, CASES):
            (path / below).mkdir(parents=True, exist_ok=True)
        lock = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be made or written: {error.strerror}; give another --out"
        ) from error
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            holder = os.pread(lock, 500, 0).decode("utf-8", "replace")
            raise CaseError(
                f"{path}: {holder or 'another fdnet is running jobs here; wait for it'}, or give "
                "another --out"
            ) from error
        yield _admitted(path, plan), lock
    finally:
        os.close(lock)


def _refuse_foreign(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise CaseError(f"{path}: is a file, expected a folder for --out")
    foreign = path.is_dir() and {child.name for child in path.iterdir()} - {LOCK, LOGS, CASES}
    if foreign and read_plan_record(path) is None:
        raise CaseError(
            f"{path}: is not empty and holds no campaign of fdnet; give another --out (nothing "
            "was changed)"
        )


def _admitted(path: Path, plan: Plan) -> Plan:
    record = read_plan_record(path)
    if record is not None and record["digest"] != plan.digest:
        names = ", ".join(one["name"] for one in record["variants"][:3])
        raise CaseError(
            f"{path}: holds another plan ({record['name']}: {names}...; digest "
            f"{record['digest']}, this one {plan.digest}); give another --out (nothing was "
            "changed)"
        )
    before = plan.seeds if record is None else tuple(record["seeds"])
    return extended(path, replace(plan, seeds=before), plan.seeds)


def extended(path: Path, plan: Plan, seeds: Sequence[int]) -> Plan:
    """The plan with further seeds, written to its folder.

    The cases are written first, so that a plan never names a case that is not there, and only
    where they change, because Snakemake repeats what is older than its case.
    """
    plan = replace(plan, seeds=tuple(dict.fromkeys([*plan.seeds, *seeds])))
    packs, rows = plan.packs, []
    for job in plan.jobs:
        file, text = path / CASES / f"{job.name}.toml", job.case.toml()
        if not file.is_file() or file.read_bytes() != text.encode():
            write_text(file, text)
        row = {"name": job.name, "variant": job.variant.name, "seed": job.case.seed}
        rows.append(row | {"pack": packs.get(job.name, "")})
    kept = ("name", "digest", "seeds", "ranks", "stages", "targets", "judge")
    record = {"fdnet_campaign": 1} | {name: getattr(plan, name) for name in kept}
    record["variants"] = [{"name": one.name, "keys": one.keys} for one in plan.variants]
    record["runs"] = rows
    write_text(path / PLAN, json.dumps(record, indent=1, default=str) + "\n")
    return plan


# ------------------------------------------------------------------------------------------------
# Which runs of a plan are done, and why the others are not.


class State(NamedTuple):
    """How a run stands: "done", "failed" or "missing", and why it is not done, in one line."""

    status: str
    reason: str = ""


def state_of(path: Path, plan: Plan, job: Job) -> State:
    """How a run of the campaign in `path` stands.

    It is done where it has all stages of the plan and every file as the run wrote it, and has
    failed where one of its files was changed, cut or removed afterwards.
    """
    folder = path / RUNS / job.name
    if not (folder / MANIFEST).exists():
        names = (job.name, f"pack-{job.case.digest('pack')}")
        reason = next(filter(None, (last_words(path / LOGS / f"{n}.txt") for n in names)), "")
        return State("failed", reason) if reason else State("missing", "not run yet")
    try:
        manifest, case = check_finished(folder)
        if case.digest() != job.case.digest():
            raise CaseError(
                f"{folder}: holds the run of another case than the plan has under this name; "
                "remove the folder, and it is run again"
            )
        read_summary(folder / "summary.json")
    except CaseError as error:
        return State("failed", str(error))
    lacking = set(plan.stages) & set(job.case.stages) - set(manifest["stages"])
    if lacking:
        return State("missing", f"not run yet: {', '.join(sorted(lacking))}")
    return State("done")


def last_words(path: Path) -> str:
    """The last line of a log that says something, without the name of the program."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("fdnet: ") and "warning:" not in line]
    return (errors or lines or [""])[-1].removeprefix("fdnet: ")
