"""The specimens of X. Shi's thesis (UT Austin, 2011) at full scale, next to its numbers.

.venv/bin/python scripts/validation.py thesis [--quick | --redraw] [--jobs N]
"""

import argparse
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import pandas as pd

from fdnet.case.file import QUICK
from fdnet.errors import CaseError, LiggghtsError
from fdnet.files import path_option, refuse_folder_name, write_text
from validation.thesis.compare import tables, trends
from validation.thesis.figures import Sources, draw_all
from validation.thesis.quantities import Run, deposition, examine, result_rows, statistics
from validation.thesis.runs import Planned, find_state, make_runs, planned

STATES = Path(__file__).parent / "states"
"""The states at the end of the runs at full scale."""


def main(arguments: list[str]) -> int:
    """Make or continue the runs, write tables and figures; returns the exit code.

    Raises LiggghtsError when runs failed, after the tables of all others are written.
    """
    parser = argparse.ArgumentParser(prog="validation.py thesis", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one run of each quick form, minutes")
    parser.add_argument("--redraw", action="store_true", help="run nothing, draw the kept states")
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side (default 1)")
    parser.add_argument("--out", type=path_option, help="tables and figures (docs/thesis)")
    options = parser.parse_args(arguments)
    out = options.out or Path("studies/thesis-quick" if options.quick else "docs/thesis")
    refuse_folder_name(out)
    own = options.out or options.quick
    states, runs = (out / "states", out / "runs") if own else (STATES, Path("runs/thesis"))
    plan = planned(quick=options.quick)
    failed = [] if options.redraw else make_runs(plan, states, runs, jobs=options.jobs)
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
    shown = {"quick"} if {one.group for one in plan} == {"quick"} else {"specimen", "variant"}
    kept, results, drawn = _rows_in(out / "results.csv"), list[Any](), dict[str, list[Run]]()
    for item in plan:
        rows = dict[Any, Any]()
        if state := find_state(states, item):
            run = examine(item, state)
            rows = {(one["law"], one["damage_law"]): one for one in result_rows(run)}
            if item.group in shown:
                drawn.setdefault(item.name.removeprefix(QUICK), []).append(run)
        for one in kept:
            if (one["id"], one["seed"]) == (item.id, item.seed):
                rows.setdefault((one["law"], one["damage_law"]), one)
        results += rows.values()
    if not results:
        what = "the folder holds no state and no results of this study"
        raise CaseError(f"{out}: {what}; leave out --redraw to run it")
    out.mkdir(parents=True, exist_ok=True)
    table, runs = _write(out / "results.csv", results), [*chain(*drawn.values())]
    measured = [row for run in runs for row in statistics(run)]
    readings = {row["note"].split(";")[0] for row in measured}
    earlier = _rows_in(out / "statistics.csv", keep_default_na=False)  # by other readings
    measured += [row for row in earlier if row["note"].split(";")[0] not in readings]
    _write(out / "statistics.csv", measured)
    _write(out / "deposition.csv", [row for run in runs for row in deposition(run)])
    compared = _write(out / "trends.csv", trends(table))
    _write(out / "tables.csv", list(tables(table)))
    _write(out / "figures.csv", draw_all(Sources(drawn, table), out))
    return compared


def _rows_in(path: Path, **how: Any) -> list[Any]:
    return pd.read_csv(path, **how).to_dict("records") if path.exists() else []


def _write(path: Path, rows: Any) -> pd.DataFrame:
    table = pd.DataFrame(rows)
    write_text(path, table.to_csv(index=False, float_format="%.9g"))
    return table
