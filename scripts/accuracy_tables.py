"""The tables of docs/accuracy.md, from computed rows and from the CSV files of other studies."""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
from accuracy_models import PAIRS, RESOLVED, rms, worst

from fdnet.network.laws.named import LAWS
from fdnet.studies.truth.truth import EQUAL, LATTICE, LOOSE, UNEQUAL

Row = dict[str, Any]
GOALS = {EQUAL: (0.03, 0.06), LATTICE: (None, 0.10), UNEQUAL: (None, 0.06)}
DAMAGE_GOAL = (0.05, 0.12)
ERROR_FREE = 0.02
RULES = (*map(" + ".join, PAIRS), RESOLVED)
OWN_TOOL = "fdnet"
COST_STEPS = ("total", "total intact", "solve", "solve stiff", "solve clogged")
NO_BENCHMARK = (
    "`docs/benchmark_network.csv` is not there yet; `scripts/benchmark_network.py` writes it."
)


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def percent(value: float, digits: int = 1) -> str:
    return f"{100.0 * value:.{digits}f} %"


def ratio(value: float, digits: int = 3) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def ratios(row: Row, names: Iterable[str], digits: int = 3) -> list[str]:
    return [ratio(row[name], digits) for name in names]


def values(rows: Iterable[Row], name: str) -> list[float]:
    """Numbers of a column, without those not computed."""
    return [row[name] for row in rows if not np.isnan(row[name])]


def reached(rows: list[Row], name: str, goal: tuple[float | None, float]) -> str:
    """Whether rms and worst are within the goal; truth's own error comes on top where it exceeds 2 %."""
    spread, most = goal
    rows = [row for row in rows if not np.isnan(row[name])]
    allowed = [
        most + (row["truth_error"] if row["truth_error"] > ERROR_FREE else 0.0) for row in rows
    ]
    good = all(abs(row[name] - 1.0) <= limit for row, limit in zip(rows, allowed, strict=True))
    return "yes" if good and (spread is None or rms(values(rows, name)) <= spread) else "no"


def summary(rows: list[Row], name: str) -> str:
    """rms of ln and the ratio furthest from 1."""
    found = values(rows, name)
    return f"{percent(rms(found))}, {ratio(worst(found))}" if found else "-"


def intact_table(rows: list[Row]) -> str:
    header = ["case", "grains", "truth's error", *LAWS, "looked at before"]
    return markdown(
        header,
        [
            [
                row["case"],
                str(row["grains"]),
                percent(row["truth_error"]),
                *ratios(row, LAWS),
                row["known_before"],
            ]
            for row in rows
        ],
    )


def intact_summary(rows: list[Row]) -> str:
    """rms and worst of each class and law, and whether its goal is reached."""
    lines = []
    for group in (EQUAL, UNEQUAL, LATTICE, LOOSE):
        of = [row for row in rows if row["group"] == group]
        goal = GOALS.get(group)
        lines.append([f"{group} ({len(of)})", *(summary(of, law) for law in LAWS)])
        if goal:
            said = f"goal: {f'rms {percent(goal[0], 0)}, ' if goal[0] else ''}worst {percent(goal[1], 0)}"
            lines.append([said, *(reached(of, law, goal) for law in LAWS)])
    return markdown(["class: rms of ln, worst", *LAWS], lines)


def held_out(rows: list[Row], names: Sequence[str], goal: tuple[float | None, float]) -> str:
    """rms and worst by what was known of the truth when the law was fixed, and whether they reach the goal."""
    kinds = {
        "looked at before": ["yes"],
        "not looked at before": ["no", "later"],
        "solved after the commit": ["later"],
    }
    lines = []
    for said, known in kinds.items():
        of = [row for row in rows if row["known_before"] in known]
        cells = [f"{summary(of, name)}: {reached(of, name, goal)}" for name in names]
        lines.append([f"{said} ({len(of)})", *cells])
    return markdown(["truth: rms of ln, worst: goal reached", *names], lines)


def choice_table(rows: list[Row], cases: list[Row]) -> str:
    """Variants of the default law: rms and worst by class."""
    groups = (EQUAL, UNEQUAL, LATTICE, LOOSE)
    lines = []
    for row in rows:
        of = {
            group: [row[case["case"]] for case in cases if case["group"] == group]
            for group in groups
        }
        lines.append(
            [row["choice"], *(f"{percent(rms(of[g]))}, {ratio(worst(of[g]))}" for g in groups)]
        )
    return markdown(["lubrication: rms of ln, worst", *groups], lines)


def damage_table(rows: list[Row], *, absolute: bool) -> str:
    """Model over truth of k/k0, or of k itself, each case and pair of laws, with rms, worst and goal."""
    names = [f"{name}: k" if absolute else name for name in RULES]
    lines = [
        [
            row["case"],
            ratio(row["k_over_k0"], 4),
            percent(row["truth_error"]),
            *ratios(row, names),
            row["known_before"],
        ]
        for row in rows
    ]
    lines.append(["**rms of ln, worst**", "", "", *(summary(rows, name) for name in names), ""])
    if not absolute:
        said = f"goal: rms {percent(DAMAGE_GOAL[0], 0)}, worst {percent(DAMAGE_GOAL[1], 0)}"
        lines.append([said, "", "", *(reached(rows, name, DAMAGE_GOAL) for name in names), ""])
    return markdown(["case", "true k/k0", "its error", *RULES, "looked at before"], lines)


def large_fine_table(rows: list[Row], path: Path) -> str:
    """k/k0 with fines of 1/3; over truth in brackets where `path` has it."""
    truth = {row["case"]: row for row in read_csv(path)}
    lines = []
    for row in rows:
        known = truth.get(f"packH_r3_d{row['points']:.0f}")
        said = f"{known['k_over_k0']} ({known['relative_error']})" if known else "-"
        over = float(known["k_over_k0"]) if known else float("nan")
        cells = [f"{ratio(row[name], 4)} ({ratio(row[name] / over, 2)})" for name in RULES]
        lines.append([f"{row['points']:g}", str(row["fines"]), said, *cells])
    return markdown(["porosity lost, points", "fines", "truth (its error)", *RULES], lines)


def bed_table(rows: list[Row]) -> str:
    return markdown(
        ["fine", "fines", "k/k0 of the bed", *RULES[:-1]],
        [
            [f"1/{row['ratio']:g}", str(row["fines"]), f"{row['bed']:.2e}"]
            + [f"{row[name]:.2e} ({ratio(row[name] / row['bed'], 2)})" for name in RULES[:-1]]
            for row in rows
        ],
    )


def polydisperse_table(rows: list[Row]) -> str:
    return markdown(
        ["case", "tessellation", "pores", *LAWS],
        [
            [row["case"], row["tessellation"], str(row["pores"]), *ratios(row, LAWS)]
            for row in rows
        ],
    )


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def grouped(
    rows: list[dict[str, str]], key: Callable[[dict[str, str]], Any]
) -> dict[Any, list[dict[str, str]]]:
    found: dict[Any, list[dict[str, str]]] = {}
    for row in rows:
        found.setdefault(key(row), []).append(row)
    return found


def span(numbers: Iterable[float]) -> str:
    numbers = list(numbers)
    return f"{min(numbers):.3f} to {max(numbers):.3f}"


def tiled_table(path: Path) -> str:
    """k over periodic by size (range over packs), and c of 1 + c / W at the largest size."""
    lines = []
    for (sides, cut), rows in grouped(
        read_csv(path), lambda row: (row["sides"], row["cut"])
    ).items():
        sizes = grouped(rows, lambda row: row["tiles"])
        last = [
            (float(row["k_over_periodic"]) - 1.0) * float(row["width_diameters"])
            for row in list(sizes.values())[-1]
        ]
        spans = [span(float(row["k_over_periodic"]) for row in of) for of in sizes.values()]
        lines.append(
            [f"{sides}; grains {cut}", *spans, f"{min(last):+.2f} to {max(last):+.2f}", rate(rows)]
        )
    widths = grouped(read_csv(path), lambda row: row["tiles"]).values()
    header = [
        f"W = {min(w):.0f} to {max(w):.0f}"
        for w in ([float(row["width_diameters"]) for row in of] for of in widths)
    ]
    return markdown(["k over periodic", *header, "c in 1 + c/W", "falls as W to the"], lines)


def rate(rows: list[dict[str, str]]) -> str:
    """Exponent of |k / periodic - 1| in the width, from the smallest to the largest size, mean over packs; - where the
    sign changes on the way."""
    found = []
    for of in grouped(rows, lambda row: row["pack"]).values():
        excess = [float(row["k_over_periodic"]) - 1.0 for row in of]
        if min(excess) < 0.0 < max(excess):
            return "-"
        width = [float(row["width_diameters"]) for row in of]
        found.append(np.log(abs(excess[-1] / excess[0])) / np.log(width[-1] / width[0]))
    return f"{fmean(found):.2f}"


def slab_table(path: Path) -> str:
    lines = []
    for thick, rows in grouped(read_csv(path), lambda row: row["thickness_diameters"]).items():
        mean, ends = (
            [float(row["mean_k_over_periodic"]) for row in rows],
            (rows, ("least", "most")),
        )
        single = [float(row[name]) for row in ends[0] for name in ends[1]]
        lines.append([thick, str(len(rows)), span(mean), span(single)])
    return markdown(["slab, diameters", "packs", "mean k over periodic", "single slabs"], lines)


def walled_table(path: Path) -> str:
    columns = {
        "grains": "grains",
        "width_diameters": "W",
        "porosity": "porosity",
        "porosity_inner": "inside",
        "k_over_inner_slip": "k over inside, slip",
        "k_over_inner_no_slip": "no-slip",
        "inner_over_carman_kozeny": "inside over Carman-Kozeny",
        "k_over_carman_kozeny": "whole, no-slip, over Carman-Kozeny",
    }
    return columns_of(path, columns)


def wall_truth_table(path: Path) -> str:
    columns = {
        "pack": "pack",
        "grains": "grains",
        "walls": "walls",
        "width_diameters": "W",
        "porosity": "porosity",
        "truth_error": "truth's relative error",
        "slip_over_truth": "slip",
        "no_slip_over_truth": "no-slip",
    }
    return columns_of(path, columns)


def columns_of(path: Path, columns: dict[str, str]) -> str:
    """A table of some columns of a CSV file, numbers to four digits."""
    rows = [[row[name] for name in columns] for row in read_csv(path)]
    return markdown(list(columns.values()), [[shortened(value) for value in row] for row in rows])


def shortened(value: str) -> str:
    try:
        return f"{float(value):.4g}" if "." in value else value
    except ValueError:
        return value


def benchmark_tables(path: Path, own: dict[str, float]) -> str:
    """Error, and time and memory, of every tool in the network benchmark; a sentence where there is none. `own`: model
    over truth of the default laws by case, as computed here."""
    if not path.exists():
        return NO_BENCHMARK
    rows = read_csv(path)
    peers = [row for row in rows if row["step"] == "error" and row["tool"] != OWN_TOOL]
    tools = list(dict.fromkeys(row["tool"] for row in peers))
    errors = []
    for case, of in grouped(peers, lambda row: row["case"].removeprefix("pack")).items():
        found = {row["tool"]: row["k_over_truth"] or row["status"] for row in of}
        mine = ratio(own.get(case, float("nan")))
        errors.append(
            [
                case,
                of[0]["grains"],
                of[0]["fines"],
                mine,
                *(found.get(tool, "-") for tool in tools),
            ]
        )
    return (
        "Model over truth, with fines where there are fines (fdnet: default laws, this page's numbers):\n\n"
        + markdown(["case", "grains", "fines", OWN_TOOL, *tools], errors)
        + f"\n\nCPU seconds on one core, peak memory in MB (`{path.name}`, as its command left it):\n\n"
        + cost_table([row for row in rows if row["step"] in COST_STEPS])
    )


def cost_table(rows: list[dict[str, str]]) -> str:
    """CPU seconds and memory, or how it ended: packs and steps down, tools across."""
    tools = list(dict.fromkeys(row["tool"] for row in rows))
    packs = grouped(rows, lambda row: (row["case"], int(row["grains"]), row["step"]))
    lines = []
    for (case, grains, step), of in sorted(packs.items()):
        fines = max(of, key=lambda row: int(row["fines"] or 0))["fines"]
        found = {row["tool"]: cost(row) for row in of}
        lines.append([case, str(grains), fines, step, *(found.get(tool, "-") for tool in tools)])
    return markdown(["case", "grains", "fines", "step", *tools], lines)


def cost(row: dict[str, str]) -> str:
    return (
        f"{float(row['cpu_s']):.3g} s, {float(row['peak_MB']):.0f}"
        if row["status"] == "ok"
        else row["status"]
    )
