"""Which build of this program runs: its version, and commit and date of its source.

A package has them in `build.json`, written when it is built (`setup.py`); a checkout asks git.
"""

import json
import subprocess
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

VERSION = "0.2.0"
"""Raised by the rule of docs/design/deploy.md; pyproject.toml reads it here."""
BUILD_FILE = "build.json"
_PACKAGE = Path(__file__).parents[1]
_COMMIT_DIGITS = 9
_GIT_S = 5.0
"""Longest wait for git in s."""


@dataclass(frozen=True, slots=True)
class Build:
    """Identity of a build."""

    version: str
    commit: str = ""
    """First digits of the commit; empty if unknown."""
    date: str = ""
    """Of the commit, in UTC, as 20261124; empty if unknown."""
    is_modified: bool = False
    """Whether the source differed from the commit."""

    @property
    def name(self) -> str:
        """As 0.2.0+20261124.4f463bb08: a version of PEP 440, which may name a folder."""
        origin = [self.date, self.commit] if self.commit else []
        local = ".".join([*origin, *(["modified"] if self.is_modified else [])])
        return f"{self.version}+{local}" if local else self.version


@cache
def present_build() -> Build:
    """Return the build that runs; without commit and date if nothing tells them."""
    try:
        return Build(**json.loads((_PACKAGE / BUILD_FILE).read_bytes()))
    except FileNotFoundError:
        return build_of_checkout(_PACKAGE.parent)


def build_of_checkout(folder: Path) -> Build:
    """Return what git knows of a folder; without commit and date if it is no checkout."""
    if not (folder / ".git").exists():
        return Build(VERSION)
    try:
        commit, seconds = _git(folder, "show", "--no-patch", "--format=%H %ct", "HEAD").split()
        # Tables are what a build has measured, and no part of it.
        sources = (".", ":(exclude)docs/tables")
        changes = _git(folder, "status", "--porcelain", "--untracked-files=no", "--", *sources)
    except (OSError, subprocess.SubprocessError):
        return Build(VERSION)
    date = f"{datetime.fromtimestamp(int(seconds), UTC):%Y%m%d}"
    return Build(VERSION, commit[:_COMMIT_DIGITS], date, bool(changes))


def write_build(build: Build, package: Path) -> None:
    """Write the identity into the files of a package."""
    text = json.dumps(asdict(build), indent=1)
    (package / BUILD_FILE).write_text(f"{text}\n", encoding="utf-8")


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "--no-optional-locks", "-C", str(folder), *arguments]
    return subprocess.run(  # noqa: S603 (constants and a path)
        command, capture_output=True, text=True, timeout=_GIT_S, check=True
    ).stdout
