"""`fdnet run`: pack, invade, analyse and report one case."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from fdnet.case.stages import STAGES
from fdnet.commands.case_options import add_case, add_program, case_of, stages_of
from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    run = commands.add_parser(
        "run", parents=[common], help="pack, invade, analyse and report one case"
    )
    add_case(run)
    run.add_argument("--out", type=path_option, help="run folder (default runs/NAME)")
    run.add_argument("--resume", action="store_true", help="continue an unfinished run")
    run.add_argument("--force", action="store_true", help="replace an earlier run")
    run.add_argument(
        "--stages",
        default=",".join(STAGES),
        help="comma-separated (default: all that the case has)",
    )
    run.add_argument("--json", action="store_true", help="print summary.json on standard output")
    add_program(run)
    run.add_argument(
        "--pack-from",
        type=path_option,
        metavar="RUN",
        help="take the finished pack of this run folder, made of the same grains and seed",
    )
    run.add_argument("--quiet", action="store_true", help="no progress")
    run.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    from fdnet.run.pipeline import run_stages
    from fdnet.run.session import RunOptions, cores

    case = case_of(options)
    out = options.out or Path("runs") / case.name
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
    )
    if options.np > cores():
        _warn(
            f"--np {options.np}: this machine has {cores()} cores, so the run will be slower than "
            f"with --np {cores()}"
        )
    summary = run_stages(case, chosen)
    for text in summary.get("warnings", []):
        if "3-D picture" in text or text.startswith("the drawing process"):
            _warn(text)
    if options.json:
        print(json.dumps(summary, indent=2))
    else:
        _print_summary(summary, out)
    return 0


def _warn(text: str) -> None:
    print(f"fdnet: warning: {text}", file=sys.stderr, flush=True)


def _print_summary(summary: dict[str, Any], out: Path) -> None:
    from fdnet.run.summary_text import summary_lines

    for line in (
        summary_lines(summary) if summary else ["done (the analysis was not among the stages)"]
    ):
        print(line)
    print(f"run folder: {out}")
