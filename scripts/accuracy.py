#!/usr/bin/env python3
"""Law by law against resolved Stokes flow: docs/accuracy.md with its tables and figure, from one command.

    .venv/bin/python scripts/accuracy.py [--more DIR]

Reads the truth (tests/data/truth/truth.csv, docs/validation/truth_own.csv) and its packs, computes every law on them
and writes docs/validation/accuracy_intact.csv, accuracy_damage.csv, accuracy_polydisperse.csv and accuracy.png, and
docs/accuracy.md from docs/accuracy.md.in. Tables of the boundary study and the benchmark are read from their CSV files.
Rows whose pack is in neither tests/data/truth nor --more are named and left out. Everything in the document's tables is
computed; about a minute.
"""

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

import accuracy_models as models
import accuracy_tables as tables
import matplotlib as mpl
import numpy as np

from fdnet.network.laws.named import DEFAULT_DAMAGE_LAW, DEFAULT_LAW, LAWS
from fdnet.studies.truth.truth import EQUAL, LOOSE, Case, read_cases

Row = dict[str, Any]
ROOT = Path(__file__).resolve().parents[1]
DEFAULT = f"{DEFAULT_LAW} + {DEFAULT_DAMAGE_LAW}"
COLOURS = ("#b2182b", "#ef8a62", "#67a9cf", "#7b3294", "#1a1a1a")
MARKERS = ("v", "^", "s", "D", "o")


def computed(cases: list[Case], folder: Path) -> dict[str, list[Row]]:
    """All rows of the document."""
    intact = [case for case in cases if case.ratio is None]
    return {
        "intact": [models.intact_row(case) for case in intact],
        "damage": [models.damaged_row(case) for case in cases if case.ratio is not None],
        "polydisperse": models.polydisperse_rows(cases),
        "choices": models.choice_rows(intact),
        "large_fines": models.large_fine_rows(folder),
        "beds": models.bed_rows(folder),
    }


def parts(
    rows: dict[str, list[Row]], refit: Row, missing: list[str], validation: Path
) -> dict[str, str]:
    """The names of docs/accuracy.md.in and what stands for them."""
    intact, damage = rows["intact"], rows["damage"]
    counted = [row for row in intact if row["group"] != LOOSE]
    return {
        "missing": ""
        if not missing
        else f" Left out here, their files not being in the project: {', '.join(missing)}.",
        "errors_intact": spread(row["truth_error"] for row in counted),
        "errors_damage": spread(row["truth_error"] for row in damage),
        "intact_table": tables.intact_table(intact),
        "intact_summary": tables.intact_summary(intact),
        "held_out_intact": tables.held_out(counted, ("series", DEFAULT_LAW), tables.GOALS[EQUAL]),
        "refit": refit_sentence(refit, [row for row in intact if row["group"] == EQUAL]),
        "choice_table": tables.choice_table(rows["choices"], intact),
        "damage_table": tables.damage_table(damage, absolute=False),
        "absolute_table": tables.damage_table(damage, absolute=True),
        "held_out_damage": tables.held_out(damage, tables.RULES[2:], tables.DAMAGE_GOAL),
        "large_fine_table": tables.large_fine_table(
            rows["large_fines"], validation / "truth_large_fines.csv"
        ),
        "resolved_summary": tables.summary(damage, models.RESOLVED),
        "bed_table": tables.bed_table(rows["beds"]),
        "polydisperse_table": tables.polydisperse_table(rows["polydisperse"]),
        "tiled_table": tables.tiled_table(validation / "boundary_tiled.csv"),
        "slab_table": tables.slab_table(validation / "boundary_slabs.csv"),
        "walled_table": tables.walled_table(validation / "boundary_walled.csv"),
        "wall_truth_table": tables.wall_truth_table(validation / "wall_truth.csv"),
        "worst_intact": named_worst(counted, DEFAULT_LAW),
        "worst_loose": named_worst([row for row in intact if row["group"] == LOOSE], DEFAULT_LAW),
        "worst_damage": named_worst(damage, DEFAULT),
        "worst_resolved": named_worst(damage, models.RESOLVED),
        "bed_span": between(row[DEFAULT] / row["bed"] for row in rows["beds"]),
        "large_fine_span": between(
            row[DEFAULT] / row[models.RESOLVED] for row in rows["large_fines"]
        ),
        "least_ratio": f"{min(row['k_over_k0'] for row in damage):.4f}",
        "most_ratio": f"{max(row['k_over_k0'] for row in damage):.2f}",
        "bed_percent": f"{100 * models.BED_SHARE:.0f}",
        "default_law": DEFAULT_LAW,
        "default_damage_law": DEFAULT_DAMAGE_LAW,
    }


def own_errors(rows: dict[str, list[Row]]) -> dict[str, float]:
    """k of the default laws over truth by case, with fines where there are fines."""
    intact = {row["case"]: row[DEFAULT_LAW] for row in rows["intact"]}
    return intact | {row["case"]: row[f"{DEFAULT}: k"] for row in rows["damage"]}


def spread(errors: Any) -> str:
    errors = sorted(errors)
    return f"{100 * errors[0]:.2g} to {100 * errors[-1]:.2g} %"


def between(ratios: Any) -> str:
    ratios = sorted(ratios)
    return f"{ratios[0]:.2f} to {ratios[-1]:.2f}"


def named_worst(rows: Sequence[Row], name: str) -> str:
    found = [row for row in rows if not np.isnan(row[name])]
    row = max(found, key=lambda row: abs(np.log(row[name])))
    return f"{row['case']}, {row[name]:.3f}"


def refit_sentence(refit: Row, equal: list[Row]) -> str:
    shipped = [row["series"] for row in equal]
    low, high = refit["weights"]
    return (
        f"shipped weight 0.35: {summed_up(shipped)}; refitted to all of them ({refit['weight']:.3f}): "
        f"{summed_up(refit['fitted'])}; one pack left out at a time (weights {low:.3f} to {high:.3f}): held-out "
        f"{summed_up(refit['held_out'])}"
    )


def summed_up(ratios: list[float]) -> str:
    return f"rms {tables.percent(models.rms(ratios))}, worst {models.worst(ratios):.3f}"


def draw(intact: list[Row], damage: list[Row], path: Path) -> None:
    """All laws in one figure: intact model over truth by case, k/k0 model against truth."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 6.2), constrained_layout=True)
    draw_intact(left, intact)
    draw_damage(right, damage)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_intact(axes: Any, rows: list[Row]) -> None:
    place = np.arange(len(rows))[::-1]
    goal = np.array([tables.GOALS.get(row["group"], (None, np.nan))[1] for row in rows])
    axes.barh(
        place,
        2 * goal,
        left=1 - goal,
        height=1.0,
        color="#b7e0b1",
        label="goal, worst case",
        zorder=0,
    )
    for law, colour, marker in zip(LAWS, COLOURS, MARKERS, strict=True):
        axes.plot(
            [row[law] for row in rows], place, marker, color=colour, ms=6, label=law, alpha=0.85
        )
    axes.axvline(1.0, color="k", lw=0.6)
    axes.set(
        xscale="log", xlim=(0.17, 3.4), ylim=(-0.6, len(rows) - 0.4), xlabel="k, model over truth"
    )
    axes.set_xticks([0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(lambda *_: "")
    axes.set_yticks(place, [row["case"] for row in rows], fontsize=8)
    axes.grid(axis="x", lw=0.3)
    axes.set_title("intact: lattices and packs against resolved Stokes flow", fontsize=10)
    axes.legend(fontsize=8, loc="lower right")


def draw_damage(axes: Any, rows: list[Row]) -> None:
    truth = np.array([row["k_over_k0"] for row in rows])
    line = np.array([0.7 * truth.min(), 1.2])
    most = tables.DAMAGE_GOAL[1]
    axes.fill_between(
        line, (1 - most) * line, (1 + most) * line, color="#b7e0b1", label="goal, worst case"
    )
    axes.plot(line, line, "k-", lw=0.6)
    styles = zip(
        tables.RULES,
        ("#b2182b", "#ef8a62", "#67a9cf", "#1a1a1a", "#7b3294"),
        ("v", "1", "s", "o", "x"),
        strict=True,
    )
    for name, colour, marker in styles:
        model = truth * np.array([row[name] for row in rows])
        axes.plot(truth, model, marker, color=colour, ms=7, label=name, alpha=0.85)
    axes.set(
        xscale="log",
        yscale="log",
        xlim=line,
        ylim=(line[0] * 0.85, 1.2),
        xlabel="k/k0, truth",
        ylabel="k/k0, model",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks([0.02, 0.05, 0.1, 0.2, 0.5, 1.0])
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_formatter(lambda *_: "")
    axes.grid(lw=0.3)
    axes.set_title("with fines: share of the permeability left", fontsize=10)
    axes.legend(fontsize=8, loc="lower right")


def write_rows(path: Path, rows: list[Row]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--packs", type=Path, default=ROOT / "tests/data/truth", help="packs and truth.csv"
    )
    parser.add_argument(
        "--more",
        type=Path,
        nargs="*",
        default=[],
        metavar="DIR",
        help="where further packs may be",
    )
    parser.add_argument(
        "--own",
        type=Path,
        default=ROOT / "docs/validation/truth_own.csv",
        help="fdnet's own truth",
    )
    parser.add_argument("--benchmark", type=Path, default=ROOT / "docs/benchmark_network.csv")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="where to write")
    given = parser.parse_args()
    cases, missing = read_cases([given.packs / "truth.csv", given.own], [given.packs, *given.more])
    rows = computed(cases, given.packs)
    validation = given.docs / "validation"
    for name in ("intact", "damage", "polydisperse"):
        write_rows(validation / f"accuracy_{name}.csv", rows[name])
    draw(rows["intact"], rows["damage"], validation / "accuracy.png")
    text = parts(rows, models.refitted_series(cases), missing, validation)
    text["benchmark"] = tables.benchmark_tables(given.benchmark, own_errors(rows))
    template = Template((given.docs / "accuracy.md.in").read_text())
    (given.docs / "accuracy.md").write_text(template.substitute(text))
    print(
        tables.intact_summary(rows["intact"]),
        tables.damage_table(rows["damage"], absolute=False),
        sep="\n\n",
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
