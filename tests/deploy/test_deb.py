"""The Debian package: it installs, updates and removes releases as install.sh does."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from deploy.releases import Releases
from tests.deploy.bundles import DEPLOY, boot, make_bundle

OLD, NEW = "0.2.0+20261117.aaaaaaaaa", "0.3.0+20261124.bbbbbbbbb"

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        os.geteuid() != 0 or shutil.which("dpkg-deb") is None, reason="needs Debian, as root"
    ),
]


def packed(folder: Path, name: str, unknown: str = "none") -> Path:
    """A package of a small release."""
    bundle = make_bundle(folder / name, name, unknown=unknown)
    subprocess.run(["sh", DEPLOY / "deb" / "deb.sh", bundle, folder / "deb"], check=True)
    (package,) = (folder / "deb").glob(f"onboard_{name}_*.deb")
    return package


def dpkg(root: Path, *action: str | Path) -> subprocess.CompletedProcess[str]:
    """Run dpkg on a computer below `root`; what the package depends on is not there."""
    folder = root / "var" / "lib" / "dpkg"
    (folder / "info").mkdir(parents=True, exist_ok=True)
    (folder / "updates").mkdir(exist_ok=True)
    (folder / "status").touch()
    options = (f"--root={root}", "--force-script-chrootless", "--force-depends", "--log=/dev/null")
    return subprocess.run(["dpkg", *options, *action], capture_output=True, text=True, check=False)


def test_an_update_lies_beside_the_release_before_and_a_purge_leaves_nothing(
    tmp_path: Path,
) -> None:
    root = tmp_path / "root"
    assert dpkg(root, "--install", packed(tmp_path, OLD)).returncode == 0
    assert boot(root) == f"{OLD} drives"
    Releases(root).proven()
    (root / "etc/onboard/car.yaml").write_text("car: {plate: MINE1}\n")
    (root / "var/lib/onboard").mkdir(parents=True)

    assert dpkg(root, "--install", packed(tmp_path, NEW)).returncode == 0
    assert boot(root) == f"{NEW} drives"
    assert Releases(root).names() == [OLD, NEW]
    assert "MINE1" in (root / "etc/onboard/car.yaml").read_text()

    assert dpkg(root, "--remove", "onboard").returncode == 0
    assert not (root / "opt/onboard").exists()
    assert not (root / "etc/systemd/system/onboard.service").exists()
    assert "MINE1" in (root / "etc/onboard/car.yaml").read_text()

    assert dpkg(root, "--purge", "onboard").returncode == 0
    assert not (root / "etc/onboard").exists()
    assert not (root / "var/lib/onboard").exists()


def test_a_release_that_is_refused_leaves_the_one_in_use(tmp_path: Path) -> None:
    root = tmp_path / "root"
    dpkg(root, "--install", packed(tmp_path, OLD))

    refused = dpkg(root, "--install", packed(tmp_path, NEW, unknown="plate"))

    assert refused.returncode == 1
    assert f"{NEW} is installed, and cannot read" in refused.stderr
    assert boot(root) == f"{OLD} drives"


@pytest.mark.skipif(shutil.which("lintian") is None, reason="no lintian")
def test_lintian_finds_nothing(tmp_path: Path) -> None:
    found = subprocess.run(
        ["lintian", packed(tmp_path, OLD)], capture_output=True, text=True, check=False
    )
    assert found.stdout == ""
