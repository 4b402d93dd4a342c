"""Cuts the power while the folder of `make box` is installed: does every box come up?

    python -m deploy.power_cuts build/box [--cuts 50] [--table FILE]

First installation, update and downgrade take turns, each cut at a random moment: every process of
install.sh is ended at once by SIGKILL, below a folder in place of /. The box then has to get ready
with the old release or the new one. Each cut is written down when it is done, so that another run
goes on where this one ended.
"""

import argparse
import csv
import fcntl
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
import yaml

from deploy.releases import ABOUT, SIGNATURE, SUMS, Bundle

REPOSITORY = Path(__file__).parents[1]
WORK = Path("out/power-cuts")
NONE = "not installed"
TOOL = "onboard-releases"
READY_WITHIN_S = 60
_SEED = 42


@dataclass(frozen=True, slots=True)
class Installation:
    """What is installed on which box."""

    step: str
    before: str
    """Release that is in use before."""
    wanted: str


@dataclass(frozen=True, slots=True)
class CutInstallation:
    """One cut, and what the box started afterwards."""

    number: int
    step: str
    after_s: str
    """Since the start of install.sh."""
    came_up: str
    """`old`, `new`, or why it did not get ready."""

    @property
    def is_good(self) -> bool:
        """Whether the box came up without anybody's help."""
        return self.came_up in ("old", "new")


def cut(install_sh: Path, root: Path, after_s: float) -> bool:
    """Begin to install, and end every process of it at once.

    Returns:
        whether it was not done yet.
    """
    process = _install(install_sh, root)
    try:
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        return True
    finally:
        _end(process, root)
    return False


def _end(process: subprocess.Popen[bytes], root: Path) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        lock = root / "opt" / "onboard" / "lock"
        if lock.exists():  # its children have it until they are gone
            with lock.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX)


def _install(install_sh: Path, root: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        ["sh", install_sh],
        env=os.environ | {"ONBOARD_ROOT": str(root)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def started_release(root: Path, configuration: Path) -> str:
    """Start the box as its unit does.

    Returns:
        the release whose daemon is ready; `NONE` if none is installed; else the last line of the
        daemon.
    """
    home = root / "opt" / "onboard"
    if not (home / "current").is_symlink():
        return NONE
    if (home / TOOL).exists():
        _releases(root, "started")
    daemon = home / "current" / "venv" / "bin" / "onboard"
    process = subprocess.Popen(
        ["timeout", str(READY_WITHIN_S), daemon, "run", configuration],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None  # noqa: S101 (it is a pipe)
    last = f"not ready within {READY_WITHIN_S} s"
    with process:
        for last in process.stdout:
            if '"event": "ready"' in last:
                process.terminate()
                return (home / "current").readlink().name
    return last.strip()


def _releases(root: Path, action: str) -> None:
    tool = root / "opt" / "onboard" / TOOL
    subprocess.run([sys.executable, tool, "--root", root, action], check=True)


class Box:
    """A box below a folder, of which each state before an installation is kept."""

    def __init__(self, work: Path, bundles: Mapping[str, Path]) -> None:
        """Install each of `bundles` once."""
        self._root, self._states = work / "root", work / "states"
        self._bundles = bundles
        self._configuration = work / "car.yaml"
        log = str(REPOSITORY / "examples" / "desk.log")
        tree = {"car": {"plate": "GN417KB"}, "can": {"interface": "log", "file": log}}
        self._configuration.write_text(yaml.safe_dump(tree), encoding="utf-8")
        shutil.rmtree(self._states, ignore_errors=True)
        (self._states / NONE).mkdir(parents=True)
        for name in bundles:
            self._put(NONE)
            self.takes_s = self._complete(name)
            _releases(self._root, "proven")
            self._root.rename(self._states / name)

    def cut(self, installation: Installation, rng: np.random.Generator) -> tuple[float, str]:
        """Cut one installation.

        Returns:
            when, s since its start, and what came up.
        """
        while True:
            self._put(installation.before)
            after_s, began_s = rng.uniform(0.0, self.takes_s), time.monotonic()
            if cut(self._bundles[installation.wanted] / "install.sh", self._root, after_s):
                return after_s, self._came_up(installation)
            self.takes_s = time.monotonic() - began_s

    def _came_up(self, installation: Installation) -> str:
        found = started_release(self._root, self._configuration)
        if found == installation.wanted:
            return "new"
        if found != installation.before:
            return found
        if found == NONE:
            self._complete(installation.wanted)
        return "old"

    def _complete(self, name: str) -> float:
        """Install; return how long it takes, s."""
        began_s = time.monotonic()
        code = _install(self._bundles[name] / "install.sh", self._root).wait()
        took_s = time.monotonic() - began_s
        found = started_release(self._root, self._configuration)
        if code != 0 or found != name:
            raise SystemExit(f"{name} cannot be installed: exit code {code}, {found}")
        return took_s

    def _put(self, state: str) -> None:
        """Restore a state at the same place, since environments name theirs."""
        shutil.rmtree(self._root, ignore_errors=True)
        subprocess.run(["cp", "-a", "--link", self._states / state, self._root], check=True)


def with_other_name(bundle: Path, folder: Path) -> Path:
    """Make another release of a folder to install: the same files under another name."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(bundle, folder, ignore=shutil.ignore_patterns(SIGNATURE))
    about = json.loads((bundle / ABOUT).read_bytes())
    text = json.dumps(about | {"name": f"{about['name']}.before"}).encode()
    (folder / ABOUT).write_bytes(text)
    lines = (bundle / SUMS).read_text("utf-8").splitlines()
    others = [line for line in lines if line.partition("  ")[2] != ABOUT]
    sums = [*others, f"{hashlib.sha256(text).hexdigest()}  {ABOUT}"]
    (folder / SUMS).write_text("\n".join(sums) + "\n", encoding="utf-8")
    return folder


def _done(file: Path) -> list[CutInstallation]:
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as opened:
        return [CutInstallation(int(row.pop("number")), **row) for row in csv.DictReader(opened)]


def _cuts(
    file: Path, box: Box, steps: list[Installation], numbers: range
) -> Iterator[CutInstallation]:
    """Yield the cuts of these numbers, each after it is written to `file`."""
    for number in numbers:
        installation = steps[number % len(steps)]
        after_s, came_up = box.cut(installation, np.random.default_rng([_SEED, number]))
        done = CutInstallation(number, installation.step, f"{after_s:.2f}", came_up)
        is_new = not file.exists()
        with file.open("a", newline="", encoding="utf-8") as opened:
            writer = csv.writer(opened, lineterminator="\n")
            if is_new:
                writer.writerow(field.name for field in fields(CutInstallation))
            writer.writerow(astuple(done))
        yield done


def write_table(file: Path, done: list[CutInstallation]) -> None:
    """Write how many boxes came up with which release, a row for each kind of installation."""
    found = Counter((each.step, each.came_up if each.is_good else "neither") for each in done)
    with file.open("w", newline="", encoding="utf-8") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        writer.writerow(("installation", "cuts", "old", "new", "neither", "latest_cut_s"))
        for step in dict.fromkeys(each.step for each in done):
            counts = [found[step, came_up] for came_up in ("old", "new", "neither")]
            latest = max(float(each.after_s) for each in done if each.step == step)
            writer.writerow((step, sum(counts), *counts, f"{latest:.1f}"))


def main() -> int:
    """Cut as often as asked; return 1 if a box did not come up."""
    parser = argparse.ArgumentParser(prog="python -m deploy.power_cuts")
    parser.add_argument("bundle", type=Path, help="folder of make box")
    parser.add_argument("--cuts", type=int, default=50)
    parser.add_argument("--table", type=Path, help="CSV file to write")
    arguments = parser.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    work = WORK.resolve()
    folders = (arguments.bundle, with_other_name(arguments.bundle, work / "before"))
    new, old = (Bundle(folder).name for folder in folders)
    file = work / f"{new}.csv"
    done = _done(file)
    if len(done) < arguments.cuts:
        box = Box(work, dict(zip((new, old), folders, strict=True)))
        steps = [
            Installation("first", NONE, new),
            Installation("update", old, new),
            Installation("downgrade", new, old),
        ]
        for each in _cuts(file, box, steps, range(len(done), arguments.cuts)):
            done.append(each)
            when = f"{each.step}, cut after {each.after_s} s"
            print(f"{len(done)} of {arguments.cuts}: {when}: {each.came_up}", flush=True)
    good = sum(each.is_good for each in done)
    print(f"{good} of {len(done)} came up with the old or the new release; each cut is in {file}")
    if arguments.table is not None:
        write_table(arguments.table, done)
    return int(good < len(done))


if __name__ == "__main__":
    sys.exit(main())
