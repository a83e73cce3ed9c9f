"""Options of every command that takes a case file."""

import argparse
from typing import Any

from fdnet.files.paths import path_option


def add_case(parser: argparse.ArgumentParser) -> None:
    """Adds the case file, --seed, --set and --np to a parser."""
    parser.add_argument("case", type=path_option, metavar="CASE.toml", help="the case file")
    parser.add_argument("--seed", type=int, help="overrides the seed of the case")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="overrides a key, e.g. fines.count=500",
    )
    parser.add_argument(
        "--np",
        type=_ranks,
        default=1,
        metavar="N",
        help="MPI ranks for LIGGGHTS (default 1); another number of ranks gives another pack from "
        "the same seed, and a cut run is continued with the number it was begun with",
    )


def _ranks(text: str) -> int:
    if not text.isdecimal() or len(text) > 9 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}, expected a number of ranks, 1 or more")
    return int(text)


def case_of(options: argparse.Namespace) -> Any:
    """The case that the options name, with --set and --seed applied."""
    from fdnet.case.file import read_case

    seed = [] if options.seed is None else [f"seed={options.seed}"]
    return read_case(options.case, assignments=[*options.set, *seed])
