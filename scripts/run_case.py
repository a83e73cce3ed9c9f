#!/usr/bin/env python3
"""Run one case: `scripts/run_case.py CASE.toml` equals `fdnet run CASE.toml`."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    try:
        from fdnet.cli import main as fdnet
    except ImportError as error:
        python = ROOT / ".venv" / "bin" / "python"
        if not python.exists() or sys.prefix == str(python.parents[1]):
            print(
                f"run_case: fdnet is not installed ({error}); run bash scripts/setup.sh first",
                file=sys.stderr,
            )
            return 2
        os.execv(python, [str(python), *sys.argv])
    return fdnet(["run", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
