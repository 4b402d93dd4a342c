#!/bin/sh
# deb.sh BOX FOLDER: packs BOX, a folder of box.sh, as a Debian package into FOLDER.
# The package carries BOX as it is, and its scripts run BOX/install.sh: a release is installed beside
# those that are there, as without it. DEBFULLNAME, DEBEMAIL: its maintainer.
set -eu
here=$(dirname "$(realpath "$0")")
box=$1 folder=$2
about() { sed -E "s/.*\"$1\": \"([^\"]+)\".*/\1/" "$box/release.json"; }
version=$(about name)
case $(about architecture) in
x86_64) architecture=amd64 ;;
aarch64) architecture=arm64 ;;
*) echo "deb.sh: Debian has no $(about architecture)" >&2 && exit 2 ;;
esac
maintainer="${DEBFULLNAME:-The maintainers of onboard} <${DEBEMAIL:-maintainers@onboard.example}>"

tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
doc=$tree/usr/share/doc/onboard
mkdir -p "$tree/DEBIAN" "$tree/usr/lib/onboard" "$doc"
cp -R "$box" "$tree/usr/lib/onboard/box"
cp "$here/copyright" "$here/../../NOTICE" "$doc/"
printf '%s\n' "onboard ($version) stable; urgency=medium" '' '  * The release of that commit.' '' \
    " -- $maintainer  $(date --rfc-email --reference="$box/release.json")" |
    gzip -9n >"$doc/changelog.gz"
cp "$here/postinst" "$here/prerm" "$here/postrm" "$tree/DEBIAN/"
chmod -R u=rwX,go=rX "$tree"
chmod 755 "$tree/DEBIAN"/p* "$tree/usr/lib/onboard/box/"*.sh "$tree/usr/lib/onboard/box/releases.py"
sed -e "s/@version/$version/; s/@architecture/$architecture/; s/@maintainer/$maintainer/" \
    -e "s/@size/$(du -sk --apparent-size "$tree/usr" | cut -f 1)/" \
    "$here/control" >"$tree/DEBIAN/control"
(cd "$tree" && find usr -type f | LC_ALL=C sort | xargs -d '\n' md5sum) >"$tree/DEBIAN/md5sums"
chmod 644 "$tree/DEBIAN/control" "$tree/DEBIAN/md5sums"
mkdir -p "$folder"
# Wheels are compressed already, and xz would take minutes.
dpkg-deb --root-owner-group -Zgzip -z1 --build "$tree" "$folder/onboard_${version}_$architecture.deb"
