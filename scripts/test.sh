#!/usr/bin/env bash
# Sets fdnet up, then runs the linter, the type checker and all tests.
# Options are passed on to pytest, for example: bash scripts/test.sh -k network
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash scripts/setup.sh --dev
.venv/bin/ruff check .
.venv/bin/ruff format --check --quiet .
.venv/bin/mypy
exec .venv/bin/python -m pytest -n 2 "$@"
