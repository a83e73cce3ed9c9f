"""Run a study, or go on with it, and write its table, figure and text."""

import argparse
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from fdnet.dem.liggghts import find_binary
from fdnet.errors import CaseError
from fdnet.files import path_option, refuse_folder_name, write_text
from validation.engine.study import Study

STUDIES: Mapping[str, str] = {
    "stiffness": "contact stiffness, from 1e2 N/m to the nominal one",
    "time-step": "time step over sqrt(m/k) and over the drag relaxation time",
    "size-ratio": "fines of 1/5 to 1/30 held in a pack, by stiffness, step and shear stiffness",
    "drag": "drag at every step, held, implicit, viscous",
    "linear-solver": "method and tolerance of the network's solve, by size and conductances",
    "laws": "conductance and damage laws, and coarse resolved flow, against Stokes truth",
    "velocity-field": "cells across a grain for the velocity between the grains",
    "specimen-size": "number of grains and seed: how large a specimen must be",
    "flow-updates": "how often a flow that follows its deposit is computed anew",
}
"""Name of each study and its question; the module has the same name with underscores."""

OF_NETWORK = ("linear-solver", "laws", "velocity-field", "specimen-size")
"""The studies of the network half; the others are of the invasion."""

THESIS = "thesis"
"""A further study, of runs and figures rather than of error against run time."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `python scripts/validation.py`."""
    parser.add_argument(
        "name",
        metavar="NAME",
        help=f"one of {', '.join(STUDIES)}; 'list' prints the question of each",
    )
    parser.add_argument("--quick", action="store_true", help="the reduced form, below 30 s")
    parser.add_argument(
        "--out", type=path_option, help="folder for table, figure and text (default studies/NAME)"
    )
    parser.add_argument("--silent", action="store_true", help="no progress")
    thesis = parser.add_argument_group(
        "only for 'thesis', all specimens of the thesis next to its numbers"
    )
    thesis.add_argument("--jobs", type=int, default=1, help="runs side by side (default 1)")
    thesis.add_argument(
        "--runs",
        type=path_option,
        default=Path("runs/thesis"),
        help="run folders while they are needed",
    )
    thesis.add_argument(
        "--redraw",
        action="store_true",
        help="run nothing: tables and figures from the states kept",
    )


def main(arguments: list[str]) -> int:
    """Runs the study that `arguments` name; returns the exit code."""
    parser = argparse.ArgumentParser(prog="validation.py", description=__doc__)
    add_arguments(parser)
    options = parser.parse_args(arguments)
    if options.name == "page":
        from validation.pages.validation import redraw, write_page

        docs = Path(__file__).resolve().parents[2] / "docs"
        if options.redraw:
            redraw(docs / "validation")
        print(write_page(docs))
        return 0
    return run(options)


def run(options: argparse.Namespace) -> int:
    """Runs one study and returns the exit code.

    Raises:
        CaseError: the name is not known, or the folder belongs to something else.
    """
    if options.name == "list":
        for name, question in STUDIES.items():
            print(f"{name:<18} {question}")
        print(f"{THESIS:<18} all specimens of the thesis at full scale, next to its numbers")
        return 0
    if options.name == THESIS:
        return _run_thesis(options)
    refuse_folder_name(options.out or Path())
    study = study_named(options.name)
    out = options.out or Path("studies") / (f"{study.name}-quick" if options.quick else study.name)
    text = run_study(study, out, quick=options.quick, show=not options.silent)
    print(text)
    for name, ending in (("table", "csv"), ("figure", "png"), ("text", "md")):
        print(f"{name + ':':<8}{out / study.name}.{ending}")
    return 0


def _run_thesis(options: argparse.Namespace) -> int:
    from validation.thesis.command import ThesisOptions, run_thesis

    refuse_folder_name(options.runs)
    refuse_folder_name(options.out or Path())
    if options.jobs < 1:
        raise CaseError(f"--jobs: {options.jobs} runs side by side, expected at least 1")
    out = options.out or Path("studies/thesis-quick" if options.quick else "docs/thesis")
    asked = ThesisOptions(
        out=out,
        runs=options.runs,
        quick=options.quick,
        jobs=options.jobs,
        redraw=options.redraw,
        show=not options.silent,
    )
    print(run_thesis(asked))
    print(f"tables and figures: {out}")
    return 0


def study_named(name: str) -> Study:
    """The study of that name.

    Raises:
        CaseError: there is none.
    """
    if name not in STUDIES:
        raise CaseError(f"study: {name!r} is not known, expected one of {', '.join(STUDIES)}")
    module: Any = import_module(_module(name))
    return module.STUDY


def _module(name: str) -> str:
    room = "network" if name in OF_NETWORK else "dem"
    return f"validation.{room}.{name.replace('-', '_')}"


def run_study(study: Study, out: Path, *, quick: bool, show: bool = False) -> str:
    """Runs or continues a study, writes NAME.csv, NAME.png and NAME.md to `out`, returns the text.

    Raises:
        LiggghtsError: the study needs LIGGGHTS, which is not there.
        CaseError: `out` belongs to something else.
    """
    from validation.engine.draw import draw_study
    from validation.engine.runner import run_points
    from validation.engine.table import study_text, write_rows

    def report(line: str) -> None:
        if show:
            print(f"{study.name}: {line}", file=sys.stderr, flush=True)

    if study.needs_liggghts:
        find_binary()
    rows = study.judge(run_points(study, out, quick=quick, report=report))
    text = study_text(study, rows)
    write_rows(rows, out / f"{study.name}.csv")
    draw_study(study, rows, out / f"{study.name}.png")
    write_text(out / f"{study.name}.md", text)
    return text
