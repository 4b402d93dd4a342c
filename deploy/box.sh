#!/bin/sh
# box.sh FOLDER: collects everything to install on a box with install.sh.
# The wheels are for Debian 12's Python and this processor's architecture, or ARCH=aarch64.
set -eu
cd "$(dirname "$0")/.."
folder=$1 arch=${ARCH:-$(uname -m)}
mkdir -p "$folder/wheels"
rm -f "$folder"/wheels/onboard-*.whl
.venv/bin/python -m pip download --quiet --disable-pip-version-check --dest "$folder/wheels" \
    --only-binary :all: --implementation cp --python-version 3.11 \
    --platform "manylinux_2_28_$arch" --platform "manylinux_2_17_$arch" \
    --platform "manylinux2014_$arch" --platform any \
    --require-hashes --requirement deploy/requirements.lock
.venv/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation \
    --wheel-dir "$folder/wheels" .
rm -rf build/lib build/bdist.*
cp -R deploy/install.sh deploy/requirements.lock deploy/files docs/in-the-car.md "$folder/"
cp examples/car.yaml "$folder/car.yaml"
