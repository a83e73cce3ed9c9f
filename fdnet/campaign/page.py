"""What a reader sees of a comparison: sentences, figures, and compare.html with both."""

import json
import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fdnet.campaign import result as results
from fdnet.campaign.result import Comparison
from fdnet.files import write_text
from fdnet.report import figures, html
from fdnet.report.tables import MILLIDARCY, in_millidarcy, millimetres, percent
from fdnet.statistics.bands import Band, seeds_for_width
from fdnet.statistics.differences import MOST_SEEDS

if TYPE_CHECKING:
    import pandas as pd

SHOWN = ["k_reduction", "damage.face_lost", "k_damaged_m2", "invasion_depth_p95_m"]
SHOWN += ["skin", "skin_flow_lost", "invaded_count", "passed_count"]
"""Quantities of the tables of the page, after the ranked one."""
LAYERS = ["porosity_initial", "porosity_damaged", "k_initial_m2", "k_damaged_m2", "k_reduction"]
"""Quantities of the tables by depth, and the number of fines."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Runs and what they say together; `print` gives a sentence for each variant and each two.

    The variants of an ensemble are one. Quantities are the numbers of summary.json by dotted key,
    as "k_reduction" or "sections.1.k_damaged_m2", in SI.
    """

    comparison: Comparison  # the runs themselves
    limits: Mapping[str, float] = field(default_factory=dict)  # the targets of a sweep, SI

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """`runs`, `failed`, and by quantity `mean`, `low` and `high`."""
        judged = [{"name": name, "state": state} for name, state, _ in self.candidates]
        more = {"candidates": judged, "targets": self.limits} if self.limits else {}
        return results.summary_of(self.comparison, more)

    @cached_property
    def candidates(self) -> list[tuple[str, str, str]]:
        """Name, state and a sentence of each variant against the targets, best first."""
        return candidates(self.comparison, self.limits)

    @cached_property
    def ranking(self) -> tuple[str, ...]:
        """A sentence for each variant, best first, by the targets and by their quantity."""
        return (*(line for *_, line in self.candidates), *ranking_lines(self.comparison))

    @cached_property
    def differences(self) -> tuple[str, ...]:
        """A sentence for each two variants."""
        return tuple(pair_lines(self.comparison))

    @property
    def path(self) -> Path:
        """Folder of table.csv, summary.json and compare.html, where they were written."""
        return self.comparison.path

    @cached_property
    def table(self) -> "pd.DataFrame":
        """A row for each run with every number of its summary, lengths in m, k in m2."""
        return results.run_table(self.comparison)

    @cached_property
    def band(self) -> "pd.DataFrame":
        """`mean`, `low` and `high` of the 95 % band, and `seeds`: a row for each quantity, or of
        several variants for each variant and quantity."""
        return results.band_table(self.comparison)

    @property
    def mean(self) -> "pd.Series[float]":
        """Mean over the seeds by quantity: `runs.mean["k_reduction"]`."""
        return self.band["mean"]

    def by_depth(self) -> "pd.DataFrame":
        """A row for each slab: edges (m), means over the seeds, and `_low` and `_high` of each."""
        return results.depth_table(self.comparison)

    def plot(self) -> Any:
        """Permeability in place (mD) against depth (mm), mean and band; returns the axes."""
        return figures.shown(partial(_fill_depth, comparison=self.comparison))[0]

    def __str__(self) -> str:
        """The ranking and the differences; of one variant the other quantities of the page."""
        variants, more = self.comparison.variants, list[str]()
        for quantity in _shown(self.comparison)[1:] if len(variants) == 1 else ():
            band = self.comparison.band(variants[0], quantity)
            more.append(f"{label(quantity)}: {band_text(quantity, band)}")
        fast = filter(None, [method_words(self.comparison)])
        return "\n".join([*self.ranking, *more, *self.differences, *fast])

    __repr__ = __str__


def write_comparison(comparison: Comparison, limits: Mapping[str, float]) -> Compared:
    """Write table.csv, summary.json, figures and compare.html; `limits` (SI) are of targets."""
    made = Compared(comparison, limits)
    table = results.run_table(comparison, object).to_csv(index=False, lineterminator="\n")
    write_text(made.path / results.TABLE, table)
    write_text(made.path / results.SUMMARY, json.dumps(made.summary, indent=1) + "\n")
    judged = [line for *_, line in made.candidates]
    text = html.page_text(
        "campaign/compare.html.j2",
        comparison=comparison,
        answer=judged[0].removeprefix("1. ") if judged else answer_words(comparison),
        method=method_words(comparison),
        by="the targets" if judged else f"{label(comparison.ranked_by)}, smallest first",
        ranking=[re.sub(r"^\d+\. ", "", line) for line in made.ranking[: len(judged) or None]],
        pairs=made.differences,
        figures=_draw(comparison),
        columns=_shown(comparison),
        slabs=sorted({int(one[1]) for one in map(results.SLAB.match, comparison.numbers) if one}),
        layers=[one for one in html.SECTION_COLUMNS[3:] if one[0] in [*LAYERS, "fines_count"]],
        label=label,
        value_text=value_text,
        ends_text=ends_text,
        link=partial(_link, made.path),
        version=metadata.version("fdnet"),
    )
    write_text(made.path / results.PAGE, text)
    return made


def _shown(comparison: Comparison) -> list[str]:
    """The ranked quantity, and those of `SHOWN` that are known."""
    every = dict.fromkeys([comparison.ranked_by, *SHOWN])
    return [one for one in every if one in comparison.numbers]


def _link(page: Path, run: results.Entry) -> str:
    report = run.folder / "report.html"
    return quote(os.path.relpath(report if report.exists() else run.folder, page))


# ---- Sentences.
LABELS = {
    "k_reduction": "permeability lost",
    "skin": "skin of the well",
    "damage.face_lost": "permeability lost by the layer at the face",
    "k_damaged_m2": "damaged permeability",
    "invasion_depth_p95_m": "depth above which 95 % of the fines lie",
    "skin_flow_lost": "flow of the well lost to the skin",
    "invaded_count": "fines that invaded",
    "passed_count": "fines that passed",
    "passed_fraction": "share of the fines that pass through the specimen unbridged",
    "cake_thickness_m": "thickness of the cake",
    "porosity_damaged": "damaged porosity",
}
"""Quantities of a summary in words."""


def label(quantity: str) -> str:
    """A quantity in words; its key where it has none."""
    return LABELS.get(quantity, quantity)


def _unit_of(quantity: str) -> tuple[float, str]:
    """Factor from SI to the unit that a reader sees, and this unit."""
    if results.SHARES.search(quantity):
        return 100.0, "%"
    if re.search(r"(?<!_m3)_m2$", quantity):
        return 1 / MILLIDARCY, "mD"
    return (1e3, "mm") if quantity.endswith("_m") else (1.0, "–")


def value_text(quantity: str, value: float | None) -> str:
    """A value for a reader, with its unit, as the report of a run has it."""
    if value is None or math.isnan(value):
        return html.DASH
    _, unit = _unit_of(quantity)
    worded = {"%": percent, "mD": in_millidarcy, "mm": millimetres, "–": html.quantity}[unit]
    return re.sub("^-", "\u2212", worded(value) + (f" {unit}" if unit in ("%", "mD") else ""))


def ends_text(quantity: str, band: Band) -> str:
    """A band without its mean: `95 % band 0.0 to 92.0 %, cut at 0.0 %`; "" without a value."""
    if math.isnan(band.low):
        return "" if math.isnan(band.mean) else "no band: one run"
    low, high, *cut = (value_text(quantity, one) for one in (band.low, band.high, *band.cut))
    ends = f"95 % band {low.partition(' ')[0]} to {high}"
    return f"{ends}, cut at {' and '.join(cut)}" if cut else ends


def band_text(quantity: str, band: Band) -> str:
    """A mean with its band: `45.0 % (95 % band 0.0 to 92.0 %, cut at 0.0 %)`."""
    ends = ends_text(quantity, band)
    return f"{value_text(quantity, band.mean)} ({ends})" if ends else html.DASH


def answer_words(comparison: Comparison) -> str:
    """What the seeds say together: the mean of one variant, or the best and who is as good."""
    first = ranking_lines(comparison)[0].removeprefix("1. ")
    pairs = [pair for pair in comparison.pairs() if pair.one == comparison.ranking()[0]]
    alike = [pair.other for pair in pairs if not pair.apart]
    if not alike:
        return first + " It is the smallest, and differs from every other variant." * bool(pairs)
    more = f" and {len(alike) - 3} more" if len(alike) > 3 else ""
    said = "It is the smallest mean, but these seeds do not tell it apart from"
    return f"{first} {said} {', '.join(alike[:3])}{more}."


def method_words(comparison: Comparison) -> str:
    """Which runs are by the fast model, and its error; "" where none is."""
    from fdnet.run.by_classes import METHOD_ERROR

    fast = sum(run.numbers.get("method") == "network" for run in comparison.done)
    which = "All" if fast == len(comparison.done) else f"{fast} of {len(comparison.done)}"
    return f"{which} runs are by the fast model of size classes: {METHOD_ERROR}." if fast else ""


def ranking_lines(comparison: Comparison) -> list[str]:
    """One sentence for each variant with its band; several are numbered, best first."""
    quantity, names = comparison.ranked_by, comparison.ranking()
    lines = []
    for number, name in enumerate(names, start=1):
        place = f"{number}. {name}" if len(names) > 1 else name
        count = len(comparison.values(name, quantity))
        band = band_text(quantity, comparison.band(name, quantity))
        told = f"{label(quantity)} {band}, {count} seed{'s' if count > 1 else ''}"
        lines.append(f"{place}: {told if count else 'no finished run'}.")
    return lines


def pair_lines(comparison: Comparison) -> list[str]:
    """Each difference with its band, and the seeds that would show one that is not shown yet."""
    lines = []
    for one, other, gap, apart in comparison.pairs():
        how = ", paired by seed, same packs" if gap.paired else ", packs not shared"
        how = "" if math.isnan(gap.p_value) else how
        needed = f"; it needs some {gap.seeds_needed} seeds of each" if gap.seeds_needed else ""
        verdict = "they differ" if apart else f"not distinguished{needed}"
        band = band_text(comparison.ranked_by, gap.band)
        lines.append(f"{one} and {other}: difference {band}{how}; {verdict}.")
    return lines


def failure_lines(comparison: Comparison) -> list[str]:
    """Each run that has no result, with its reason and folder."""
    failed = comparison.failed
    lines = [f"{one.name} {one.status}: {one.reason} (folder {one.folder})" for one in failed]
    return [*lines, *(f"{one}: has no result and is left out" for one in comparison.left_out)]


HEADS = {"met": "meets every target", "open": "may meet its targets", "missed": "misses a target"}
"""The 95 % band lies below the limit, across it, or above it."""


def candidates(comparison: Comparison, limits: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Name, state and reasons of each mud: all met first, then by the mean nearest its limit."""
    states, rows = list(HEADS), []
    for name in filter(comparison.of_variant, comparison.variants if limits else ()):
        reasons, worst, over = [], 0, -math.inf
        for target, limit in limits.items():
            quantity = results.GOALS[target][0]
            values, band = comparison.values(name, quantity), comparison.band(name, quantity)
            state = 0 if band.high <= limit else 2 if band.low > limit else 1
            worst = max(worst, state)
            over = max(over, band.mean / limit if limit else math.inf)
            reason = f"{label(quantity)} {band_text(quantity, band)}, at most "
            reason += f"{value_text(quantity, limit)}: {states[state]}"
            if state == 1 and len(values) > 1 and (gap := abs(band.mean - limit)) > 0:
                needed = seeds_for_width([*values.values()], gap, MOST_SEEDS)
                reason += f", some {needed} seeds would decide it"
            reasons.append(reason)
        rows.append((worst, over, name, "; ".join(reasons)))
    return [
        (name, states[worst], f"{number}. {name} {HEADS[states[worst]]}: {reasons}.")
        for number, (worst, _, name, reasons) in enumerate(sorted(rows), start=1)
    ]


# ---- Figures, as SVG inside of the page.
def _draw(comparison: Comparison) -> dict[str, dict[str, str]]:
    """The figures that have data, drawn into the folder of the page, by the stem of their file."""
    shown, several = dict[str, dict[str, str]](), len(comparison.variants) > 1

    def add(name: str, fill: Callable[..., None], caption: str) -> None:
        path = figures.draw(comparison.path / f"{name}.svg", partial(fill, comparison=comparison))
        shown[name] = html.shown_figure(path, caption)

    if several and comparison.numbers.get(comparison.ranked_by):
        caption = "Every run (grey), mean over the seeds (line) and its 95 % band (blue)."
        add("ranking", _fill_ranking, caption)
    if "sections.1.k_damaged_inplace_m2" in comparison.numbers:
        most = f", of {len(figures.PALETTE)} variants at most"
        more = most if several else "; thin lines are the runs"
        caption = (
            "Permeability in place of the slabs after the invasion, mean over the seeds with its "
            f"95 % band; dashed is the intact sand{more}."
        )
        add("by_depth", _fill_depth, caption)
    return shown


def _fill_ranking(figure: Any, *, comparison: Comparison) -> None:
    """Every run as a dot, the mean of each variant with its band."""
    quantity, axes = comparison.ranked_by, figure.subplots()
    names = [name for name in comparison.ranking() if comparison.values(name, quantity)]
    factor, unit = _unit_of(quantity)
    for place, name in enumerate(names):
        band = comparison.band(name, quantity)
        values = [factor * value for value in comparison.values(name, quantity).values()]
        axes.plot(values, [place] * len(values), "o", ms=4, color="0.6", zorder=2)
        axes.hlines(place, factor * band.low, factor * band.high, figures.BLUE, lw=5, alpha=0.4)
        axes.plot(factor * band.mean, place, "|", ms=16, mew=2.5, color=figures.BLUE, zorder=3)
    axes.set_yticks(range(len(names)), [_short(name) for name in names])
    axes.invert_yaxis()
    axes.margins(y=0.25 / len(names) + 0.05)
    axes.set_xlabel(f"{label(quantity)} ({unit})")
    figure.set_size_inches(7.2, 0.9 + 0.42 * len(names))


def _fill_depth(figure: Any, *, comparison: Comparison) -> None:
    """Permeability in place of the slabs by depth, of the first variants of the ranking."""
    axes, table = figure.subplots(), results.depth_table(comparison)
    runs = comparison.done if len(comparison.variants) == 1 else []
    for colour, name in zip(figures.PALETTE, comparison.ranking(), strict=False):
        mine = table[table["variant"] == name]
        if not len(mine):
            continue
        edges, look = [*mine["x_lo_m"], mine["x_hi_m"].iloc[-1]], {"color": colour}
        mean, low, high, intact = (
            mine[f"k_{end}"].to_numpy() / MILLIDARCY
            for end in ("damaged_inplace_m2", "damaged_inplace_m2_low",
                        "damaged_inplace_m2_high", "initial_inplace_m2")
        )  # fmt: skip
        figures.stairs(axes, edges, high, baseline=low, fill=True, alpha=0.18, **look)
        figures.stairs(axes, edges, intact, linestyle="--", linewidth=1.0, **look)
        figures.stairs(axes, edges, mean, label="mean" if runs else _short(name), **look)
        axes.set_xlim(1e3 * edges[0], 1e3 * edges[-1])
        for run in runs:
            keys = [f"sections.{slab}.k_damaged_inplace_m2" for slab in mine["section"]]
            one = [run.numbers.get(key) or math.nan for key in keys]
            figures.stairs(axes, edges, [k / MILLIDARCY for k in one], linewidth=0.6, **look)
    axes.set(xlabel=figures.DEPTH_LABEL, ylabel="permeability in place (mD)", ylim=(0, None))
    axes.yaxis.set_major_formatter("{x:,.10g}")
    figures.legend_above(axes, columns=2)


def _short(name: str) -> str:
    """A name as it is drawn: not too long, and no sign of it read as a formula."""
    return (name if len(name) <= 40 else f"{name[:37]}...").replace("$", r"\$")
