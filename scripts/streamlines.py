#!/usr/bin/env python3
"""Speed and streamlines of the fluid in a finished run, without and with its fines.

.venv/bin/python scripts/streamlines.py runs/quick --png streamlines.png
"""

import argparse

from fdnet.files import path_option
from fdnet.studies.dem.streamlines import draw_streamlines

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("run", type=path_option, metavar="RUN_DIR")
parser.add_argument("--png", type=path_option, required=True, help="write the picture here")

if __name__ == "__main__":
    options = parser.parse_args()
    print(draw_streamlines(options.run, options.png))
