#!/bin/sh
# Installs or updates onboard on a Debian 12 computer. Run as root:
#
#   install.sh [--vcan]              --vcan: a virtual CAN bus, for tests
#   install.sh --uninstall [--purge] --purge: also configuration, keys and recordings
#
# It needs the folder that `make box` creates. Only missing Debian packages are downloaded. A second
# run changes nothing. Ended at any moment, it leaves the old release or the new one (releases.py);
# another run completes it. Of a system whose root is read-only it writes only what differs.
#
# ONBOARD_ROOT: a folder in place of /, for tests; users, packages and units are left as they are.
set -eu
here=$(dirname "$(realpath "$0")")
files=$here/files
root=${ONBOARD_ROOT:-}
home=$root/opt/onboard etc=$root/etc/onboard state=$root/var/lib/onboard
units=$root/etc/systemd/system networks=$root/etc/systemd/network
journal=$root/etc/systemd/journald.conf.d/onboard.conf
rules=$root/etc/udev/rules.d/70-onboard.rules
sysctl=$root/etc/sysctl.d/80-onboard.conf
programs=$root/usr/local/bin
before=$home/units-before

complain() { echo "install.sh: $1" >&2; exit "${2:-1}"; }

main() {
    action=install vcan=no purge=no
    for option; do
        case $option in
        --vcan) vcan=yes ;;
        --uninstall) action=uninstall ;;
        --purge) purge=yes ;;
        *) complain "unknown option $option; see the head of this file" 2 ;;
        esac
    done
    [ "$(id -u)" = 0 ] || complain "must be run as root" 2
    [ "$purge" = no ] || [ "$action" = uninstall ] || complain "--purge is for --uninstall" 2
    "$action"
}

install() {
    mkdir -p "$home"
    exec 9>"$home/lock"
    flock --nonblock 9 || complain "another installation is at work" 2
    if [ -z "$root" ]; then
        add_packages python3 gpsd
        add_user
    fi
    add_configuration
    add_release
    add_system_files
    rm -rf "$home/venv"  # of a build before releases.py
    [ -n "$root" ] || start_units
    echo "installed; edit $etc/car.yaml, then: onboard doctor && systemctl restart onboard"
}

start_units() {
    note_units
    systemctl daemon-reload
    udevadm control --reload 2>/dev/null || true  # containers have no udev
    /lib/systemd/systemd-sysctl "$sysctl" 2>/dev/null || true  # nor their own kernel
    systemctl try-restart systemd-journald.service
    start_network
    for unit in gpsd.service onboard.service; do
        systemctl is-enabled --quiet "$unit" || systemctl enable --quiet "$unit"
    done
    systemctl restart --no-block gpsd.service onboard.service
}

add_packages() {
    missing=""
    for package; do
        dpkg-query -Wf '${db:Status-Status}' "$package" 2>/dev/null | grep -q '^installed' ||
            missing="$missing $package"
    done
    [ -n "$missing" ] || return 0
    export DEBIAN_FRONTEND=noninteractive
    # shellcheck disable=SC2086  # a list of words on purpose
    apt-get -qq update && apt-get -qq install -y --no-install-recommends $missing ||
        complain "please install$missing"
}

add_user() {
    getent passwd onboard >/dev/null ||
        useradd --system --user-group --home-dir "$state" --shell /usr/sbin/nologin onboard
    for group in video systemd-journal; do
        id -nG onboard | grep -qw "$group" || usermod --append --groups "$group" onboard
    done
}

# The release that is installed decides whether a new one may be; the first one itself. Its units are
# put with it.
add_release() {
    releases=$home/onboard-releases
    [ -x "$releases" ] || releases=$here/releases.py
    ONBOARD_LOCKED=1 "$releases" --root "$root/" install "$here"
    put "$here/releases.py" "$home/onboard-releases" 755
}

# Writes a file if it differs, by one rename.
put() {
    if cmp -s "$1" "$2"; then return 0; fi
    mkdir -p "${2%/*}"
    cp "$1" "$2.new" || complain "$2 differs, and cannot be written: mount -o remount,rw /"
    chmod "${3:-644}" "$2.new"
    sync "$2.new"
    mv "$2.new" "$2"
}

put_link() {
    [ "$(readlink "$2")" != "$1" ] || return 0
    mkdir -p "${2%/*}"
    ln -s "$1" "$2.new"
    mv -T "$2.new" "$2"
}

add_configuration() {
    mkdir -p "$etc"
    [ -e "$etc/car.yaml" ] || put "$here/car.yaml" "$etc/car.yaml"
    [ -z "$root" ] || return 0
    chown -R root:onboard "$etc"
    chmod 750 "$etc"
    chmod 640 "$etc/car.yaml"
    # Only the service's user may read the keys.
    if [ -d "$etc/keys" ]; then
        chown -R onboard:onboard "$etc/keys"
        chmod -R u=rwX,go= "$etc/keys"
    fi
}

add_system_files() {
    put "$files/onboard-gpsd.conf" "$units/gpsd.service.d/onboard.conf"
    put "$files/onboard-journald.conf" "$journal"
    put "$files/70-onboard.rules" "$rules"
    put "$files/80-onboard-sysctl.conf" "$sysctl"
    for file in 79-onboard-slcan.network 80-onboard-can.network; do
        put "$files/$file" "$networks/$file"
    done
    if [ "$vcan" = yes ]; then
        for file in 80-onboard-vcan.netdev 80-onboard-vcan.network; do
            put "$files/$file" "$networks/$file"
        done
    fi
    put_link /opt/onboard/current/venv/bin/onboard "$programs/onboard"
    put_link /opt/onboard/onboard-releases "$programs/onboard-releases"
}

# Writes down which units were enabled, once, for the uninstallation.
note_units() {
    [ ! -e "$before" ] || return 0
    for unit in gpsd.service systemd-networkd.service systemd-networkd-wait-online.service; do
        echo "$unit $(systemctl is-enabled "$unit" 2>/dev/null || true)"
    done >"$before.new"
    mv "$before.new" "$before"
}

restore_units() {
    [ -e "$before" ] || return 0
    while read -r unit was; do
        case $was in
        enabled) systemctl enable --quiet "$unit" ;;
        disabled) systemctl disable --quiet --now "$unit" ;;
        esac
    done <"$before"
}

start_network() {
    # networkd manages only the interfaces of these files; other network software keeps the rest. So
    # the boot must not wait for networkd to be online.
    if ! systemctl is-enabled --quiet systemd-networkd.service; then
        systemctl enable --quiet systemd-networkd.service
        systemctl disable --quiet systemd-networkd-wait-online.service
    fi
    systemctl restart systemd-networkd.service
}

stop_units() {
    systemctl disable --quiet --now onboard.service 2>/dev/null || true
    restore_units
}

# Removes a folder; where a partition is mounted, only what is in it.
remove() {
    if mountpoint -q "$1"; then find "$1" -mindepth 1 -delete; else rm -rf "$1"; fi
}

uninstall() {
    [ -n "$root" ] || stop_units
    rm -rf "$units/gpsd.service.d/onboard.conf" "$units/onboard.service.d"
    rm -f "$units/onboard.service" "$units/onboard-proven.service" "$journal" "$rules" "$sysctl"
    rm -f "$programs/onboard" "$programs/onboard-releases"
    rm -f "$networks"/79-onboard-slcan.network "$networks"/80-onboard-can.network
    rm -f "$networks"/80-onboard-vcan.*
    rmdir "$units/gpsd.service.d" 2>/dev/null || true
    if [ -z "$root" ]; then
        if ip link show vcan0 >/dev/null 2>&1; then ip link delete vcan0; fi
        systemctl daemon-reload
        udevadm control --reload 2>/dev/null || true  # containers have no udev
    fi
    remove "$home"
    if [ "$purge" = yes ]; then
        remove "$etc"
        remove "$state"
        [ -n "$root" ] || userdel onboard 2>/dev/null || true
        echo "uninstalled; all files are removed"
    else
        echo "uninstalled; $etc and $state are kept (--purge removes them)"
    fi
}

main "$@"
