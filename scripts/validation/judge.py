"""Errors of observed values, their 95 % bands, and what can be said of them.

All studies of error against run time keep one table, with a row for each quantity of each run:

    series, knob, value, seed    the curve, what is varied, its value, and the sample: a seed, or
                                 the name of a pack
    quantity, observed           what was measured, SI, and its value
    sd                           standard deviation of `observed` that the measurement itself
                                 states; empty where there is none
    error                        of this run, as a fraction
    band                         half of the 95 % band of the mean error at this value
    core_s, rss_mb, steps        processor seconds, peak memory in MB, steps of LIGGGHTS or of an
                                 iteration
    status                       "done", or why there is no result

`error` and `band` follow from the other columns and the rules of the study, `[[judge]]` in its
file. They are written for readers, and computed anew whenever the table is read.
"""

import math
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import binomtest
from scipy.stats import t as student

from fdnet.errors import CaseError
from fdnet.files import replacing

TEXTS, COSTS = ("series", "knob", "value", "seed", "quantity", "status"), ("core_s", "rss_mb")
COLUMNS = (*TEXTS[:5], "observed", "sd", "error", "band", *COSTS, "steps", "status")
DONE, SD = "done", " ±"
"""The status of a run with a result, and the ending of the name of its standard deviation."""
_ROUNDING, _NINE_DIGITS = 1e-12, 1e-8
_OF_ONE_RUN = 1.96
_MOST_SEEDS = 10_000


class Rule(NamedTuple):
    """How the errors of some quantities follow from the observed values.

    `series` and `quantities` are patterns as in file names. The reference is the first of the
    values `reference` that was run, in the first of `reference_series` that was run, or in each
    series itself where none is given. `form` says what the error of a run is:

    - "paired": its difference from the reference run of the same seed, over the reference's mean;
    - "unpaired": its difference from the reference's mean, over it;
    - "each": its difference from the reference run of the same sample, over that one;
    - "error": what was observed is the error already; "size": its magnitude is.

    With `trials`, what was observed is a share of so many trials. `size` names a further quantity
    that holds the magnitude of the error, with {} for the name of the quantity: by how much a
    single run is off.
    """

    quantities: Sequence[str]
    form: str
    series: Sequence[str] = ("*",)
    reference: Sequence[Any] = ()
    reference_series: Sequence[str] = ()
    size: str = ""
    trials: int = 0


class Level(NamedTuple):
    """All runs of one value of a knob: their number, mean cost, mean error and its band."""

    value: str
    runs: int
    cost: float
    error: float
    band: float

    @property
    def resolved(self) -> bool:
        """Whether the error stands out of its band."""
        return self.band <= abs(self.error)

    @property
    def seeds_needed(self) -> int | None:
        """Seeds, to a tenth, with which a mean error of this size would; None above 10,000."""
        scatter = self.band * math.sqrt(self.runs) / _quantile(self.runs)
        for seeds in (int(2 * 1.1**n) for n in range(90)):
            if _quantile(seeds) * scatter / math.sqrt(seeds) <= abs(self.error):
                return seeds if seeds <= _MOST_SEEDS else None
        return None


def read_rows(path: Path) -> pd.DataFrame:
    """The table of a study. Raises CaseError when it cannot be read or has other columns."""
    try:
        empty = {name: [""] for name in COLUMNS if name not in TEXTS}
        rows = pd.read_csv(
            path, dtype=dict.fromkeys(TEXTS, str), keep_default_na=False, na_values=empty
        )
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: cannot be read as the table of a study: {error}") from error
    if tuple(rows.columns) != COLUMNS:
        raise CaseError(f"{path}: has the columns {list(rows.columns)}, expected {list(COLUMNS)}")
    return rows


def rows_from(records: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The table of rows that lack what is judged, and perhaps some costs."""
    rows = pd.DataFrame(records, columns=list(COLUMNS))
    numbers = [name for name in COLUMNS if name not in TEXTS]
    return rows.astype(dict.fromkeys(numbers, float) | dict.fromkeys(TEXTS, str))


def shown(value: Any) -> str:
    """A value of a knob as the table has it."""
    return value if isinstance(value, str) else f"{value:.9g}"


def write_rows(rows: pd.DataFrame, path: Path) -> None:
    """Write the table with nine digits."""
    with replacing(path) as part:
        rows.to_csv(part, columns=list(COLUMNS), index=False, float_format="%.9g")


def judged(rows: pd.DataFrame, rules: Sequence[Rule]) -> pd.DataFrame:
    """The rows with `error` and `band` computed anew; they are empty where no rule holds.

    Raises CaseError when no run of a reference was done.
    """
    derived = {rule.size.format(name) for rule in rules for name in rule.quantities if rule.size}
    kept = rows[~rows.quantity.isin(derived)].reset_index(drop=True)
    kept[["error", "band"]] = np.nan
    sizes = []
    for rule in rules:
        for name in rule.quantities:
            named = kept[(kept.quantity == name) & _named(kept.series, rule.series)]
            apart = rule.reference and not rule.reference_series and rule.form != "each"
            for _, pool in named.groupby("series", sort=False) if apart else [("", named)]:
                done = pool[(pool.status == DONE) & pool.observed.notna()]
                if pool.empty or (done.empty and not rule.reference):
                    continue
                errors = _errors(done, rule, pool)
                kept.loc[done.index, "error"] = errors.error
                kept.loc[done.index, "band"] = _bands(done, errors)
                if rule.size:
                    size = errors.assign(error=errors.error.abs(), shift=0.0)
                    new = {"error": size.error, "band": _bands(done, size)}
                    sized = done.assign(quantity=rule.size.format(name), **new)
                    sizes.append(sized[sized.error.notna()])
    return pd.concat([kept, *sizes], ignore_index=True)


def among(name: str, patterns: Sequence[str]) -> bool:
    """Whether a name fits one of the patterns."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def _named(names: pd.Series, patterns: Sequence[str]) -> pd.Series:
    return names.isin([name for name in names.unique() if among(name, patterns)])


def _errors(done: pd.DataFrame, rule: Rule, asked: pd.DataFrame) -> pd.DataFrame:
    """Error of each run, its standard deviation `sd`, and the band of the reference, `shift`."""
    sd = done.sd.fillna(0.0)
    if rule.form in ("error", "size"):
        error = done.observed.abs() if rule.form == "size" else done.observed
        if rule.trials:
            half = done.observed.map(lambda share: _half_of_wilson(share, rule.trials))
            sd = half / _OF_ONE_RUN
        return pd.DataFrame({"error": error, "sd": sd, "shift": 0.0}, index=done.index)
    best = _reference(done, rule, asked)
    base = done[best].groupby("seed")["observed"].first()
    own = done.seed.map(base)
    if rule.form == "each":
        known = done.seed.map(done[best].groupby("seed")["sd"].first()).fillna(0.0)
        sd = (sd**2 + known**2) ** 0.5
        error = (done.observed / own - 1.0).where(~best)
        return pd.DataFrame({"error": error, "sd": sd / own.abs(), "shift": 0.0})
    mean = float(base.mean())
    size = abs(mean) or 1.0
    origin = own.fillna(mean).where(~best & (rule.form == "paired"), mean)
    difference = done.observed - origin
    error = (difference / size).where(difference.abs() > _ROUNDING * abs(mean), 0.0)
    scatter = error.groupby([done.series, done.value]).transform("std")
    shift = 0.0 if rule.form == "paired" else _half_width(base) / size
    return pd.DataFrame(
        {"error": error, "sd": scatter.fillna(scatter.max()), "shift": (~best) * shift}
    )


def _reference(done: pd.DataFrame, rule: Rule, asked: pd.DataFrame) -> pd.Series:
    """Which of the runs are those of the reference."""
    for series in rule.reference_series or ("*",):
        for value in rule.reference:
            same = [one for one in done.value.unique() if same_value(one, value)]
            best = done.value.isin(same) & _named(done.series, (series,))
            if best.any():
                return best
    why = "; ".join(sorted(set(asked.status) - {DONE})[:3]) or "none was asked for"
    raise CaseError(
        f"{asked.quantity.iloc[0]}: no run of the reference {list(rule.reference)} was done "
        f"({why}); mend the cause and repeat the command"
    )


def same_value(text: str, value: Any) -> bool:
    """Whether a value of the table, which is a text, is this number or text."""
    try:
        return math.isclose(float(text), float(value), rel_tol=1e-6)
    except ValueError:
        return text == str(value)


def _bands(done: pd.DataFrame, errors: pd.DataFrame) -> pd.Series:
    """Half of the 95 % band of the mean error of all runs at the value of each run."""
    groups = errors.groupby([done.series, done.value])
    count, scatter = groups["error"].transform("count"), groups["error"].transform("std")
    several = scatter * count.map(lambda n: _quantile(n) / math.sqrt(n) if n > 1 else math.nan)
    band = several.where(count > 1, _OF_ONE_RUN * errors.sd.fillna(0.0))
    return ((band**2 + errors["shift"] ** 2) ** 0.5).where(errors.error.notna())


@cache
def _quantile(runs: int) -> float:
    """Student's t that the 95 % band of a mean of so many runs reaches."""
    return float(student.ppf(0.975, runs - 1)) if runs > 1 else _OF_ONE_RUN


def _half_width(values: pd.Series) -> float:
    count = len(values)
    return _quantile(count) * float(values.std()) / math.sqrt(count) if count > 1 else 0.0


def _half_of_wilson(share: float, trials: int) -> float:
    """Half of the 95 % interval of a share (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    band = binomtest(round(share * trials), trials).proportion_ci(method="wilson")
    return float(band.high - band.low) / 2.0


# ---- What the table says: mean errors by value, in words.
def levels(rows: pd.DataFrame, series: str, quantity: str, *, cost: str = "core_s") -> list[Level]:
    """The values of one series, in the order of the table, as far as they have an error."""
    own = rows[(rows.series == series) & (rows.quantity == quantity) & rows.error.notna()]
    return [
        Level(
            str(value),
            len(group),
            float(group[cost].mean()),
            _mean(group.error),
            group.band.iloc[0],
        )
        for value, group in own.groupby("value", sort=False)
    ]


def _mean(errors: pd.Series) -> float:
    """The mean; 0 where it is below the nine digits of the table."""
    mean = float(errors.mean())
    return 0.0 if abs(mean) < _NINE_DIGITS * errors.abs().max() else mean


def percent(level: Level) -> str:
    """The mean error with its band."""
    band = f" ± {100 * level.band:.2g}" if level.band else ""
    return f"{100 * level.error:+.3g}{band} %"


def verdict(level: Level, *, signed: bool = True) -> str:
    """What the seeds show: nothing where the band is larger than a signed error."""
    if not signed or level.resolved or level.runs < 2 or level.error == 0.0:
        return ""
    needed = level.seeds_needed
    would = f"{needed} would" if needed else f"more than {_MOST_SEEDS:,} would"
    return f"not resolved by {level.runs} seeds; {would}"


def table(
    rows: pd.DataFrame,
    quantity: str,
    *,
    cost: str = "core_s",
    series: Sequence[str] = ("*",),
    signed: bool = True,
) -> str:
    """The errors of a quantity as Markdown, a line for each series and value.

    Nothing is said of a magnitude and its band, because it is never below zero.
    """
    unit = {"core_s": "core s", "steps": "steps"}[cost]
    lines = [f"| series | value | error | {unit} | |", "|---|---|---|---|---|"]
    for name in dict.fromkeys(rows.series):
        if among(name, series):
            lines += [
                f"| {name} | {one.value} | {percent(one)} | {one.cost:.3g} "
                f"| {verdict(one, signed=signed)} |"
                for one in levels(rows, name, quantity, cost=cost)
            ]
    return "\n".join(lines)


def failures(rows: pd.DataFrame) -> list[str]:
    """Points that were refused or failed, one sentence each."""
    lost = rows[rows.status != DONE].drop_duplicates(["series", "value", "seed"])
    return [
        f"{r.series}, {r.knob} {r.value}, seed {r.seed}: {r.status}" for r in lost.itertuples()
    ]


# ---- The answer: what a shortcut costs.
class Shortcut(NamedTuple):
    """What a shortcut costs: its words, the error of a quantity, and how much time it saves."""

    says: str
    error_of: str
    level: Level
    saves: float
    signed: bool

    @property
    def resolved(self) -> bool:
        """Whether the error stands out of its band; a magnitude does."""
        return self.level.resolved or not self.signed


def shortcut(
    rows: pd.DataFrame,
    *,
    says: str,
    error_of: str,
    series: str,
    quantity: str,
    value: str,
    instead: str,
    instead_series: str | None = None,
    signed: bool = True,
) -> Shortcut:
    """The shortcut of taking `value` of the knob, next to `instead`, of another series or not;
    `says` and `error_of` are words for the reader."""
    one, other = (
        [level for level in levels(rows, name, quantity) if same_value(level.value, wanted)]
        for name, wanted in ((series, value), (instead_series or series, instead))
    )
    if not one or not other:
        raise CaseError(f"{series}: has no {quantity} at {value} or {instead}")
    return Shortcut(says, error_of, one[0], other[0].cost / one[0].cost, signed)


def answer_table(shortcuts: Sequence[Shortcut]) -> str:
    """The answer as Markdown."""
    lines = ["| shortcut | time | error | of | |", "|---|---|---|---|---|"]
    lines += [
        f"| {one.says} | {1 / one.saves:.2g} × | {percent(one.level)} | {one.error_of} "
        f"| {verdict(one.level, signed=one.signed)} |"
        for one in shortcuts
    ]
    return "\n".join(lines)
