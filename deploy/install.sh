#!/bin/sh
# Installs or updates onboard on a Debian 12 computer. Run as root:
#
#   install.sh [--vcan]              --vcan: a virtual CAN bus, for tests
#   install.sh --uninstall [--purge] --purge: also configuration, keys and recordings
#
# It needs the folder that `make box` creates. Only missing Debian packages are downloaded. A second
# run changes nothing.
set -eu
here=$(dirname "$(realpath "$0")")
files=$here/files
home=/opt/onboard etc=/etc/onboard state=/var/lib/onboard
units=/etc/systemd/system networks=/etc/systemd/network
journal=/etc/systemd/journald.conf.d/onboard.conf
rules=/etc/udev/rules.d/70-onboard.rules
sysctl=/etc/sysctl.d/80-onboard.conf
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
    [ -d "$here/wheels" ] || complain "no wheels in this folder: create it with 'make box'" 2
    add_packages python3-venv gpsd
    add_user
    add_program
    add_configuration
    note_units
    add_system_files
    systemctl daemon-reload
    udevadm control --reload 2>/dev/null || true  # containers have no udev
    /lib/systemd/systemd-sysctl "$sysctl" 2>/dev/null || true  # nor their own kernel
    systemctl try-restart systemd-journald.service
    start_network
    systemctl enable --quiet gpsd.service onboard.service
    systemctl restart --no-block gpsd.service onboard.service
    echo "installed; edit $etc/car.yaml, then: onboard doctor && systemctl restart onboard"
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
    for group in video systemd-journal; do usermod --append --groups "$group" onboard; done
}

add_program() {
    mkdir -p "$home"
    [ -x "$home/venv/bin/python" ] || python3 -m venv "$home/venv"
    pip="$home/venv/bin/python -m pip --isolated --disable-pip-version-check install --quiet"
    pip="$pip --root-user-action=ignore --no-index --find-links $here/wheels"
    $pip --require-hashes --requirement "$here/requirements.lock"
    # The version alone does not identify the build, so it is always reinstalled.
    $pip --no-deps --force-reinstall onboard
    cp "$here/in-the-car.md" "$home/"
    ln -sf "$home/venv/bin/onboard" /usr/local/bin/onboard
}

add_configuration() {
    mkdir -p "$etc"
    [ -e "$etc/car.yaml" ] || cp "$here/car.yaml" "$etc/car.yaml"
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
    mkdir -p "$networks" "${journal%/*}" "${sysctl%/*}" "$units/gpsd.service.d"
    cp "$files/onboard.service" "$units/"
    cp "$files/onboard-gpsd.conf" "$units/gpsd.service.d/onboard.conf"
    cp "$files/onboard-journald.conf" "$journal"
    cp "$files/70-onboard.rules" "$rules"
    cp "$files/80-onboard-sysctl.conf" "$sysctl"
    cp "$files/80-onboard-can.network" "$networks/"
    if [ "$vcan" = yes ]; then
        cp "$files/80-onboard-vcan.netdev" "$files/80-onboard-vcan.network" "$networks/"
    fi
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
    while read -r unit state; do
        case $state in
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

uninstall() {
    systemctl disable --quiet --now onboard.service 2>/dev/null || true
    restore_units
    rm -rf "$home" "$units/gpsd.service.d/onboard.conf" "$units/onboard.service.d"
    rm -f "$units/onboard.service" "$journal" "$rules" "$sysctl" /usr/local/bin/onboard
    rm -f "$networks"/80-onboard-can.network "$networks"/80-onboard-vcan.*
    rmdir "$units/gpsd.service.d" 2>/dev/null || true
    if ip link show vcan0 >/dev/null 2>&1; then ip link delete vcan0; fi
    systemctl daemon-reload
    udevadm control --reload 2>/dev/null || true  # containers have no udev
    if [ "$purge" = yes ]; then
        rm -rf "$etc" "$state"
        userdel onboard 2>/dev/null || true
        echo "uninstalled; all files are removed"
    else
        echo "uninstalled; $etc and $state are kept (--purge removes them)"
    fi
}

main "$@"
