"""`fdnet init`: a case file from a sand, a mud and a well, or a copy of a shipped one."""

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.commands.options import OUTPUT, THE_CASE, meant, new_command
from fdnet.errors import CaseError
from fdnet.files import path_option

if TYPE_CHECKING:
    from fdnet.scales.design import Design
    from fdnet.scales.questions import Question

SIZES = ("quick", "standard")
SHIPPED = "cases that come with fdnet"


def add_init(commands: Any) -> None:
    """Adds the command to the command line."""
    from fdnet.scales.questions import QUESTIONS

    about = "write a case from a sand, a mud and a well: it asks, or takes options"
    example = 'fdnet init --name mine --sand-d50 "0.4 mm" --mud-d50 "40 um" --solids "5 %"'
    init = new_command(commands, "init", _init, about, example, "fdnet init --from well")
    for question in QUESTIONS:
        flag = f"--{question.key.replace('_', '-')} TEXT"
        init.add(THE_CASE, flag, f'{question.text}, e.g. "{question.example}"')
    for group, what in (("sand", "sieve"), ("mud", "laser")):
        text = f"a table of sizes instead ({what})"
        init.add(THE_CASE, f"--{group}-file CSV", text, path_option)
    init.add(THE_CASE, "--name NAME", "of the case (default my-case)")
    init.add(THE_CASE, "--size", "how long it may take (default quick)", choices=SIZES)
    init.add(SHIPPED, "--list", "list them")
    init.add(SHIPPED, "--from CASE", "copy this one as it is")
    init.add(OUTPUT, "--out FILE", "file to write (default NAME.toml)", path_option)
    init.share("--force")


def _init(options: argparse.Namespace) -> int:
    from fdnet.files import refuse_present, write_new
    from fdnet.scales.clock import spoken_time
    from fdnet.scales.design import case_text, taken

    if options.list or getattr(options, "from") is not None:
        return _shipped(options)
    name = options.name or "my-case"
    out = options.out or Path(f"{name}.toml")
    refuse_present(out, force=options.force)
    design = _designed(options, name, out)
    write_new(out, case_text(design), force=options.force)
    print(f"{out}: written, expected to take {spoken_time(design.seconds)} on one core")
    for text in taken(design):
        print(f"  {text}")
    print(f"  fdnet check {out}    what is odd, time and memory")
    print(f"  fdnet run {out}      the answer, in runs/{name}/report.html")
    return 0


def _shipped(options: argparse.Namespace) -> int:
    """List the cases that come with fdnet, or copy one."""
    from fdnet.case.file import shipped_cases
    from fdnet.files import write_new
    from fdnet.scales.questions import QUESTIONS

    known, name = {case.name: case for case in shipped_cases()}, getattr(options, "from")
    if name is None:
        for case in known.values():
            print(f"{case.name:<24} {case.about}")
        return 0
    if name not in known:
        raise CaseError(
            f"--from {name}: no case of this name comes with fdnet{meant(name, known)} (fdnet "
            "init --list)"
        )
    keys = [*(one.key for one in QUESTIONS), "sand_file", "mud_file", "name", "size"]
    for flag in (f"--{key.replace('_', '-')}" for key in keys if getattr(options, key)):
        raise CaseError(f"--from: copies a case as it is; leave {flag} out and edit the copy")
    out = options.out or Path(f"{name}.toml")
    write_new(out, known[name].path.read_text(encoding="utf-8"), force=options.force)
    print(f"{out}: written; fdnet check {out} looks at it, fdnet run {out} runs it")
    return 0


def _designed(options: argparse.Namespace, name: str, out: Path) -> "Design":
    """The design of the answers; on a terminal those that make no case are asked for again."""
    from fdnet.run.pipeline import refusals
    from fdnet.scales.design import BUDGETS, designed, filled
    from fdnet.scales.questions import QUESTIONS, named_in

    texts = {"name": name}
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
                texts,
                BUDGETS[options.size or SIZES[0]],
                folder=out.absolute().parent,
                refusals=refusals,
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
