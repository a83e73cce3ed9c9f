"""What a reader sees of a comparison: sentences, figures, and compare.html with both."""

import base64
import io
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

import numpy as np

from fdnet.campaign import result as results
from fdnet.campaign.result import Comparison
from fdnet.files import write_text
from fdnet.report import figures
from fdnet.report.tables import MILLIDARCY
from fdnet.statistics.bands import Band, seeds_for_width
from fdnet.statistics.differences import MOST_SEEDS

if TYPE_CHECKING:
    import pandas as pd

SHOWN = ("k_reduction", "k_damaged_m2", "invasion_depth_p95_m", "invaded_count", "passed_count")
"""Quantities of the tables of the page, after the ranked one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Compared:
    """Runs and what they say together; `print` gives a sentence for each variant and each two.

    The variants of an ensemble are one. Quantities are the numbers of summary.json by dotted key,
    as "k_reduction" or "sections.1.k_damaged_m2", in SI.

    Attributes:
        comparison: the runs themselves.
        summary: `runs`, `failed`, and by quantity `mean`, `low` and `high`.
        ranking: a sentence for each variant, best first.
        differences: a sentence for each two variants.
    """

    comparison: Comparison
    summary: Mapping[str, Any]
    ranking: tuple[str, ...]
    differences: tuple[str, ...]

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
        """`mean`, `low` and `high` of the 95 % band, and `seeds`: a row for each quantity.

        Where there are several variants, the rows go by variant and quantity.
        """
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
        (axes,) = figures.shown(lambda figure: _fill_depth(figure.subplots(), self.comparison))
        return axes

    def __str__(self) -> str:
        """The ranking and the differences."""
        return "\n".join([*self.ranking, *self.differences])

    __repr__ = __str__


def write_comparison(
    comparison: Comparison, limits: Mapping[str, float] | None = None
) -> Compared:
    """Write table.csv, summary.json and compare.html; `limits` (SI) are those of targets."""
    from jinja2 import Environment, StrictUndefined

    results.write_table(comparison)
    muds, ranking = candidates(comparison, limits or {}), ranking_lines(comparison)
    pairs, judged = pair_lines(comparison), [mud.line for mud in muds]
    states = [{"name": mud.name, "state": mud.state} for mud in muds]
    more = {"candidates": states, "targets": limits} if limits else {}
    summary = results.write_summary(comparison, more)
    trim: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True}
    environment = Environment(autoescape=True, undefined=StrictUndefined, **trim)
    shown = dict.fromkeys([comparison.ranked_by, *SHOWN])

    def link(run: results.Entry) -> str:
        report = run.folder / "report.html"
        target = report if report.exists() else run.folder
        return quote(os.path.relpath(target, comparison.path))

    page = resources.files("fdnet.campaign").joinpath("compare.html.j2").read_text("utf-8")
    text = environment.from_string(page).render(
        comparison=comparison,
        columns=[one for one in shown if one in comparison.numbers],
        muds=judged,
        ranking=[re.sub(r"^\d+\. ", "", line) for line in ranking],
        pairs=pairs,
        figures=[*filter(None, (_draw_ranking(comparison), _draw_depth(comparison)))],
        label=lambda quantity: LABELS.get(quantity, quantity),
        value_text=value_text,
        band_text=band_text,
        link=link,
        version=metadata.version("fdnet"),
    )
    write_text(comparison.path / results.PAGE, text)
    order, gaps = (*judged, *ranking), tuple(pairs)
    return Compared(comparison=comparison, summary=summary, ranking=order, differences=gaps)


def compared(comparison: Comparison) -> Compared:
    """What runs say together, with nothing written."""
    return Compared(
        comparison=comparison,
        summary=results.summary_of(comparison, {}),
        ranking=tuple(ranking_lines(comparison)),
        differences=tuple(pair_lines(comparison)),
    )


# ---- Sentences.
LABELS = {
    "k_reduction": "permeability lost",
    "k_damaged_m2": "damaged permeability",
    "invasion_depth_p95_m": "depth above which 95 % of the fines lie",
    "invaded_count": "fines that invaded",
    "passed_count": "fines that passed",
    "passed_fraction": "share of the fines that pass through the specimen unbridged",
    "cake_thickness_m": "thickness of the cake",
    "porosity_damaged": "damaged porosity",
}
"""Quantities of a summary in words."""


def unit_of(quantity: str) -> tuple[float, str]:
    """Factor from SI to the unit that a reader sees, and this unit; "" for a plain number."""
    if results.SHARES.search(quantity):
        return 100.0, "%"
    if quantity.endswith("_m2"):
        return 1 / MILLIDARCY, "mD"
    return (1e3, "mm") if quantity.endswith("_m") else (1.0, "")


def value_text(quantity: str, value: float | None) -> str:
    """A value for a reader, with its unit."""
    factor, unit = unit_of(quantity)
    if value is None or math.isnan(value):
        return "no value"
    return f"{_digits(factor * value)} {unit}".strip()


def _digits(value: float) -> str:
    text = f"{value:,.0f}" if abs(value) >= 1000 else f"{value:z.3g}"
    return text.replace("-", "\u2212")


def band_text(quantity: str, band: Band) -> str:
    """A mean with its band: `45 % (95 % band 0 to 92 %, cut at 0 %)`."""
    mean = value_text(quantity, band.mean)
    if math.isnan(band.low):
        return mean if math.isnan(band.mean) else f"{mean} (no band: one run)"
    low = _digits(unit_of(quantity)[0] * band.low)
    cut = " and ".join(value_text(quantity, bound) for bound in band.cut)
    high = value_text(quantity, band.high) + (f", cut at {cut}" if cut else "")
    return f"{mean} (95 % band {low} to {high})"


def ranking_lines(comparison: Comparison) -> list[str]:
    """One sentence for each variant with its band; several are numbered, best first."""
    quantity, names = comparison.ranked_by, comparison.ranking()
    lines = []
    for number, name in enumerate(names, start=1):
        place = f"{number}. {name}" if len(names) > 1 else name
        count = len(comparison.values(name, quantity))
        band = band_text(quantity, comparison.band(name, quantity))
        told = f"{LABELS.get(quantity, quantity)} {band}, {count} seed{'s' if count > 1 else ''}"
        lines.append(f"{place}: {told if count else 'no finished run'}.")
    return lines


def pair_lines(comparison: Comparison) -> list[str]:
    """Each difference with its band, and the seeds that would show one that is not shown yet."""
    lines = []
    for one, other, gap, apart in comparison.pairs():
        how = "paired by seed, same packs" if gap.paired else "packs not shared"
        needed = f"; it needs some {gap.seeds_needed} seeds of each" if gap.seeds_needed else ""
        verdict = "they differ" if apart else f"not distinguished{needed}"
        band = band_text(comparison.ranked_by, gap.band)
        lines.append(f"{one} and {other}: difference {band}, {how}; {verdict}.")
    return lines


def failure_lines(comparison: Comparison) -> list[str]:
    """Each run that has no result, with its reason and folder."""
    failed = comparison.failed
    lines = [f"{one.name} {one.status}: {one.reason} (folder {one.folder})" for one in failed]
    return [*lines, *(f"{one}: has no result and is left out" for one in comparison.left_out)]


HEADS = {"met": "meets every target", "open": "may meet its targets", "missed": "misses a target"}
"""The 95 % band lies below the limit, across it, or above it."""


class Candidate(NamedTuple):
    """A mud, the worst of its states against the targets, and a sentence with the reasons."""

    name: str
    state: str
    line: str


def candidates(comparison: Comparison, limits: Mapping[str, float]) -> list[Candidate]:
    """The muds by their states: all met first, then by the mean nearest to its limit."""
    states, rows = list(HEADS), []
    for name in filter(comparison.of_variant, comparison.variants if limits else ()):
        reasons, worst, over = [], 0, -math.inf
        for target, limit in limits.items():
            quantity = results.GOALS[target][0]
            values = [*comparison.values(name, quantity).values()]
            band = comparison.band(name, quantity)
            state = 0 if band.high <= limit else 2 if band.low > limit else 1
            worst = max(worst, state)
            over = max(over, band.mean / limit if limit else math.inf)
            reason = f"{LABELS.get(quantity, quantity)} {band_text(quantity, band)}, at most "
            reason += f"{value_text(quantity, limit)}: {states[state]}"
            if state == 1 and len(values) > 1 and (gap := abs(band.mean - limit)) > 0:
                needed = seeds_for_width(values, gap, MOST_SEEDS)
                reason += f", some {needed} seeds would decide it"
            reasons.append(reason)
        rows.append((worst, over, name, "; ".join(reasons)))
    return [
        Candidate(name, states[worst], f"{number}. {name} {HEADS[states[worst]]}: {reasons}.")
        for number, (worst, _, name, reasons) in enumerate(sorted(rows), start=1)
    ]


# ---- Figures, as SVG inside of the page.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#5A5A5A", "#8C564B")
"""The palette of Okabe and Ito (2008), which readers with any colour vision can tell apart."""


def _draw_ranking(comparison: Comparison) -> dict[str, str] | None:
    """Every run as a dot, the mean of each variant with its band."""
    quantity = comparison.ranked_by
    names = [name for name in comparison.ranking() if comparison.values(name, quantity)]
    if not names:
        return None
    factor, _ = unit_of(quantity)
    figure, axes = _axes(0.9 + 0.42 * len(names))
    for place, name in enumerate(names):
        values = factor * np.array(list(comparison.values(name, quantity).values()))
        band = comparison.band(name, quantity)
        axes.plot(values, np.full(len(values), place), "o", ms=4, color="0.6", zorder=2)
        ends = (factor * band.low, factor * band.high)
        axes.hlines(place, *ends, color=COLOURS[0], lw=5, alpha=0.4)
        axes.plot(factor * band.mean, place, "|", ms=16, mew=2.5, color=COLOURS[0], zorder=3)
    axes.set_yticks(range(len(names)), [_short(name) for name in names])
    axes.invert_yaxis()
    axes.margins(y=0.25 / len(names) + 0.05)
    axes.set_xlabel(_with_unit(quantity))
    caption = "Every run (grey), mean over the seeds (line) and its 95 % band (blue)"
    return _svg(figure, f"{caption}{', best first' if len(names) > 1 else ''}.")


def _draw_depth(comparison: Comparison) -> dict[str, str] | None:
    """Permeability in place of the slabs by depth, of the first variants of the ranking."""
    figure, axes = _axes(4.2)
    drawn = _fill_depth(axes, comparison)
    if not drawn:
        return None
    caption = (
        "Permeability of the slabs by depth after the invasion, mean over the seeds with its 95 % "
        f"band, of the first {drawn} variants; dashed is the intact sand."
    )
    return _svg(figure, caption)


def _fill_depth(axes: Any, comparison: Comparison) -> int:
    """Draws permeability by depth with its bands; gives the number of variants drawn."""
    slabs = [key[:-6] for key in comparison.numbers if re.match(r"sections\.\d+\.x_lo_m", key)]
    drawn = 0
    for colour, name in zip(COLOURS, comparison.ranking(), strict=False):
        mine = [slab for slab in slabs if comparison.values(name, f"{slab}x_lo_m")]
        if not mine:
            continue
        starts, stops, intact, damaged = (
            [comparison.band(name, slab + end) for slab in mine]
            for end in ("x_lo_m", "x_hi_m", "k_initial_inplace_m2", "k_damaged_inplace_m2")
        )
        edges = [1e3 * band.mean for band in (*starts, stops[-1])]
        look: dict[str, Any] = {"edges": edges, "baseline": None, "color": colour}
        after, before = ([one.mean / MILLIDARCY for one in bands] for bands in (damaged, intact))
        axes.stairs(after, lw=2, label=_short(name), **look)
        axes.stairs(before, lw=1, ls="--", **look)
        low, high = ([getattr(b, end) / MILLIDARCY for b in damaged] for end in ("low", "high"))
        axes.stairs(high, **look | {"baseline": low}, fill=True, alpha=0.18)
        drawn += 1
    axes.set(xlabel="depth (mm)", ylabel="permeability in place (mD)", ylim=(0, None))
    if drawn:
        axes.legend(fontsize=8, framealpha=0.9)
    return drawn


def _axes(height: float) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, height), layout="constrained")
    axes = figure.subplots()
    axes.grid(lw=0.4, color="0.85")
    return figure, axes


def _svg(figure: Any, caption: str) -> dict[str, str]:
    from matplotlib import rc_context

    text = io.StringIO()
    with rc_context({"svg.hashsalt": "fdnet"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    data = base64.b64encode(text.getvalue().encode()).decode("ascii")
    return {"uri": f"data:image/svg+xml;base64,{data}", "caption": caption}


def _short(name: str) -> str:
    """A name as it is drawn: not too long, and no sign of it read as a formula."""
    return (name if len(name) <= 40 else f"{name[:37]}...").replace("$", r"\$")


def _with_unit(quantity: str) -> str:
    unit = unit_of(quantity)[1]
    return f"{LABELS.get(quantity, quantity)} ({unit})" if unit else LABELS.get(quantity, quantity)
