#!/bin/sh
# image.sh FOLDER: creates disk.raw, vmlinuz and initrd of a small Debian 12 in FOLDER.
# Kernel and systemd are Debian's; only vm-agent is added. Needs root (or passwordless sudo) for
# mmdebstrap. Does nothing if the image exists already.
set -eu
here=$(dirname "$(realpath "$0")")
folder=$(realpath -m "$1")
stamp=$(cat "$0" "$here/agent.py" | sha256sum | cut -c1-16)
[ "$(cat "$folder/image.stamp" 2>/dev/null)" != "$stamp" ] || exit 0

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }
missing=""
for package in mmdebstrap qemu-system-x86 qemu-utils e2fsprogs; do
    dpkg-query -Wf '${db:Status-Status}' "$package" 2>/dev/null | grep -q '^installed' ||
        missing="$missing $package"
done
# shellcheck disable=SC2086  # a list of words on purpose
[ -z "$missing" ] || { as_root apt-get -qq update &&
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $missing; }

mkdir -p "$folder"
root=$folder/root
as_root rm -rf "$root"
# A minimal initramfs with the drivers of the disk, since a slow processor unpacks it.
as_root mmdebstrap --quiet --variant=minbase \
    --aptopt='APT::Install-Recommends "false"' --aptopt='Acquire::Languages "none"' \
    --dpkgopt=force-unsafe-io \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' \
    --include=systemd,systemd-sysv,udev,dbus,kmod,iproute2,iw,procps,can-utils,gpsd \
    --include=python3,python3-venv,linux-image-amd64,initramfs-tools \
    --essential-hook='mkdir -p "$1/etc/initramfs-tools/conf.d"' \
    --essential-hook='echo MODULES=list >"$1/etc/initramfs-tools/conf.d/small"' \
    --essential-hook='printf "virtio_pci\nvirtio_blk\next4\n" >"$1/etc/initramfs-tools/modules"' \
    bookworm "$root"

# Set up the machine as an administrator would; deploy/install.sh installs onboard later.
as_root sh -eu -s "$root" "$here/agent.py" <<'SETUP'
root=$1
install -m 755 "$2" "$root/usr/local/sbin/vm-agent"
cat >"$root/etc/systemd/system/vm-agent.service" <<'UNIT'
[Unit]
Description=Runs the commands of the test

[Service]
ExecStart=/usr/local/sbin/vm-agent
KillMode=process
OOMScoreAdjust=-1000
UNIT
mkdir -p "$root/etc/systemd/system/multi-user.target.wants" "$root/etc/systemd/system-generators"
ln -sf ../vm-agent.service "$root/etc/systemd/system/multi-user.target.wants/"
ln -sf /dev/null "$root/etc/systemd/system-generators/systemd-getty-generator"
for unit in apt-daily.timer apt-daily-upgrade.timer dpkg-db-backup.timer e2scrub_all.timer \
    e2scrub_reap.service fstrim.timer getty@tty1.service; do
    ln -sf /dev/null "$root/etc/systemd/system/$unit"
done
ln -sf /lib/systemd/system/multi-user.target "$root/etc/systemd/system/default.target"
echo car >"$root/etc/hostname"
echo '127.0.0.1 localhost car' >"$root/etc/hosts"
echo '/dev/vda / ext4 defaults 0 1' >"$root/etc/fstab"
mkdir -p "$root/share"
SETUP

as_root cp "$root"/boot/vmlinuz-* "$folder/vmlinuz"
as_root cp "$root"/boot/initrd.img-* "$folder/initrd"
truncate -s 4G "$folder/disk.raw"
as_root mke2fs -q -F -t ext4 -d "$root" "$folder/disk.raw"
as_root rm -rf "$root"
as_root chown "$(id -u):$(id -g)" "$folder"/disk.raw "$folder"/vmlinuz "$folder"/initrd
echo "$stamp" >"$folder/image.stamp"
