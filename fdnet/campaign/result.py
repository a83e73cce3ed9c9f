"""What the runs of a campaign say together: means with bands, differences, tables, targets."""

import difflib
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fdnet.campaign.plan import PACKS, RUNS, Plan, label_of, read_plan_record, state_of
from fdnet.case.case import Case
from fdnet.case.units import converted, share_of
from fdnet.errors import CaseError
from fdnet.report.tables import read_summary
from fdnet.run.folder import MANIFEST, check_finished, is_run_folder, read_record
from fdnet.run.records import processor_seconds
from fdnet.statistics.bands import Band, student_band
from fdnet.statistics.differences import Difference, difference, holm

if TYPE_CHECKING:
    import pandas as pd

RANKED_BY = "k_reduction"
PASSED = "passed_fraction"
TABLE, SUMMARY, PAGE = "table.csv", "summary.json", "compare.html"
SHARES = re.compile(
    r"(^|\.)(k_reduction|.*porosity.*|.*_fraction|share_\w+|.*_share|\w+_lost|\w*over_initial)$"
)
"""Quantities that are shares of one: a reader sees them in percent."""
SLAB = re.compile(r"sections\.(\d+)\.(?!section$)(\w+)")  # A number of a slab, apart from its own
_NEVER_NEGATIVE = re.compile(r"((?<!\bb_s)_m|_m2|_m3|_s|_count|_over_k0)$|seconds\.")
"""Lengths (but for the coefficient b_s_m), permeabilities, volumes and times. So are counts."""


# ---- Runs gathered by variant.
class Entry(NamedTuple):
    """A run of a comparison; runs of one variant differ by the seed alone.

    Runs with the same digest `pack` have the same grains. `numbers` are those of summary.json by
    dotted key. `status` is "done", "failed" or "missing", and `reason` why it is not done.
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


class Pair(NamedTuple):
    """Two variants, how they differ, and whether by more than chance for all pairs together."""

    one: str
    other: str
    difference: Difference
    apart: bool


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs and what they say together, in the folder `path`, by the varied `keys`.

    The entries are all runs, also those that are not done; `left_out` are folders of planned runs
    that are not among them. The smallest `ranked_by` is first. `packs_s` are processor seconds of
    the packs that several runs share, which no run counts.
    """

    title: str
    path: Path
    keys: tuple[str, ...]
    entries: tuple[Entry, ...]
    ranked_by: str = RANKED_BY
    left_out: tuple[str, ...] = ()
    packs_s: float = 0.0

    @property
    def cost_s(self) -> float:
        """Processor seconds of the finished runs, and of the packs that they share, once."""
        parts = [f"cpu_seconds.{name}" for name in ("liggghts", "python")]
        return self.packs_s + sum(run.numbers.get(one) or 0 for run in self.done for one in parts)

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

    @cached_property
    def numbers(self) -> dict[str, dict[str, dict[int, float]]]:
        """Every finite number of the finished runs, by quantity, variant and seed."""
        table: dict[str, dict[str, dict[int, float]]] = {}
        for run in self.done:
            for key, value in run.numbers.items():
                number = isinstance(value, int | float) and not isinstance(value, bool)
                if number and math.isfinite(value):
                    table.setdefault(key, {}).setdefault(run.variant, {})[run.seed] = value
        return table

    def of_variant(self, variant: str) -> list[Entry]:
        """The finished runs of a variant."""
        return [entry for entry in self.done if entry.variant == variant]

    def values(self, variant: str, quantity: str) -> dict[int, float]:
        """The quantity of the finished runs of a variant, by seed; those without one left out."""
        return self.numbers.get(quantity, {}).get(variant, {})

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
        values = [v for one in self.numbers.get(quantity, {}).values() for v in one.values()]
        share = SHARES.search(quantity)
        counts = all(isinstance(value, int) for value in values)
        least, most = 0.0, 1.0 if share else math.inf
        inside = all(least <= value <= most for value in values)
        bounded = inside and (share or counts or _NEVER_NEGATIVE.search(quantity))
        return (least, most) if bounded else (-math.inf, math.inf)

    def overall(self, quantity: str) -> tuple[Band, int]:
        """Band of the mean over all variants, by seed, and the number of seeds that all have."""
        values = [self.values(one, quantity) for one in self.variants]
        seeds = [seed for seed in values[0] if all(seed in one for one in values)]
        means = [math.fsum(one[seed] for one in values) / len(values) for seed in seeds]
        return student_band(means).within(*self.bounds(quantity)), len(means)

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


def _known(comparison: Comparison) -> Comparison:
    """The comparison. Raises CaseError when no finished run has the quantity that it ranks by."""
    names, quantity = list(comparison.numbers), comparison.ranked_by
    if names and quantity not in names:
        near = difflib.get_close_matches(quantity, names, n=3, cutoff=0.3) or [RANKED_BY]
        problem = f"{quantity!r} is no number of the summaries"
        raise CaseError(f"--rank-by: {problem}; did you mean {', '.join(near)}?")
    return comparison


# ---- Gathering: the runs of a campaign, or run folders of anywhere.
_TEXTS = ("law", "damage_law_used", "stop_reason", "method")
"""Texts of a summary that a table shows next to the numbers."""


def gather_plan(path: Path, plan: Plan, *, ranked_by: str = RANKED_BY) -> Comparison:
    """The comparison of all runs of the campaign in `path`, done or not."""
    entries = []
    for job in plan.jobs:
        state, folder = state_of(path, plan, job), path / RUNS / job.name
        numbers = _numbers_of(folder) if state.status == "done" else {}
        of_case = (job.variant.name, job.case.seed, job.variant.keys, folder)
        entries.append(Entry(job.name, *of_case, job.case.digest("pack"), numbers, *state))
    digests = dict.fromkeys(plan.packs.values())
    packs = [read_record(path / PACKS / digest, "pack") for digest in digests]
    shared = sum(processor_seconds(packs, {}).values())
    keys, runs_of = dict.fromkeys(key for v in plan.variants for key in v.keys), tuple(entries)
    return _known(Comparison(plan.name, path, tuple(keys), runs_of, ranked_by, packs_s=shared))


def gather_runs(runs: Sequence[Path], out: Path, *, ranked_by: str = RANKED_BY) -> Comparison:
    """The comparison of finished run folders; a folder of a campaign stands for all its runs."""
    left_out: list[str] = []
    folders = [folder for run in runs for folder in _folders(run, left_out)]
    cases = [check_finished(folder)[1] for folder in folders]
    data = [_data(case) for case in cases]
    every = dict.fromkeys(key for one in data for key in one)
    keys = tuple(key for key in every if any(one.get(key) != data[0].get(key) for one in data))
    varied = [{key: one.get(key) for key in keys} for one in data]
    names = _variant_names([case.name for case in cases], varied)
    entries: dict[tuple[str, int], Entry] = {}
    for folder, case, name, held in zip(folders, cases, names, varied, strict=True):
        of_case = (name, case.seed, held, folder.absolute(), case.digest("pack"))
        entry = Entry(folder.name, *of_case, _numbers_of(folder))
        same = entries.setdefault((name, case.seed), entry)
        if same is not entry:
            what = f"is the same case and seed as {same.folder}, and would be counted twice"
            raise CaseError(f"{entry.folder}: {what}; leave one out")
    title, runs_of = f"{len(entries)} runs", tuple(entries.values())
    return _known(Comparison(title, out, keys, runs_of, ranked_by, tuple(left_out)))


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
    """Every number of a summary by dotted key, with a few texts and the share that passed."""
    summary = read_summary(folder / SUMMARY)
    flat = {key: value for key, value in _flat("", summary) if key != "seed"}
    supplied = summary["supplied_count"]
    return flat | ({PASSED: summary["passed_count"] / supplied} if supplied else {})


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """`sections.1.k_damaged_m2` and so on; of a list of sentences their number."""
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


def _data(case: Case) -> dict[Any, Any]:
    """Every key of a case but those that name it, dotted."""
    import pandas as pd

    (result,) = pd.json_normalize(dict(case.data()), max_level=1).to_dict("records")
    unnamed = ("name", "seed", "given")
    return {k: value for k, value in result.items() if str(k).split(".")[0] not in unnamed}


def _variant_names(cases: Sequence[str], varied: Sequence[Mapping[str, Any]]) -> list[str]:
    """The name of each case where names tell the variants apart, else the differing keys."""
    own = [repr(keys) for keys in varied]
    if len(set(cases)) == len(set(own)) == len(set(zip(cases, own, strict=True))):
        return list(cases)
    return [label_of(keys) or name for keys, name in zip(varied, cases, strict=True)]


# ---- table.csv and summary.json.
def run_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """A row for each run, with every number of its summary by dotted key, SI."""
    rows = []
    for one in comparison.entries:
        varied = dict.fromkeys(comparison.keys)
        for key, value in one.keys.items():
            varied[key] = json.dumps(value) if isinstance(value, list | Mapping) else value
        row = {"run": one.name, "variant": one.variant, **varied, "seed": one.seed}
        row |= {"status": one.status, "reason": one.reason}
        rows.append(row | {"folder": os.path.relpath(one.folder, comparison.path), **one.numbers})
    return rows


def band_table(comparison: Comparison) -> "pd.DataFrame":
    """Mean, band and seeds by quantity, SI; of several variants by variant and quantity."""
    import pandas as pd

    rows = [
        {"variant": name, "quantity": quantity, **row}
        for name in comparison.variants
        for quantity, row in _bands_of(comparison, name).items()
    ]
    columns = ["variant", "quantity", "mean", "low", "high", "seeds"]
    index = ["variant", "quantity"] if len(comparison.variants) > 1 else "quantity"
    return pd.DataFrame(rows, columns=columns).set_index(index)[columns[2:]]


def depth_table(comparison: Comparison) -> "pd.DataFrame":
    """A row for each variant and slab: edges (m), and means with bands as `_low` and `_high`."""
    import pandas as pd

    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for name in comparison.variants:
        for quantity, band in _bands_of(comparison, name).items():
            if slab := SLAB.fullmatch(quantity):
                start = {"variant": name, "section": int(slab[1])}
                row = rows.setdefault((name, int(slab[1])), start)
                row[slab[2]] = band["mean"]
                if not slab[2].startswith("x_"):
                    row |= {f"{slab[2]}_{end}": band[end] for end in ("low", "high")}
    table = pd.DataFrame([*rows.values()])
    return table.sort_values(["variant", "section"], ignore_index=True)


def run_table(comparison: Comparison, dtype: Any = None) -> "pd.DataFrame":
    """The `run_rows`, with the types of their numbers or as objects."""
    import pandas as pd

    return pd.DataFrame(run_rows(comparison), dtype=dtype)


def summary_of(comparison: Comparison, more: Mapping[str, Any]) -> dict[str, Any]:
    """Means over seeds and variants, and of each variant, with `more` keys, as JSON knows them."""
    kept = ("run", "status", "reason", "folder")
    lost = [row for row in run_rows(comparison) if row["status"] != "done"]
    failures = [{key: row[key] for key in kept} for row in lost]
    result: dict[str, Any] = {
        "title": comparison.title,
        "runs": len(comparison.entries),
        "done": len(comparison.done),
        "failed": len(failures),
        "failures": failures,
        "left_out": list(comparison.left_out),
        "all_cpu_seconds": comparison.cost_s,
        "ranked_by": comparison.ranked_by,
        "ranking": comparison.ranking() if len(comparison.variants) > 1 else [],
        "variants": [_variant_row(comparison, name) for name in comparison.variants],
        "pairs": [_pair_row(pair) for pair in comparison.pairs()],
    }
    for quantity in comparison.numbers:
        band, seeds = comparison.overall(quantity)
        result.setdefault(quantity, _band_row(band) | {"seeds": seeds})
    text = json.dumps(result | dict(more), default=str)
    return dict(json.loads(text, parse_constant=lambda _: None))


def _variant_row(comparison: Comparison, name: str) -> dict[str, Any]:
    runs = [entry.status for entry in comparison.entries if entry.variant == name]
    row = {"name": name, "keys": dict(comparison.keys_of(name)), "runs": len(runs)}
    row["failed"] = len(runs) - runs.count("done")
    return row | _bands_of(comparison, name)


def _bands_of(comparison: Comparison, name: str) -> dict[str, Any]:
    """The band of every quantity of a variant, with its seeds and its extremes."""
    row = {}
    for quantity in comparison.numbers:
        if values := comparison.values(name, quantity).values():
            ends = {"seeds": len(values), "least": min(values), "most": max(values)}
            row[quantity] = _band_row(comparison.band(name, quantity)) | ends
    return row


def _band_row(band: Band) -> dict[str, Any]:
    row: dict[str, Any] = {"mean": band.mean, "low": band.low, "high": band.high}
    return row | ({"cut_at": list(band.cut)} if band.cut else {})


def _pair_row(pair: Pair) -> dict[str, Any]:
    gap = pair.difference._asdict()
    row = {"one": pair.one, "other": pair.other, "difference": _band_row(gap.pop("band"))}
    return row | gap | {"apart": pair.apart}


# ---- Targets: what a mud is asked for, and which muds reach it.
GOALS: Mapping[str, tuple[str, Callable[[str], float]]] = {
    "depth": ("invasion_depth_p95_m", lambda text: converted(text, "_mm") / 1e3),
    "k_loss": ("k_reduction", share_of),
    "bridging": (PASSED, share_of),
}
"""Targets of a sweep, the largest values that are accepted: quantity, and SI from a text."""


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
    return limits
