"""The Debian package in namespaces: installed, updated, removed and purged by dpkg, as root.

python -m deploy.vm.deb
"""

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

from deploy.releases import ABOUT, SUMS
from deploy.vm.__main__ import ENABLED
from deploy.vm.drive import FOLDER
from deploy.vm.machine import MachineError
from deploy.vm.namespaces import Namespaces, new_folder
from deploy.vm.share import BUILD, ROOT, SHARE, box_build, make_box, make_image

DEBS = SHARE / "deb"
INSTALL_S = 600.0
LEFT = (
    "ls -d /opt/onboard /etc/onboard /var/lib/onboard /usr/lib/onboard /usr/local/bin/onboard*"
    " /etc/systemd/system/*onboard* /etc/systemd/network/*onboard* /etc/sysctl.d/*onboard*"
    " /etc/udev/rules.d/*onboard* 2>/dev/null; getent passwd onboard; dpkg-query -l onboard"
    " 2>/dev/null | grep onboard"
)
"""Lists what a purge must remove."""


def main() -> int:
    """Run the test; returns 0 if the package does what it says."""
    make_image()
    make_box()
    old, new = box_build(), f"{box_build()}.later"
    shutil.rmtree(DEBS, ignore_errors=True)
    _pack(SHARE / "box")
    _pack(_renamed(SHARE / "box", BUILD / "later", new))
    folder = BUILD / "deb"
    new_folder(folder)
    machine = Namespaces(BUILD, folder, SHARE)
    try:
        _drive_dpkg(machine, old, new)
    except (AssertionError, MachineError) as error:
        print(error)
        return 1
    finally:
        machine.cut_power()
    return 0


def _drive_dpkg(machine: Namespaces, old: str, new: str) -> None:
    enabled = machine.run(ENABLED, check=False).output

    machine.run(f"dpkg --install /share/deb/onboard_{old}_*.deb", INSTALL_S)
    _expect(machine, "systemctl is-enabled onboard gpsd", "enabled\nenabled")
    _expect(machine, "onboard --version", f"onboard {old}")
    _expect(machine, "stat --format '%U %a' /etc/onboard/car.yaml", "root 640")
    machine.run("systemctl stop onboard; echo '# mine' >>/etc/onboard/car.yaml")
    machine.run("onboard-releases proven")
    print("installed")

    machine.run(f"dpkg --install /share/deb/onboard_{new}_*.deb", INSTALL_S)
    _expect(machine, "ls /opt/onboard/releases", f"{old}\n{new}")
    _expect(machine, "readlink /opt/onboard/current", f"releases/{new}")
    machine.run(f"systemctl stop onboard; onboard-releases switch {old}")
    _expect(machine, "readlink /opt/onboard/current", f"releases/{old}")
    _expect(machine, "tail -n 1 /etc/onboard/car.yaml", "# mine")
    print("updated, and back")

    machine.run("dpkg --remove onboard")
    _expect(machine, "ls /opt", "")
    _expect(machine, "tail -n 1 /etc/onboard/car.yaml", "# mine")
    _expect(machine, ENABLED, enabled.strip())
    print("removed")

    machine.run(f"umount {FOLDER}; dpkg --purge onboard")
    _expect(machine, LEFT, "")
    print("purged")


def _expect(machine: Namespaces, command: str, answer: str) -> None:
    output = machine.run(command, check=False).output.strip()
    if output != answer:
        raise AssertionError(f"{command}: {output!r}; expected {answer!r}")


def _pack(box: Path) -> None:
    subprocess.run(["sh", ROOT / "deploy" / "deb" / "deb.sh", box, DEBS], check=True)


def _renamed(box: Path, folder: Path, name: str) -> Path:
    """Copy a folder to install under the name of another release."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(box, folder)
    about = json.loads((folder / ABOUT).read_bytes()) | {"name": name}
    (folder / ABOUT).write_text(json.dumps(about), encoding="utf-8")
    digest = hashlib.sha256((folder / ABOUT).read_bytes()).hexdigest()
    lines = (folder / SUMS).read_text("utf-8").splitlines()
    lines = [f"{digest}  {ABOUT}" if line.endswith(f"  {ABOUT}") else line for line in lines]
    (folder / SUMS).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return folder


if __name__ == "__main__":
    sys.exit(main())
