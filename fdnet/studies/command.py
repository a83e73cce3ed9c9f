"""`fdnet study NAME`: run a study, or go on with it, and write its table, figure and text."""

import argparse
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from fdnet.atomic import write_text
from fdnet.dem.binary import find_binary
from fdnet.errors import CaseError
from fdnet.studies.engine.study import Study

STUDIES: Mapping[str, str] = {
    "stiffness": "contact stiffness, from 1e2 N/m to the nominal one",
    "time-step": "time step over sqrt(m/k) and over the drag relaxation time",
    "drag": "drag at every step, held, implicit, viscous",
    "speed": "mobile grains, neighbour skin and bins, MPI ranks",
    "throat-occupancy": "what the thesis's two planes and quadrature make of a fine's volume in a throat",
    "linear-solver": "method and tolerance of the network's solve, by size and spread of conductance",
    "laws": "conductance and damage laws, and coarse resolved flow, against Stokes truth",
    "specimen-size": "number of grains and seed: how large a specimen must be, and what a small one is worth",
    "economies": "what makes full-scale invasions affordable: each economy with its error and its speed-up",
}
"""Name of each study and what it asks; the module has the same name with underscores."""

OF_NETWORK = ("throat-occupancy", "linear-solver", "laws", "specimen-size")
"""The studies of the network half; the others are of the invasion."""

THESIS = "thesis"
"""The study beside them, of runs and figures rather than of error against run time."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `fdnet study`."""
    parser.add_argument(
        "name", metavar="NAME", help=f"one of {', '.join(STUDIES)}; 'list' says what each asks"
    )
    parser.add_argument("--quick", action="store_true", help="the reduced form, below 30 s")
    parser.add_argument(
        "--out", type=Path, help="folder for table, figure and text (default studies/NAME)"
    )
    parser.add_argument("--silent", action="store_true", help="no progress")
    thesis = parser.add_argument_group(
        "only for 'thesis', all specimens of the thesis beside its numbers"
    )
    thesis.add_argument("--jobs", type=int, default=1, help="runs side by side (default 1)")
    thesis.add_argument(
        "--runs", type=Path, default=Path("runs/thesis"), help="run folders while they are needed"
    )
    thesis.add_argument(
        "--redraw",
        action="store_true",
        help="run nothing: tables and figures from the states kept",
    )


def run(options: argparse.Namespace) -> int:
    """Run one study; returns the exit code. Raises CaseError on an unknown name or a folder that is not the study's."""
    if options.name == "list":
        for name, asks in STUDIES.items():
            print(f"{name:<18} {asks}")
        print(f"{THESIS:<18} all specimens of the thesis at full scale, beside its numbers")
        return 0
    if options.name == THESIS:
        return _run_thesis(options)
    study = study_named(options.name)
    out = options.out or Path("studies") / (f"{study.name}-quick" if options.quick else study.name)
    text = run_study(study, out, quick=options.quick, show=not options.silent)
    print(text)
    print(
        f"table:  {out / study.name}.csv\nfigure: {out / study.name}.png\ntext:   {out / study.name}.md"
    )
    return 0


def _run_thesis(options: argparse.Namespace) -> int:
    from fdnet.studies.thesis.command import ThesisOptions, run_thesis

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
    """The study of that name. Raises CaseError when there is none."""
    if name not in STUDIES:
        raise CaseError(f"study: {name!r} is not known, expected one of {', '.join(STUDIES)}")
    module: Any = import_module(_module(name))
    return module.STUDY


def _module(name: str) -> str:
    room = "network" if name in OF_NETWORK else "dem"
    return f"fdnet.studies.{room}.{name.replace('-', '_')}"


def run_study(study: Study, out: Path, *, quick: bool, show: bool = False) -> str:
    """Run or continue, then write NAME.csv, NAME.png and NAME.md into `out`; returns the text.

    Raises LiggghtsError when the study needs a LIGGGHTS that is not there, CaseError when `out` is not this study's.
    """
    from fdnet.studies.engine.draw import draw_study
    from fdnet.studies.engine.runner import run_points
    from fdnet.studies.engine.table import study_text, write_rows

    def tell(line: str) -> None:
        if show:
            print(f"{study.name}: {line}", file=sys.stderr, flush=True)

    if study.needs_liggghts:
        find_binary()
    rows = study.judge(run_points(study, out, quick=quick, tell=tell))
    text = study_text(study, rows)
    write_rows(rows, out / f"{study.name}.csv")
    draw_study(study, rows, out / f"{study.name}.png")
    write_text(out / f"{study.name}.md", text)
    return text
