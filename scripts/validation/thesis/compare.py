"""Comparisons with the thesis: its Tables 3 to 11 next to ours, and whether its trends hold.

Both start from results.csv, a row for each run and pair of laws. Values over seeds have Student's
95 % band, differences Welch's (1947). A specimen of fewer than three seeds borrows the spread of
its quick form, which is cautious: that has a sixth of the cross-section.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import spearmanr
from scipy.stats import t as student

from fdnet.case.file import QUICK
from fdnet.spheres.snapshot import Array
from validation.thesis.published import in_words, reductions, rows_in, thesis_of
from validation.thesis.quantities import SECTIONS

Table = Any  # rows of results.csv as a pandas table, or a column of it
LAWS = ("thesis, thesis", "lubrication, auto", "lubrication, all-spheres")
"""The thesis's laws, an earlier default of fdnet (rows of earlier scripts), and that of today."""
MARGIN, OVERLAP, PASSED, ROUNDING = 0.20, 0.05, 0.05, 1e-9
"""Share of the larger loss within which losses are alike, overlap over a diameter and share passed
above which a remark is made, and differences that count as none."""
QUANTITIES: Mapping[str, Any] = {row.quantity: row for row in rows_in("quantities.csv")}
"""The quantities of a run: `values` gives one from rows of results.csv, in its `unit`; `thesis` is
the thesis's number of it, times `scale`. It may depend on the pair of laws, may grow with the
specimen, so that a borrowed spread is widened, and may be too small when fines pass (`deep`). A
`response` is how values answer to the drag: slope or rank correlation."""


def values_in(rows: Table, quantity: str) -> Table:
    """(R,) a quantity from R rows of results.csv."""
    if QUANTITIES[quantity].by_law:
        deep, others = rows[_sections("k_reduction", 2, 4)], rows[_sections("k_reduction", 2)]
        total = rows.k_reduction_1 + deep.sum(axis=1)
        more = {"k_1_to_4_mm": deep.mean(axis=1), "k_beyond_1_mm": others.max(axis=1)}
        rows = rows.assign(**more, k_sum_to_4_mm=total.where(total > 0))
    return rows.eval(QUANTITIES[quantity].values).astype(float)


def reported(run: str, quantity: str) -> str:
    """The thesis's number of a quantity in its unit, as text; "" where it has none."""
    name, scale = QUANTITIES[quantity].thesis, float(QUANTITIES[quantity].scale)
    one = thesis_of(run)
    values = reductions(one)[:1] if name == "section_reduction" else one.get(name, [])
    sense = one.get("senses", {}).get(name.replace("section", "first_section"), "")
    return " or ".join(in_words(sense, value, scale) for value in np.atleast_1d(values))


def rows_of(results: Table, run: str, laws: str = LAWS[0]) -> Table:
    """The rows of one run by one pair of laws, in the order of the seeds."""
    chosen = (results.id == run) & (results.law + ", " + results.damage_law == laws)
    return results[chosen].sort_values("seed")


def values_of(results: Table, run: str, quantity: str, laws: str = LAWS[0]) -> Array:
    """(S,) a quantity over the seeds of a run, without unknown values."""
    return values_in(rows_of(results, run, laws), quantity).dropna().to_numpy()


# ---- Means, differences and their 95 % bands.
class Mean(NamedTuple):
    """A mean over seeds, its variance and degrees of freedom, seeds, and whose spread it has."""

    mean: float
    variance: float = math.nan
    freedom: int = 0
    seeds: int = 0
    spread: str = ""


def mean_of(values: Any, lent: Any = (), *, grows: bool = False) -> Mean:
    """The mean of values; fewer than three borrow the spread of those lent, at least their
    relative one where it `grows` with the specimen."""
    if not len(values):
        return Mean(math.nan)
    mean, own, factor = float(np.mean(values)), len(values) >= 3, 1.0
    used = values if own else lent
    if len(used) < 3:
        return Mean(mean, seeds=len(values))
    if not own and grows and np.mean(lent) > 0:
        factor = max(1.0, mean / float(np.mean(lent)))
    same = np.ptp(used) <= ROUNDING * np.max(np.abs(used))
    variance = 0.0 if same else factor**2 * float(np.var(used, ddof=1)) / len(values)
    return Mean(mean, variance, len(used) - 1, len(values), "seeds" if own else "quick form")


def half_width(*means: Mean) -> float:
    """Half of the 95 % band of a mean, or of the difference of two; nan where not known."""
    variance = sum(one.variance for one in means)
    if not variance > 0:
        return variance
    parts = [(one.variance / variance) ** 2 / one.freedom for one in means if one.variance > 0]
    return float(student.ppf(0.975, 1 / sum(parts)) * math.sqrt(variance))


# ---- Tables 3 to 11: tables.csv.
def tables(results: Table) -> Iterator[dict[str, Any]]:
    """Rows of tables.csv: each number of the thesis's tables next to ours with its band.

    compared.csv has the runs next to each table, and the quantities, or k by section.
    """
    for table in rows_in("compared.csv"):
        for run, laws in product(table.runs.split("|"), (LAWS[0], LAWS[2])):
            rows = rows_of(results, run, laws)
            for name, given, values, unit, by_law in _cells(rows, run, table.names.split("|")):
                if laws != LAWS[0] and not by_law:
                    continue
                mean = mean_of(values.dropna().to_numpy(float))
                row = {"table": table.table, "run": run, "quantity": name}
                row |= {"laws": laws if by_law else "", "unit": unit, "thesis": given}
                row |= {"ours": mean.mean, "half_width": half_width(mean), "seeds": mean.seeds}
                yield row | {"ended_by": ", ".join(dict.fromkeys(rows.stop_reason))}


def _cells(rows: Table, run: str, names: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    given = [f"{100 * one:.6g}" for one in reductions(thesis_of(run))] + [""] * SECTIONS
    for name in names:
        if name in QUANTITIES:
            one = QUANTITIES[name]
            yield name, reported(run, name), values_in(rows, name), one.unit, one.by_law
        else:
            for column, told in zip(_sections(name), given, strict=False):
                yield column, told, 100 * rows[column], "%", True


def _sections(name: str, first: int = 1, last: int = SECTIONS) -> list[str]:
    return [f"{name}_{number}" for number in range(first, last + 1)]


# ---- The seven trends of the thesis's chapter 4 and Figure 14: trends.csv.
def trends(results: Table) -> list[dict[str, Any]]:
    """Rows of trends.csv: every comparison of claims.csv at full scale and in the quick forms.

    `one` has "more" than `other`, is "alike" within MARGIN, or lies "above" the bound. The bound
    of trend 1 is the share that the thesis's specimen 1 has in its first millimetre.
    """
    made = []
    for scale, prefix in (("full scale", ""), ("quick forms", QUICK)):
        for claim in rows_in("claims.csv"):
            names, what = [prefix + o for o in (claim.one, claim.other) if o], claim.quantity
            if QUANTITIES[what].response and not responses(results, names[0], what):
                continue
            for laws in LAWS if QUANTITIES[what].by_law else ("",):
                if laws != LAWS[2] or any(len(rows_of(results, one, laws)) for one in names):
                    made.append({"trend": int(claim.trend), "scale": scale, "laws": laws})
                    made[-1] |= _compared(results, claim, names, laws or LAWS[0])
    return sorted(made, key=lambda row: row["trend"])


def responses(results: Table, run: str, response: str) -> list[float]:
    """How a quantity answers to the drag, one value for each seed with three multipliers or more.

    A slope is of least squares over the decimal logarithm of the multiplier; a rank correlation is
    Spearman's, 0 when all values are the same. The case itself has the multiplier 1.
    """
    rows = results[results.law + ", " + results.damage_law == LAWS[0]]
    scanned = rows.id.str.extract(r"^(\S+) drag\.multiplier=(\S+)$")
    x = scanned[1].astype(float).where(rows.id != run, 1.0)
    table: Table = pd.DataFrame({"x": np.log10(x), "seed": rows.seed})
    table["y"] = values_in(rows, response)
    made = []
    for _, one in table[(rows.id == run) | (scanned[0] == run)].dropna().groupby("seed"):
        x, y = one.x.to_numpy(), one.y.to_numpy()
        if len(one) < 3:
            continue
        if QUANTITIES[response].response == "rank":
            made.append(0.0 if np.ptp(y) == 0 else float(spearmanr(x, y).statistic))
        else:
            made.append(float(np.dot(x - x.mean(), y) / np.dot(x - x.mean(), x)))
    return made


def _compared(results: Table, claim: Any, names: Sequence[str], laws: str) -> dict[str, Any]:
    means = [_mean(results, name, claim.quantity, laws) for name in names]
    values = [one.mean for one in means] + ([] if claim.other else [float(claim.bound)])
    gap, half = values[0] - values[1], half_width(*means)
    margin = MARGIN * max(values) if claim.sense == "alike" else math.nan
    row = {"quantity": claim.quantity, "unit": QUANTITIES[claim.quantity].unit}
    row |= {"sense": claim.sense, "one": names[0], "other": names[1] if claim.other else ""}
    row |= {"one_value": values[0], "other_value": values[1], "difference": gap}
    row |= {"low": gap - half, "high": gap + half, "margin": margin}
    row |= {"verdict": verdict(claim.sense, gap - half, gap + half, margin)}
    row |= {"runs_one": means[0].seeds, "runs_other": means[1].seeds if claim.other else 0}
    row["spread"] = "; ".join(dict.fromkeys(one.spread for one in means if one.spread))
    return row | {"note": "; ".join(_notes(results, names, claim.quantity))}


def _mean(results: Table, run: str, quantity: str, laws: str) -> Mean:
    names = [run] if run.startswith(QUICK) else [run, QUICK + run]
    if QUANTITIES[quantity].response:
        return mean_of(*(responses(results, name, quantity) for name in names))
    samples = (values_of(results, name, quantity, laws) for name in names)
    return mean_of(*samples, grows=bool(QUANTITIES[quantity].grows))


def verdict(sense: str, low: float, high: float, margin: float) -> str:
    """What the 95 % interval of a difference decides; "alike" is within `margin`."""
    holds, fails = low > ROUNDING, high < -ROUNDING
    if sense == "alike":
        holds, fails = -margin <= low and high <= margin, low > margin or high < -margin
    return "holds" if holds else "does not hold" if fails else "not decided"


def _notes(results: Table, names: Sequence[str], quantity: str) -> Iterator[str]:
    """What weakens a comparison: missing runs, runs that did not plug, fines that passed."""
    if QUANTITIES[quantity].response:
        scanned = results.id.str.startswith(f"{names[0]} drag.multiplier=")
        names = [*dict.fromkeys(results.id[scanned | (results.id == names[0])])]
    for name in names:
        rows = rows_of(results, name)
        if not len(rows):
            yield f"no run of {name}"
            continue
        if ends := sorted({*rows.stop_reason} - {"plugged"}):
            yield f"{name} ended by {', '.join(ends)}"
        if rows.max_overlap.max() > OVERLAP:
            yield f"fines of {name} overlap by up to {rows.max_overlap.max():.0%} of a diameter"
        passed, inside = int(rows.passed_count.sum()), int(rows.invaded_count.sum())
        if QUANTITIES[quantity].deep and passed > PASSED * (inside + passed):
            share = passed / (inside + passed)
            yield f"{share:.0%} of the fines passed through {name}, so they went deeper still"
