"""The `fdnet` command: runs, ensembles and sweeps, permeability, mechanics, cores and wells.

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
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from fdnet.commands import campaign, finished, formation, init, mechanics, permeability, run
from fdnet.commands.options import Parser, meant
from fdnet.errors import FdnetError, words_of

COMMANDS = (
    *(init.add_init, run.add_case_commands, permeability.add_permeability),
    *(finished.add_commands_on_runs, mechanics.add_mechanics, campaign.add_campaign_commands),
    formation.add_formation,
)
"""What adds commands to the parser, in the order that `fdnet --help` shows."""

_STOPPED = 130
_SIGNALS: list[int] = []  # Signals to stop that have arrived


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    _accept_any_character()
    _SIGNALS.clear()
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given
    whole = arguments is None
    _listen_for_stops()
    if whole:
        sys.unraisablehook = _stop_again
    try:
        options = _parsed(given)
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
        print("fdnet:", *str(error).split(), file=sys.stderr)
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


def _listen_for_stops() -> None:
    """Ctrl-C, unless the shell has switched it off, and the end that a queue asks for."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def _interrupt(number: int, *_: Any) -> NoReturn:
    _SIGNALS.append(number)
    raise KeyboardInterrupt


def _stop_again(lost: Any) -> None:
    """Sends a stop once more that arrived where nothing can be raised, as in a call-back.

    Other such errors are shown as Python shows them, unless a stop has made them.
    """
    if issubclass(lost.exc_type, KeyboardInterrupt):
        main_thread = (threading.main_thread().ident, signal.SIGINT)
        again = threading.Timer(0.2, signal.pthread_kill, main_thread)
        again.daemon = True
        again.start()
    elif not _SIGNALS:
        sys.__unraisablehook__(lost)


def _parsed(given: Sequence[str]) -> argparse.Namespace:
    """The options of a command line. Ends with one line on stderr where it cannot be read."""
    parser = _parser()
    known = commands_of(parser)
    name = next((one for one in given if not one.startswith("-")), None)
    if name is not None and name not in known:
        near = f"; did you mean run {name}?" if name.endswith(".toml") else meant(name, known)
        parser.error(f"{name}: is no command{near}")
    options, unknown = parser.parse_known_args(given)
    if unknown:
        options.parser.refuse(unknown)
    return options


def _parser() -> Parser:
    parser = Parser(
        prog="fdnet",
        description="What do the fines of a drilling mud cost the permeability of a sand?",
        epilog="example:\n  fdnet init --from quick && fdnet run quick.toml\n\n"
        "fdnet COMMAND --help explains a command. Pages named as docs/... are the project's.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(action=_say, parser=parser)
    parser.add_argument("--version", action="store_true", help="print the version")
    words = 'print what completes commands, for bash and zsh: eval "$(fdnet --completion)"'
    parser.add_argument("--completion", action="store_true", help=words)
    commands = parser.add_subparsers(metavar="COMMAND", title="commands")
    for add in COMMANDS:
        add(commands)
    return parser


def _say(options: argparse.Namespace) -> int:
    """What `fdnet` says without a command: its version, the script of a shell, or its help."""
    if options.version:
        from importlib import metadata

        print(f"fdnet {metadata.version('fdnet')}")
    elif options.completion:
        from fdnet.case.file import shipped_cases

        print(completion(commands_of(options.parser), [case.name for case in shipped_cases()]))
    else:
        options.parser.print_help()
    return 0


def commands_of(parser: argparse.ArgumentParser) -> dict[str, Parser]:
    """The parser of each command, by its name."""
    actions = parser._actions
    (commands,) = (one for one in actions if isinstance(one, argparse._SubParsersAction))
    return dict(commands.choices)


def completion(commands: Mapping[str, Parser], cases: Sequence[str]) -> str:
    """A script for bash and zsh that completes commands, options, their choices, and `cases`."""
    lines = [f"    'init --from') words='{' '.join(cases)}' ;;"]
    options = []
    for name, parser in commands.items():
        flags = [one for one in parser._actions if one.option_strings]
        names = " ".join(flag for one in flags for flag in one.option_strings)
        options.append(f"    {name}) words='{names}' ;;")
        lines += [
            f"    '{name} {flag}') words='{' '.join(one.choices)}' ;;"
            for one in flags
            if one.choices
            for flag in one.option_strings
        ]
    return _SCRIPT.format("\n".join(lines), " ".join(commands), "\n".join(options))


_SCRIPT = """\
if [ -n "$ZSH_VERSION" ]; then
  type compdef > /dev/null || {{ autoload -U compinit && compinit -i; }}
  autoload -U +X bashcompinit && bashcompinit
fi
_fdnet() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words=""
  case "${{COMP_WORDS[1]}} ${{COMP_WORDS[COMP_CWORD-1]}}" in
{}
    *) [ "$COMP_CWORD" = 1 ] && words="{}" ;;
  esac
  [ "${{word:0:1}}" = - ] && case "${{COMP_WORDS[1]}}" in
{}
  esac
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _fdnet fdnet"""


if __name__ == "__main__":
    sys.exit(main())
