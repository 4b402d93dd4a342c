"""The package: an sdist builds the wheel, which has all that a first hour needs."""

import re
import subprocess
import sys
import tarfile
import time
import urllib.request
from pathlib import Path

import pytest

from onboard.errors import UserError
from onboard.recorder.build import present_build
from onboard.tools.example_cli import EXAMPLES, example
from tests.docs.test_pages import PAGES, ROOT

_STARTS_WITHIN_S = 60.0


def run(*command: str | Path, cwd: Path) -> str:
    """Run this Python in isolation, and return what it prints."""
    ended = subprocess.run(
        [sys.executable, *command],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package as pip installs it from the wheel that the sdist builds, without dependencies."""
    folder = tmp_path_factory.mktemp("package")
    pip = ("-m", "pip", "--quiet", "--disable-pip-version-check")
    offline = ("--no-deps", "--no-build-isolation", "--no-index")
    run("setup.py", "-q", "egg_info", "-e", folder, "sdist", "-d", folder, cwd=ROOT)
    (archive,) = folder.glob("onboard-*.tar.gz")
    with tarfile.open(archive) as source:
        source.extractall(folder, filter="data")
    (unpacked,) = (path for path in folder.glob("onboard-*") if path.is_dir())
    run(*pip, "wheel", *offline, "--wheel-dir", folder, unpacked, cwd=folder)
    (wheel,) = folder.glob("onboard-*.whl")
    run(*pip, "install", *offline, "--target", folder / "site", wheel, cwd=folder)
    return folder / "site"


@pytest.mark.long
def test_the_installed_desk_serves_its_page(installed: Path, tmp_path: Path) -> None:
    path = f"import sys; sys.path.insert(0, {str(installed)!r})"
    onboard = ("-c", f"{path}; from onboard.tools.cli import main; main()")
    assert run(*onboard, "--version", cwd=tmp_path) == f"onboard {present_build().name}\n"
    for name in EXAMPLES:
        run(*onboard, "example", name, cwd=tmp_path)
    page = "http://127.0.0.1:18460/"
    config = tmp_path / "desk.yaml"
    config.write_text(config.read_text("utf-8").replace("8460", "18460"), encoding="utf-8")

    with subprocess.Popen([sys.executable, *onboard, "run", "desk.yaml"], cwd=tmp_path) as desk:
        try:
            text = first_answer(page)
        finally:
            desk.terminate()

    assert "<title>" in text
    assert desk.returncode == 0


@pytest.mark.long
def test_the_installed_help_names_pages_whose_links_hold(installed: Path, tmp_path: Path) -> None:
    path = f"import sys; sys.path.insert(0, {str(installed)!r})"
    shown = run("-c", f"{path}; from onboard.tools.cli import app; app(['--help'])", cwd=tmp_path)

    first = Path(shown.split("Documentation: ")[1].strip())
    pages = list(first.parent.rglob("*.md"))
    assert first == installed / "onboard" / "pages" / "README.md"
    assert {page.name for page in pages} >= {path.name for path in PAGES}
    for page in pages:
        for target in re.findall(r"\]\((?!\w+:)([^)\s#]+)", page.read_text("utf-8")):
            assert (page.parent / target).exists(), (page, target)


def first_answer(address: str) -> str:
    """The page, as soon as it is there: a process starts in its own time."""
    until = time.monotonic() + _STARTS_WITHIN_S
    while True:
        try:
            with urllib.request.urlopen(address, timeout=5.0) as answer:  # noqa: S310 (our own)
                return str(answer.read().decode())
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


def test_an_example_is_written_with_the_files_that_it_names_into_a_new_folder(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "trial" / "desk"
    example("desk.yaml", folder)

    assert "file: desk.log" in (folder / "desk.yaml").read_text("utf-8")
    log = (folder / "desk.log").read_bytes()
    assert log == (ROOT / "examples/desk.log").read_bytes()


def test_a_file_of_two_examples_is_written_once_and_none_is_replaced(tmp_path: Path) -> None:
    example("desk", tmp_path)
    example("lesson", tmp_path)
    (tmp_path / "desk.log").write_text("mine", encoding="utf-8")

    with pytest.raises(UserError, match=r"desk\.log: exists; remove it"):
        example("lesson", tmp_path)
    assert (tmp_path / "desk.log").read_text("utf-8") == "mine"
    with pytest.raises(UserError, match=r"desk\.log/here: cannot be made: Not a directory"):
        example("lesson", tmp_path / "desk.log" / "here")
