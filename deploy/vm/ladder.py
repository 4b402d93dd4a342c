"""One scenario up the ladder, with the installed box as the last rung: systemd in namespaces.

The rig has a network namespace of its own, connected with that of the box, so that nothing else
has the addresses of both. Needs root.

    python -m deploy.vm.ladder [SCENARIO [CAR]]
"""

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from deploy.box_tests import read_figures, record
from deploy.vm.namespaces import Namespaces, new_folder
from deploy.vm.share import BUILD, SHARE, box_build, make_box, make_image
from onboard.settings import parse_settings
from sim_rig.boxes.settings import BoxSettings
from sim_rig.boxes.trial_keys import run_credentials
from sim_rig.cars.camera_view import calibration
from sim_rig.runs.ladder import FIGURES
from sim_rig.scenario.car_config import car_config, gnss_config
from sim_rig.scenario.schema import Scenario, load_scenario

OUT = BUILD / "ladder"
RIG, BOX = "192.168.77.1", "192.168.77.2"
BUS_PORT, CAMERA_PORT, UNIT_PORT = 29536, 8090, 5398
RADIO_PORT, NMEA_PORT, DETECTOR_PORT = 5399, 5000, 5300
RECORDING = "/var/lib/onboard/black-box"

SET_UP = f"""set -e
sh /share/box/install.sh
systemctl stop onboard
cp /share/ladder/car.yaml /etc/onboard/
cp -R /share/ladder/keys /etc/onboard/
chown -R onboard:onboard /etc/onboard/keys && chmod -R go= /etc/onboard/keys
echo 'DEVICES="udp://0.0.0.0:{NMEA_PORT}"' >/etc/default/gpsd
systemctl restart gpsd
mkdir -p /etc/systemd/system/onboard.service.d
cp /share/ladder/wait.conf /etc/systemd/system/onboard.service.d/
systemctl daemon-reload
systemctl start --no-block onboard
"""
WAIT = f"""[Service]
# A box is switched on for its own rung: starting in vain would take the time of the others.
ExecStartPre=/bin/bash -c 'until : </dev/tcp/{RIG}/{CAMERA_PORT}; do sleep 0.5; done 2>/dev/null'
TimeoutStartSec=infinity
"""


def main() -> int:
    """Climb; returns the exit code of `sim-rig ladder`."""
    parser = argparse.ArgumentParser(prog="python -m deploy.vm.ladder")
    parser.add_argument("scenario", nargs="?", default="fig4")
    parser.add_argument("car", nargs="?", default="red", help="the car that is the box")
    given = parser.parse_args()
    scenario, car = load_scenario(given.scenario), given.car
    if car not in scenario.equipped:
        parser.error(f"no such equipped car (given {car!r}); cars: {', '.join(scenario.equipped)}")
    make_image()
    make_box()
    shutil.rmtree(OUT, ignore_errors=True)
    new_folder(OUT / "namespaces")
    machine = Namespaces(BUILD, OUT / "namespaces", SHARE)
    try:
        box = OUT / f"{car}.yaml"
        tree = wires(scenario, car, machine.init)
        box.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
        settings = parse_settings(tree, BoxSettings, box.name)
        fill_share(car_yaml(scenario, car), scenario, car, settings)
        machine.run(SET_UP, timeout_s=600.0)
        climb = [sys.executable, "-m", "sim_rig", "ladder", given.scenario]
        with connected(machine) as in_network:
            code = subprocess.run(
                [*in_network, *climb, "--box", f"{car}={box}", "--out", OUT], check=False
            ).returncode
        if code == 0:
            record("box-ladder", box_build(), read_figures(OUT / FIGURES))
        return code
    finally:
        journal = machine.run("journalctl -u onboard -o cat", check=False).output
        (OUT / "journal.txt").write_text(journal, encoding="utf-8")
        machine.cut_power()


def wires(scenario: Scenario, car: str, init: str) -> dict[str, Any]:
    """Tree of the box's `BoxSettings`.

    Args:
        scenario: the scenario.
        car: name of the car that is the box.
        init: process of the box's systemd, through which its files are seen.
    """
    drive = OUT / "drive"
    return {
        "plate": scenario.cars[car].identity,
        "bus": {"host": RIG, "port": BUS_PORT},
        "camera": {"host": RIG, "port": CAMERA_PORT},
        "radio": {"host": RIG, "port": UNIT_PORT, "box_host": BOX, "box_port": RADIO_PORT},
        "satellites": {"host": BOX, "port": NMEA_PORT},
        "detector": {"host": BOX, "port": DETECTOR_PORT},
        "keys": str(OUT / "trial"),
        "recording": str(drive),
        "fetch": ["cp", "-rT", f"/proc/{init}/root{RECORDING}", str(drive)],
    }


def car_yaml(scenario: Scenario, car: str, rig: str = RIG, box: str = BOX) -> dict[str, Any]:
    """Tree of the box's `CarConfig`, with the addresses of rig and box as the latter sees them."""
    config = car_config(scenario, car, seed=scenario.seed)
    config["security"]["keys_folder"] = "/etc/onboard/keys"
    config |= {
        "can": {"interface": "socketcand", "channel": "can0", "host": rig, "port": BUS_PORT},
        "camera": {"source": f"http://{rig}:{CAMERA_PORT}/{car}"}
        | calibration(scenario.lens).model_dump(),
        "radio": {
            "endpoint": "iwcu",
            "listen_host": box,
            "listen_port": RADIO_PORT,
            "unit_host": rig,
            "unit_port": UNIT_PORT,
        },
        "recorder": {"folder": RECORDING},
    }
    if scenario.gnss is not None:
        config["gnss"] = gnss_config(scenario.gnss)
    if scenario.detector is not None:
        config["detector"] = {"host": box, "port": DETECTOR_PORT}
    return config


def fill_share(config: Mapping[str, Any], scenario: Scenario, car: str, box: BoxSettings) -> None:
    """Make the keys, and write what the box reads, with its `config`."""
    run_credentials(scenario, {car: box}, time.time())
    folder = SHARE / "ladder"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(box.keys / car, folder / "keys")
    (folder / "car.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    (folder / "wait.conf").write_text(WAIT, encoding="utf-8")


@contextmanager
def connected(machine: Namespaces) -> Iterator[list[str]]:
    """Connect the box with a network of the rig's; yields the command that enters the latter."""
    rig = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
    try:
        while Path(f"/proc/{rig.pid}/ns/net").readlink() == Path("/proc/self/ns/net").readlink():
            time.sleep(0.05)
        in_network = ["nsenter", "--target", str(rig.pid), "--net"]
        to_box = f"ip link add rig type veth peer name box netns {machine.init}"
        here = f"ip link set lo up; {to_box}; ip address add {RIG}/24 dev rig; ip link set rig up"
        subprocess.run([*in_network, "sh", "-ec", here], check=True)
        machine.run(f"ip address add {BOX}/24 dev box; ip link set box up")
        yield in_network
    finally:
        rig.kill()
        rig.wait()


if __name__ == "__main__":
    sys.exit(main())
