"""Build the machine, install the box on it, inject the faults, and print the results.

python -m deploy.vm [--namespaces] [--reuse]

If all limits were kept, the results are written to the table of `deploy.box_tests`.
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import yaml

from deploy.box_tests import record
from deploy.vm.drive import BOX, FOLDER, TRACE, NotSeenError, StatusRow, VmDrive, slowness
from deploy.vm.machine import HANG_TIMEOUT_S, Machine, MachineError, new_disk
from deploy.vm.namespaces import Namespaces, new_folder
from deploy.vm.report import figures, table
from deploy.vm.share import BUILD, SHARE, box_build, make_box, make_image
from onboard.security.key_files import write_credentials
from onboard.tools.doctor.finding import FindingLevel, best_levels
from onboard.tools.test_ca.authority import KnownPlate, make_trial
from onboard.vision.settings import CameraSettings
from onboard.wave_udp import psid
from sim_rig.cars.camera_view import SMALL_LENS
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar
from sim_rig.scenario.car_config import plate_digest

INSTALLED = BUILD / "installed.qcow2", BUILD / "installed.raw"
"""The disk and the small disk after install.sh; each run works on copies."""
DRIVEN = BUILD / "driven.qcow2", BUILD / "driven.raw"

SMALL_DISK_BYTES = 48 << 20
IMAGES = 40
TAG_M = 0.4
"""A large tag, for small images, since the guest is slow."""
VIEW = SMALL_LENS.model_dump()
CAR = {
    "car": {"plate": "TAG2"},
    "can": {"interface": "socketcan", "channel": "vcan0"},
    "obd": {"polling_hz": 10.0},
    "camera": {"source": "http://127.0.0.1:8081/car", **VIEW},
    "vision": {"plates": False, "tag_side_m": TAG_M},
    "gnss": {},
    "radio": {"endpoint": "iwcu", "listen_port": 5398, "unit_port": 5399},
    "security": {"keys_folder": "/etc/onboard/keys", "plate_digest": {"scrypt_log2_n": 6}},
    "sensor_timeouts": {"speed_s": 2.0, "camera_s": 3.0, "position_s": 3.0},
    "trace": {"file": TRACE},
    "recorder": {"folder": BOX, "segment_s": 10.0, "ring_mib": 24.0},
}
DOCTOR = best_levels(CAR) | {
    "camera": FindingLevel.DOUBTFUL,  # the rig's is slow, as suits QEMU
    "radio": FindingLevel.DOUBTFUL,  # nobody sends yet
    "keys": FindingLevel.DOUBTFUL,  # the public community key
    "disk": FindingLevel.MISSING,  # a small one, to be filled
}
"""Levels of the subjects that `onboard doctor` reports of the installed box."""
DOCTOR_IN_QEMU = {"clock": FindingLevel.DOUBTFUL}
"""A clock that nothing sets."""
RIG_UNIT = """
[Unit]
Description=The other end of the daemon's wires

[Service]
Type=exec
ExecStart=/opt/onboard/current/venv/bin/python /root/rig.py /root/images /root/keys BUS
# The camera (port 8081) must be ready before the daemon starts, as in a car.
ExecStartPost=/bin/sh -c 'until grep -q :1F91 /proc/net/tcp; do sleep 0.2; done'
Restart=always

[Install]
WantedBy=multi-user.target
"""
MOUNT = f"""
echo '/dev/vdb {FOLDER} ext4 x-systemd.device-timeout=0 0 2' >>/etc/fstab  # late at load
mkdir -p {FOLDER} && mount {FOLDER}
"""
SET_UP = """set -e
sh /share/box/install.sh --vcan
systemctl stop onboard
chown -R onboard:onboard /var/lib/onboard
cp -R /share/keys/ahead /root/keys && chmod -R go= /root/keys
cp -R /share/keys/car /etc/onboard/keys
cp -R /share/rig.py /share/images /root/
cp /share/rig.service /etc/systemd/system/
mkdir -p /etc/systemd/system/onboard.service.d
printf '[Unit]\\nAfter=rig.service\\n' >/etc/systemd/system/onboard.service.d/test.conf
systemctl enable --quiet rig
chown -R onboard:onboard /etc/onboard/keys && chmod -R go= /etc/onboard/keys
cp /share/car.yaml /etc/onboard/car.yaml
echo 'DEVICES="udp://127.0.0.1:5000"' >/etc/default/gpsd
systemctl restart gpsd
sync
"""
"""Installation as described in docs/in-the-car.md."""

ENABLED = (
    "for unit in gpsd.service systemd-networkd.service systemd-networkd-wait-online.service;"
    " do echo $unit $(systemctl is-enabled $unit); done"
)
"""Lists whether the units are enabled that the installation may switch on or off."""
STATE = (
    "find /etc /opt/onboard /var/lib/onboard /usr/local/bin -xdev -not -type d -not -name '*.pyc'"
    " -not -name direct_url.json -not -name RECORD -printf '%p %U %G %m %s\\n' | sort"
)
"""Lists all installed files with owner, mode and size."""


def main() -> int:
    """Run the test; returns 0 if all limits were kept."""
    parser = argparse.ArgumentParser(prog="python -m deploy.vm")
    parser.add_argument("--namespaces", action="store_true", help="in namespaces, without QEMU")
    parser.add_argument(
        "--reuse", action="store_true", help="use the installed disk of the last run"
    )
    arguments = parser.parse_args()
    test = VmTest()
    is_kept = test.run_in_namespaces() if arguments.namespaces else test.run(reuse=arguments.reuse)
    text = test.table()
    print(text)
    if is_kept:
        test.record("box-test" if arguments.namespaces else "vm-test")
    return 0 if is_kept else 1


class VmTest:
    """One run of the test and its results."""

    def __init__(self) -> None:
        self._rows: list[StatusRow] = []
        self._failures: list[str] = []
        self._took_s: dict[str, float] = {}
        self._slowness = 1.0

    def run(self, *, reuse: bool) -> bool:
        """Run all steps, also after a failure; returns whether all limits were kept."""
        self._prepare(reuse=reuse)
        with self._timed("boot"):
            machine = Machine(BUILD, DRIVEN, SHARE, counted=True)
        try:
            self._slowness = slowness(machine)
            machine.run("systemctl start rig; systemctl stop onboard")  # once the rig is ready
            self._doctor(machine)
            drive = VmDrive(machine)
            self._drive(drive)
            recording = drive.newest_recording()
            with self._timed("power cut and boot"):
                machine.cut_power()
                machine = Machine(BUILD, DRIVEN, SHARE, counted=True)
            drive = VmDrive(machine)
            self._do(partial(drive.after_power_cut, recording))
            self._do(drive.stop)
            self._uninstall(machine)
        finally:
            machine.cut_power()
        return self._is_kept()

    def run_in_namespaces(self) -> bool:
        """Run the steps that need no kernel of their own; returns whether all limits were kept."""
        self._make_share("socketcand", {"can": {"interface": "socketcand", "channel": "can0"}})
        folder = BUILD / "namespaces"
        new_folder(folder)
        machine = Namespaces(BUILD, folder, SHARE)
        try:
            with self._timed("install.sh twice"):
                enabled = machine.run(ENABLED, check=False).output
                machine.run(SET_UP, timeout_s=600.0)
                before = machine.run(STATE).output
                machine.run("sh /share/box/install.sh --vcan; systemctl stop onboard")
                if machine.run(STATE).output != before:
                    self._failures.append("a second run of install.sh changes files")
            machine.run("systemctl daemon-reload; systemctl start rig")
            self._doctor(machine)
            drive = VmDrive(machine)
            self._drive(drive)
            self._do(drive.stop)
            machine.cut_power()
            machine = Namespaces(BUILD, folder, SHARE, is_root_read_only=True)
            drive = VmDrive(machine)
            self._do(drive.use_read_only_root)
            self._do(partial(drive.fall_back, "read-only root: "))
            machine.cut_power()
            machine = Namespaces(BUILD, folder, SHARE)
            self._uninstall(machine)
            if (left := machine.run(ENABLED, check=False).output) != enabled:
                self._failures.append(f"uninstall left units as {left}, before: {enabled}")
        finally:
            machine.cut_power()
        return self._is_kept()

    def _is_kept(self) -> bool:
        return not self._failures and all(row.is_kept for row in self._rows)

    def record(self, target: str) -> None:
        """Write the results to the table of the docs."""
        record(target, box_build(), figures(self._rows))

    def table(self) -> str:
        """The results as Markdown."""
        return table(self._rows, self._failures, self._took_s, self._slowness)

    # ---- before the drive ----------------------------------------------------------------

    def _prepare(self, *, reuse: bool) -> None:
        self._make_share("vcan", {})
        if not (reuse and INSTALLED[0].exists()):
            self._install()
        DRIVEN[0].unlink(missing_ok=True)
        new_disk(DRIVEN[0], INSTALLED[0], "qcow2")
        shutil.copyfile(INSTALLED[1], DRIVEN[1])

    def _install(self) -> None:
        disk, small_disk = INSTALLED
        disk.unlink(missing_ok=True)
        new_disk(disk, BUILD / "disk.raw", "raw")
        with small_disk.open("wb") as file:
            file.truncate(0)
            file.truncate(SMALL_DISK_BYTES)
        subprocess.run(["mke2fs", "-q", "-F", "-t", "ext4", small_disk], check=True)
        with self._timed("boot and install.sh"):
            # The host's clock and two cores are faster than counted instructions.
            try:
                machine = Machine(BUILD, INSTALLED, SHARE, counted=False)
                try:
                    machine.run(MOUNT + SET_UP, timeout_s=HANG_TIMEOUT_S - 300.0)
                finally:
                    machine.power_off()
            except MachineError:
                disk.unlink()
                raise

    def _make_share(self, bus: str, changes: dict[str, object]) -> None:
        with self._timed("image (reused between runs)"):
            make_image()
        with self._timed("make box"):
            make_box()
            _fill_share(bus, CAR | changes)

    def _doctor(self, machine: Machine | Namespaces) -> None:
        """Check the findings of `onboard doctor`; in namespaces the clock is this machine's."""
        with self._timed("doctor"):
            command = "runuser -u onboard -- onboard doctor --json --patience 15"
            answer = machine.run(command, check=False)
        found = {each["subject"]: each["level"] for each in json.loads(answer.output)}
        here = DOCTOR_IN_QEMU if isinstance(machine, Machine) else {"clock": found.get("clock")}
        expected = {**DOCTOR, **here}
        if found != expected:
            self._failures.append(f"doctor: {answer.output}")

    # ---- the drive -----------------------------------------------------------------------

    def _drive(self, drive: VmDrive) -> None:
        for step in drive.steps():
            self._do(step)

    def _uninstall(self, machine: Machine | Namespaces) -> None:
        with self._timed("uninstall"):
            machine.run(f"umount {FOLDER}; sh /share/box/install.sh --uninstall --purge")
            left = machine.run(
                "ls -d /opt/onboard /etc/onboard /var/lib/onboard /etc/systemd/system/*onboard*"
                " /etc/systemd/network/*onboard* /etc/sysctl.d/*onboard* /usr/local/bin/onboard"
                " 2>/dev/null",
                check=False,
            )
        if left.output:
            self._failures.append(f"uninstall left {left.output}")

    def _do(self, step: Callable[[], Iterator[StatusRow]]) -> None:
        name = getattr(step, "func", step).__name__.replace("_", " ")
        with self._timed(name):
            try:
                self._rows.extend(step())
            except (NotSeenError, MachineError) as error:
                self._failures.append(f"{name}: {error}")
                print(self._failures[-1], flush=True)

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        began_s = time.monotonic()
        yield
        self._took_s[name] = time.monotonic() - began_s
        print(f"{name}: {self._took_s[name]:.0f} s", flush=True)


def _fill_share(bus: str, car: dict[str, object]) -> None:
    """Write the files that the guest reads: configuration, keys and camera images."""
    shutil.copy(Path(__file__).with_name("rig.py"), SHARE)
    (SHARE / "rig.service").write_text(RIG_UNIT.replace("BUS", bus), encoding="utf-8")
    ocb = car | {"radio": {"endpoint": "raw", "interface": "wlan0"}}
    for name, content in (("car", car), ("car-ocb", ocb)):
        text = yaml.safe_dump(content, sort_keys=False)
        (SHARE / f"{name}.yaml").write_text(text, encoding="utf-8")
    shutil.rmtree(SHARE / "keys", ignore_errors=True)
    (SHARE / "keys").mkdir(mode=0o700)
    digest = plate_digest()
    plates = {"car": KnownPlate("TAG2", digest), "ahead": KnownPlate("TAG1", digest)}
    for name, credentials in make_trial(
        plates, {psid.BSM, psid.LCCA}, time.time(), plates=plates
    ).items():
        write_credentials(SHARE / "keys" / name, credentials)
    if not (SHARE / "images").is_dir():
        (SHARE / "images").mkdir()
        _render(SHARE / "images")


def _render(folder: Path) -> None:
    """Render a car with a tag some 12 m ahead, whose distance varies periodically."""
    renderer = CameraRenderer(CameraSettings(source="rig", **VIEW))
    rng = np.random.default_rng(1)
    for number in range(IMAGES):
        gap_m = 12.0 + 0.3 * np.sin(2 * np.pi * number / IMAGES)
        ahead = SceneCar(ahead_m=gap_m, tag_id=1, tag_side_m=TAG_M)
        image = renderer.draw(Scene(cars=(ahead,), travelled_m=3.75 * number), rng)
        cv2.imwrite(str(folder / f"{number:03}.jpg"), image)


if __name__ == "__main__":
    sys.exit(main())
