#!/usr/bin/env bash
# From a fresh clone to a first damaged formation: set-up, a small case, its summary.
# Options are handed to `fdnet run`. A finished run is not repeated; --force repeats it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash scripts/setup.sh
.venv/bin/fdnet run cases/quick.toml --out runs/quick --resume "$@"
echo
echo "report:   runs/quick/report.html"
echo "pictures: runs/quick/figures/"
echo "ParaView: runs/quick/*.vtp, *.pvd"
