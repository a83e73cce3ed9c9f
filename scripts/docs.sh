#!/usr/bin/env bash
# Builds the documentation site into docs/_build/html, with warnings as errors, and checks its
# links without a network. The tutorials run for real while it is built.
#
#   bash scripts/docs.sh [--no-tutorials]
#
#   --no-tutorials   show the tutorials without running them (quick, for work on the text)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

execute=force
for option in "$@"; do
    case "$option" in
    --no-tutorials) execute=off ;;
    -h | --help)
        sed -n '2,/^set -e/s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
        exit 0
        ;;
    *)
        printf "docs: unknown option '%s': expected --no-tutorials or --help\n" "$option" >&2
        exit 2
        ;;
    esac
done

bash scripts/setup.sh
stamp="$(sha256sum pyproject.toml)"
if [ "$(cat .venv/.fdnet-docs 2>/dev/null)" != "$stamp" ]; then
    echo "docs: installing Sphinx and its extensions into .venv"
    .venv/bin/python -m pip install -q --disable-pip-version-check --no-input -e '.[docs]'
    printf '%s\n' "$stamp" >.venv/.fdnet-docs
fi
rm -rf docs/_build
export PATH="$PWD/.venv/bin:$PATH" FDNET_DOCS_EXECUTE="$execute"
export IPYTHONDIR="$PWD/docs/_build/ipython" JUPYTER_RUNTIME_DIR="$PWD/docs/_build/jupyter"
# What is left out of the messages: that the tutorials' Python listens on this machine unencrypted.
.venv/bin/python -m sphinx -j 2 -b html -W --keep-going -q docs docs/_build/html \
    2> >(grep -v 'IPKernelApp.*without encryption' >&2)
.venv/bin/python docs/_ext/check_links.py docs/_build/html
echo "docs: docs/_build/html/index.html"
