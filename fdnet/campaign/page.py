"""What a reader sees of a comparison: sentences, figures, and compare.html with both."""

import base64
import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from importlib import metadata, resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from fdnet.campaign.result import (
    MET,
    MISSED,
    OPEN,
    PAGE,
    SHARES,
    Candidate,
    Comparison,
    Entry,
    Pair,
    Verdict,
    write_summary,
    write_table,
)
from fdnet.files import write_text
from fdnet.report.tables import MILLIDARCY
from fdnet.statistics.bands import Band, student_band
from fdnet.statistics.differences import MOST_SEEDS

SHOWN = ("k_reduction", "k_damaged_m2", "invasion_depth_p95_m", "invaded_count", "passed_count")
"""Quantities of the tables of the page, after the ranked one."""
MOST_PAIRS, MOST_NAMED, MOST_CURVES = 60, 3, 8
"""Most differences that the page lists, variants that a sentence names, and curves of a figure."""


def write_comparison(
    comparison: Comparison, more: Mapping[str, Any], muds: Sequence[Candidate] = ()
) -> dict[str, Any]:
    """Write table.csv, table.parquet (with pyarrow), summary.json and compare.html.

    `more` are further keys of the summary, `muds` those judged by targets. Returns the summary.
    """
    from jinja2 import Environment, StrictUndefined

    write_table(comparison)
    summary = write_summary(comparison, more)
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    having = set(comparison.quantities)
    page = resources.files("fdnet.campaign").joinpath("compare.html.j2").read_text("utf-8")
    text = environment.from_string(page).render(
        comparison=comparison,
        columns=[n for n in dict.fromkeys([comparison.ranked_by, *SHOWN]) if n in having],
        muds=candidate_lines(muds),
        ranking=[re.sub(r"^\d+\. ", "", line) for line in ranking_lines(comparison)],
        pairs=pair_lines(comparison),
        most_pairs=MOST_PAIRS,
        figures=_figures(comparison),
        label=label,
        value_text=value_text,
        band_text=band_text,
        link=lambda entry: _link(comparison, entry),
        version=metadata.version("fdnet"),
    )
    write_text(comparison.path / PAGE, text)
    return summary


def _link(comparison: Comparison, entry: Entry) -> str:
    """To the report of the run, or to its folder where there is none."""
    report = entry.folder / "report.html"
    path = report if report.exists() else entry.folder
    return quote(Path(os.path.relpath(path, comparison.path)).as_posix())


# ------------------------------------------------------------------------------------------------
# Sentences.


LABELS = {
    "k_reduction": "permeability lost",
    "k_damaged_m2": "damaged permeability",
    "k_initial_m2": "intact permeability",
    "invasion_depth_m": "depth of the deepest fine",
    "invasion_depth_p95_m": "depth above which 95 % of the fines lie",
    "invaded_count": "fines that invaded",
    "passed_count": "fines that passed",
    "passed_fraction": "share of the fines that pass through the specimen unbridged",
    "cake_thickness_m": "thickness of the cake",
    "porosity_damaged": "damaged porosity",
}
"""Quantities of a summary in words."""


def label(quantity: str) -> str:
    """A quantity in words."""
    return LABELS.get(quantity, quantity)


def unit_of(quantity: str) -> tuple[float, str]:
    """Factor from SI to the unit that a reader sees, and this unit; "" for a plain number."""
    if SHARES.search(quantity):
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
    quantity, pairs, names = comparison.ranked_by, comparison.pairs(), comparison.ranking()
    lines = []
    for number, name in enumerate(names, start=1):
        place = f"{number}. {name}" if len(names) > 1 else name
        values = comparison.values(name, quantity).values()
        if not values:
            lines.append(f"{place}: no finished run.")
            continue
        band = band_text(quantity, comparison.band(name, quantity))
        lack = len(comparison.of_variant(name)) - len(values)
        spread = f"{len(values)} seed{'s' if len(values) > 1 else ''}"
        spread += f" ({lack} more without a value)" if lack else ""
        if len(values) > 1:
            low, high = (value_text(quantity, value) for value in (min(values), max(values)))
            spread += f" from {low} to {high}"
        lines.append(f"{place}: {label(quantity)} {band}, {spread}{_ties(name, pairs)}.")
    return lines


def _ties(name: str, pairs: Sequence[Pair]) -> str:
    """With which variants a variant may be equal."""
    open_pairs = [pair for pair in pairs if name in (pair.one, pair.other) and not pair.apart]
    equal = [pair.other if pair.one == name else pair.one for pair in open_pairs]
    names = ", ".join(equal) if len(equal) <= MOST_NAMED else f"{len(equal)} others"
    return f"; cannot be distinguished from {names}" if equal else ""


def pair_lines(comparison: Comparison) -> list[str]:
    """Each difference with its band, and the seeds that would show one that is not shown yet."""
    lines = []
    for pair in comparison.pairs():
        gap = pair.difference
        how = "paired by seed, same packs" if gap.paired else "packs not shared"
        if pair.apart:
            verdict = "they differ"
        elif math.isnan(gap.p_value):
            verdict = "one seed each says nothing about chance"
        elif gap.seeds_needed is None:
            verdict = f"not distinguished, and {MOST_SEEDS:,} seeds would not do it either"
        else:
            verdict = "not distinguished: a difference of this size needs some "
            verdict += f"{gap.seeds_needed} seeds of each"
        band = band_text(comparison.ranked_by, gap.band)
        lines.append(f"{pair.one} and {pair.other}: difference {band}, {how}; {verdict}.")
    return lines


def failure_lines(comparison: Comparison) -> list[str]:
    """Each run that has no result, with its reason and folder."""
    failed = [
        f"{entry.name} {entry.status}: {entry.reason} (folder {entry.folder})"
        for entry in comparison.failed
    ]
    return [*failed, *(f"{one}: has no result and is left out" for one in comparison.left_out)]


def candidate_lines(muds: Sequence[Candidate]) -> list[str]:
    """The ranking of the muds by their targets, a sentence each with its reason."""
    heads = {MET: "meets every target", OPEN: "may meet its targets", MISSED: "misses a target"}
    return [
        f"{number}. {mud.name} {heads[mud.state]}: {'; '.join(map(_reason, mud.verdicts))}."
        for number, mud in enumerate(muds, start=1)
    ]


def _reason(verdict: Verdict) -> str:
    quantity, limit, band, state, seeds = verdict
    more = f", some {seeds} seeds would decide it" if seeds else ""
    most = value_text(quantity, limit)
    return f"{label(quantity)} {band_text(quantity, band)}, at most {most}: {state}{more}"


# ------------------------------------------------------------------------------------------------
# Figures, as SVG inside of the page.


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#5A5A5A", "#8C564B")
"""The palette of Okabe and Ito (2008), which readers with any colour vision can tell apart."""


def _figures(comparison: Comparison) -> list[dict[str, str]]:
    """Address and caption of each figure that the comparison has data for."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "fdnet"
    drawn = (_draw_ranking(comparison), _draw_depth(comparison), _draw_keys(comparison))
    return [figure for figure in drawn if figure is not None]


def _draw_ranking(comparison: Comparison) -> dict[str, str] | None:
    """Every run as a dot, the mean of each variant with its band."""
    quantity = comparison.ranked_by
    names = [name for name in comparison.ranking() if comparison.values(name, quantity)]
    if not names:
        return None
    factor, _ = unit_of(quantity)
    figure, (axes,) = _panels(1, 7.2, 0.9 + 0.42 * len(names))
    for place, name in enumerate(names):
        values = factor * np.array(list(comparison.values(name, quantity).values()))
        band = comparison.band(name, quantity)
        axes.plot(values, np.full(len(values), place), "o", ms=4, color="0.6", zorder=2)
        ends = [factor * band.low, factor * band.high]
        axes.plot(ends, [place, place], color=COLOURS[0], lw=5, alpha=0.4, solid_capstyle="butt")
        axes.plot(factor * band.mean, place, "|", ms=16, mew=2.5, color=COLOURS[0], zorder=3)
    axes.set_yticks(range(len(names)), [_short(name) for name in names])
    axes.invert_yaxis()
    axes.margins(y=0.25 / len(names) + 0.05)
    axes.set_xlabel(_with_unit(quantity))
    order = ", best first" if len(names) > 1 else ""
    caption = f"Every run (grey), mean over the seeds (line) and its 95 % band (blue){order}."
    return _svg(figure, caption)


def _draw_depth(comparison: Comparison) -> dict[str, str] | None:
    """Permeability in place of the slabs by depth, of the first variants of the ranking."""
    figure, (axes,) = _panels(1, 7.2, 4.2)
    drawn = 0
    for name in comparison.ranking()[:MOST_CURVES]:
        runs = [_sections(entry) for entry in comparison.of_variant(name)]
        runs = [rows for rows in runs if rows.size]
        if not runs or any(not np.array_equal(rows[:2], runs[0][:2]) for rows in runs):
            continue
        edges = 1e3 * np.append(runs[0][0], runs[0][1, -1])
        intact, damaged = (np.array([rows[row] for rows in runs]) / MILLIDARCY for row in (2, 3))
        bands = [student_band(column[~np.isnan(column)]).within(0, np.inf) for column in damaged.T]
        colour = COLOURS[drawn]
        means = [band.mean for band in bands]
        axes.stairs(means, edges, baseline=None, color=colour, lw=2, label=_short(name))
        axes.stairs(intact.mean(0), edges, baseline=None, color=colour, lw=1, ls="--")
        low, high = [band.low for band in bands], [band.high for band in bands]
        axes.stairs(high, edges, baseline=low, fill=True, color=colour, alpha=0.18)
        drawn += 1
    axes.set_xlabel("depth (mm)")
    axes.set_ylabel("permeability in place (mD)")
    axes.set_ylim(bottom=0)
    if drawn:
        axes.legend(fontsize=8, framealpha=0.9)
    rest = len(comparison.variants) - drawn
    more = f" {rest} variants further down the ranking are left out." if rest else ""
    caption = (
        "Permeability of the slabs by depth after the invasion, mean over the seeds with its "
    )
    figured = _svg(figure, f"{caption}95 % band; dashed is the intact sand.{more}")
    return figured if drawn else None


def _sections(entry: Entry) -> np.ndarray:
    """(4, S) of a run: ends of the slabs, m, and permeability in place before and after, m2."""
    names = ("x_lo_m", "x_hi_m", "k_initial_inplace_m2", "k_damaged_inplace_m2")
    rows: list[list[Any]] = []
    while f"sections.{len(rows) + 1}.x_lo_m" in entry.numbers:
        rows.append([entry.number(f"sections.{len(rows) + 1}.{name}") for name in names])
    return np.array(rows, dtype=float).T


def _draw_keys(comparison: Comparison) -> dict[str, str] | None:
    """A panel for each key that holds numbers; of two, the colour tells the other one's value."""
    held = {name: comparison.keys_of(name) for name in comparison.variants}
    numbers: dict[str, dict[str, Any]] = {
        key: {name: _number_of(keys.get(key)) for name, keys in held.items()}
        for key in comparison.keys
    }
    numbers = {k: v for k, v in numbers.items() if None not in v.values()}
    numbers = {k: v for k, v in numbers.items() if len(set(v.values())) > 1}
    if not numbers:
        return None
    quantity, (factor, _) = comparison.ranked_by, unit_of(comparison.ranked_by)
    keys = list(numbers)
    figure, panels = _panels(len(keys), 3.4 * min(3, len(keys)) + 0.6, 3.0)
    for key, axes in zip(keys, panels, strict=False):
        other = keys[1 - keys.index(key)] if len(keys) == 2 else ""
        groups = sorted({*numbers[other].values()}) if other else [None]
        for colour, value in zip(COLOURS * len(groups), groups, strict=False):
            names = [n for n in held if not other or numbers[other][n] == value]
            names.sort(key=lambda name: numbers[key][name] or 0.0)
            bands = [comparison.band(name, quantity) for name in names]
            x = [numbers[key][name] for name in names]
            low, high = factor * np.array([(band.low, band.high) for band in bands]).T
            axes.vlines(x, low, high, color=colour, lw=4, alpha=0.3)
            means = [factor * band.mean for band in bands]
            text = f"{other.rsplit('.', 1)[-1]} {value:g}" if value is not None else None
            axes.plot(x, means, "o-" if other else "o", color=colour, ms=5, lw=1, label=text)
        axes.set_xlabel(key)
        if other:
            axes.legend(fontsize=7)
    panels[0].set_ylabel(_with_unit(quantity))
    return _svg(figure, "Every variant against each varied key, with its 95 % band.")


def _number_of(value: Any) -> float | None:
    """A number, or the number that a text with a unit begins with; None for anything else."""
    try:
        return float(str(value).split()[0])
    except (ValueError, IndexError):
        return None


def _panels(count: int, width: float, height: float) -> tuple[Any, list[Any]]:
    import matplotlib.pyplot as plt

    lines = math.ceil(count / 3)
    figure, grid = plt.subplots(
        *(lines, min(3, count)),
        figsize=(width, height * lines),
        squeeze=False,
        sharey=True,
        constrained_layout=True,
    )
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    for axes in grid.flat:
        axes.grid(lw=0.4, color="0.85")
    return figure, list(grid.flat[:count])


def _svg(figure: Any, caption: str) -> dict[str, str]:
    import matplotlib.pyplot as plt

    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    data = base64.b64encode(text.getvalue().encode()).decode("ascii")
    return {"uri": f"data:image/svg+xml;base64,{data}", "caption": caption}


def _short(name: str) -> str:
    """A name as it is drawn: not too long, and no sign of it read as a formula."""
    return (name if len(name) <= 40 else f"{name[:37]}...").replace("$", r"\$")


def _with_unit(quantity: str) -> str:
    unit = unit_of(quantity)[1]
    return f"{label(quantity)} ({unit})" if unit else label(quantity)
