#!/usr/bin/env bash
# Sets fdnet up, then runs the linter, the type checker and all tests.
# Options are passed on to pytest, for example: bash scripts/test.sh -k network
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash scripts/setup.sh --dev
# The first analysis of a version compiles for a minute; the linters run at the same time.
.venv/bin/fdnet permeability tests/data/packC_r5_d2.csv --units mm \
    --periodic yz --box 0,4.1176,0,4.1176,0,4.1176 --compare-laws \
    >/dev/null &
warming=$!
trap 'kill $warming 2>/dev/null || true' EXIT
.venv/bin/ruff check .
.venv/bin/ruff format --check --quiet .
.venv/bin/mypy
if ! wait $warming; then
    echo "test.sh: the analysis that compiles the package failed, see above" >&2
    exit 1
fi
trap - EXIT
# Each of the two processes takes its half of the tests in order, then what the other has left.
export NUMBA_NUM_THREADS=1
exec .venv/bin/python -m pytest -n 2 --dist worksteal "$@"
