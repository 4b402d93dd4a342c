#!/bin/sh
# Debian packages that some tests hold us against (tshark, gpsd, ...), and libraries that SUMO's
# wheel leaves to the system. Installed where we are allowed to; where not, those tests skip and say
# so. Names given are installed in their place.
set -u
PACKAGES="${*:-tshark gpsd softhsm2 libgl1 libxext6 libxrender1 libatomic1}"

missing=""
for package in $PACKAGES; do
    dpkg-query -Wf '${db:Status-Status}' "$package" 2>/dev/null | grep -q '^installed' ||
        missing="$missing $package"
done
[ -n "$missing" ] || exit 0
command -v apt-get >/dev/null || { echo "no apt-get: tests that need$missing are skipped"; exit 0; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086  # a list of words on purpose
as_root apt-get -qq update >/dev/null &&
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $missing >/dev/null ||
    echo "could not install$missing: tests that need them are skipped"
exit 0
