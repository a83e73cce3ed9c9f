"""`fdnet init`: a case file from a sand, a mud and a well."""

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.files import path_option

if TYPE_CHECKING:
    from fdnet.scales.design import Design
    from fdnet.scales.questions import Question

SIZES = ("quick", "standard")


def add_init(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    from fdnet.scales.questions import QUESTIONS

    init = commands.add_parser(
        "init",
        parents=[common],
        help="write a case from a sand, a mud and a well: asks, or takes options",
    )
    for question in QUESTIONS:
        flag = f"--{question.key.replace('_', '-')}"
        asked = f'{question.text}, e.g. "{question.example}"'.replace("%", "%%")
        init.add_argument(flag, metavar="TEXT", help=asked)
    for group, what in (("sand", "sieve"), ("mud", "laser")):
        init.add_argument(
            f"--{group}-file",
            type=path_option,
            metavar="CSV",
            help=f"a table of sizes instead ({what})",
        )
    init.add_argument("--name", default="my-case", help="of the case (default my-case)")
    init.add_argument(
        "--size", choices=SIZES, default=SIZES[0], help="how long it may take (default quick)"
    )
    init.add_argument("--out", type=path_option, help="file to write (default NAME.toml)")
    init.add_argument("--force", action="store_true", help="replace a file that is there")
    init.set_defaults(action=_init)


def _init(options: argparse.Namespace) -> int:
    from fdnet.files import refuse_present, write_new
    from fdnet.scales.clock import spoken_time
    from fdnet.scales.design import case_text, left_out

    out = options.out or Path(f"{options.name}.toml")
    refuse_present(out, force=options.force)
    design = _designed(options, out)
    write_new(out, case_text(design), force=options.force)
    print(f"{out}: written, expected to take {spoken_time(design.seconds)} on one core")
    for text in left_out(design):
        print(f"  {text}")
    print(f"  fdnet check {out}    what is odd, time and memory")
    print(f"  fdnet run {out}      the answer, in runs/{options.name}/report.html")
    return 0


def _designed(options: argparse.Namespace, out: Path) -> "Design":
    """The design of the answers; on a terminal those that make no case are asked for again."""
    from fdnet.errors import CaseError
    from fdnet.run.pipeline import refusals
    from fdnet.scales.design import BUDGETS, designed, filled
    from fdnet.scales.questions import QUESTIONS, named_in

    texts = {"name": options.name}
    for question in QUESTIONS:
        if (text := getattr(options, question.key)) is not None:
            texts[question.key] = text
    for group in ("sand", "mud"):
        if (file := getattr(options, f"{group}_file")) is not None:  # as seen from the case
            texts[f"{group}_file"] = os.path.relpath(file.absolute(), out.absolute().parent)
    ask = _ask if sys.stdin.isatty() else None
    while True:
        texts = filled(texts, ask)
        try:
            return designed(
                texts, BUDGETS[options.size], folder=out.absolute().parent, refusals=refusals
            )
        except CaseError as error:
            again = [one for one in named_in(str(error)) if not texts.get(f"{one.group}_file")]
            if ask is None or not again:
                raise
            print(" ".join(str(error).split()), file=sys.stderr)
        for question in again:
            del texts[question.key]


def _ask(question: "Question", problem: str) -> str | None:
    """The answer of the terminal to a question; None when it has no more."""
    if problem:
        print(problem, file=sys.stderr)
    default = f" [{question.default}]" if question.default else ""
    example = "" if default else f', e.g. "{question.example}"'
    try:
        return input(f"{question.text}{example}{default}: ")
    except EOFError:
        return None
