"""Usage and options of each command of fdnet as rows of a table, from its own parser."""

import argparse
import re
from collections.abc import Iterator


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    from fdnet.cli import _parser

    for action in _parser()._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    raise LookupError("the parser of fdnet has no commands")


def usage_of(parser: argparse.ArgumentParser) -> str:
    """The usage of a command, wrapped to the width of the page."""
    parser.formatter_class = lambda prog: argparse.HelpFormatter(prog, width=78)
    return parser.format_usage().removeprefix("usage: ").replace("[-h] ", "").strip()


def option_rows(parser: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """Name and meaning of every argument, in Markdown; raises LookupError for one without help."""
    for action in parser._actions:
        if isinstance(action, argparse._HelpAction):
            continue
        if not action.help:
            raise LookupError(f"{parser.prog} {action.dest}: the argument has no help text")
        yield _name(action), _meaning(action)


def _name(action: argparse.Action) -> str:
    if not action.option_strings:
        return f"`{action.metavar or action.dest}`"
    choices = "{" + ",".join(action.choices) + "}" if action.choices else ""
    value = action.metavar or choices
    if not value and action.nargs != 0:
        value = action.dest.upper()
    return f"`{' '.join([action.option_strings[0], str(value)]).strip()}`"


def _meaning(action: argparse.Action) -> str:
    text = re.sub(r"(?<![\w-])--[a-z-]+", r"`\g<0>`", str(action.help).replace("%%", "%"))
    return text[0].upper() + text[1:] + ("" if text.endswith(".") else ".")
