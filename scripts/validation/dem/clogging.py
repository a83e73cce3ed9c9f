"""Which throats clog, of those that fines came to: several runs added up, arrivals counted."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import read_history, readable_states
from fdnet.errors import CaseError
from fdnet.report.figures import draw
from fdnet.report.tables import write_rows
from fdnet.run.bridging import CLOGGED
from fdnet.run.finished import open_run
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.snapshot import Array, one_line
from validation.dem.arrivals import arrivals
from validation.engine.bands import wilson_interval

RATIOS = (0.0, 0.25, 0.33, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5, math.inf)
"""Edges of the classes of the diameter of a fine over that of the throat."""
TICKS = (0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0)
FEWEST = 5
"""Throats below which a class is in the table and not in the figure."""
NO_CLOG, FLICKERING = 1.0 / 3.0, (1.0 / 5.26, 1.0 / 3.03)
"""Ratios below which Marin and others (2018, Phys. Rev. E 97, 021102) saw no clog up to 60 % of
solids, and between which Souzy and Marin (2022, J. Fluid Mech. 953, A40) saw clogs come and go."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Met:
    """The open throats of one run (T), of which fines came to some.

    Attributes:
        concentration: volume fraction of the fines in the mud.
        ratio: (T,) mean diameter of the fines over that of the throat.
        arrived: (T,) fines that came, counted.
        halved: (T,) the same, counted from every second state.
        estimated: (T,) the same by the share of the clean flow.
        blocked: (T,) whether one fine covers it, or little of its conductance is left.
    """

    concentration: float
    ratio: Array
    arrived: Array
    halved: Array
    estimated: Array
    blocked: Array

    __repr__ = one_line


def met_throats(folder: Path) -> Met:
    """The throats of a finished run. Raises CaseError where it has no fines."""
    run = open_run(folder)
    if not isinstance(run.case, InvasionCase):
        raise CaseError(f"{folder}: has no fines; give folders of invasions")
    network, table, summary = run.network(), run.throats, run.summary
    grains, own = run.spheres("initial").grains(), folder / "invade"
    states = [
        state
        for _, state in readable_states(
            own, read_history(own), run.case, invasion_scales(run.case), grains
        )
    ]
    clean = table["conductance_initial_m3"].to_numpy()
    left = table["conductance_damaged_m3"].to_numpy()
    width = 2.0 * table["throat_radius_m"].to_numpy()
    first = summary["k_initial_m2"] * network.area / float(np.ptp(network.box[0]))
    entered = summary["invaded_count"] + summary["passed_count"]
    flux = np.abs(table["flux_initial_m3"].to_numpy())
    use = (width > 0) & (clean > 0)
    diameter = 2.0 * float(run.spheres().fines().radius.mean())
    return Met(
        concentration=run.case.fines.placed_fraction,
        ratio=diameter / width[use],
        arrived=arrivals(network, states)[use],
        halved=arrivals(network, states[::-1][::2][::-1])[use],
        estimated=entered * flux[use] / first,
        blocked=(table["blocked"].to_numpy() > 0)[use] | (left < CLOGGED * clean)[use],
    )


def clogging_rows(runs: Sequence[Met]) -> list[dict[str, Any]]:
    """One row for each concentration and class of ratio that fines came to."""
    rows = []
    for concentration in sorted({run.concentration for run in runs}):
        some = [run for run in runs if run.concentration == concentration]
        came = [run.arrived > 0 for run in some]
        values = {
            name: np.concatenate(
                [getattr(run, name)[use] for run, use in zip(some, came, strict=True)]
            )
            for name in ("ratio", "arrived", "halved", "estimated", "blocked")
        }
        which = np.searchsorted(RATIOS, values["ratio"], "right") - 1
        for number in np.unique(which):
            own = {name: value[which == number] for name, value in values.items()}
            rows.append(_row(concentration, int(number), own))
    return rows


def _row(concentration: float, number: int, own: Mapping[str, Array]) -> dict[str, Any]:
    met, blocked = len(own["ratio"]), int(own["blocked"].sum())
    low, high = wilson_interval(blocked, met)
    upper = RATIOS[number + 1]
    return {
        "concentration": concentration,
        "ratio_lo": RATIOS[number],
        "ratio_hi": upper if math.isfinite(upper) else None,
        "ratio_mean": float(own["ratio"].mean()),
        "met": met,
        "blocked": blocked,
        "share_blocked": blocked / met,
        "share_low": low,
        "share_high": high,
        "arrived_mean": float(own["arrived"].mean()),
        "arrived_mean_half_the_states": float(own["halved"].mean()),
        "arrived_mean_estimated": float(own["estimated"].mean()),
        "blocked_per_100_arrivals": 100.0 * blocked / float(own["arrived"].sum()),
    }


def clogging_of_runs(folders: Sequence[Path], table: Path, figure: Path) -> list[dict[str, Any]]:
    """The rows of all runs added up, also written to `table` (CSV) and drawn to `figure` (PNG)."""
    rows = clogging_rows([met_throats(folder) for folder in folders])
    write_rows(table, rows)
    draw(figure, partial(fill_clogging, rows=rows))
    return rows


def fill_clogging(figure: Any, *, rows: Sequence[Mapping[str, Any]]) -> None:
    """Blocked throats against the ratio, of those met and of the fines that came to them."""
    left, right = figure.subplots(1, 2)
    figure.set_size_inches(11.0, 4.6)
    for concentration in sorted({row["concentration"] for row in rows}):
        own = [
            row for row in rows if row["concentration"] == concentration and row["met"] >= FEWEST
        ]
        ratio = np.array([row["ratio_mean"] for row in own])
        for axes, name in ((left, "share_blocked"), (right, "blocked_per_100_arrivals")):
            value = np.array([row[name] for row in own])
            scale = np.divide(
                value,
                [row["share_blocked"] for row in own],
                out=np.zeros(len(own)),
                where=value > 0,
            )
            band = [np.array([row[end] for row in own]) for end in ("share_low", "share_high")]
            off = [
                np.maximum(value - scale * band[0], 0.0),
                np.maximum(scale * band[1] - value, 0),
            ]
            label = f"{100 * concentration:.3g} % by volume"
            axes.errorbar(ratio, value, yerr=off, marker="o", capsize=3, label=label)
    left.axvspan(*FLICKERING, color="0.88", label="clogs come and go (Souzy and Marin 2022)")
    left.axvline(
        NO_CLOG, color="0.3", linestyle="--", label="left of it no clog (Marin and others 2018)"
    )
    left.set(ylim=(0, 1), ylabel="blocked, of the throats that fines came to (–)")
    right.set(yscale="log", ylabel="blocked throats per 100 arrivals (–)")
    for axes in (left, right):
        axes.set(xscale="log", xlabel="diameter of the fine over that of the throat (–)")
        axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
        axes.minorticks_off()
    names = left.get_legend_handles_labels()
    figure.legend(*names, loc="outside upper center", ncols=3, fontsize=9, frameon=False)
