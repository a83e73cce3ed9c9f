"""`fdnet run`, `check`, `render` and `cases`: commands on a case, and options they share."""

import argparse
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.errors import PAGE, CaseError
from fdnet.files import path_option
from fdnet.names import STAGES

if TYPE_CHECKING:
    from fdnet.case.case import Case
    from fdnet.scales.check import Checked
    from fdnet.scales.scales import Scales


def add_case(parser: argparse.ArgumentParser) -> None:
    """Adds the case file, --seed, --set and --np to a parser."""
    add_file_and_set(parser)
    add_ranks(parser)


def add_file_and_set(parser: argparse.ArgumentParser) -> None:
    """Adds the case file, --seed and --set to a parser."""
    parser.add_argument("case", type=path_option, metavar="CASE.toml", help="the case file")
    add_overrides(parser, example="fines.count=500")


def add_overrides(parser: argparse.ArgumentParser, *, example: str) -> None:
    """Adds --seed and --set to a parser; the help of --set shows `example`."""
    parser.add_argument("--seed", type=int, help="overrides the seed of the case")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help=f"overrides a key, e.g. {example}",
    )


def add_ranks(parser: argparse.ArgumentParser) -> None:
    """Adds --np to a parser."""
    parser.add_argument(
        "--np",
        type=_ranks,
        default=1,
        metavar="N",
        help="MPI ranks of LIGGGHTS for invasion and clean-up (default 1); packing takes one, and "
        "a cut invasion is continued with the number it was begun with",
    )


def add_program(parser: argparse.ArgumentParser) -> None:
    """Adds --liggghts, --launcher and --timeout to a parser."""
    parser.add_argument("--liggghts", metavar="PATH", help="the LIGGGHTS binary")
    parser.add_argument(
        "--launcher",
        metavar="TEMPLATE",
        help="how several MPI ranks are started, with {ranks} for their number, e.g. "
        "'srun -n {ranks}' (default: the mpirun of LIGGGHTS)",
    )
    parser.add_argument(
        "--timeout",
        type=float,
        metavar="SECONDS",
        help="stop LIGGGHTS after this time (continue with --resume)",
    )


def stages_of(text: str) -> tuple[str, ...]:
    """The stages that --stages names. Raises CaseError for others, and for none."""
    names = [part.strip() for part in text.split(",") if part.strip()]
    unknown = [name for name in names if name not in STAGES]
    if unknown or not names:
        raise CaseError(
            f"--stages: {text!r} has {unknown or 'nothing'}, expected some of {','.join(STAGES)}"
        )
    return tuple(stage for stage in STAGES if stage in names)


def _ranks(text: str) -> int:
    if not text.isdecimal() or len(text) > 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}, expected a number of ranks, 1 or more")
    return int(text)


def case_of(options: argparse.Namespace) -> Any:
    """The case that the options name, with --set and --seed applied."""
    from fdnet.case.file import read_case

    return read_case(options.case, assignments=overrides_of(options))


def overrides_of(options: argparse.Namespace) -> list[str]:
    """The assignments of --set, then that of --seed."""
    seed = [] if options.seed is None else [f"seed={options.seed}"]
    return [*options.set, *seed]


# ------------------------------------------------------------------------------------------------
# `fdnet cases`: list the shipped cases, or copy one.


def add_cases(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    cases = commands.add_parser(
        "cases", parents=[common], help="list the cases that come with fdnet, or copy one"
    )
    cases.add_argument("name", nargs="?", help="the case to copy (default: list all)")
    cases.add_argument("--out", type=path_option, help="file to write (default NAME.toml)")
    cases.add_argument("--force", action="store_true", help="replace a file that is there")
    cases.set_defaults(action=_cases)


def _cases(options: argparse.Namespace) -> int:
    import difflib

    from fdnet.case.file import shipped_cases
    from fdnet.files import write_new

    known, name = {case.name: case for case in shipped_cases()}, options.name
    if name is None:
        for case in known.values():
            print(f"{case.name:<24} {case.about}")
        return 0
    if name not in known:
        near = difflib.get_close_matches(name, list(known), n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise CaseError(f"{name}: no case of this name comes with fdnet{hint} (fdnet cases)")
    out = options.out or Path(f"{name}.toml")
    write_new(out, known[name].path.read_text(encoding="utf-8"), force=options.force)
    print(f"{out}: written; fdnet check {out} looks at it, fdnet run {out} runs it")
    return 0


# ------------------------------------------------------------------------------------------------
# `fdnet check`: what is odd about a case, what to do about it, and what the run takes.


def add_check(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    check = commands.add_parser(
        "check", parents=[common], help="say what is odd about a case, and what it takes"
    )
    add_case(check)
    check.add_argument("--json", action="store_true", help="print the findings as JSON")
    check.set_defaults(action=_check)


def _check(options: argparse.Namespace) -> int:
    from fdnet.scales.scales import scales_of

    case = case_of(options)
    result = looked_at(case, scales_of(case))
    if options.json:
        print(json.dumps(result.data(), indent=2))
    else:
        print("\n".join(result.lines()))
    for one in result.findings:
        if one.refused:
            raise CaseError(f"fdnet run refuses this case: {one.what}")
    return 0


def looked_at(case: "Case", scales: "Scales") -> "Checked":
    """The case with all that `fdnet run` would say or refuse."""
    from fdnet.run.pipeline import refusals
    from fdnet.scales.check import checked

    return checked(case, scales, tuple(refusals(case, scales)))


# ------------------------------------------------------------------------------------------------
# `fdnet render`: write the decks without LIGGGHTS and print the scales.


def add_render(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    render = commands.add_parser(
        "render", parents=[common], help="write the decks without LIGGGHTS and print the scales"
    )
    add_case(render)
    render.add_argument("--out", type=path_option, required=True, help="folder for the decks")
    render.set_defaults(action=_render)


def _render(options: argparse.Namespace) -> int:
    from fdnet.dem.invade_deck import render_decks
    from fdnet.run.folder import is_run_folder
    from fdnet.scales.scales import scales_of
    from fdnet.scales.table import scale_rows

    case = case_of(options)
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
    print("\n".join(looked_at(case, scales).lines()))
    for deck in decks:
        print(f"deck: {deck}")
    return 0


# ------------------------------------------------------------------------------------------------
# `fdnet run`: pack, invade, analyse and report one case.


def add_run(commands: Any, common: argparse.ArgumentParser) -> None:
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
    from fdnet.report.text import seconds_line, summary_lines
    from fdnet.run.pipeline import run_stages
    from fdnet.run.records import RunOptions, cores

    case = case_of(options)
    out, printed = options.out or Path("runs") / case.name, []

    def tell(summary: Mapping[str, Any]) -> None:
        """The answer, as soon as it is known: the pictures may take longer than it did."""
        if summary and not options.json:
            try:
                print("\n".join(summary_lines(summary)), flush=True)
            except BrokenPipeError:  # the reader has gone; the run goes on to its end
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            printed.append(summary)

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
        answered=tell,
    )
    if options.np > cores():
        _warn(
            f"--np {options.np}: this machine has {cores()} cores, so the run will be slower than "
            f"with --np {cores()}"
        )
    summary = run_stages(case, chosen)
    for text in summary.get("warnings", []):
        if text.endswith((f"{PAGE}#no-picture)", f"{PAGE}#no-view)")):
            _warn(text)
    if options.json:
        print(json.dumps(summary, indent=2))
        return 0
    if not printed:
        tell(summary)
    done = "done (the analysis was not among the stages)"
    print(seconds_line(summary) if summary else done)
    print(f"run folder: {out}")
    return 0


def _warn(text: str) -> None:
    print(f"fdnet: warning: {text}", file=sys.stderr, flush=True)
