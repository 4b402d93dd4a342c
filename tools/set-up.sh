#!/bin/sh
# Makes .venv with exactly what the lock file $1 pins, and installs this project into it.
# Needs python3 (3.11 or later). Debian keeps venv's pip apart: it is installed where we may.
set -eu
cd "$(dirname "$0")/.."

python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    { echo "python3 is $(python3 -V), 3.11 or later is needed" >&2; exit 2; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }

if ! python3 -c 'import ensurepip' 2>/dev/null; then
    echo "python3 has no ensurepip: installing python3-venv"
    as_root apt-get -qq update && as_root apt-get -qq install -y python3-venv ||
        { echo "please install python3-venv (apt-get install python3-venv)" >&2; exit 2; }
fi
echo "setting up .venv from $1, which takes one to three minutes"
[ -x .venv/bin/python ] || python3 -m venv .venv
.venv/bin/python -m pip install --quiet --require-hashes -r "$1"
.venv/bin/python -m pip install --quiet --no-deps --no-build-isolation --editable .
