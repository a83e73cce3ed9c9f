#!/usr/bin/env python3
"""The evidence for fdnet: error against run time of its choices, and comparisons from outside.

    .venv/bin/python scripts/validation.py NAME [--quick] [--out DIR]
    .venv/bin/python scripts/validation.py list
    .venv/bin/python scripts/validation.py page [--redraw]

NAME runs a study, or goes on with it. `page` runs nothing: it writes docs/validation.md from the
committed tables in docs/validation, with `--redraw` also the figure and text of each study.
"""

import argparse
import sys
from pathlib import Path

from fdnet.errors import FdnetError
from validation.command import add_arguments, run
from validation.pages.validation import redraw, write_page

DOCS = Path(__file__).resolve().parents[1] / "docs"


def main() -> int:
    """Parse the arguments and run; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_arguments(parser)
    given = parser.parse_args()
    if given.name == "page":
        if given.redraw:
            redraw(DOCS / "validation")
        print(write_page(DOCS))
        return 0
    try:
        return run(given)
    except FdnetError as error:
        print(f"validation.py: {error}", file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
