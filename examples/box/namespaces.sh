#!/bin/sh
# A box without hardware: a daemon in namespaces with a network address and clocks of its own, on the
# wires of red.yaml; the bus is served by socketcand. Needs no root, util-linux and iproute2; sim-rig
# and onboard are those of the PYTHON that is given. Afterwards the recording of the box is played
# onto its wires: does it decide as a replay does?
#
#   PYTHON=.venv/bin/python examples/box/namespaces.sh [ladder SCENARIO | run SCENARIO [OPTION]... | score]
set -eu
if [ -z "${IN_NAMESPACES:-}" ]; then
    IN_NAMESPACES=1 exec unshare --user --map-root-user --net --pid --mount-proc --fork \
        --kill-child "$0" "$@"
fi
here=$(dirname "$0")
[ $# -gt 0 ] || set -- ladder fig4
case $1 in
ladder) car=red= rung=box ;;
score) car= ;;
*) car=red= rung=live ;;
esac
folder=out/box
rm -rf "$folder"
mkdir -p "$folder"
served='s|^bus:.*|bus: {host: 192.168.77.1, port: 29536}|'
sed -e "$served" -e '/^fetch:/d' -e "s|^recording:.*|recording: $folder/drive|" \
    -e "s|^keys:.*|keys: $folder/trial|" "$here/red.yaml" > "$folder/red.yaml"
bus='can: {interface: socketcand, channel: can0, host: 192.168.77.1, port: 29536}'
sed -e "s|^can:.*|$bus|" -e "s|/etc/onboard/keys|$folder/trial/red|" \
    -e "s|/var/lib/onboard/drive|$folder/drive, pictures_hz: 30, picture_quality: 95|" "$here/car.yaml" > "$folder/car.yaml"
echo 'seed: 7' >> "$folder/car.yaml"    # a drive that is played has answers to its questions

# The daemon, with the UTC of a file, restarted as by systemd, and started while there are wires.
onboard="$PYTHON -m sim_rig.processes.settable_clock $folder/utc run $folder/car.yaml"
wires="until : </dev/tcp/192.168.77.1/8090; do sleep 0.5; done 2>/dev/null"
unshare --net --time --monotonic 1000 bash -c "
    until $wires; $onboard & echo \$! > $folder/daemon; wait \$!; do sleep 1; done; exec sleep 3600
" > "$folder/car.log" 2>&1 &
box=$!
ip link set lo up
until [ "$(readlink "/proc/$box/ns/net")" != "$(readlink /proc/self/ns/net)" ]; do sleep 0.1; done
ip link add rig type veth peer name box netns "$box"
ip address add 192.168.77.1/24 dev rig
ip link set rig up
nsenter --target "$box" --net sh -c '
    ip link set lo up; ip address add 192.168.77.2/24 dev box; ip link set box up
'
"$PYTHON" -m sim_rig doctor "$folder/red.yaml" --out "$folder"
# A recording of the run alone: when a box opens a camera again that was away is a matter of chance.
kill -KILL "$(cat "$folder/daemon")"
"$PYTHON" -m sim_rig "$@" --box "$car$folder/red.yaml" --out "$folder"
[ "$1" != score ] || exit 0
recording=$folder/$2-$rung/box/red
"$PYTHON" -m onboard replay --expect "$recording"

kill "$(cat "$folder/daemon")"
cat >> "$folder/red.yaml" <<END
start: [nsenter, --target, "$box", --net, $(echo "$onboard" | sed 's/ /, /g')]
set_clock: [sh, -c, "echo {utc} > $folder/utc"]
END
"$PYTHON" -m sim_rig play "$recording" --box "$folder/red.yaml" --out "$folder"
"$PYTHON" -m onboard replay --expect "$folder/red-played/box/red"
