"""The `fdnet` command: runs, ensembles and sweeps of cases, permeability, mechanics, studies.

It reads the arguments, calls the package and prints. Exit codes: 0 done, 2 bad input (nothing
written), 3 LIGGGHTS missing or failed, 4 degenerate geometry or an unconverged solve, 5 some
runs of an ensemble or a sweep failed, 130 stopped by the user.
"""

import argparse
import io
import os
import shlex
import signal
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from fdnet.commands import (
    cases,
    check,
    compare,
    design,
    ensemble,
    init,
    mechanics,
    movie,
    permeability,
    render,
    run,
    stokes,
    study,
    sweep,
)
from fdnet.errors import FdnetError, words_of
from fdnet.permeability.options import joined_box

COMMANDS = (
    *(init, cases, check, run, ensemble, sweep, compare, design),
    *(render, permeability, stokes, mechanics, movie, study),
)
"""Modules of the commands, in the order that `fdnet --help` shows."""

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
    for command in COMMANDS:
        command.add_command(commands, common)
    return parser


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib import metadata

        print(f"fdnet {metadata.version('fdnet')}")
        parser.exit(0)


if __name__ == "__main__":
    sys.exit(main())
