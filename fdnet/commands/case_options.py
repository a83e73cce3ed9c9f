"""Options of every command that takes a case file."""

import argparse
from typing import Any

from fdnet.case.stages import STAGES
from fdnet.errors import CaseError
from fdnet.files.paths import path_option


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
        help="MPI ranks for LIGGGHTS (default 1); another number of ranks gives another pack from "
        "the same seed, and a cut run is continued with the number it was begun with",
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
