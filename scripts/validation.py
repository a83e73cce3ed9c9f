#!/usr/bin/env python3
"""The evidence for fdnet: error against run time of its choices, and comparisons from outside.

    .venv/bin/python scripts/validation.py NAME [--quick] [--out DIR]
    .venv/bin/python scripts/validation.py list

NAME runs a study, or goes on with it; `NAME --help` says what else it takes. Comparisons with
commands of their own: accuracy, benchmark, truth, outside, mechanics, scoreboard, bridging,
closures, size-classes, both, thesis.
"""

import sys
from collections.abc import Sequence
from importlib import import_module

from fdnet.errors import FdnetError

CHAPTERS: dict[str, str] = {
    "accuracy": "validation.accuracy",
    "benchmark": "validation.benchmark",
    "truth": "validation.truth_solved",
    "outside": "validation.outside",
    "mechanics": "validation.mechanics",
    "scoreboard": "validation.scoreboard",
    "bridging": "validation.bridging",
    "closures": "validation.closures",
    "size-classes": "validation.size_classes",
    "both": "validation.both",
    "thesis": "validation.thesis.command",
}
"""Name and module of the comparisons with a command of their own, `main(arguments) -> int`.

All other names are studies of error against run time.
"""
STUDIES = "validation.study"


def main(arguments: Sequence[str]) -> int:
    """Runs what `arguments` name; returns the exit code."""
    name, *rest = arguments or ["--help"]
    module = CHAPTERS.get(name)
    if name in ("-h", "--help", "list"):
        print(__doc__)
    try:
        if module:
            return int(import_module(module).main(rest))
        return int(import_module(STUDIES).main([name, *rest]))
    except FdnetError as error:
        print(f"validation.py: {error}", file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
