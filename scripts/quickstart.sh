#!/usr/bin/env bash
# From a fresh clone to a first result: sets fdnet up, runs a small case and prints its summary.
# Options are passed on to `fdnet run`. A finished run is not repeated unless --force is given.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash scripts/setup.sh
.venv/bin/fdnet run cases/quick.toml --out runs/quick --resume "$@"
echo
echo "report:   runs/quick/report.html"
echo "pictures: runs/quick/figures/"
echo "ParaView: runs/quick/*.vtp, *.pvd"
