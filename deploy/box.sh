#!/bin/sh
# box.sh FOLDER: collects everything to install on a box with install.sh.
# The wheels are for Debian 12's Python and this processor's architecture, or ARCH=aarch64.
# KEYS: folder of the root of the trial, which signs the release.
set -eu
cd "$(dirname "$0")/.."
folder=$1 arch=${ARCH:-$(uname -m)}
mkdir -p "$folder/wheels"
rm -f "$folder"/wheels/onboard-*.whl
for lock in deploy/requirements.lock deploy/installer.lock; do
    .venv/bin/python -m pip download --quiet --disable-pip-version-check \
        --dest "$folder/wheels" --only-binary :all: --implementation cp --python-version 3.11 \
        --platform "manylinux_2_28_$arch" --platform "manylinux_2_17_$arch" \
        --platform "manylinux2014_$arch" --platform any \
        --require-hashes --requirement "$lock"
done
.venv/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation \
    --wheel-dir "$folder/wheels" .
rm -rf build/lib build/bdist.*
cp -R deploy/install.sh deploy/releases.py deploy/requirements.lock deploy/files "$folder/"
cp docs/in-the-car.md examples/car.yaml "$folder/"

build=$(.venv/bin/python -m onboard --version | cut -d ' ' -f 2)
printf '{"name": "%s", "architecture": "%s", "python": "3.11"}\n' "$build" "$arch" \
    >"$folder/release.json"
rm -f "$folder"/SHA256SUMS*
(cd "$folder" && find -- * -type f | LC_ALL=C sort | xargs sha256sum) >"$folder.sums"
mv "$folder.sums" "$folder/SHA256SUMS"
[ -z "${KEYS:-}" ] || .venv/bin/python -m onboard keys sign "$folder/SHA256SUMS" --root "$KEYS"
(cd "$folder" && sha256sum SHA256SUMS)  # where trust begins: docs/in-the-car.md
