"""Options of each command of fdnet, from its own parser."""

import argparse
import re
from collections import Counter
from collections.abc import Iterator

SHARED = 2
"""An option that means the same to so many commands is explained once."""


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    from fdnet.cli import _parser, commands_of

    return commands_of(_parser())


def shared_rows() -> list[tuple[str, str]]:
    """Name and meaning of the options that `SHARED` or more commands take, in Markdown."""
    rows = Counter(row for parser in commands().values() for row in _rows(parser))
    return sorted(row for row, count in rows.items() if count >= SHARED and "--" in row[0])


def own_rows(name: str) -> list[tuple[str, str]]:
    """Name and meaning of the other arguments of a command, and a row that names the shared."""
    shared, rows = shared_rows(), list(_rows(commands()[name]))
    names = ", ".join(f"`{row[0].strip('`').split()[0]}`" for row in rows if row in shared)
    also = [("Also", f"{names}.")] if names else []
    return [row for row in rows if row not in shared] + also


def _rows(parser: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """Every argument; raises LookupError for one without help."""
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
