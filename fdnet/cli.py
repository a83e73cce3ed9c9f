"""The `fdnet` command: runs, ensembles and sweeps of cases, permeability, mechanics.

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
import threading
from collections.abc import Sequence
from typing import Any, NoReturn

from fdnet.commands import campaign, finished, init, mechanics, permeability, run
from fdnet.commands.permeability import joined_box
from fdnet.errors import FdnetError, words_of

COMMANDS = (
    *(init.add_init, run.add_cases, run.add_check, run.add_run),
    *(campaign.add_ensemble, campaign.add_sweep, campaign.add_compare, campaign.add_design),
    *(run.add_render, permeability.add_permeability, finished.add_stokes),
    *(mechanics.add_mechanics, finished.add_movie),
)
"""What adds each command to the parser, in the order that `fdnet --help` shows."""

_STOPPED = 130
_PATIENCE = 0.2
"""Seconds after which a stop that was lost is sent once more."""
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
    debug = "--debug" in given
    whole = arguments is None
    _listen_for_stops(whole=whole)
    try:
        options = _parser().parse_args(joined_box(given))
        options.command_line = shlex.join(["fdnet", *given])
        code = options.action(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader has gone; all work is done
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 0
    except FdnetError as error:
        if debug:
            raise
        print(f"fdnet: {_one_line(error)}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return _stopped(whole=whole)
    except Exception as error:
        if _SIGNALS:  # a library may turn the stop into an error of its own
            return _stopped(whole=whole)
        words = words_of(error)
        if debug or not words:
            raise
        print(f"fdnet: {words}", file=sys.stderr)
        return 2


def _accept_any_character() -> None:
    """Print a character that the terminal does not know as its number, rather than fail."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _stopped(*, whole: bool) -> int:
    """Say it in one line; where this is the `whole` process, one more Ctrl-C adds nothing."""
    if whole:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    print(
        "fdnet: stopped; what was written is kept, repeat the command to go on "
        "(a run: with --resume)",
        file=sys.stderr,
    )
    return _STOPPED


def _listen_for_stops(*, whole: bool) -> None:
    """Ctrl-C, unless the shell has switched it off, and the end that a queue asks for.

    Where this is the `whole` process, also those that are lost on their way.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    if whole:
        sys.unraisablehook = _stop_again


def _interrupt(number: int, *_: Any) -> NoReturn:
    _SIGNALS.append(number)
    raise KeyboardInterrupt


def _stop_again(lost: Any) -> None:
    """Sends a stop once more that arrived where nothing can be raised, as in a call-back.

    Other such errors are shown as Python shows them, unless a stop has made them.
    """
    if issubclass(lost.exc_type, KeyboardInterrupt):
        main_thread = (threading.main_thread().ident, signal.SIGINT)
        again = threading.Timer(_PATIENCE, signal.pthread_kill, main_thread)
        again.daemon = True
        again.start()
    elif not _SIGNALS:
        sys.__unraisablehook__(lost)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _parser() -> argparse.ArgumentParser:
    common = _Parser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show a traceback on errors")
    parser = _Parser(prog="fdnet", description=str(__doc__).splitlines()[0])
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(required=True, metavar="command")
    for add in COMMANDS:
        add(commands, common)
    return parser


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib import metadata

        print(f"fdnet {metadata.version('fdnet')}")
        parser.exit(0)


if __name__ == "__main__":
    sys.exit(main())
