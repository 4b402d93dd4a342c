"""What goes onto a box: which packages, under which licences, and how the service is shut in."""

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


def test_a_box_gets_the_versions_that_the_tests_ran_with() -> None:
    assert pinned(ROOT / "deploy" / "requirements.lock") < pinned(ROOT / "requirements.lock")


def test_nothing_in_a_car_is_under_the_gpl() -> None:
    """One package is under the lesser one: a library that the user may exchange."""
    names = {pin.split("==")[0] for pin in pinned(ROOT / "deploy" / "requirements.lock")}
    names.discard("colorama")  # for Windows

    assert {name for name in names if "GPL" in licences(name)} == {"python-can"}
    assert "LGPL" in licences("python-can")


def licences(name: str) -> str:
    about = metadata(name)
    return f"{about.get('License-Expression')} {about.get_all('Classifier')}"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze")
def test_the_service_is_shut_in() -> None:
    """At most 2.0 of 10, as `systemd-analyze security` counts exposure."""
    result = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--threshold=20", str(UNIT)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-300:] + result.stderr


def test_scripts_are_scripts_of_any_posix_shell() -> None:
    for script in (ROOT / "deploy").rglob("*.sh"):
        subprocess.run(["sh", "-n", str(script)], check=True)
