#!/bin/sh
# newcomer.sh [LONG]: what a first hour promises, in a fresh clone with a home of its own, and from the
# wheel in an empty folder. Each step is timed; the first that fails ends it. With an argument, `make demo`
# and `make test` too.
set -eu
source=$(cd "$(dirname "$0")/.." && pwd)
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
export HOME="$root/home" PIP_NO_INPUT=1
unset PYTHONPATH VIRTUAL_ENV || true
mkdir "$HOME"

step() {
    name=$1
    shift
    began=$(date +%s)
    if ! "$@" >"$root/log" 2>&1; then
        tail -20 "$root/log"
        echo "FAILED after $(($(date +%s) - began)) s: $name"
        exit 1
    fi
    echo "$(($(date +%s) - began)) s: $name"
}

# The daemon runs until it is stopped; its page is what a newcomer opens.
desk() (
    onboard example desk --out "$root/empty" && cd "$root/empty" || exit 1
    sed -i "s/8460/18461/" desk.yaml
    onboard run desk.yaml &
    for _ in $(seq 120); do
        python - <<'END' && kill $! && wait $! && exit 0
import urllib.request
urllib.request.urlopen("http://127.0.0.1:18461/", timeout=5).read().index(b"<title>")
END
        sleep 0.5
    done
    exit 1
)

step "clone" git clone --quiet "$source" "$root/onboard"
cd "$root/onboard"
if [ $# -gt 0 ]; then
    step "demo" make demo
    grep "^INVALID" "$root/log" || true
fi
step "set up" make .venv/rig-ready
PATH="$root/onboard/.venv/bin:$PATH"
step "a study" sim-rig study lcca-chain --runs 1 --cars 3 --out "$root/studies"
step "a scenario" sim-rig run --virtual --out "$root/out" fig4
step "its replay" onboard replay "$root/out/fig4-virtual/box/red" --expect
step "sdist and wheel" sh -ec 'python setup.py -q sdist --dist-dir "$0"
    python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$0" "$0"/onboard-*.tar.gz' "$root/dist"
[ $# -eq 0 ] || step "test" make test

# From here on a user without a checkout.
cd "$HOME"
mkdir "$root/empty"
step "a new environment" python3 -m venv "$root/venv"
PATH="$root/venv/bin:$PATH"
step "the wheel" sh -c 'pip install --quiet "$(echo "$0"/onboard-*.whl)[rig]"' "$root/dist"
step "its desk" desk
cd "$root/empty"
rm desk.log
step "its lesson" sh -ec 'onboard example lesson && python make_clip.py && onboard see clip.mp4 | grep RD288HX
    onboard replay --can desk.log --clip clip.mp4 --config lesson.yaml | grep fcw'
