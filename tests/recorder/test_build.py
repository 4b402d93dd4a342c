"""Identity of a build: from git in a checkout, from the package where it is installed."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from onboard.recorder.build import VERSION, Build, build_of_checkout, present_build

ROOT = Path(__file__).parents[2]
IDENTITY = ("-c", "user.name=a", "-c", "user.email=a@b")


def git(folder: Path, *arguments: str) -> str:
    command = ["git", *IDENTITY, "-C", str(folder), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    git(tmp_path, "init", "--quiet")
    (tmp_path / "file").write_text("one")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "--quiet", "--message=one", "--date=2026-11-24T00:00:00Z")
    return tmp_path


def test_a_build_is_named_like_a_version_and_a_folder() -> None:
    assert Build("0.2.0", "4f463bb4b", "20261124").name == "0.2.0+20261124.4f463bb4b"
    assert Build("0.2.0", "4f463bb4b", "20261124", is_modified=True).name.endswith(".modified")
    assert Build("0.2.0").name == "0.2.0"


def test_a_checkout_is_named_by_its_commit(checkout: Path) -> None:
    commit = git(checkout, "rev-parse", "HEAD").strip()

    build = build_of_checkout(checkout)

    assert build.version == VERSION
    assert len(build.commit) >= 7
    assert commit.startswith(build.commit)
    assert build.date.isdecimal()
    assert not build.is_modified


def test_a_checkout_that_differs_from_its_commit_says_so(checkout: Path) -> None:
    (checkout / "file").write_text("two")
    (checkout / "notes").write_text("of no commit")

    assert build_of_checkout(checkout).is_modified


def test_a_table_that_a_build_has_written_does_not_modify_it(checkout: Path) -> None:
    table = checkout / "docs" / "tables" / "box-tests.csv"
    table.parent.mkdir(parents=True)
    table.touch()
    git(checkout, "add", "docs")
    assert not build_of_checkout(checkout).is_modified


def test_a_folder_that_is_no_checkout_has_a_version_only(tmp_path: Path) -> None:
    assert build_of_checkout(tmp_path) == Build(VERSION)
    (tmp_path / ".git").mkdir()
    assert build_of_checkout(tmp_path) == Build(VERSION)


@pytest.mark.long
def test_a_package_carries_the_identity_of_the_checkout_that_it_was_built_from(
    tmp_path: Path,
) -> None:
    subprocess.run(["git", "clone", "--quiet", ROOT, tmp_path / "clone"], check=True)
    wheel = ["pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", "out"]
    subprocess.run([sys.executable, "-m", *wheel, "."], cwd=tmp_path / "clone", check=True)
    (built,) = (tmp_path / "clone" / "out").glob(f"onboard-{VERSION}-*.whl")
    with zipfile.ZipFile(built) as package:
        package.extractall(tmp_path / "installed")

    version = subprocess.run(
        [sys.executable, "-m", "onboard", "--version"],
        cwd=tmp_path / "installed",
        capture_output=True,
        text=True,
        check=True,
    )

    assert version.stdout == f"onboard {build_of_checkout(tmp_path / 'clone').name}\n"
    assert present_build().commit in version.stdout
