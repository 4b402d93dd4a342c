#!/usr/bin/python3 -ISE
"""Keeps releases of onboard side by side, and takes the last good one when a new one fails.

    onboard-releases list               which there are, which is in use, good, or has failed
    onboard-releases install FOLDER     checks a folder of `make box`, installs it, and switches
    onboard-releases switch RELEASE     takes another one at the next start
    onboard-releases remove RELEASE
    onboard-releases started | ended | proven      called by the units

It needs Debian's Python only, since it must work when a release does not.

    /opt/onboard/releases/NAME       a whole environment; its file `complete` is written last
    /opt/onboard/releases/NAME/units   its units, which systemd has while it is in use
    /opt/onboard/current             a link to the one in use, replaced by one rename
    /opt/onboard/good                a link to the last one that ran for a minute
    /opt/onboard/starts              name and number of starts of one that is not proven
    /opt/onboard/failed              name of the one that was left for the good one

`started` and `ended` are part of the time until a killed daemon is ready again, so what only the
other actions need is imported by these.

A power cut at any moment leaves `current` at a complete release: files are on the disk before
`complete` is, and that before the link. Units that are not those of `current` are replaced at the
next start.
"""

import contextlib
import errno
import fcntl
import filecmp
import os
import re
import sys
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path

SUMS, SIGNATURE, ABOUT = "SHA256SUMS", "SHA256SUMS.sig", "release.json"
"""Files of a folder to install: hashes of all others, their signature, and what it is."""
COMPLETE, UNITS = "complete", "units"
_NAME = re.compile(r"[0-9A-Za-z][0-9A-Za-z.+_-]*")
"""Of a release, which is the name of its folder."""
MOST_DEATHS = 3
"""Starts of a release that is not proven, after which the good one is taken."""
MISTAKE = 2
"""Exit code of `onboard` for a mistake of the user's or a missing device, which another release
would not mend."""


class RefusedError(Exception):
    """A folder or release that cannot be used; one line for the user."""


About = namedtuple("About", ("name", "architecture", "python"))
"""What a folder to install is for: build, architecture of `uname -m`, version of Python."""


class Bundle:
    """A folder to install."""

    def __init__(self, folder: Path) -> None:
        """Check the folder against its hashes.

        Raises:
            RefusedError: it is no such folder, is damaged, or is for another computer.
        """
        import json  # noqa: PLC0415

        self.folder = folder
        try:
            self.sums = (folder / SUMS).read_bytes()
        except OSError as error:
            raise RefusedError(f"{folder}: no {SUMS}: create the folder with 'make box'") from error
        self._check_hashes()
        try:
            self.about = About(**json.loads((folder / ABOUT).read_bytes()))
            is_text = all(isinstance(each, str) for each in self.about)
        except (TypeError, ValueError):
            is_text = False
        if not is_text:
            raise RefusedError(f"{folder}: {ABOUT}: says no name, architecture and python")
        if not _NAME.fullmatch(self.about.name):
            raise RefusedError(
                f"{folder}: {ABOUT}: name {self.about.name!r} is none of a release: letters,"
                " digits and . + - _"
            )
        here = About(self.about.name, os.uname().machine, f"3.{sys.version_info.minor}")
        if self.about != here:
            raise RefusedError(
                f"{folder}: is for {self.about.architecture} and Python {self.about.python}; this"
                f" is {here.architecture} with Python {here.python}"
            )

    @property
    def name(self) -> str:
        """Name of the release: the build, and of one that is no commit its hash too."""
        build: str = self.about.name
        return f"{build}.{self.digest[:8]}" if "modified" in build else build

    @property
    def digest(self) -> str:
        """SHA-256 of its hashes."""
        import hashlib  # noqa: PLC0415

        return hashlib.sha256(self.sums).hexdigest()

    def _check_hashes(self) -> None:
        import hashlib  # noqa: PLC0415

        named = {}
        for line in self.sums.decode(errors="replace").splitlines():
            digest, _, name = line.partition("  ")
            named[name] = digest
        there = {
            str(path.relative_to(self.folder))
            for path in self.folder.rglob("*")
            if path.is_file() and path.name not in {SUMS, SIGNATURE}
        }
        if missing := sorted(named.keys() - there):
            raise RefusedError(f"{self.folder}: {missing[0]} is missing: copy the folder again")
        if more := sorted(there - named.keys()):
            raise RefusedError(f"{self.folder}: {more[0]} is not of this release")
        for name, digest in named.items():
            with (self.folder / name).open("rb") as file:
                if hashlib.file_digest(file, "sha256").hexdigest() != digest:
                    raise RefusedError(f"{self.folder}: {name} is damaged: copy the folder again")


class Releases:
    """All releases of one computer."""

    def __init__(self, root: Path) -> None:
        """Look below `root`, which is / but in tests."""
        self._home = root / "opt" / "onboard"
        self._etc = root / "etc" / "onboard"
        self._systemd = root / "etc" / "systemd" / "system"
        self._is_here = root == Path("/")
        self._all = self._home / "releases"

    def names(self) -> list[str]:
        """Those that are complete."""
        return sorted(path.parent.name for path in self._all.glob(f"*/{COMPLETE}"))

    def named(self, link: str) -> str | None:
        """Name of the release that `current` or `good` is; `None` without one."""
        try:
            name = (self._home / link).readlink().name
        except OSError:
            return None
        return name if (self._all / name / COMPLETE).exists() else None

    @property
    def failed(self) -> str | None:
        """Name of the release that was left for the good one."""
        return self._read("failed") or None

    # ---- installation ----------------------------------------------------------------------

    def install(self, bundle: Bundle) -> str:
        """Install and check a release; it is not taken yet.

        Returns:
            its name.

        Raises:
            RefusedError: it is signed by nobody whom the car trusts, does not start, or cannot read
                the car's configuration.
            OSError: it cannot be written.
        """
        folder = self._all / bundle.name
        verifier = self._verifier()
        if verifier is not None and self._sums(folder) != bundle.sums:
            self._check_signature(bundle, self._all / verifier)
        self._remove_incomplete()
        if not (folder / COMPLETE).exists():
            try:
                self._build(bundle, folder)
                if verifier is None:
                    self._check_first(bundle, folder)
                os.sync()
                _write(folder / COMPLETE, bundle.name)
            except BaseException:
                with contextlib.suppress(OSError):
                    _remove(folder)
                raise
        self._check_configuration(folder)
        return bundle.name

    def _verifier(self) -> str | None:
        """Name of the release that verifies updates; links that are lost make no first release."""
        return self.named("current") or self.named("good") or max(self.names(), default=None)

    def _sums(self, folder: Path) -> bytes | None:
        """Hashes of a release that is installed already."""
        return (folder / SUMS).read_bytes() if (folder / COMPLETE).exists() else None

    def _check_signature(self, bundle: Bundle, verifier: Path) -> None:
        """Have a release verify a folder, by the roots of the car's keys."""
        keys = self._etc / "keys"
        if not keys.is_dir():
            print(f"signature not verified: there are no keys in {keys}")
            return
        sums, signature = bundle.folder / SUMS, bundle.folder / SIGNATURE
        if not signature.exists():
            raise RefusedError(
                f"{bundle.folder}: is not signed: make it by 'KEYS=keys/root make box'"
            )
        onboard = verifier / "venv" / "bin" / "onboard"
        verify = (onboard, "keys", "verify", sums, "--signature", signature, "--trusted", keys)
        code, output = _run(*verify)
        if code != 0:
            raise RefusedError(f"{bundle.folder}: {_reason(code, output)}")

    def _check_first(self, bundle: Bundle, folder: Path) -> None:
        """Say how trust begins: the first release is verified by nothing but itself."""
        self._check_signature(bundle, folder)
        print(f"first release: the line that 'make box' printed must be {bundle.digest}  {SUMS}")

    def _build(self, bundle: Bundle, folder: Path) -> None:
        venv, wheels = folder / "venv", bundle.folder / "wheels"
        folder.mkdir(parents=True)
        _must(sys.executable, "-I", "-m", "venv", "--without-pip", venv)
        (pip,) = wheels.glob("pip-*.whl")
        install = [
            *(venv / "bin" / "python", pip / "pip", "--isolated", "--disable-pip-version-check"),
            *("install", "--quiet", "--root-user-action=ignore", "--no-index", "--no-cache-dir"),
            *("--find-links", wheels),
        ]
        _must(*install, "--require-hashes", "--requirement", bundle.folder / "requirements.lock")
        _must(*install, "--no-deps", "onboard")
        _must(venv / "bin" / "onboard", "--version")
        for file in (SUMS, "in-the-car.md"):
            _copy(bundle.folder / file, folder / file)
        (folder / UNITS).mkdir()
        for unit in (bundle.folder / "files").glob("*.service"):
            _copy(unit, folder / UNITS / unit.name)

    def _check_configuration(self, folder: Path) -> None:
        configuration = self._etc / "car.yaml"
        if not configuration.exists():
            return
        code, output = _run(folder / "venv" / "bin" / "onboard", "check", configuration)
        if code != 0:
            raise RefusedError(
                f"{folder.name} is installed, and cannot read {configuration}: correct it, and"
                f" install again. {output.strip()}"
            )

    def _remove_incomplete(self) -> None:
        for folder in self._all.glob("*"):
            if not (folder / COMPLETE).exists():
                _remove(folder)

    def switch(self, name: str) -> None:
        """Take a release with its units at the next start.

        Raises:
            RefusedError: there is no such release.
            OSError: it cannot be written, and nothing is changed.
        """
        before = self.named("current")
        if name not in self.names():
            raise RefusedError(f"no release {name}; there are {', '.join(self.names()) or 'none'}")
        (self._home / "starts").unlink(missing_ok=True)
        (self._home / "failed").unlink(missing_ok=True)
        try:
            self._put_units(name)
            self._link("current", name)
        except OSError:
            if before is not None:
                self._take_back_units(before)
            raise

    def _put_units(self, name: str) -> None:
        units = sorted((self._all / name / UNITS).glob("*"))  # none in a release of before
        there = {unit: self._systemd / unit.name for unit in units}
        other = [unit for unit in units if not _is_same(unit, there[unit])]
        for unit in other:
            _copy(unit, there[unit])
        if other and self._is_here:
            _run("systemctl", "daemon-reload")

    def _take_back_units(self, name: str) -> None:
        """Put them where a root that is read-only must not end the start or the roll-back."""
        try:
            self._put_units(name)
        except OSError as error:
            print(f"units of another release than {name}: {error.filename}: {error.strerror}")

    def remove(self, name: str) -> None:
        """Remove a release that is not needed.

        Raises:
            RefusedError: it is in use, or the one to fall back to.
        """
        if name in (self.named("current"), self.named("good")):
            raise RefusedError(f"{name} is in use, or the one to fall back to")
        if name not in self.names():
            raise RefusedError(f"no release {name}; there are {', '.join(self.names()) or 'none'}")
        (self._all / name / COMPLETE).unlink()  # half removed, it is no release
        _remove(self._all / name)

    def remove_others(self) -> None:
        """Remove all but the one in use and the one to fall back to."""
        for name in self.names():
            if name not in (self.named("current"), self.named("good")):
                self.remove(name)

    # ---- at work ---------------------------------------------------------------------------

    def started(self) -> None:
        """Count a start; after too many without proof, take the good release."""
        starts = self._starts()
        if self._is_unproven() and starts >= MOST_DEATHS:
            self._fall_back(f"it has ended {starts} times")
        elif self._is_unproven():
            self._write_starts(starts + 1)
        current = self.named("current")
        if current is not None:
            self._take_back_units(current)

    def ended(self, result: str, exit_code: int | None) -> None:
        """Take the good release if the new one did not get ready in time.

        Args:
            result: `SERVICE_RESULT` of systemd.
            exit_code: of the daemon; `None` if a signal ended it.
        """
        if not self._is_unproven():
            return
        if result == "timeout":
            self._fall_back("it did not get ready in time")
        elif result == "success" or exit_code == MISTAKE:
            self._write_starts(max(0, self._starts() - 1))

    def proven(self) -> None:
        """Make the release in use the one to fall back to."""
        current = self.named("current")
        if current is not None:
            self._link("good", current)
            (self._home / "starts").unlink(missing_ok=True)

    def _is_unproven(self) -> bool:
        good = self.named("good")
        return good is not None and self.named("current") != good

    def _fall_back(self, why: str) -> None:
        failed, good = self.named("current"), self.named("good")
        assert good is not None  # noqa: S101 (asked before)
        print(f"release {failed} is left for {good}: {why}")
        self._link("current", good)
        self._take_back_units(good)
        (self._home / "starts").unlink(missing_ok=True)
        _write(self._home / "failed", failed or "")

    def _starts(self) -> int:
        name, _, number = self._read("starts").partition(" ")
        return int(number) if name == str(self.named("current")) and number.isdecimal() else 0

    def _write_starts(self, number: int) -> None:
        _write(self._home / "starts", f"{self.named('current')} {number}")

    # ---- files -----------------------------------------------------------------------------

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other installers out.

        Raises:
            RefusedError: one is at work.
        """
        if "ONBOARD_LOCKED" in os.environ:  # by install.sh
            yield
            return
        self._home.mkdir(parents=True, exist_ok=True)
        with (self._home / "lock").open("wb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise RefusedError("another installation is at work") from None
            yield

    def _link(self, link: str, name: str) -> None:
        new = self._home / f"{link}.new"
        new.unlink(missing_ok=True)
        new.symlink_to(Path("releases", name))
        new.replace(self._home / link)
        _sync(self._home)

    def _read(self, file: str) -> str:
        try:
            return (self._home / file).read_text("utf-8").strip()
        except OSError:
            return ""


def _write(path: Path, text: str) -> None:
    """Replace a file by one rename, safe from a power cut."""
    new = path.with_name(f"{path.name}.new")
    with new.open("w", encoding="utf-8") as file:
        file.write(f"{text}\n")
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)
    _sync(path.parent)


def _copy(source: Path, target: Path) -> None:
    """Replace a file by one rename, safe from a power cut."""
    target.parent.mkdir(parents=True, exist_ok=True)
    new = target.with_name(f"{target.name}.new")
    new.write_bytes(source.read_bytes())
    new.chmod(0o644)
    _sync(new)
    new.replace(target)
    _sync(target.parent)


def _is_same(one: Path, other: Path) -> bool:
    return other.exists() and filecmp.cmp(one, other, shallow=False)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _remove(folder: Path) -> None:
    import shutil  # noqa: PLC0415

    shutil.rmtree(folder)


def _run(*command: object) -> tuple[int, str]:
    """Exit code and output of a command."""
    import subprocess  # noqa: PLC0415

    done = subprocess.run(
        [str(word) for word in command],
        # Not with the modules of whoever installs: pip would take them for those of the release.
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def _must(*command: object) -> None:
    code, output = _run(*command)
    if code != 0:
        raise RefusedError(f"{command[0]} failed, and nothing is changed: {_reason(code, output)}")


def _reason(code: int, output: str) -> str:
    """Last line that a command wrote."""
    lines = [line for line in output.splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {code}"


def _list(releases: Releases) -> None:
    for name in releases.names():
        marks = [mark for mark in ("current", "good") if releases.named(mark) == name]
        if releases.failed == name:
            marks.append("failed")
        print(f"{name}  {', '.join(marks)}".rstrip())


def _do(releases: Releases, action: str, what: Path) -> None:
    match action:
        case "list":
            _list(releases)
        case "install":
            with releases.locked():
                name = releases.install(Bundle(what))
                releases.switch(name)
                releases.remove_others()
            print(f"{name} is taken at the next start")
        case "switch":
            with releases.locked():
                releases.switch(str(what))
        case "remove":
            with releases.locked():
                releases.remove(str(what))
        case "started":
            releases.started()
        case "ended":
            status = os.environ.get("EXIT_STATUS", "")
            exit_code = int(status) if status.isdecimal() else None
            releases.ended(os.environ.get("SERVICE_RESULT", ""), exit_code)
        case "proven":
            releases.proven()


def _arguments() -> tuple[str, Path, Path]:
    """Action, what it is to be done with, and the root."""
    if sys.argv[1:] in (["started"], ["ended"]):
        return sys.argv[1], Path(), Path("/")
    import argparse  # noqa: PLC0415

    parser = argparse.ArgumentParser(prog="onboard-releases", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--root", type=Path, default=Path("/"), help=argparse.SUPPRESS)
    actions = parser.add_subparsers(dest="action", required=True)
    for action in ("list", "started", "ended", "proven"):
        actions.add_parser(action)
    for action in ("install", "switch", "remove"):
        actions.add_parser(action).add_argument("what", type=Path)
    arguments = parser.parse_args(namespace=argparse.Namespace(what=Path()))
    return arguments.action, arguments.what, arguments.root


def main() -> int:
    """Run one action; returns 2 for what is refused."""
    action, what, root = _arguments()
    try:
        _do(Releases(root), action, what)
    except RefusedError as error:
        print(error, file=sys.stderr)
        return MISTAKE
    except OSError as error:
        advice = ": mount -o remount,rw /" if error.errno == errno.EROFS else ""
        print(
            f"{error.filename or ''}: {error.strerror}; nothing is changed{advice}", file=sys.stderr
        )
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
