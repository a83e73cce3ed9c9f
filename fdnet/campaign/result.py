"""What the runs of a campaign say together: means with bands, differences, tables, targets."""

import difflib
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

from fdnet.campaign.plan import RUNS, Plan, read_plan_record, state_of
from fdnet.case.case import Case
from fdnet.case.units import converted, share_of
from fdnet.errors import CaseError
from fdnet.files import refuse_folder_name, replacing, write_text
from fdnet.report.tables import read_summary
from fdnet.run.folder import MANIFEST, check_finished, is_run_folder
from fdnet.statistics.bands import Band, seeds_for_width, student_band
from fdnet.statistics.differences import MOST_SEEDS, Difference, difference, holm

RANKED_BY = "k_reduction"
PASSED = "passed_fraction"
TABLE, SUMMARY, PAGE = "table.csv", "summary.json", "compare.html"
SHARES = re.compile(r"(^|\.)(k_reduction|.*porosity.*|.*_fraction|.*_share|\w*over_initial)$")
"""Quantities that are shares of one: a reader sees them in percent."""
_FURTHER_SHARES = re.compile(r"(^|\.)(share_\w+|\w+_loss)$")
_NEVER_NEGATIVE = re.compile(r"((?<!\bb_s)_m|_m2|_m3|_s|_count|_over_k0)$|^seconds\.")
"""Lengths (but for the coefficient b_s_m), permeabilities, volumes, times and counts."""


# ------------------------------------------------------------------------------------------------
# Runs gathered by variant.


class Entry(NamedTuple):
    """A run of a comparison.

    Attributes:
        name: of the run.
        variant: of what it is a sample; runs of one variant differ by the seed alone.
        seed: of the run.
        keys: varied keys with their values.
        folder: the run folder.
        pack: digest of the case's pack: two runs with the same have the same grains.
        numbers: every number of summary.json, by dotted key; {} of a run that is not done.
        status: "done", "failed" or "missing".
        reason: why it is not done; "" when it is.
    """

    name: str
    variant: str
    seed: int
    keys: Mapping[str, Any]
    folder: Path
    pack: str
    numbers: Mapping[str, Any]
    status: str = "done"
    reason: str = ""

    def number(self, quantity: str) -> float | int | None:
        """The quantity where it is a finite number, and no yes or no."""
        value = self.numbers.get(quantity)
        if isinstance(value, int | float) and not isinstance(value, bool):
            return value if math.isfinite(value) else None
        return None


class Pair(NamedTuple):
    """Two variants, how they differ, and whether by more than chance for all pairs together."""

    one: str
    other: str
    difference: Difference
    apart: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Comparison:
    """Runs and what they say together.

    Attributes:
        title: what is compared.
        path: the folder of the results.
        keys: the keys that are varied.
        entries: all runs, also those that are not done.
        ranked_by: quantity of the order; the smallest is first.
        left_out: folders of planned runs that are not among the entries, for want of a result.
    """

    title: str
    path: Path
    keys: tuple[str, ...]
    entries: tuple[Entry, ...]
    ranked_by: str = RANKED_BY
    left_out: tuple[str, ...] = ()

    @property
    def done(self) -> list[Entry]:
        """The runs that have a result."""
        return [entry for entry in self.entries if entry.status == "done"]

    @property
    def failed(self) -> list[Entry]:
        """The runs that have none, failed or not run."""
        return [entry for entry in self.entries if entry.status != "done"]

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, in their order."""
        return tuple(dict.fromkeys(entry.variant for entry in self.entries))

    @property
    def quantities(self) -> list[str]:
        """Every quantity of which some run has a number."""
        names = dict.fromkeys(key for entry in self.done for key in entry.numbers)
        return [key for key in names if any(e.number(key) is not None for e in self.done)]

    def of_variant(self, variant: str) -> list[Entry]:
        """The finished runs of a variant."""
        return [entry for entry in self.done if entry.variant == variant]

    def values(self, variant: str, quantity: str) -> dict[int, float]:
        """The quantity of the finished runs of a variant, by seed; those without one left out."""
        numbers = {entry.seed: entry.number(quantity) for entry in self.of_variant(variant)}
        return {seed: float(value) for seed, value in numbers.items() if value is not None}

    def keys_of(self, variant: str) -> Mapping[str, Any]:
        """The varied keys of a variant."""
        return next(entry.keys for entry in self.entries if entry.variant == variant)

    def band(self, variant: str, quantity: str) -> Band:
        """Mean over the seeds of a variant with its 95 % band, cut at the quantity's bounds."""
        values = list(self.values(variant, quantity).values())
        return student_band(values).within(*self.bounds(quantity))

    def bounds(self, quantity: str) -> tuple[float, float]:
        """Least and largest value that the quantity can have: 0 and 1 of a share, 0 of a count.

        They are infinite of any other quantity, and of one that some run has beyond them.
        """
        values = [v for entry in self.done if (v := entry.number(quantity)) is not None]
        least, most = -math.inf, math.inf
        if SHARES.search(quantity) or _FURTHER_SHARES.search(quantity):
            least, most = 0.0, 1.0
        elif _NEVER_NEGATIVE.search(quantity) or all(isinstance(value, int) for value in values):
            least = 0.0
        return (least, most) if all(least <= v <= most for v in values) else (-math.inf, math.inf)

    def overall(self, quantity: str) -> tuple[Band, int]:
        """Mean over all variants with its band, and the number of seeds that it rests on.

        Of each seed that all variants have, the mean over the variants is one value; the band is
        Student's over these. For one variant this is `band`.
        """
        by_variant = [self.values(variant, quantity) for variant in self.variants]
        seeds = [seed for seed in by_variant[0] if all(seed in one for one in by_variant)]
        means = [math.fsum(one[seed] for one in by_variant) / len(by_variant) for seed in seeds]
        return student_band(means).within(*self.bounds(quantity)), len(seeds)

    def ranking(self) -> list[str]:
        """Variants by the mean of `ranked_by`, smallest first; those without a value last."""
        means = {one: self.band(one, self.ranked_by).mean for one in self.variants}
        return sorted(means, key=lambda one: (math.isnan(means[one]), means[one]))

    def pairs(self) -> list[Pair]:
        """Every two variants that both have values, in the order of the ranking."""
        values = {one: self.values(one, self.ranked_by) for one in self.ranking()}
        names = list(combinations([name for name in values if values[name]], 2))
        gaps = [difference(values[a], values[b], paired=self._share_packs(a, b)) for a, b in names]
        least, most = self.bounds(self.ranked_by)
        bands = [gap.band.within(least - most, most - least) for gap in gaps]
        apart = holm([gap.p_value for gap in gaps])
        return [
            Pair(*two, gap._replace(band=band), differ)
            for two, gap, band, differ in zip(names, gaps, bands, apart, strict=True)
        ]

    def _share_packs(self, one: str, other: str) -> bool:
        """Whether runs of the same seed have the same grains in both variants."""
        packs = [{e.seed: e.pack for e in self.of_variant(name)} for name in (one, other)]
        both = packs[0].keys() & packs[1].keys()
        return bool(both) and all(packs[0][seed] == packs[1][seed] != "" for seed in both)


def refuse_unknown(comparison: Comparison, quantity: str, option: str) -> None:
    """Raises CaseError, with the nearest names, when no finished run has this quantity."""
    names = comparison.quantities
    if names and quantity not in names:
        near = difflib.get_close_matches(quantity, names, n=3, cutoff=0.3)
        raise CaseError(
            f"{option}: {quantity!r} is no number of the summaries; did you mean "
            f"{', '.join(near) or 'k_reduction'}?"
        )


# ------------------------------------------------------------------------------------------------
# Gathering: the runs of a campaign, or run folders of anywhere.


_TEXTS = ("law", "damage_law_used", "stop_reason")
"""Texts of a summary that a table shows next to the numbers."""


def gather_plan(path: Path, plan: Plan, *, ranked_by: str = RANKED_BY) -> Comparison:
    """The comparison of all runs of the campaign in `path`, done or not.

    Raises CaseError when a summary cannot be read.
    """
    entries = []
    for job in plan.jobs:
        state, folder = state_of(path, plan, job), path / RUNS / job.name
        numbers = _numbers_of(folder) if state.status == "done" else {}
        of_case = (job.variant.name, job.case.seed, job.variant.keys, folder)
        entries.append(Entry(job.name, *of_case, job.case.digest("pack"), numbers, *state))
    return Comparison(
        title=plan.name, path=path, keys=plan.keys, entries=tuple(entries), ranked_by=ranked_by
    )


def gather_runs(runs: Sequence[Path], out: Path, *, ranked_by: str = RANKED_BY) -> Comparison:
    """The comparison of finished run folders; a folder of a campaign stands for all its runs.

    Runs whose cases differ by the seed alone are one variant. Raises CaseError for a folder that
    holds no finished run or one whose files were changed, and for two runs of the same case and
    seed, as one given twice is.
    """
    left_out: list[str] = []
    cases: dict[Path, Case] = {}
    for folder in (folder for run in runs for folder in _folders(run, left_out)):
        if folder.resolve() in (other.resolve() for other in cases):
            raise CaseError(f"{folder}: is given twice, and would be counted twice")
        cases[folder] = check_finished(folder)[1]
    data = [_data(case) for case in cases.values()]
    every = dict.fromkeys(key for one in data for key in one)
    keys = tuple(key for key in every if any(one.get(key) != data[0].get(key) for one in data))
    varied = [{key: one.get(key) for key in keys} for one in data]
    names = _variant_names([case.name for case in cases.values()], varied)
    entries: dict[tuple[str, int], Entry] = {}
    for (folder, case), name, held in zip(cases.items(), names, varied, strict=True):
        of_case = (name, case.seed, held, folder.absolute(), case.digest("pack"))
        entry = Entry(folder.name, *of_case, _numbers_of(folder))
        same = entries.setdefault((name, case.seed), entry)
        if same is not entry:
            raise CaseError(
                f"{entry.folder}: is the same case with the same seed as {same.folder}, and would "
                "be counted twice; leave one out"
            )
    return Comparison(
        title=f"{len(entries)} runs",
        path=out,
        keys=keys,
        entries=tuple(entries.values()),
        ranked_by=ranked_by,
        left_out=tuple(left_out),
    )


def make_result_folder(out: Path) -> None:
    """Make the folder of a comparison, unless it is there from an earlier one.

    Raises CaseError for a folder that holds something else.
    """
    refuse_folder_name(out)
    if out.exists() and not out.is_dir():
        raise CaseError(f"{out}: is a file, expected a folder for --out")
    own = {TABLE, "table.parquet", SUMMARY, PAGE}
    if out.is_dir() and {path.name for path in out.iterdir()} - own:
        raise CaseError(
            f"{out}: is not empty and holds no comparison of fdnet; give another --out (nothing "
            "was changed)"
        )
    out.mkdir(parents=True, exist_ok=True)


def _folders(run: Path, left_out: list[str]) -> Iterator[Path]:
    """The run folders that `run` stands for; runs of a campaign without a result are left out."""
    plan = None if not run.is_dir() or is_run_folder(run) else read_plan_record(run)
    if plan is None:
        yield run
        return
    below = [run / RUNS / one["name"] for one in plan["runs"]]
    having = [folder for folder in below if (folder / MANIFEST).exists()]
    if not having:
        raise CaseError(f"{run}: this campaign has no finished run yet; run it first")
    left_out += [str(folder) for folder in below if folder not in having]
    yield from having


def _numbers_of(folder: Path) -> dict[str, Any]:
    """Every number of the summary of a run, by dotted key, and a few of its texts.

    Sections are numbered from 1: `sections.1.k_damaged_m2`. Lists of sentences give their number,
    and counts the share of the fines that passed. Raises CaseError as `read_summary` does.
    """
    summary = read_summary(folder / SUMMARY)
    flat = {key: value for key, value in _flat("", summary) if key != "seed"}
    supplied = summary["supplied_count"]
    return flat | ({PASSED: summary["passed_count"] / supplied} if supplied else {})


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, list):
        if not any(isinstance(one, Mapping) for one in value):
            yield prefix, len(value)
            return
        value = dict(enumerate(value, start=1))
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _flat(f"{prefix}.{key}".lstrip("."), one)
    elif isinstance(value, int | float) or value is None or prefix in _TEXTS:
        yield prefix, value


def _data(case: Case) -> dict[str, Any]:
    """Every key of a case but those that name it, dotted."""
    result: dict[str, Any] = {}
    for table, keys in case.data().items():
        if isinstance(keys, Mapping):
            result |= {f"{table}.{key}": value for key, value in keys.items()}
        else:
            result[table] = keys
    unnamed = ("name", "seed", "given")
    return {key: value for key, value in result.items() if key.split(".")[0] not in unnamed}


def _variant_names(cases: Sequence[str], varied: Sequence[Mapping[str, Any]]) -> list[str]:
    """A name for each run: what its case has of its own; equal cases share one.

    It is the name of the case where names tell the variants apart, and else the differing keys.
    """
    own = [repr(keys) for keys in varied]
    if len(set(cases)) == len(set(own)) == len(set(zip(cases, own, strict=True))):
        return list(cases)
    labels = ["+".join(f"{k.rsplit('.', 1)[-1]}={v}" for k, v in keys.items()) for keys in varied]
    return [label or name for label, name in zip(labels, cases, strict=True)]


# ------------------------------------------------------------------------------------------------
# table.csv, table.parquet and summary.json.


def _relative(comparison: Comparison, entry: Entry) -> str:
    return os.path.relpath(entry.folder, comparison.path)


def write_table(comparison: Comparison) -> None:
    """Write table.csv, and table.parquet where pyarrow is installed: one row for each run.

    Its columns are run, variant, the varied keys, seed, status, reason, folder, and every number
    of the summaries by dotted key, SI, with a few of their texts.
    """
    import pandas as pd

    numbers = dict.fromkeys(key for entry in comparison.done for key in entry.numbers)
    rows = [
        {
            "run": entry.name,
            "variant": entry.variant,
            **{key: _plain(entry.keys.get(key)) for key in comparison.keys},
            "seed": entry.seed,
            "status": entry.status,
            "reason": entry.reason,
            "folder": _relative(comparison, entry),
            **{key: entry.numbers.get(key) for key in numbers},
        }
        for entry in comparison.entries
    ]
    frame = pd.DataFrame(rows, columns=list(rows[0]), dtype=object)
    with replacing(comparison.path / TABLE) as part:
        frame.to_csv(part, index=False, lineterminator="\n")
    if find_spec("pyarrow") is not None:
        frame = frame.convert_dtypes()
        for name in frame.select_dtypes("object"):  # of several types: as texts
            frame[name] = frame[name].map(str, na_action="ignore")
        with replacing(comparison.path / "table.parquet") as part:
            frame.to_parquet(part, engine="pyarrow", index=False)


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, int | float | str) else json.dumps(value)


def write_summary(comparison: Comparison, more: Mapping[str, Any]) -> dict[str, Any]:
    """Write summary.json, with `more` keys; returns its mapping.

    Each quantity has its mean and 95 % band over the seeds; with several variants, the mean over
    the variants and, under `variants`, that of each. One variant has no rank.
    """
    failures = [
        {"run": one.name, "status": one.status, "reason": one.reason}
        | {"folder": _relative(comparison, one)}
        for one in comparison.failed
    ]
    result: dict[str, Any] = {
        "title": comparison.title,
        "runs": len(comparison.entries),
        "done": len(comparison.done),
        "failed": len(failures),
        "failures": failures,
        "left_out": list(comparison.left_out),
        "ranked_by": comparison.ranked_by,
        "ranking": comparison.ranking() if len(comparison.variants) > 1 else [],
        "variants": [_variant_row(comparison, name) for name in comparison.variants],
        "pairs": [_pair_row(pair) for pair in comparison.pairs()],
    }
    for quantity in comparison.quantities:
        band, seeds = comparison.overall(quantity)
        result.setdefault(quantity, _band_row(band) | {"seeds": seeds})
    result |= dict(more)
    text = json.dumps(result, indent=1, allow_nan=False, default=str)
    write_text(comparison.path / SUMMARY, text + "\n")
    return result


def _variant_row(comparison: Comparison, name: str) -> dict[str, Any]:
    runs = sum(entry.variant == name for entry in comparison.entries)
    row = {"name": name, "keys": dict(comparison.keys_of(name)), "runs": runs}
    row["failed"] = runs - len(comparison.of_variant(name))
    for quantity in comparison.quantities:
        values = list(comparison.values(name, quantity).values())
        if values:
            ends = {"seeds": len(values), "least": min(values), "most": max(values)}
            row[quantity] = _band_row(comparison.band(name, quantity)) | ends
    return row


def _band_row(band: Band) -> dict[str, Any]:
    """Mean, low and high, null where there is none; and the bounds that the band was cut at."""
    ends = {"mean": band.mean, "low": band.low, "high": band.high}
    row = {name: None if math.isnan(value) else value for name, value in ends.items()}
    return row | ({"cut_at": list(band.cut)} if band.cut else {})


def _pair_row(pair: Pair) -> dict[str, Any]:
    gap = pair.difference._asdict()
    p_value = None if math.isnan(gap["p_value"]) else gap["p_value"]
    row = {"one": pair.one, "other": pair.other, "difference": _band_row(gap.pop("band"))}
    return row | gap | {"p_value": p_value, "apart": pair.apart}


# ------------------------------------------------------------------------------------------------
# Targets: what a mud is asked for, and which muds reach it.


MET, OPEN, MISSED = "met", "open", "missed"
"""The 95 % band lies below the limit, across it, or above it."""


GOALS: Mapping[str, tuple[str, Callable[[str], float]]] = {
    "depth": ("invasion_depth_p95_m", lambda text: converted(text, "_mm") / 1e3),
    "k_loss": ("k_reduction", share_of),
    "bridging": (PASSED, share_of),
}
"""Targets of a design, the largest values that are accepted: quantity, and SI from a text."""


class Verdict(NamedTuple):
    """How a mud stands against one target, and the seeds expected to decide an open one."""

    quantity: str
    limit: float
    band: Band
    state: str
    seeds_needed: int | None


class Candidate(NamedTuple):
    """A mud, its verdicts, the worst of their states, and the largest mean over its limit."""

    name: str
    verdicts: tuple[Verdict, ...]
    state: str
    worst: float


def read_targets(targets: Mapping[str, Any]) -> dict[str, float]:
    """The limits of the table [targets], SI. Raises CaseError for unknown or unreadable ones."""
    limits = {}
    for name, text in targets.items():
        if name not in GOALS:
            raise CaseError(f"targets.{name}: unknown, expected some of {', '.join(GOALS)}")
        try:
            limits[name] = GOALS[name][1](str(text))
        except ValueError as error:
            raise CaseError(f"targets.{name}: {text!r}: {error}") from error
    if not limits:
        raise CaseError('targets: missing; give the table [targets], e.g. k_loss = "30 %"')
    return limits


def candidates(comparison: Comparison, limits: Mapping[str, float]) -> list[Candidate]:
    """The muds by their verdicts: all met first, then by the mean nearest to its limit."""
    order, muds = (MET, OPEN, MISSED), []
    for name in filter(comparison.of_variant, comparison.variants):
        verdicts = tuple(_verdict(comparison, name, *one) for one in limits.items())
        state = max((verdict.state for verdict in verdicts), key=order.index)
        worst = max(v.band.mean / v.limit if v.limit else math.inf for v in verdicts)
        muds.append(Candidate(name, verdicts, state, worst))
    return sorted(muds, key=lambda mud: (order.index(mud.state), mud.worst))


def _verdict(comparison: Comparison, name: str, target: str, limit: float) -> Verdict:
    quantity = GOALS[target][0]
    values, band = comparison.values(name, quantity).values(), comparison.band(name, quantity)
    state = MET if band.high <= limit else MISSED if band.low > limit else OPEN
    gap = abs(band.mean - limit)
    decidable = state == OPEN and len(values) > 1 and gap > 0
    needed = seeds_for_width(list(values), gap, MOST_SEEDS) if decidable else None
    return Verdict(quantity, limit, band, state, needed)
