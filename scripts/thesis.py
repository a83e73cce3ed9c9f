#!/usr/bin/env python3
"""Write docs/thesis.md from docs/thesis.md.in and the tables of the study `thesis`.

    .venv/bin/python scripts/thesis.py [--docs docs]

Runs nothing and draws nothing, so it takes a second.
"""

import argparse
import sys
from pathlib import Path

from fdnet.files import path_option
from validation.thesis.page.document import write_page

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Parse the arguments and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--docs", type=path_option, default=ROOT / "docs", help="where to read and write"
    )
    print(write_page(parser.parse_args().docs))
    return 0


if __name__ == "__main__":
    sys.exit(main())
