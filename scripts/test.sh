#!/usr/bin/env bash
# Set-up, lint, types, all tests. Options are handed to pytest: bash scripts/test.sh -k network
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash scripts/setup.sh --dev
.venv/bin/ruff check .
.venv/bin/ruff format --check --quiet .
.venv/bin/mypy
exec .venv/bin/python -m pytest -n 2 "$@"
