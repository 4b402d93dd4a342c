"""One scenario up the ladder, with the box in QEMU as the last rung, and the rig outside of it.

There SocketCAN, systemd and the rig meet: the bus is a serial line of the machine, of which the box
makes `can0` by slcand, and on which the rig is the ECU. The network is that of QEMU's user mode:
the box has the rig at 10.0.2.2, and the rig has the ports of the box at 127.0.0.1. The disk is the
one that `make vm-test` has installed. QEMU interprets, by the host's clock: where the box is too
slow for real time the run fails or is invalid, and the table says so.

    python -m deploy.vm.qemu_ladder [SCENARIO [CAR]]
"""

import argparse
import json
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

from deploy.box_tests import read_figures, record
from deploy.vm.__main__ import INSTALLED
from deploy.vm.ladder import (
    CAMERA_PORT,
    DETECTOR_PORT,
    NMEA_PORT,
    RADIO_PORT,
    RECORDING,
    UNIT_PORT,
    car_yaml,
    fill_share,
)
from deploy.vm.machine import HANG_TIMEOUT_S, Machine, new_disk
from deploy.vm.share import BUILD, SHARE
from onboard.settings import parse_settings
from sim_rig.boxes.settings import BoxSettings
from sim_rig.runs.ladder import FIGURES
from sim_rig.scenario.schema import Scenario, load_scenario

OUT = BUILD / "qemu-ladder"
DISKS = OUT / "disk.qcow2", OUT / "disk.raw"
MONITOR, DRIVE = OUT / "monitor", OUT / "drive"
LOOPBACK, RIG, BOX = "127.0.0.1", "10.0.2.2", "10.0.2.15"
LINE_BAUD = 115_200
READY_WITHIN_S = 600.0
UP_WITHIN_S = 300
"""Time of the bus to come up."""

FORWARDED = ",".join(
    f"hostfwd=udp:{LOOPBACK}:{port}-:{port}" for port in (RADIO_PORT, NMEA_PORT, DETECTOR_PORT)
)
DEVICES = (
    *("-chardev", "pty,id=bus", "-device", "isa-serial,chardev=bus"),
    *("-netdev", f"user,id=net,{FORWARDED}", "-device", "virtio-net-pci,netdev=net"),
    *("-virtfs", f"local,path={DRIVE},mount_tag=drive,security_model=none"),
    *("-qmp", f"unix:{MONITOR},server=on,wait=off"),
)
SLCAN_UNIT = f"""
[Unit]
Description=The serial line as CAN bus can0
Before=onboard.service

[Service]
ExecStart=/usr/bin/slcand -F -o -c -s6 -S {LINE_BAUD} /dev/ttyS1 can0
Restart=always
"""
DROP_IN = """[Service]
# Interpreted, the daemon is slower than its watchdog allows.
WatchdogSec=0
TimeoutStartSec=infinity
"""
SET_UP = f"""set -e
systemctl stop onboard rig
cp /share/ladder/car.yaml /etc/onboard/
rm -rf /etc/onboard/keys /etc/systemd/system/onboard.service.d
cp -R /share/ladder/keys /etc/onboard/
mkdir -p {RECORDING} /etc/systemd/system/onboard.service.d
mount -t 9p -o trans=virtio,version=9p2000.L drive {RECORDING}
chown -R onboard:onboard /etc/onboard/keys {RECORDING}
chmod -R go= /etc/onboard/keys {RECORDING}
cp /share/ladder/slcan.service /etc/systemd/system/
cp /share/ladder/qemu.conf /etc/systemd/system/onboard.service.d/
for each in /sys/class/net/e*; do
    ip address add {BOX}/24 dev "${{each##*/}}"
    ip link set "${{each##*/}}" up
done
echo 'DEVICES="udp://0.0.0.0:{NMEA_PORT}"' >/etc/default/gpsd
systemctl daemon-reload
systemctl start slcan
timeout {UP_WITHIN_S} sh -c 'until ip link show can0 | grep -q "state UP"; do sleep 1; done'
systemctl start --no-block onboard
"""


def main() -> int:
    """Climb; returns the exit code of `sim-rig ladder`."""
    parser = argparse.ArgumentParser(prog="python -m deploy.vm.qemu_ladder")
    parser.add_argument("scenario", nargs="?", default="fig4")
    parser.add_argument("car", nargs="?", default="red", help="the car that is the box")
    given = parser.parse_args()
    scenario, car = load_scenario(given.scenario), given.car
    if not INSTALLED[0].exists():
        parser.error("no disk is installed: run make vm-test first")
    shutil.rmtree(OUT, ignore_errors=True)
    DRIVE.mkdir(parents=True)
    new_disk(DISKS[0], INSTALLED[0], "qcow2")
    shutil.copyfile(INSTALLED[1], DISKS[1])
    machine = Machine(BUILD, DISKS, SHARE, counted=False, devices=DEVICES)
    try:
        tree = wires(scenario, car, serial_line())
        box = OUT / f"{car}.yaml"
        box.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
        settings = parse_settings(tree, BoxSettings, box.name)
        fill_share(car_in_qemu(scenario, car), scenario, car, settings)
        (SHARE / "ladder" / "slcan.service").write_text(SLCAN_UNIT, encoding="utf-8")
        (SHARE / "ladder" / "qemu.conf").write_text(DROP_IN, encoding="utf-8")
        build = machine.run("onboard --version").output.split()[1]
        print(machine.run(SET_UP, timeout_s=HANG_TIMEOUT_S - 300.0).output, flush=True)
        climb = [sys.executable, "-m", "sim_rig", "ladder", given.scenario]
        code = subprocess.run(
            [*climb, "--box", f"{car}={box}", "--out", OUT], check=False
        ).returncode
        print(machine.run("ip -details -statistics link show can0").output)
        if (OUT / FIGURES).exists():
            record("vm-ladder", build, read_figures(OUT / FIGURES))
        return code
    finally:
        journal = machine.run("journalctl -u onboard -u slcan -o cat", check=False).output
        (OUT / "journal.txt").write_text(journal, encoding="utf-8")
        machine.cut_power()


def serial_line() -> Path:
    """Return the pty of the machine's second serial line, as QEMU names it."""
    with socket.socket(socket.AF_UNIX) as wire:
        wire.connect(str(MONITOR))
        with wire.makefile("rwb") as monitor:
            monitor.write(b'{"execute": "qmp_capabilities"} {"execute": "query-chardev"}')
            monitor.flush()
            _greeting, _done, answer = (json.loads(monitor.readline()) for _ in range(3))
    (name,) = (each["filename"] for each in answer["return"] if each["label"] == "bus")
    return Path(str(name).removeprefix("pty:"))


def wires(scenario: Scenario, car: str, line: Path) -> dict[str, Any]:
    """Tree of the box's `BoxSettings`; `line` is that of its bus."""
    return {
        "plate": scenario.cars[car].identity,
        "bus": {"interface": "slcan", "serial": str(line)},
        "camera": {"port": CAMERA_PORT},
        "radio": {"port": UNIT_PORT, "box_port": RADIO_PORT},
        "satellites": {"port": NMEA_PORT},
        "detector": {"port": DETECTOR_PORT},
        "keys": str(OUT / "trial"),
        "recording": str(DRIVE),
        "ready_within_s": READY_WITHIN_S,
    }


def car_in_qemu(scenario: Scenario, car: str) -> dict[str, Any]:
    """Tree of the box's `CarConfig`."""
    can = {"interface": "socketcan", "channel": "can0"}
    return car_yaml(scenario, car, rig=RIG, box=BOX) | {"can": can}


if __name__ == "__main__":
    sys.exit(main())
