"""Releases side by side: what is installed, what is refused, and which one is taken at a start."""

import errno
import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from deploy.releases import COMPLETE, MISTAKE, UNITS, Bundle, RefusedError, Releases, main
from onboard.security.key_files import write_authority
from onboard.tools.test_ca.authority import make_root
from onboard.wave_udp import psid
from tests.deploy.bundles import boot, install, make_bundle, seal

OLD, NEW = "0.2.0+20261117.aaaaaaaaa", "0.3.0+20261124.bbbbbbbbb"


@pytest.fixture
def releases(tmp_path: Path) -> Releases:
    """Two complete releases, of which the old one is in use and proven."""
    for name in (OLD, NEW):
        folder = tmp_path / "opt" / "onboard" / "releases" / name
        folder.mkdir(parents=True)
        (folder / COMPLETE).touch()
        (folder / UNITS).mkdir()
        for file in ("onboard.service", "onboard-proven.service"):
            (folder / UNITS / file).write_text(f"of {name}\n")
    found = Releases(tmp_path)
    found.switch(OLD)
    found.proven()
    return found


# ---- at work -----------------------------------------------------------------------------------


def test_a_start_imports_only_what_it_needs(releases: Releases, tmp_path: Path) -> None:
    """A killed daemon is ready again after `ended` and `started`."""
    script = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1]);"
        "import releases; found = releases.Releases(Path(sys.argv[2]));"
        "found.ended('signal', None); found.started(); print(*sys.modules)"
    )
    folder = Path(__file__).parents[2] / "deploy"
    run = [sys.executable, "-ISE", "-c", script, str(folder), str(tmp_path)]
    modules = set(subprocess.run(run, check=True, capture_output=True, text=True).stdout.split())
    assert "releases" in modules
    assert modules.isdisjoint({"argparse", "dataclasses", "hashlib", "json", "subprocess"})


def test_a_release_that_ran_for_a_minute_is_the_one_to_fall_back_to(releases: Releases) -> None:
    releases.switch(NEW)
    releases.started()
    releases.proven()
    assert (releases.named("current"), releases.named("good")) == (NEW, NEW)


def test_a_release_that_dies_three_times_is_left_for_the_good_one(releases: Releases) -> None:
    releases.switch(NEW)
    for _ in range(3):
        releases.started()
        assert releases.named("current") == NEW
        releases.ended("exit-code", 1)
    releases.started()
    assert (releases.named("current"), releases.failed) == (OLD, NEW)


def test_a_release_that_the_disk_has_lost_is_left_for_the_good_one(
    releases: Releases, tmp_path: Path
) -> None:
    releases.switch(NEW)
    shutil.rmtree(tmp_path / "opt/onboard/releases" / NEW)
    for _ in range(4):
        releases.started()
    assert releases.named("current") == OLD


def unit(root: Path) -> str:
    return (root / "etc/systemd/system/onboard.service").read_text()


def test_units_are_those_of_the_release_in_use(releases: Releases, tmp_path: Path) -> None:
    assert unit(tmp_path) == f"of {OLD}\n"
    releases.switch(NEW)
    assert unit(tmp_path) == f"of {NEW}\n"
    releases.ended("timeout", None)
    assert unit(tmp_path) == f"of {OLD}\n", "rolled back with it"


def test_units_that_a_power_cut_left_behind_are_replaced_at_the_next_start(
    releases: Releases, tmp_path: Path
) -> None:
    (tmp_path / "etc/systemd/system/onboard.service").write_text(f"of {NEW}\n")
    releases.started()
    assert unit(tmp_path) == f"of {OLD}\n"


def test_units_that_cannot_be_written_keep_the_release_in_use(
    releases: Releases, tmp_path: Path
) -> None:
    """As on a root that is read-only; a roll-back does without them."""
    there = tmp_path / "etc/systemd/system/onboard.service"
    (there.parent / "onboard.service.new").mkdir()
    with pytest.raises(OSError, match=r"onboard\.service"):
        releases.switch(NEW)
    assert releases.named("current") == OLD
    assert (there.parent / "onboard-proven.service").read_text() == f"of {OLD}\n", "taken back"
    (there.parent / "onboard.service.new").rmdir()
    releases.switch(NEW)
    (there.parent / "onboard.service.new").mkdir()
    releases.ended("timeout", None)
    assert releases.named("current") == OLD


def test_on_a_root_that_is_read_only_an_update_with_other_units_says_what_to_do(
    releases: Releases,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    unit = str(tmp_path / "etc/systemd/system/onboard.service.new")

    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), unit)

    monkeypatch.setattr("deploy.releases._copy", refuse)
    monkeypatch.setattr(sys, "argv", ["onboard-releases", "--root", str(tmp_path), "switch", NEW])
    assert main() == 1
    said = capsys.readouterr().err
    assert said == f"{unit}: Read-only file system; nothing is changed: mount -o remount,rw /\n"
    assert releases.named("current") == OLD


def test_power_cuts_count_as_deaths_since_nothing_else_can_be_known(releases: Releases) -> None:
    releases.switch(NEW)
    for _ in range(4):
        releases.started()
    assert releases.named("current") == OLD


def test_a_release_that_is_not_ready_in_time_is_left_at_once(releases: Releases) -> None:
    releases.switch(NEW)
    releases.started()
    releases.ended("timeout", None)
    assert (releases.named("current"), releases.failed) == (OLD, NEW)


@pytest.mark.parametrize(
    ("result", "exit_code"), [("exit-code", MISTAKE), ("success", 0), ("success", None)]
)
def test_a_missing_device_and_a_stop_do_not_count(
    releases: Releases, result: str, exit_code: int | None
) -> None:
    releases.switch(NEW)
    for _ in range(10):
        releases.started()
        releases.ended(result, exit_code)
    assert releases.named("current") == NEW


def test_the_good_release_is_never_left(releases: Releases) -> None:
    for _ in range(10):
        releases.started()
        releases.ended("exit-code", 1)
    releases.ended("timeout", None)
    assert (releases.named("current"), releases.failed) == (OLD, None)


def test_a_release_that_failed_can_be_taken_again(releases: Releases) -> None:
    releases.switch(NEW)
    releases.ended("timeout", None)
    releases.switch(NEW)
    assert releases.failed is None
    releases.started()
    assert releases.named("current") == NEW


def test_a_first_release_without_a_good_one_stays(tmp_path: Path) -> None:
    folder = tmp_path / "opt" / "onboard" / "releases" / NEW
    folder.mkdir(parents=True)
    (folder / COMPLETE).touch()
    only = Releases(tmp_path)
    only.switch(NEW)
    for _ in range(9):
        only.started()
        only.ended("timeout", None)
    assert only.named("current") == NEW


def test_releases_in_use_are_not_removed_and_others_are(releases: Releases, tmp_path: Path) -> None:
    for name in (OLD, "0.1.0"):
        with pytest.raises(RefusedError):
            releases.remove(name)
    releases.remove(NEW)
    assert releases.names() == [OLD]
    assert not (tmp_path / "opt" / "onboard" / "releases" / NEW).exists()


def test_a_release_that_is_not_complete_is_none(releases: Releases, tmp_path: Path) -> None:
    (tmp_path / "opt" / "onboard" / "releases" / NEW / COMPLETE).unlink()
    assert releases.names() == [OLD]
    with pytest.raises(RefusedError, match=f"no release .*there are .*{OLD[:5]}"):
        releases.switch(NEW)


@pytest.mark.parametrize("lost", [("current",), ("current", "good")])
def test_an_update_is_no_first_release_where_links_are_lost(
    releases: Releases, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lost: tuple[str, ...]
) -> None:
    """It is verified by a release that is there, not by itself."""
    for link in lost:
        (tmp_path / "opt/onboard" / link).unlink()
    verifiers: list[Path] = []

    def refuse(_self: Releases, _bundle: Bundle, verifier: Path) -> None:
        verifiers.append(verifier)
        raise RefusedError("forged")

    monkeypatch.setattr(Releases, "_check_signature", refuse)
    monkeypatch.setattr(Releases, "_build", lambda *_: pytest.fail("its programs ran"))
    with pytest.raises(RefusedError, match="forged"):
        releases.install(Bundle(make_bundle(tmp_path / "box", f"{NEW}.1")))
    assert [each.name for each in verifiers] == [OLD if "good" not in lost else NEW]


# ---- what is refused ---------------------------------------------------------------------------


def test_a_release_for_another_architecture_is_refused(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "box", NEW, architecture="s390x")
    with pytest.raises(RefusedError, match=r"is for s390x and Python 3\.\d+; this is"):
        Bundle(bundle)


@pytest.mark.parametrize(
    "about", ["{", "[]", '{"name": 3}', '{"name": 3, "architecture": 1, "python": 2}', "\xff"]
)
def test_a_folder_that_does_not_say_what_it_is_is_refused_and_no_traceback(
    tmp_path: Path, about: str
) -> None:
    """It is read before its signature."""
    folder = make_bundle(tmp_path / "new", NEW)
    (folder / "release.json").write_text(about, encoding="latin-1")
    seal(folder)

    with pytest.raises(RefusedError, match=r"release\.json: says no name, architecture and python"):
        Bundle(folder)


def test_a_folder_that_was_copied_in_part_is_refused(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "box", NEW)
    wheel = next((bundle / "wheels").glob("onboard*"))
    wheel.write_bytes(wheel.read_bytes()[:-10])
    with pytest.raises(RefusedError, match=f"{wheel.name} is damaged: copy the folder again"):
        Bundle(bundle)
    wheel.unlink()
    with pytest.raises(RefusedError, match=f"{wheel.name} is missing"):
        Bundle(bundle)
    (bundle / "SHA256SUMS").unlink()
    with pytest.raises(RefusedError, match="no SHA256SUMS: create the folder with 'make box'"):
        Bundle(bundle)


def test_a_file_that_is_not_of_the_release_is_refused(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "box", NEW)
    (bundle / "wheels" / "more-1.0-py3-none-any.whl").touch()
    with pytest.raises(RefusedError, match=r"more-1\.0-py3-none-any\.whl is not of this release"):
        Bundle(bundle)


@pytest.mark.parametrize("name", ["../../../box", "", ".", "a/b", "-rf"])
def test_a_release_cannot_name_a_folder_elsewhere(tmp_path: Path, name: str) -> None:
    """It could be its own, with a file `complete`: it then counts as installed, and is run."""
    bundle = make_bundle(tmp_path / "box", name)
    with pytest.raises(RefusedError, match=r"release\.json: name .* is none of a release"):
        Bundle(bundle)


def test_two_modified_builds_of_one_commit_have_two_names(tmp_path: Path) -> None:
    one, other = (
        Bundle(make_bundle(tmp_path / str(files), f"{NEW}.modified", files=files))
        for files in (1, 2)
    )
    assert one.name != other.name
    assert one.name.startswith(f"{NEW}.modified.")


def test_a_second_installer_is_refused(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "box", NEW)
    root = tmp_path / "root"
    (root / "opt" / "onboard").mkdir(parents=True)
    with (root / "opt" / "onboard" / "lock").open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = install(bundle, root)
        tool = [sys.executable, f"{bundle}/releases.py", "--root", f"{root}", "switch", NEW]
        switched = subprocess.run(tool, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "install.sh: another installation is at work\n")
    assert (switched.returncode, switched.stderr) == (2, "another installation is at work\n")
    assert boot(root) == "not installed"


def written_outside_of_opt(root: Path) -> dict[Path, int]:
    files = [*(root / "etc").rglob("*"), *(root / "usr").rglob("*")]
    return {path: path.lstat().st_mtime_ns for path in files}


# ---- the whole installation, in a folder in place of / ------------------------------------------


@pytest.mark.long
def test_an_update_and_a_downgrade_leave_the_release_that_was_installed_last(
    tmp_path: Path,
) -> None:
    root = tmp_path / "root"
    old, new = (make_bundle(tmp_path / name, name) for name in (OLD, NEW))
    for bundle, name in ((old, OLD), (new, NEW), (old, OLD)):
        done = install(bundle, root)
        assert done.returncode == 0, done.stdout
        assert boot(root) == f"{name} drives"
    unit = (root / "etc/systemd/system/onboard.service").read_text()
    assert "/opt/onboard/current/venv/bin/onboard run" in unit
    assert (root / "usr/local/bin/onboard").readlink() == Path(
        "/opt/onboard/current/venv/bin/onboard"
    )
    before = written_outside_of_opt(root)
    assert install(new, root).returncode == 0
    assert written_outside_of_opt(root) == before, "there, the disk may be read-only"
    assert install(new, root, "--uninstall", "--purge").returncode == 0
    assert [path for path in root.rglob("*") if not path.is_dir()] == []


@pytest.mark.long
def test_modules_of_whoever_installs_are_not_taken_for_those_of_the_release(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = tmp_path / "modules" / "onboard-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: onboard\nVersion: 1.0\n")
    monkeypatch.setenv("PYTHONPATH", str(about.parent))
    root = tmp_path / "root"
    done = install(make_bundle(tmp_path / "box", NEW), root)
    assert done.returncode == 0, done.stdout
    assert boot(root) == f"{NEW} drives"


@pytest.mark.long
def test_a_release_that_cannot_read_the_configuration_is_not_taken(tmp_path: Path) -> None:
    root = tmp_path / "root"
    assert install(make_bundle(tmp_path / "old", OLD), root).returncode == 0
    (root / "etc/onboard/car.yaml").write_text("watch: {speed_s: 1.0}\n")
    done = install(make_bundle(tmp_path / "new", NEW, unknown="watch"), root)
    assert done.returncode == 2
    assert "cannot read" in done.stdout
    assert "watch: unknown key" in done.stdout
    assert boot(root) == f"{OLD} drives"


def date_all(folder: Path, utc_s: float) -> None:
    for path in folder.rglob("*"):
        os.utime(path, (utc_s, utc_s), follow_symlinks=False)


@pytest.mark.long
def test_a_clock_that_is_set_back_before_and_within_an_update_changes_nothing(
    tmp_path: Path,
) -> None:
    """What is installed is then of the future, an installation that was cut among it."""
    root, in_a_year_s = tmp_path / "root", time.time() + 366 * 86_400.0
    old, new = (make_bundle(tmp_path / name, name) for name in (OLD, NEW))
    assert install(old, root).returncode == 0
    cut = root / "opt/onboard/releases" / NEW / "venv"
    cut.mkdir(parents=True)
    (cut / "left").touch()
    for bundle, name in ((new, NEW), (old, OLD)):
        date_all(root, in_a_year_s)
        date_all(bundle, in_a_year_s)
        done = install(bundle, root)
        assert done.returncode == 0, done.stdout
        assert boot(root) == f"{name} drives"
    assert not (cut / "left").exists()


def make_roots(folder: Path) -> None:
    for name in ("trial", "other"):
        made = make_root(name, psid.OF_VEHICLES, valid_from_utc_s=1_700_000_000.0, valid_for_s=1e8)
        write_authority(folder / name, made)


@pytest.mark.long
def test_the_first_release_names_the_hash_with_which_trust_begins(tmp_path: Path) -> None:
    """And if the keys are there already, their root must have signed it."""
    make_roots(tmp_path)
    root = tmp_path / "root"
    bundle = make_bundle(tmp_path / "box", OLD, key=tmp_path / "other")
    shutil.copytree(tmp_path / "trial" / "roots", root / "etc/onboard/keys/roots")
    done = install(bundle, root)
    assert (done.returncode, boot(root)) == (2, "not installed")
    assert "not signed by a root of" in done.stdout

    seal(bundle, tmp_path / "trial")
    done = install(bundle, root)
    digest = hashlib.sha256((bundle / "SHA256SUMS").read_bytes()).hexdigest()
    assert f"first release: the line that 'make box' printed must be {digest}" in done.stdout
    assert boot(root) == f"{OLD} drives"


@pytest.mark.long
def test_an_update_is_signed_by_a_root_that_the_car_trusts(tmp_path: Path) -> None:
    make_roots(tmp_path)
    root = tmp_path / "root"
    assert (
        "not verified: there are no keys"
        in install(make_bundle(tmp_path / "old", OLD), root).stdout
    )
    shutil.copytree(tmp_path / "trial" / "roots", root / "etc/onboard/keys/roots")

    new = make_bundle(tmp_path / "new", NEW)
    assert "is not signed" in install(new, root).stdout
    seal(new, tmp_path / "other")
    done = install(new, root)
    assert done.returncode == 2
    assert "not signed by a root of" in done.stdout
    assert boot(root) == f"{OLD} drives"
    seal(new, tmp_path / "trial")
    done = install(new, root)
    assert done.returncode == 0, done.stdout
    assert boot(root) == f"{NEW} drives"
    (new / "SHA256SUMS.sig").unlink()
    assert install(new, root).returncode == 0, "it is installed already"
    (root / "opt/onboard/current").unlink()
    forged = install(make_bundle(tmp_path / "forged", f"{NEW}.1", key=tmp_path / "other"), root)
    assert forged.returncode == 2, forged.stdout
    assert "first release" not in forged.stdout, "verified by one that is there"


@pytest.mark.long
def test_a_disk_that_is_full_leaves_the_old_release(tmp_path: Path) -> None:
    root = tmp_path / "root"
    small = ("unshare", "--user", "--map-root-user", "--mount", "sh", "-euc")
    if subprocess.run([*small, "true"], check=False, capture_output=True).returncode:
        pytest.skip("no user namespaces")
    old = make_bundle(tmp_path / "old", OLD)
    new = make_bundle(tmp_path / "new", NEW, files=4000)
    (root / "opt" / "onboard").mkdir(parents=True)
    script = (
        "home=$ONBOARD_ROOT/opt/onboard; onboard=$home/current/venv/bin/onboard;"
        ' mount -t tmpfs -o size=3m,nr_inodes=600 tmpfs "$home"; sh "$0/install.sh";'
        ' sh "$1/install.sh" || "$onboard" run car.yaml;'
        # And full in the switch itself, to a release that is there.
        ' mkdir "$home/releases/other"; touch "$home/releases/other/complete";'
        ' n=0; while touch "$home/$n" 2>&1; do n=$((n + 1)); done;'
        ' "$home/onboard-releases" --root "$ONBOARD_ROOT" switch other || "$onboard" run car.yaml'
    )
    done = subprocess.run(
        [*small, script, old, new],
        env={"ONBOARD_ROOT": str(root), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert "No space left on device; nothing is changed" in done.stdout
    assert done.stdout.count(f"{OLD} drives") == 2, done.stdout
