"""The `fdnet` command: run, render, permeability, study.

It reads the arguments, calls the package and prints. Exit codes: 0 done, 2 bad input (nothing
written), 3 LIGGGHTS missing or failed, 4 degenerate geometry or an unconverged solve, 130 stopped
by the user.
"""

import argparse
import io
import json
import os
import shlex
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from fdnet.case.stages import STAGES
from fdnet.errors import CaseError, FdnetError, words_of
from fdnet.files.paths import path_option
from fdnet.permeability.options import joined_box

_STOPPED = 130
_SIGNALS: list[int] = []
"""Signals to stop that have arrived."""


class _Parser(argparse.ArgumentParser):
    """One line on stderr for a bad command line too."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    _accept_any_character()
    _SIGNALS.clear()
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(joined_box(given))
    options.command_line = shlex.join(["fdnet", *given])
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        code = options.action(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader has gone; all work is done
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 0
    except FdnetError as error:
        if options.debug:
            raise
        print(f"fdnet: {_one_line(error)}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return _stopped()
    except Exception as error:
        if _SIGNALS:  # a library may turn the stop into an error of its own
            return _stopped()
        words = words_of(error)
        if options.debug or not words:
            raise
        print(f"fdnet: {words}", file=sys.stderr)
        return 2


def _accept_any_character() -> None:
    """Print a character that the terminal does not know as its number, rather than fail."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _stopped() -> int:
    print(
        "fdnet: stopped; what was written is kept, repeat the command to go on "
        "(a run: with --resume)",
        file=sys.stderr,
    )
    return _STOPPED


def _interrupt(number: int, *_: Any) -> NoReturn:
    _SIGNALS.append(number)
    raise KeyboardInterrupt


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _parser() -> argparse.ArgumentParser:
    common = _Parser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show a traceback on errors")
    parser = _Parser(prog="fdnet", description=str(__doc__).splitlines()[0])
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(required=True, metavar="command")
    _add_run(commands, common)
    _add_render(commands, common)
    _add_permeability(commands, common)
    _add_study(commands, common)
    return parser


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib import metadata

        print(f"fdnet {metadata.version('fdnet')}")
        parser.exit(0)


def _add_case(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("case", type=path_option, metavar="CASE.toml", help="the case file")
    parser.add_argument("--seed", type=int, help="overrides the seed of the case")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="overrides a key, e.g. fines.count=500",
    )
    parser.add_argument(
        "--np",
        type=_ranks,
        default=1,
        metavar="N",
        help="MPI ranks for LIGGGHTS (default 1); another number of ranks gives another pack from "
        "the same seed, and a cut run is continued with the number it was begun with",
    )


def _ranks(text: str) -> int:
    if not text.isdecimal() or len(text) > 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}, expected a number of ranks, 1 or more")
    return int(text)


def _add_run(commands: Any, common: argparse.ArgumentParser) -> None:
    run = commands.add_parser(
        "run", parents=[common], help="pack, invade, analyse and report one case"
    )
    _add_case(run)
    run.add_argument("--out", type=path_option, help="run folder (default runs/NAME)")
    run.add_argument("--resume", action="store_true", help="continue an unfinished run")
    run.add_argument("--force", action="store_true", help="replace an earlier run")
    run.add_argument(
        "--stages",
        default=",".join(STAGES),
        help="comma-separated (default: all four)",
    )
    run.add_argument("--json", action="store_true", help="print summary.json on standard output")
    run.add_argument("--liggghts", metavar="PATH", help="the LIGGGHTS binary")
    run.add_argument(
        "--timeout",
        type=float,
        metavar="SECONDS",
        help="stop LIGGGHTS after this time (continue with --resume)",
    )
    run.add_argument("--quiet", action="store_true", help="no progress")
    run.set_defaults(action=_run)


def _add_render(commands: Any, common: argparse.ArgumentParser) -> None:
    render = commands.add_parser(
        "render", parents=[common], help="write the decks without LIGGGHTS and print the scales"
    )
    _add_case(render)
    render.add_argument("--out", type=path_option, required=True, help="folder for the decks")
    render.set_defaults(action=_render)


def _add_permeability(commands: Any, common: argparse.ArgumentParser) -> None:
    from fdnet.permeability.command import run
    from fdnet.permeability.options import add_arguments

    command = commands.add_parser(
        "permeability",
        parents=[common],
        help="permeability of a file of spheres, without LIGGGHTS",
    )
    add_arguments(command)
    command.set_defaults(action=run)


def _add_study(commands: Any, common: argparse.ArgumentParser) -> None:
    from fdnet.studies.command import add_arguments, run

    command = commands.add_parser(
        "study", parents=[common], help="error against run time of one of fdnet's choices"
    )
    add_arguments(command)
    command.set_defaults(action=run)


def _case_of(options: argparse.Namespace) -> Any:
    from fdnet.case.file import read_case

    seed = [] if options.seed is None else [f"seed={options.seed}"]
    return read_case(options.case, assignments=[*options.set, *seed])


def _stages(text: str) -> tuple[str, ...]:
    names = [part.strip() for part in text.split(",") if part.strip()]
    unknown = [name for name in names if name not in STAGES]
    if unknown or not names:
        raise CaseError(
            f"--stages: {text!r} has {unknown or 'nothing'}, expected some of {','.join(STAGES)}"
        )
    return tuple(stage for stage in STAGES if stage in names)


def _run(options: argparse.Namespace) -> int:
    from fdnet.run.pipeline import run_stages
    from fdnet.run.session import RunOptions, cores

    case = _case_of(options)
    out = options.out or Path("runs") / case.name
    chosen = RunOptions(
        out=out,
        ranks=options.np,
        resume=options.resume,
        force=options.force,
        stages=_stages(options.stages),
        liggghts=options.liggghts,
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


def _render(options: argparse.Namespace) -> int:
    from fdnet.dem.render import render_decks
    from fdnet.run.mark import is_run_folder
    from fdnet.scales.cost import over_limit
    from fdnet.scales.scales import scales_of
    from fdnet.scales.table import scale_rows

    case = _case_of(options)
    scales = scales_of(case)
    if is_run_folder(options.out):
        raise CaseError(
            f"{options.out}: is a run folder; give another --out (nothing was changed)"
        )
    decks = render_decks(case, options.out, ranks=options.np)
    for row in scale_rows(case, scales):
        print(
            f"{row.name:<36} {row.symbol:<11} {row.value:>12.4g} {row.unit:<5} "
            f"{row.formula:<40} {row.source}"
        )
    for warning in filter(None, [*scales.warnings, over_limit(case, scales)]):
        print(f"warning: {warning}")
    for deck in decks:
        print(f"deck: {deck}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
