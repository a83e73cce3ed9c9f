"""`fdnet cases`: list the shipped cases, or copy one."""

import argparse
from pathlib import Path
from typing import Any

from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    cases = commands.add_parser(
        "cases", parents=[common], help="list the cases that come with fdnet, or copy one"
    )
    cases.add_argument("name", nargs="?", help="the case to copy (default: list all)")
    cases.add_argument("--out", type=path_option, help="file to write (default NAME.toml)")
    cases.add_argument("--force", action="store_true", help="replace a file that is there")
    cases.set_defaults(action=_cases)


def _cases(options: argparse.Namespace) -> int:
    from fdnet.case.shipped import shipped_cases
    from fdnet.files.new import write_new

    if options.name is None:
        for case in shipped_cases():
            print(f"{case.name:<24} {case.about}")
        return 0
    out = options.out or Path(f"{options.name}.toml")
    text = _text_of(options.name)
    write_new(out, text, force=options.force)
    print(f"{out}: written; fdnet check {out} looks at it, fdnet run {out} runs it")
    return 0


def _text_of(name: str) -> str:
    import difflib

    from fdnet.case.shipped import shipped_cases
    from fdnet.errors import CaseError

    known = {case.name: case for case in shipped_cases()}
    if name not in known:
        near = difflib.get_close_matches(name, list(known), n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise CaseError(f"{name}: no case of this name comes with fdnet{hint} (fdnet cases)")
    return known[name].path.read_text(encoding="utf-8")
