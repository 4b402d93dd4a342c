"""Cuts the power while the folder of `make box` is installed: does every box come up?

    python -m deploy.power_cuts build/box [--cuts 50] [--table FILE]

First installation, update and downgrade take turns, each cut at a random moment: every process of
install.sh is ended at once by SIGKILL, below a folder in place of /. A third of the moments is
after the switch of `current`, which is near the end. The box then has to get ready with the new
release if `current` was switched, and else with the old one; if there was none, another run of
install.sh has to complete it. Each cut is written down when it is done, so that another run goes on
where this one ended.
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
POLL_S = 0.001
"""Interval at which `current` is read."""
STEPS = ("first", "update", "downgrade")
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
    current: str
    """`old` or `new`: which release `current` named after the cut."""
    came_up: str
    """`old`, `new`, or why it did not get ready."""

    @property
    def is_good(self) -> bool:
        """Whether the box came up with the release that was in use, without anybody's help."""
        return self.came_up == self.current


def cut(
    install_sh: Path, root: Path, after_s: float, switched_to: str | None = None
) -> float | None:
    """Begin to install, and end every process of it at once.

    Args:
        install_sh: of the folder to install.
        root: folder in place of /.
        after_s: when, since the start, or since `current` is `switched_to` if this is given.
        switched_to: name of the release that is installed.

    Returns:
        when it was cut, s since the start; `None` if it was done before.
    """
    began_s = time.monotonic()
    process = _install(install_sh, root)
    try:
        if switched_to is not None:
            _await_switch(process, root, switched_to)
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        return time.monotonic() - began_s
    finally:
        _end(process, root)
    return None


def _await_switch(process: subprocess.Popen[bytes], root: Path, name: str) -> None:
    while current_release(root) != name and process.poll() is None:
        time.sleep(POLL_S)


def current_release(root: Path) -> str:
    """Name of the release that `current` names; `NONE` without one."""
    try:
        return (root / "opt" / "onboard" / "current").readlink().name
    except OSError:
        return NONE


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
    if current_release(root) == NONE:
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
                return current_release(root)
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
            self._takes_s, self._after_switch_s = self._complete(name)
            _releases(self._root, "proven")
            self._root.rename(self._states / name)

    def cut(
        self, installation: Installation, rng: np.random.Generator, *, is_switched: bool
    ) -> tuple[float, str, str]:
        """Cut one installation, after its switch if `is_switched`.

        Returns:
            when, s since its start, which release `current` named then, and what came up.
        """
        wanted = installation.wanted
        while True:
            self._put(installation.before)
            takes_s = self._after_switch_s if is_switched else self._takes_s
            install_sh = self._bundles[wanted] / "install.sh"
            began_s = time.monotonic()
            moment_s = rng.uniform(0.0, takes_s)
            cut_s = cut(install_sh, self._root, moment_s, wanted if is_switched else None)
            if cut_s is not None:
                current = "new" if current_release(self._root) == wanted else "old"
                return cut_s, current, self._came_up(installation)
            if is_switched:
                self._after_switch_s = moment_s
            else:
                self._takes_s = time.monotonic() - began_s

    def _came_up(self, installation: Installation) -> str:
        found = started_release(self._root, self._configuration)
        if found not in (installation.before, installation.wanted):
            return found
        if installation.before == NONE:
            self._complete(installation.wanted)
        return "new" if found == installation.wanted else "old"

    def _complete(self, name: str) -> tuple[float, float]:
        """Install; return how long it takes, and how long after its switch, s."""
        began_s = time.monotonic()
        process = _install(self._bundles[name] / "install.sh", self._root)
        _await_switch(process, self._root, name)
        switched_s = time.monotonic()
        code = process.wait()
        ended_s = time.monotonic()
        found = started_release(self._root, self._configuration)
        if code != 0 or found != name:
            raise SystemExit(f"{name} cannot be installed: exit code {code}, {found}")
        return ended_s - began_s, ended_s - switched_s

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
        is_switched = number // len(steps) % 3 == 0
        rng = np.random.default_rng([_SEED, number])
        after_s, current, came_up = box.cut(installation, rng, is_switched=is_switched)
        done = CutInstallation(number, installation.step, f"{after_s:.2f}", current, came_up)
        is_new = not file.exists()
        with file.open("a", newline="", encoding="utf-8") as opened:
            writer = csv.writer(opened, lineterminator="\n")
            if is_new:
                writer.writerow(field.name for field in fields(CutInstallation))
            writer.writerow(astuple(done))
        yield done


def write_table(file: Path, done: list[CutInstallation]) -> None:
    """Write which release came up, a row for each kind of installation and what `current` was."""
    kinds = sorted({(each.step, each.current) for each in done}, key=_order)
    with file.open("w", newline="", encoding="utf-8") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        writer.writerow(
            ("installation", "current", "cuts", "old", "new", "neither", "latest_cut_s")
        )
        for step, current in kinds:
            of_kind = [each for each in done if (each.step, each.current) == (step, current)]
            found = Counter(each.came_up for each in of_kind)
            neither = len(of_kind) - found["old"] - found["new"]
            latest_s = max(float(each.after_s) for each in of_kind)
            counts = (len(of_kind), found["old"], found["new"], neither)
            writer.writerow((step, current, *counts, f"{latest_s:.1f}"))


def _order(kind: tuple[str, str]) -> tuple[int, bool]:
    step, current = kind
    return STEPS.index(step), current == "new"


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
        releases = ((NONE, new), (old, new), (new, old))
        steps = [Installation(step, *each) for step, each in zip(STEPS, releases, strict=True)]
        for each in _cuts(file, box, steps, range(len(done), arguments.cuts)):
            done.append(each)
            when = f"{each.step}, cut after {each.after_s} s"
            print(f"{len(done)} of {arguments.cuts}: {when}: {each.came_up}", flush=True)
    good = sum(each.is_good for each in done)
    print(f"{good} of {len(done)} came up with the release that was in use; each cut is in {file}")
    if arguments.table is not None:
        write_table(arguments.table, done)
    return int(good < len(done))


if __name__ == "__main__":
    sys.exit(main())
