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
# gpsd-clients draws SciPy and GTK (480 MB); we need one program of it, whose libraries gpsd has.
[ $# -gt 0 ] || command -v gpsdecode >/dev/null || decoder=gpsdecode
wanted="$missing ${decoder:-}"
[ "$wanted" != " " ] || exit 0
command -v apt-get >/dev/null || { echo "no apt-get: tests that need $wanted are skipped"; exit 0; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }
export DEBIAN_FRONTEND=noninteractive

install_decoder() (
    folder=$(mktemp -d) && trap 'rm -r "$folder"' EXIT && cd "$folder" && chmod 755 . &&
        apt-get -qq download gpsd-clients 2>/dev/null &&
        dpkg-deb --fsys-tarfile gpsd-clients_*.deb | tar -xO ./usr/bin/gpsdecode >gpsdecode &&
        as_root install gpsdecode /usr/local/bin/
)

# shellcheck disable=SC2086  # a list of words on purpose
as_root apt-get -qq update >/dev/null &&
    { [ -z "$missing" ] ||
        as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $missing >/dev/null; } &&
    { [ -z "${decoder:-}" ] || install_decoder; } ||
    echo "could not install $wanted: tests that need them are skipped"
exit 0
