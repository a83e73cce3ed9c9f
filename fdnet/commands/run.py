"""`fdnet run`, `check` and `render`: commands on a case."""

import argparse
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.commands.options import LIGGGHTS, OUTPUT, case_of, new_command, stages_of
from fdnet.errors import PAGE, CaseError
from fdnet.files import path_option

if TYPE_CHECKING:
    from fdnet.scales.check import Checked


LOOK_AT_FIRST = ("u", "Re", "d/D", "n", "t_run")
"""Symbols in the table of scales: velocity, throat ratio, number of fines, time."""


def add_case_commands(commands: Any) -> None:
    """Adds `fdnet run`, `check` and `render` to the command line."""
    about = "pack the sand, let fines invade it, give the permeability before and after"
    example = "fdnet run mine.toml --out runs/mine --set fines.count=500"
    run = new_command(commands, "run", _run, about, example, f"{example} --resume")
    run.share("case", "--seed", "--set", "--np", "--liggghts", "--launcher", "--timeout")
    pack = "take the finished pack of this run folder, made of the same grains and seed"
    run.add(LIGGGHTS, "--pack-from RUN", pack, path_option)
    run.add(OUTPUT, "--out DIR", "run folder (default runs/NAME)", path_option)
    run.add(OUTPUT, "--resume", "continue an unfinished run")
    run.share("--force", "--stages", "--json", "--quiet")
    run.share("--fast")
    dry = "write nothing; print velocities, time steps and what is odd (fdnet render: decks too)"
    run.add(OUTPUT, "--dry-run", dry)

    about = "say what is odd about a case, what to do about it, and what the run takes"
    check = new_command(commands, "check", _check, about, "fdnet check mine.toml --strict")
    check.share("case", "--seed", "--set", "--np", "--json", "--fast")
    check.add(OUTPUT, "--strict", "end with exit code 2 where anything is odd")

    about = "write the LIGGGHTS decks, and print what fdnet run --dry-run prints"
    render = new_command(commands, "render", _render, about, "fdnet render mine.toml --out decks")
    render.share("case", "--seed", "--set", "--np", "--out")


# ---- `fdnet check`: what is odd about a case, what to do about it, and what the run takes.
def _check(options: argparse.Namespace) -> int:
    result = looked_at(case_of(options))
    print(json.dumps(result.data(), indent=2) if options.json else "\n".join(result.lines()))
    _refuse_refused(result)
    if options.strict and result.findings:
        raise CaseError(f"--strict: {len(result.findings)} things are odd about this case")
    return 0


def looked_at(case: Any) -> "Checked":
    """The case with all that `fdnet run` would say or refuse."""
    from fdnet.run.pipeline import refusals
    from fdnet.scales.check import checked
    from fdnet.scales.scales import scales_of

    scales = scales_of(case)
    return checked(case, scales, tuple(refusals(case, scales)))


def _refuse_refused(result: "Checked") -> None:
    for one in result.findings:
        if one.refused:
            raise CaseError(f"fdnet run refuses this case: {one.what}")


# ---- `fdnet run --dry-run` prints the scales; `fdnet render` writes the decks too.
def _render(options: argparse.Namespace) -> int:
    from fdnet.dem.invade_deck import render_decks
    from fdnet.run.folder import is_run_folder

    case = case_of(options)
    if is_run_folder(options.out):
        raise CaseError(
            f"{options.out}: is a run folder; give another --out (nothing was changed)"
        )
    decks = render_decks(case, options.out, ranks=options.np)
    _print_scales(case)
    for deck in decks:
        print(f"deck: {deck}")
    return 0


def _print_scales(case: Any) -> "Checked":
    """Print velocities, time steps and dimensionless numbers, and what is odd about the case."""
    from fdnet.scales.scales import scales_of
    from fdnet.scales.table import scale_rows

    for row in scale_rows(case, scales_of(case)):
        mark = ">" if row.symbol in LOOK_AT_FIRST else " "
        print(
            f"{mark} {row.name:<36} {row.symbol:<11} {row.value:>12.4g} {row.unit:<5} "
            f"{row.formula:<40} {row.source}"
        )
    result = looked_at(case)
    print("> marks what to look at first", *result.lines(), sep="\n")
    return result


# ---- `fdnet run`: pack, invade, analyse and report one case.
def _run(options: argparse.Namespace) -> int:
    from fdnet.report.text import seconds_line, summary_lines
    from fdnet.run.pipeline import run_stages
    from fdnet.run.records import RunOptions, cores

    case = case_of(options)
    if options.dry_run:
        _refuse_refused(_print_scales(case))
        return 0
    out, printed = options.out or Path("runs") / case.name, []

    def tell(summary: Mapping[str, Any]) -> None:
        """The answer, as soon as it is known: the pictures may take longer than it did."""
        if summary and not options.json:
            try:
                print("\n".join(summary_lines(summary)), flush=True)
            except BrokenPipeError:  # the reader has gone; the run goes on to its end
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            printed.append(summary)

    chosen = RunOptions(
        out=out,
        ranks=options.np,
        resume=options.resume,
        force=options.force,
        stages=stages_of(options.stages),
        liggghts=options.liggghts,
        launcher=options.launcher,
        pack_from=options.pack_from,
        timeout=options.timeout,
        show_progress=not options.quiet,
        command=options.command_line,
        answered=tell,
    )
    if options.np > cores():
        _warn(
            f"--np {options.np}: this machine has {cores()} cores, so the run will be slower than "
            f"with --np {cores()}"
        )
    summary = run_stages(case, chosen)
    for text in summary.get("warnings", []):
        if text.endswith((f"{PAGE}#no-picture)", f"{PAGE}#no-view)")):
            _warn(text)
    if options.json:
        print(json.dumps(summary, indent=2))
        return 0
    if not printed:
        tell(summary)
    done = "done (the analysis was not among the stages)"
    print(seconds_line(summary) if summary else done)
    print(f"run folder: {out}")
    return 0


def _warn(text: str) -> None:
    print(f"fdnet: warning: {text}", file=sys.stderr, flush=True)
