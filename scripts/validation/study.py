"""Studies of error against run time: what they run, and the one table that they write.

A study is a file `studies/NAME.toml`. It is a sweep file (`case`, `seeds`, `[set]`, `[grid]` and
`[[variants]]`, as `fdnet sweep` takes them), or a list of `[[points]]` that are no runs, or both.
Runs are carried by fdnet's campaign; a point goes to the function `measure(point, work)` of the
module `measure`, which returns numbers by name. Both end as rows of the table of `judge`.

    title, question       in words
    knob                  key of the case whose value is that of the row; without it the name of
                          a variant is "series: value"
    series                name of the runs of a sweep without variants
    [quantities]          name = expression of the numbers of summary.json, with _ for each dot
    [[points]]            series, knob and lists of settings, every combination of which is a
                          point; the setting that the knob names is its value. Braces in the name
                          of the series stand for settings. With `isolated = true` each point has a
                          process of its own, for its memory and its time limit.
    [[judge]]             the rules of `judge.Rule`
    [[panel]]             quantity, title and series of one axes of the picture and of the table
    [[answer]]            one line of the answer: what a shortcut costs
    [quick]               tables that replace those above, or are merged into them, for --quick
"""

import argparse
import ctypes
import itertools
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import pandas as pd
import tomli_w

import fdnet
from fdnet.case.file import toml_tables
from fdnet.dem.liggghts import peak_resident_bytes
from fdnet.errors import CaseError, FdnetError
from fdnet.files import path_option, refuse_folder_name, write_text
from validation import judge

FOLDER = Path(__file__).with_name("studies")
KEPT = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "error_against_time"
NAMES = tuple(
    path.stem
    for path in sorted(FOLDER.glob("*.toml"))
    if "\nquestion = " in path.read_text("utf-8")
)
"""The studies: the files with a question. The other files are cases of theirs."""
SWEEP = ("name", "case", "cases", "seeds", "set", "grid", "variants")
POINTS = "points.jsonl"
Result = TypeVar("Result")
LONGEST_S, MOST_BYTES = 300.0, 16 * 2**30
"""Limits of an isolated point."""


class Point(NamedTuple):
    """What is measured once: a value of a knob, a sample, and further settings."""

    series: str
    knob: str
    value: Any
    seed: Any
    settings: Mapping[str, Any]


class Study(NamedTuple):
    """A study: its name, what its file holds, and its rules."""

    name: str
    data: Mapping[str, Any]
    rules: tuple[judge.Rule, ...]

    @property
    def measure(self) -> Callable[[Point, Path], Mapping[str, float]]:
        """The function that measures a point."""
        return import_module(self.data["measure"]).measure


def read_study(name: str, *, quick: bool = False) -> Study:
    """The study of that name. Raises CaseError when there is none."""
    if name not in NAMES:
        raise CaseError(f"study: {name!r} is not known, expected one of {', '.join(NAMES)}")
    data = toml_tables(FOLDER / f"{name}.toml", "a study")
    for key, value in data.pop("quick", {}).items() if quick else ():
        data[key] = {**data.get(key, {}), **value} if isinstance(value, dict) else value
    return Study(name, data, tuple(judge.Rule(**rule) for rule in data["judge"]))


def kept_rows(name: str) -> pd.DataFrame:
    """The table of a study that is kept in the docs, judged anew."""
    return judge.judged(judge.read_rows(KEPT / f"{name}.csv"), read_study(name).rules)


# ---- Points that are no runs.
def points_of(study: Study) -> list[Point]:
    """Every combination of the settings of every table `[[points]]`."""
    return [point for table in study.data.get("points", ()) for point in _points(table)]


def _points(table: Mapping[str, Any]) -> Iterator[Point]:
    lists = {
        key: value if isinstance(value, list) else [value]
        for key, value in table.items()
        if key not in ("series", "knob", "seeds")
    }
    samples = table.get("seeds", 1)
    samples = samples if isinstance(samples, list) else range(1, samples + 1)
    for values in itertools.product(*lists.values()):
        settings = dict(zip(lists, values, strict=True))
        name = table["series"].format(**settings)
        for seed in samples:
            yield Point(name, table["knob"], settings[table["knob"]], seed, settings)


def measured(study: Study, out: Path, report: Callable[[str], None]) -> Iterator[dict[str, Any]]:
    """The rows of all points. Points that `out` already has are not measured again."""
    path, work = out / POINTS, out / "work"
    work.mkdir(parents=True, exist_ok=True)
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    lines, cut = text.splitlines(), not text.endswith("\n") and bool(text)
    whole = [json.loads(line) for line in lines if line.endswith("]")]
    known = {key: numbers for key, numbers in whole if numbers["status"] == judge.DONE}
    points = points_of(study)
    for number, point in enumerate(points, 1):
        key = json.dumps(point)
        if key not in known:
            known[key] = _attempt(study, point, work)
            with path.open("a", encoding="utf-8") as file:
                file.write("\n" * cut + json.dumps([key, known[key]]) + "\n")
            cut = False
            report(f"{number} of {len(points)}: {point.series}, {point.value}")
        yield from rows_of_point(point, known[key])


def rows_of_point(point: Point, numbers: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The rows of a point: one for each number that it found but the costs."""
    row: dict[str, Any] = {"series": point.series, "knob": point.knob, "seed": str(point.seed)}
    row["value"] = judge.shown(point.value)
    row |= {name: numbers.get(name) for name in (*judge.COSTS, "steps", "status")}
    for name in numbers.keys() - row.keys():
        if not name.endswith(judge.SD):
            sd = numbers.get(name + judge.SD)
            yield row | {"quantity": name, "observed": numbers[name], "sd": sd}
    if numbers["status"] != judge.DONE:
        yield row | {"quantity": ""}


def _attempt(study: Study, point: Point, work: Path) -> dict[str, Any]:
    """What a point found, its costs and its status; in a process of its own if it wants."""
    if not point.settings.get("isolated"):
        return measure_point(study, point, work)
    words = [study.name, str(work), json.dumps(point), str(os.getpid())]
    command = [sys.executable, "-m", "validation.study", *words]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
    except subprocess.TimeoutExpired:
        return {"status": f"over time: more than {LONGEST_S:g} s"}
    if done.returncode:
        why = (done.stderr.strip() or f"exit {done.returncode}").splitlines()[-1]
        return {"status": f"failed: {why}"}
    return json.loads(done.stdout.splitlines()[-1])


def measure_point(study: Study, point: Point, work: Path) -> dict[str, Any]:
    """What a point found, its costs and its status; costs that it finds itself count."""
    before = processors()
    try:
        numbers, status = dict(study.measure(point, work)), judge.DONE
    except FdnetError as error:
        words = " ".join(str(error).split()).replace(f"{work}/", "").split("; ")[0]
        numbers, status = {}, f"refused: {words}"
    except MemoryError:
        numbers, status = {}, "over memory"
    costs = {"core_s": processors() - before, "rss_mb": peak_resident_bytes() / 1e6, "steps": None}
    return {**costs, **numbers, "status": status}


def least_time(work: Callable[[], Result], *, times: int = 3) -> tuple[Result, float]:
    """What `work` returns, and the core seconds of the quickest of `times` runs.

    The first run may compile or load. There are only two runs when they take more than a second,
    and only one when it takes more than ten.
    """
    took: list[float] = []
    while True:
        start = time.process_time()
        result = work()
        took.append(time.process_time() - start)
        if len(took) == times or sum(took) > (1.0 if len(took) > 1 else 10.0):
            return result, min(took)


def processors() -> float:
    """CPU seconds of this process and of the children that it has waited for."""
    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


# ---- Whole runs, carried by the campaign.
def swept(study: Study, out: Path, *, jobs: int | None, show: bool) -> Iterator[dict[str, Any]]:
    """The rows of all runs of the sweep. Runs that `out` already has are not run again."""
    data = dict(study.data) | {"case": str(FOLDER / study.data["case"])}
    names = {f"v{n}": one["name"] for n, one in enumerate(data.get("variants", ()))}
    if names:  # the campaign changes a name that no file can have
        given = zip(names, data["variants"], strict=True)
        data["variants"] = [{**one, "name": name} for name, one in given]
    path = out / "sweep.toml"
    write_text(path, tomli_w.dumps({key: data[key] for key in SWEEP if key in data}))
    stages = ("pack", "invade", "analyse")
    runs = fdnet.sweep(path, out=out / "sweep", jobs=jobs, stages=stages, progress=show).table
    if not (runs["status"] == judge.DONE).any():
        raise CaseError(f"{out / 'sweep'}: no run was done, the first because: {runs.reason[0]}")
    numbers = runs.rename(columns=lambda name: name.replace(".", "_"))
    observed = {name: numbers.eval(text) for name, text in study.data["quantities"].items()}
    by_run = pd.DataFrame(observed, index=runs.index).to_dict("records")
    for run, quantities in zip(runs.to_dict("records"), by_run, strict=True):
        name = names.get(str(run["variant"]).split("+")[0], study.data.get("series", ""))
        yield from rows_of_run(study, name, run, quantities)


def rows_of_run(
    study: Study, name: str, run: Mapping[Any, Any], observed: Mapping[Any, float]
) -> Iterator[dict[str, Any]]:
    """The rows of one run of the variant `name`, given as a row of the campaign's table."""
    series, _, value = name.partition(": ")
    knob = study.data.get("knob", "variant")
    done = run["status"] == judge.DONE
    row = {
        "series": series,
        "knob": knob,
        "value": value or judge.shown(run[knob]),
        "seed": str(run["seed"]),
        "core_s": run["cpu_seconds.liggghts"] + run["cpu_seconds.python"],
        "rss_mb": max(run[f"peak_memory_bytes.{one}"] for one in ("liggghts", "python")) / 1e6,
        "steps": run["dem_steps"],
        "status": judge.DONE if done else f"{run['status']}: {run['reason']}",
    }
    for quantity, number in observed.items():
        yield row | {"quantity": quantity, "observed": number if done else None}


# ---- The command.
def run_study(
    study: Study, out: Path, *, jobs: int | None = None, show: bool = False
) -> pd.DataFrame:
    """Runs a study, or goes on with it; writes NAME.csv and NAME.png to `out`, returns the rows.

    Raises CaseError when a folder belongs to something else, LiggghtsError without LIGGGHTS.
    """
    from validation.picture import draw

    def report(line: str) -> None:
        if show:
            print(f"{study.name}: {line}", file=sys.stderr, flush=True)

    if out.exists() and not (out / POINTS).exists() and any(out.iterdir()):
        raise CaseError(f"{out}: holds no study (no {POINTS}); give an empty or new folder")
    out.mkdir(parents=True, exist_ok=True)
    (out / POINTS).touch()
    lines = list(measured(study, out, report))
    if "case" in study.data:
        lines += swept(study, out, jobs=jobs, show=show)
    rows = judge.judged(judge.rows_from(lines), study.rules)
    judge.write_rows(rows, out / f"{study.name}.csv")
    draw(study.data.get("panel", ()), rows, out / f"{study.name}.png")
    return rows


def study_table(study: Study, rows: pd.DataFrame) -> str:
    """The errors of every panel as Markdown, and what has no result."""
    parts = [
        f"**{panel['title']}**\n\n"
        + judge.table(
            rows,
            panel["quantity"],
            cost=panel.get("cost", "core_s"),
            series=panel.get("series", ("*",)),
            signed=not panel.get("magnitude", False),
        )
        for panel in study.data.get("panel", ())
    ]
    return "\n\n".join([*parts, *judge.failures(rows)])


def main(arguments: Sequence[str]) -> int:
    """Runs the study that `arguments` name, or shows its kept results; returns the exit code."""
    parser = argparse.ArgumentParser(prog="validation.py", description="Error against run time.")
    parser.add_argument("name", metavar="NAME", help=f"one of {', '.join(NAMES)}, answer or list")
    parser.add_argument("--quick", action="store_true", help="the reduced form, below a minute")
    parser.add_argument("--out", type=path_option, help="folder (default studies/NAME)")
    parser.add_argument("--jobs", type=int, help="runs at the same time (default: cores)")
    parser.add_argument("--silent", action="store_true", help="no progress")
    parser.add_argument(
        "--table", action="store_true", help="run nothing: the table of the kept results"
    )
    parser.add_argument(
        "--draw", action="store_true", help="run nothing: draw the kept results again"
    )
    options = parser.parse_args(list(arguments))
    if options.name == "list":
        for name in NAMES:
            print(f"{name:<16} {read_study(name).data['question']}")
        return 0
    if options.name == "answer":
        return _answer(draw=options.draw)
    study = read_study(options.name, quick=options.quick)
    if options.table or options.draw:
        rows = kept_rows(options.name)
        if options.draw:
            from validation.picture import draw

            draw(study.data["panel"], rows, KEPT / f"{study.name}.png")
        print(study_table(study, rows))
        return 0
    refuse_folder_name(options.out or Path())
    name = f"{study.name}-quick" if options.quick else study.name
    out = options.out or Path("studies") / name
    rows = run_study(study, out, jobs=options.jobs, show=not options.silent)
    print(study_table(study, rows))
    print(f"\ntable:  {out / study.name}.csv\nfigure: {out / study.name}.png")
    return 0


def _answer(*, draw: bool) -> int:
    """What each shortcut costs, from the kept results."""
    shortcuts = [
        judge.shortcut(kept_rows(name), **line)
        for name in NAMES
        for line in read_study(name).data.get("answer", ())
    ]
    if draw:
        from validation.picture import draw_answer

        draw_answer(shortcuts, KEPT / "answer.png")
    print(judge.answer_table(shortcuts))
    return 0


def _isolated(name: str, work: str, point: str, parent: str) -> None:
    """Prints what one point found, with limited memory; for a process that ends with `parent`."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != int(parent):  # the study ended before the kernel was asked
        return
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    print(json.dumps(measure_point(read_study(name), Point(*json.loads(point)), Path(work))))


if __name__ == "__main__":
    _isolated(*sys.argv[1:])
