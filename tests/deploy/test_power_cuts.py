"""The power is cut at random moments of installations: what does the box start afterwards?"""

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.deploy.bundles import boot, install, make_bundle

CUTS = 50
NONE = "not installed"
OLD, NEW = "0.2.0+20261117.aaaaaaaaa", "0.3.0+20261124.bbbbbbbbb"


def cut(bundle: Path, root: Path, after_s: float) -> bool:
    """Begin to install, and end every process of it at once; return whether it was not done yet."""
    process = subprocess.Popen(
        ["sh", bundle / "install.sh"],
        env=os.environ | {"ONBOARD_ROOT": str(root)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        lock = root / "opt" / "onboard" / "lock"
        if lock.exists():  # its children have it until they are gone
            with lock.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX)
        return True
    return False


@pytest.mark.long
def test_every_box_starts_the_old_or_the_new_release_after_a_power_cut(tmp_path: Path) -> None:
    rng = np.random.default_rng(42)
    bundles = {name: make_bundle(tmp_path / name, name, files=200) for name in (OLD, NEW)}
    root = tmp_path / "root"
    began_s = time.monotonic()
    assert install(bundles[OLD], root).returncode == 0
    takes_s = time.monotonic() - began_s
    found: Counter[str] = Counter()
    before = OLD
    while found.total() < CUTS:
        if is_first := found.total() % 5 == 0:
            shutil.rmtree(root)
            before = NONE
        wanted = NEW if before == OLD else OLD
        shutil.rmtree(root / "opt/onboard/releases" / wanted, ignore_errors=True)  # built again
        began_s = time.monotonic()
        was_cut = cut(bundles[wanted], root, rng.uniform(0.0, takes_s))
        after = boot(root).removesuffix(" drives")
        if was_cut:
            step = "first" if is_first else "update" if wanted == NEW else "downgrade"
            found[f"{step}: {'new' if after == wanted else 'old'}"] += 1
        else:
            takes_s = min(takes_s, time.monotonic() - began_s)
        assert after in (before, wanted), f"{dict(found)}: {before} to {wanted}: {after}"
        if after == NONE:
            assert install(bundles[wanted], root).returncode == 0, "another run completes it"
            after = boot(root).removesuffix(" drives")
            assert after == wanted
        before = after
    sys.stdout.write(f"{CUTS} cuts within {takes_s:.1f} s: {dict(sorted(found.items()))}\n")
