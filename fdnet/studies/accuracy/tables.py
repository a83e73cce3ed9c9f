"""The tables of the accuracy page that are made from computed rows."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from fdnet.network.laws.named import LAWS
from fdnet.studies.accuracy.deposits import BED_PAIRS
from fdnet.studies.accuracy.goals import (
    DAMAGE_GOAL,
    GOALS,
    Goal,
    Row,
    percent,
    ratio,
    reached,
    rms,
    summary,
    worst,
)
from fdnet.studies.accuracy.rows import RULES
from fdnet.studies.engine.csv_rows import read_named
from fdnet.studies.engine.markdown import markdown_table
from fdnet.studies.truth.cases import EQUAL, LATER, LATTICE, LOOSE, NO, UNEQUAL, YES

GROUPS = (EQUAL, UNEQUAL, LATTICE, LOOSE)
KNOWN = {
    "looked at before": [YES],
    "not looked at before": [NO, LATER],
    "solved after the commit": [LATER],
}


def _ratios(row: Row, names: Iterable[str]) -> list[str]:
    return [ratio(row[name]) for name in names]


def intact_table(rows: list[Row]) -> str:
    """Model over truth of every case and law."""
    lines = [
        [
            row["case"],
            str(row["grains"]),
            percent(row["truth_error"]),
            *_ratios(row, LAWS),
            row["known_before"],
        ]
        for row in rows
    ]
    return markdown_table(["case", "grains", "truth's error", *LAWS, "looked at before"], lines)


def intact_summary(rows: list[Row]) -> str:
    """rms and worst of each group and law, and whether its goal is reached."""
    lines = []
    for group in GROUPS:
        of = [row for row in rows if row["group"] == group]
        lines.append([f"{group} ({len(of)})", *(summary(of, law) for law in LAWS)])
        if goal := GOALS.get(group):
            lines.append([_goal_words(goal), *(reached(of, law, goal) for law in LAWS)])
    return markdown_table(["class: rms of ln, worst", *LAWS], lines)


def _goal_words(goal: Goal) -> str:
    spread, most = goal
    return f"goal: {f'rms {percent(spread, 0)}, ' if spread else ''}worst {percent(most, 0)}"


def held_out(rows: list[Row], names: Sequence[str], goal: Goal) -> str:
    """rms and worst by what was known of the truth when the law was chosen, and the goal."""
    lines = []
    for words, known in KNOWN.items():
        of = [row for row in rows if row["known_before"] in known]
        cells = [f"{summary(of, name)}: {reached(of, name, goal)}" for name in names]
        lines.append([f"{words} ({len(of)})", *cells])
    return markdown_table(["truth: rms of ln, worst: goal reached", *names], lines)


def choice_table(rows: list[Row], cases: list[Row]) -> str:
    """Variants of the default law: rms and worst by group."""
    lines = []
    for row in rows:
        of = {
            group: [row[case["case"]] for case in cases if case["group"] == group]
            for group in GROUPS
        }
        cells = (f"{percent(rms(of[g]))}, {ratio(worst(of[g]))}" for g in GROUPS)
        lines.append([row["choice"], *cells])
    return markdown_table(["lubrication: rms of ln, worst", *GROUPS], lines)


def damage_table(rows: list[Row], *, absolute: bool) -> str:
    """Model over truth of k/k0, or of k itself, of each case and pair of laws."""
    names = [f"{name}: k" if absolute else name for name in RULES]
    lines = [
        [
            row["case"],
            ratio(row["k_over_k0"], 4),
            percent(row["truth_error"]),
            *_ratios(row, names),
            row["known_before"],
        ]
        for row in rows
    ]
    lines.append(["**rms of ln, worst**", "", "", *(summary(rows, name) for name in names), ""])
    if not absolute:
        cells = (reached(rows, name, DAMAGE_GOAL) for name in names)
        lines.append([_goal_words(DAMAGE_GOAL), "", "", *cells, ""])
    return markdown_table(["case", "true k/k0", "its error", *RULES, "looked at before"], lines)


def large_fine_table(rows: list[Row], path: Path) -> str:
    """k/k0 with fines of a third of a grain; over truth in brackets where `path` has it."""
    truth = {row["case"]: row for row in read_named(path)}
    lines = []
    for row in rows:
        known = truth.get(f"packH_r3_d{row['points']:.0f}")
        words = f"{known['k_over_k0']} ({known['relative_error']})" if known else "-"
        over = float(known["k_over_k0"]) if known else float("nan")
        cells = [f"{ratio(row[name], 4)} ({ratio(row[name] / over, 2)})" for name in RULES]
        lines.append([f"{row['points']:g}", str(row["fines"]), words, *cells])
    return markdown_table(["porosity lost, points", "fines", "truth (its error)", *RULES], lines)


def bed_table(rows: list[Row]) -> str:
    """k/k0 with all pores full of fines; over the estimate of the bed in brackets."""
    lines = [
        [f"1/{row['ratio']:g}", str(row["fines"]), f"{row['bed']:.2e}"]
        + [f"{row[name]:.2e} ({ratio(row[name] / row['bed'], 2)})" for name in BED_PAIRS]
        for row in rows
    ]
    return markdown_table(["fine", "fines", "k/k0 of the bed", *BED_PAIRS], lines)


def polydisperse_table(rows: list[Row]) -> str:
    """Model over truth of every law on unequal grains, in both tessellations."""
    lines = [
        [row["case"], row["tessellation"], str(row["pores"]), *_ratios(row, LAWS)] for row in rows
    ]
    return markdown_table(["case", "tessellation", "pores", *LAWS], lines)
