"""The specimens of X. Shi's thesis (UT Austin, 2011) at full scale, next to its numbers.

.venv/bin/python scripts/validation.py thesis [--quick] [--jobs N]    runs, tables, figures
.venv/bin/python scripts/validation.py thesis --redraw                no runs
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from fdnet.case.file import QUICK
from fdnet.errors import CaseError, LiggghtsError
from fdnet.files import path_option, refuse_folder_name, write_text
from validation.thesis.compare import tables, trends
from validation.thesis.figures import Sources, draw_all
from validation.thesis.quantities import (
    Run,
    deposition,
    examine,
    result_rows,
    statistics,
)
from validation.thesis.runs import Planned, find_state, make_runs, planned

STATES = Path(__file__).parent / "states"
"""The states at the end of the runs at full scale."""


def main(arguments: list[str]) -> int:
    """Make or continue the runs, write tables and figures; returns the exit code.

    Raises LiggghtsError when runs failed, after the tables of all others are written, and
    CaseError when there is nothing to draw.
    """
    parser = argparse.ArgumentParser(
        prog="validation.py thesis",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="one run of each quick form, minutes")
    parser.add_argument("--redraw", action="store_true", help="run nothing, draw the kept states")
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side (default 1)")
    parser.add_argument("--out", type=path_option, help="tables and figures (docs/thesis)")
    parser.add_argument(
        "--runs", type=path_option, default=Path("runs/thesis"), help="run folders"
    )
    parser.add_argument("--silent", action="store_true", help="no progress")
    options = parser.parse_args(arguments)
    out = options.out or Path("studies/thesis-quick" if options.quick else "docs/thesis")
    for folder in (options.runs, out):
        refuse_folder_name(folder)
    if options.jobs < 1:
        raise CaseError(f"--jobs: {options.jobs} runs side by side, expected at least 1")
    states = out / "states" if options.out or options.quick else STATES
    plan, failed = planned(quick=options.quick), []
    if not options.redraw:
        show = not options.silent
        failed = make_runs(plan, states, options.runs, jobs=options.jobs, show=show)
    compared = write_all(plan, out, states)
    print(compared.groupby(["trend", "scale", "laws", "verdict"]).size().to_string())
    print(f"tables and figures: {out}")
    if failed:
        raise LiggghtsError(f"run the study again to continue; failed: {'; '.join(failed)}")
    return 0


def write_all(plan: Sequence[Planned], out: Path, states: Path) -> pd.DataFrame:
    """Write the tables and figures of all runs that have a state; returns trends.csv.

    Rows of an earlier results.csv stay where a run has no state, or none by those laws today. Runs
    of specimens and variants are drawn, or the quick forms when there is nothing else.
    """
    kept: Any = pd.read_csv(out / "results.csv") if (out / "results.csv").exists() else None
    results: list[dict[str, Any]] = []
    runs: list[Run] = []
    for item in plan:
        state, rows = find_state(states, item), []
        if state is not None:
            runs.append(examine(item, state))
            rows = result_rows(runs[-1])
            if item.group not in ("specimen", "variant") and len(plan) > len(planned(quick=True)):
                runs.pop()
        known = {(one["law"], one["damage_law"]) for one in rows}
        if kept is not None:
            mine: Any = kept[(kept.id == item.id) & (kept.seed == item.seed)].to_dict("records")
            rows += [one for one in mine if (one["law"], one["damage_law"]) not in known]
        results += rows
    if not results:
        raise CaseError(
            f"{out}: the folder holds no state and no results of this study; leave out --redraw "
            "to run it"
        )
    table = _write(out / "results.csv", results)
    measured = [row for run in runs for row in statistics(run)]
    path = out / "statistics.csv"
    if path.exists():  # what earlier scripts measured in another way stays
        readings = {row["note"].split(";")[0] for row in measured}
        earlier: Any = pd.read_csv(path, keep_default_na=False).to_dict("records")
        measured += [row for row in earlier if row["note"].split(";")[0] not in readings]
    _write(path, measured)
    _write(out / "deposition.csv", [row for run in runs for row in deposition(run)])
    compared = _write(out / "trends.csv", trends(table))
    _write(out / "tables.csv", list(tables(table)))
    by_name: dict[str, list[Run]] = {}
    for run in runs:
        by_name.setdefault(run.item.name.removeprefix(QUICK), []).append(run)
    _write(out / "figures.csv", draw_all(Sources(by_name, table), out))
    return compared


def _write(path: Path, rows: Any) -> pd.DataFrame:
    table = pd.DataFrame(rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, table.to_csv(index=False, float_format="%.9g"))
    return table
