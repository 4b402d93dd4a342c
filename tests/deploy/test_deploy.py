"""Installed packages, their licences, and the sandbox of the service."""

import re
import shutil
import subprocess
from importlib.metadata import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UNIT = ROOT / "deploy" / "files" / "onboard.service"


def pinned(lock: Path) -> set[str]:
    return set(re.findall(r"^([\w.-]+==\S+)", lock.read_text(), re.MULTILINE))


@pytest.mark.parametrize("lock", ["deploy/requirements.lock", "requirements-rig.lock"])
def test_a_box_and_the_demo_get_the_package_versions_of_the_tests(lock: str) -> None:
    assert pinned(ROOT / lock) < pinned(ROOT / "requirements.lock")


def test_no_installed_package_is_under_the_gpl() -> None:
    """One package is under the LGPL: a library that the user may replace."""
    names = {pin.split("==")[0] for pin in pinned(ROOT / "deploy" / "requirements.lock")}
    names.discard("colorama")  # for Windows

    assert {name for name in names if "GPL" in licences(name)} == {"python-can"}
    assert "LGPL" in licences("python-can")


def test_the_notice_names_each_package_whose_licence_is_not_permissive() -> None:
    names = {pin.split("==")[0] for pin in pinned(ROOT / "requirements.lock")}
    notice = (ROOT / "NOTICE").read_text("utf-8")

    asks_more = {name for name in names - {"colorama"} if re.search("GPL|MPL", licences(name))}
    assert {"python-can", "libsumo", "pycrate", "hypothesis"} <= asks_more
    assert {name for name in asks_more if name not in notice} == set()


def licences(name: str) -> str:
    about = metadata(name)
    first_lines = [each.partition("\n")[0] for each in about.get_all("License") or ()]
    return f"{first_lines} {about.get_all('License-Expression')} {about.get_all('Classifier')}"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze")
def test_the_service_is_sandboxed() -> None:
    """At most 2.0 of 10, as `systemd-analyze security` counts exposure."""
    result = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--threshold=20", str(UNIT)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-300:] + result.stderr


def test_a_serial_adapter_is_not_held_back_by_what_its_driver_refuses() -> None:
    """The first file that matches counts. The driver of slcan knows no restart."""
    files = {file.name: file.read_text() for file in (ROOT / "deploy" / "files").glob("*.network")}
    of_all = min(name for name, text in files.items() if "Name=can*\n\n" in text)
    of_slcan = [name for name, text in files.items() if "Name=can*\nDriver=can\n" in text]

    assert "RestartSec=" in files[of_all]
    assert [name < of_all for name in of_slcan] == [True]
    assert "RestartSec=" not in files[of_slcan[0]].partition("[Match]")[2]


def test_scripts_parse_in_a_posix_shell() -> None:
    for script in (ROOT / "deploy").rglob("*.sh"):
        subprocess.run(["sh", "-n", str(script)], check=True)
