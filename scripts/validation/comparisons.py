"""Comparisons with numbers from elsewhere: one CSV of what was measured, one table, one figure.

A chapter lists its comparisons. Its command measures the points that the CSV lacks, so it goes on
where it was stopped; `--rows FILE.csv` judges rows that are there and runs nothing.
"""

import argparse
import csv
import math
import shutil
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fdnet.case.case import Case
from fdnet.dem.deck import snapshot_of
from fdnet.dem.liggghts import Binary, Launch, find_binary
from fdnet.dem.packing import make_pack
from fdnet.errors import CaseError, FdnetError
from fdnet.files import path_option, refuse_folder_name, replacing, write_text
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Snapshot
from validation.study import processors

TEMPLATES = Path(__file__).parent / "templates"
COLUMNS = ("comparison", "value", "seed", "quantity", "observed", "core_s", "status")
DONE = "done"
BLUE, ORANGE, BLACK = "#0072B2", "#D55E00", "#1A1A1A"
Value = float | str
Judge = Callable[[pd.DataFrame], list["Finding"]]


class Trial(NamedTuple):
    """One point that is measured: the knob's value, a seed, an empty folder, the reduced form."""

    value: Any
    seed: int
    folder: Path
    quick: bool


class Finding(NamedTuple):
    """A line of the table; `over` is the difference over the allowed one, nan without one."""

    what: str
    expected: str
    source: str
    measured: str
    over: float
    note: str = ""

    @property
    def verdict(self) -> str:
        """In words."""
        return self.note or ("holds" if abs(self.over) <= 1 else "**does not hold**")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What is measured, and how it is judged.

    Attributes:
        name: as the CSV has it.
        full: values of the knob, each with its number of seeds.
        quick: those of the reduced form.
        measure: observations by name of one trial.
        judge: findings from the rows that were done.
        of: names of the comparisons whose rows it takes.
    """

    name: str
    full: Mapping[Value, int]
    quick: Mapping[Value, int]
    measure: Callable[[Trial], Mapping[str, float]]
    judge: Judge
    of: tuple[str, ...]


class Chapter(NamedTuple):
    """Comparisons, and what draws the second axes of their figure from the rows."""

    comparisons: tuple[Comparison, ...]
    panel: Callable[[Any, pd.DataFrame], None]


def percent(error: float) -> str:
    """A relative error with its sign, in percent; of one below 1e-5 no digit is shown."""
    if abs(error) < 1e-5 or math.isinf(error):
        return "within 0.001 %" if abs(error) < 1 else "never"
    return f"{100 * error:+.2g} %".replace("-", "−")


def chapter_of(
    table: Path, functions: Mapping[str, Any], panel: Callable[[Any, pd.DataFrame], None]
) -> Chapter:
    """The chapter of a TOML table, which names its functions as the mapping does.

    A comparison has the function that measures it (and its further `arguments`), and one that
    judges it or lines with what is expected.
    """
    parts = tomllib.loads(table.read_text(encoding="utf-8"))["comparison"]
    comparisons = tuple(
        Comparison(
            name=part["name"],
            full=dict(part["full"]),
            quick=dict(part["quick"]),
            measure=partial(functions[part["measure"]], **part.get("arguments", {})),
            judge=functions[part["judge"]]
            if "judge" in part
            else partial(_by_lines, lines=part.get("line", []), exact=functions),
            of=tuple(part.get("of", [part["name"]])),
        )
        for part in parts
    )
    return Chapter(comparisons, panel)


def _by_lines(
    rows: pd.DataFrame, *, lines: Sequence[Mapping[str, Any]], exact: Mapping[str, Any]
) -> list[Finding]:
    """The worst error of each line of the table that has a row."""
    every = []
    for line in lines:
        own = rows[rows.value.isin(line.get("values", rows.value))]
        own = own[own.quantity.str.contains(line.get("quantity", ""), regex=False)]
        if own.empty:
            continue
        law, within = line.get("exact", 0.0), line["within"]
        truth = own.value.map(
            exact[law] if isinstance(law, str) else lambda _, law=law: float(law)
        )
        error = (own.observed - truth) / truth.abs().where(truth != 0, 1.0)
        at = error.index[int(np.argmax(np.abs(error.to_numpy())))]
        size = f"{own.observed[at]:.4g}, " if truth[at] and np.isfinite(error[at]) else ""
        worst = f", worst of {len(own)}" if len(own) > 1 else ""
        expected = f"{line['expected']} ± {100 * within:g} %"
        seen = f"{size}{percent(error[at])}{worst}"
        every.append(Finding(line["what"], expected, line["source"], seen, error[at] / within))
    return every


def read_rows(path: Path) -> pd.DataFrame:
    """The rows of the CSV; those of a value that is a number hold it as one."""
    names = {"comparison": str}
    rows = pd.read_csv(path, dtype=names) if path.exists() else pd.DataFrame(columns=list(COLUMNS))
    return rows.assign(value=[_value(text) for text in rows.value])


def _value(text: Any) -> Value:
    try:
        return float(text)
    except ValueError:
        return str(text)


def measure(comparisons: Sequence[Comparison], path: Path, *, quick: bool) -> None:
    """Adds the points that the CSV lacks to it, one after the other; those that failed again.

    Raises CaseError at the end, when all others are measured, with the first that failed.
    """
    rows, failed = read_rows(path), []
    known = {
        (row.comparison, row.value, row.seed) for row in rows.itertuples() if row.status == DONE
    }
    if (rows.status != DONE).any():
        rows[rows.status == DONE].to_csv(path, index=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    for one in comparisons:
        for value, seeds in (one.quick if quick else one.full).items():
            for seed in range(1, seeds + 1):
                if (one.name, value, seed) in known:
                    continue
                folder = path.parent / "work" / f"{one.name} {value} {seed}".replace(" ", "-")
                shutil.rmtree(folder, ignore_errors=True)
                before, status, seen = processors(), DONE, {"": float("nan")}
                try:
                    seen = dict(one.measure(Trial(value, seed, folder, quick)))
                except FdnetError as error:
                    status = " ".join(str(error).split())
                    failed.append(f"{one.name} {value} {seed}: {status}")
                core = round(processors() - before, 3)
                with path.open("a", newline="", encoding="utf-8") as file:
                    writer = csv.writer(file)
                    writer.writerows([COLUMNS] if file.tell() == 0 else [])
                    writer.writerows(
                        [one.name, value, seed, name, repr(float(observed)), core, status]
                        for name, observed in seen.items()
                    )
                print(f"{one.name} {value} {seed}: {seen} {status}", file=sys.stderr, flush=True)
    if failed:
        raise CaseError(
            f"{path}: {len(failed)} points failed, the first: {failed[0]}; run the command again"
        )


def findings(comparisons: Sequence[Comparison], rows: pd.DataFrame) -> list[Finding]:
    """The lines of all comparisons of which there are rows that were done."""
    return [line for one in comparisons for line in one.judge(rows[rows.comparison.isin(one.of)])]


def table(lines: Sequence[Finding]) -> str:
    """The lines as a table in Markdown."""
    rows = [(line.what, line.expected, line.source, line.measured, line.verdict) for line in lines]
    head = [("what", "expected", "source", "measured", "verdict"), ("---",) * 5]
    return "".join(f"| {' | '.join(row)} |\n" for row in [*head, *rows])


def draw_differences(axes: Any, lines: Sequence[Finding]) -> None:
    """Every difference with its sign over the one that is allowed; an arrow where it is larger."""
    shown = [line for line in lines if not math.isnan(line.over)][::-1]
    axes.axvspan(-1, 1, color="0.92")
    axes.axvline(0, color=BLACK, lw=0.8)
    for place, line in enumerate(shown):
        colour = BLUE if abs(line.over) <= 1 else ORANGE
        marker = "o" if abs(line.over) < 6 else ">" if line.over > 0 else "<"
        axes.plot(min(6.0, max(-6.0, line.over)), place, marker, color=colour)
        axes.text(0.01, place + 0.2, line.what, transform=axes.get_yaxis_transform())
    axes.set(yticks=[], ylim=(-0.7, len(shown) - 0.2))
    axes.set(xlabel="difference over the allowed one (grey: holds)")


def command(name: str, chapter: Chapter, arguments: Sequence[str]) -> int:
    """Measures, judges, and writes NAME.csv, NAME.md (the table) and NAME.png."""
    from matplotlib.figure import Figure

    comparisons = chapter.comparisons
    names = [one.name for one in comparisons]
    parser = argparse.ArgumentParser(prog=f"validation.py {name}")
    parser.add_argument("--quick", action="store_true", help="the reduced form, about a minute")
    parser.add_argument("--only", metavar="NAME", help=f"one of: {'; '.join(names)}")
    parser.add_argument("--out", type=path_option, help="default studies/NAME")
    parser.add_argument("--rows", type=path_option, help="judge this CSV and run nothing")
    given = parser.parse_args(arguments)
    refuse_folder_name(given.out or Path())
    if given.only and given.only not in names:
        raise CaseError(f"--only: {given.only!r} is not known, expected one of {names}")
    out = given.out or Path("studies") / (f"{name}-quick" if given.quick else name)
    if not given.rows:
        find_binary()
        chosen = [one for one in comparisons if given.only in (None, one.name)]
        measure(chosen, out / f"{name}.csv", quick=given.quick)
    elif not given.rows.is_file():
        raise CaseError(f"--rows: there is no file {given.rows}")
    rows = read_rows(given.rows or out / f"{name}.csv")
    rows = rows[rows.status == DONE]
    lines = findings(comparisons, rows)
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / f"{name}.md", table(lines))
    heights = (0.36 * sum(not math.isnan(line.over) for line in lines) + 1.0, 4.0)
    figure = Figure(figsize=(5.2, sum(heights)), layout="constrained", dpi=130)
    above, below = figure.subplots(2, height_ratios=heights)
    draw_differences(above, lines)
    chapter.panel(below, rows)
    with replacing(out / f"{name}.png") as part:
        figure.savefig(part)
    print(table(lines))
    return 0


@cache
def the_binary() -> Binary:
    """LIGGGHTS, looked up once."""
    return find_binary()


def packed(case: Case, folder: Path) -> Snapshot:
    """The case's grains, packed once for all trials that share seed, box and grains."""
    plain = case.model_copy(update={"run": type(case.run)()})
    own = folder / f"pack-{plain.digest('pack')}"
    if not (own / "attempts.json").exists():
        make_pack(plain, own, Launch(binary=the_binary()))
    return snapshot_of(read_frame(own / "post" / "pack.dump"), plain, time_s=0.0)
