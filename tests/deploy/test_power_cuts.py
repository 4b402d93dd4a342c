"""The power is cut at random moments of installations: what does the box start afterwards?"""

import shutil
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from deploy.power_cuts import (
    NONE,
    CutInstallation,
    current_release,
    cut,
    with_other_name,
    write_table,
)
from deploy.releases import Bundle
from tests.deploy.bundles import boot, install, make_bundle

CUTS = 50
AFTER_SWITCH_S = 0.05
OLD, NEW = "0.2.0+20261117.aaaaaaaaa", "0.3.0+20261124.bbbbbbbbb"


def test_a_folder_under_another_name_is_another_release(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "new", NEW)
    other = Bundle(with_other_name(bundle, tmp_path / "other"))
    assert other.name == f"{NEW}.before"
    assert Bundle(bundle).name == NEW


def test_the_table_counts_what_came_up(tmp_path: Path) -> None:
    done = [
        CutInstallation(0, "first", "3.00", "old", "old"),
        CutInstallation(1, "update", "9.50", "new", "new"),
        CutInstallation(2, "update", "9.75", "new", "old"),
        CutInstallation(3, "first", "4.25", "old", "203/EXEC: No such file or directory"),
    ]
    write_table(tmp_path / "table.csv", done)
    assert (tmp_path / "table.csv").read_text().splitlines() == [
        "installation,current,cuts,old,new,neither,latest_cut_s",
        "first,old,2,1,0,1,4.2",
        "update,new,2,1,1,0,9.8",
    ]
    assert [each.is_good for each in done] == [True, True, False, False]


def test_a_cut_after_the_switch_waits_for_it(tmp_path: Path) -> None:
    install_sh, home = tmp_path / "install.sh", tmp_path / "opt" / "onboard"
    home.mkdir(parents=True)
    switch = f"ln -s releases/{NEW} {home}/current"
    install_sh.write_text(f"exec 9>{home}/lock; flock 9; {switch}; exec tail -f /dev/null")
    assert cut(install_sh, tmp_path, 0.0, switched_to=NEW) is not None
    assert current_release(tmp_path) == NEW

    install_sh.write_text("exit 1")
    assert cut(install_sh, tmp_path, 0.0, switched_to=OLD) is None, "it has ended without"


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
        is_late = found.total() % 3 == 0
        moment_s = rng.uniform(0.0, AFTER_SWITCH_S if is_late else takes_s)
        switched_to = wanted if is_late else None
        cut_s = cut(bundles[wanted] / "install.sh", root, moment_s, switched_to)
        current = current_release(root)
        after = boot(root).removesuffix(" drives")
        if cut_s is not None:
            step = "first" if is_first else "update" if wanted == NEW else "downgrade"
            found[f"{step}: {'new' if after == wanted else 'old'}"] += 1
        elif not is_late:
            takes_s = min(takes_s, time.monotonic() - began_s)
        assert current in (before, wanted)
        assert after == current, f"{dict(found)}: {before} to {wanted}: {after}"
        if after == NONE:
            assert install(bundles[wanted], root).returncode == 0, "another run completes it"
            after = boot(root).removesuffix(" drives")
            assert after == wanted
        before = after
    assert sum(n for kind, n in found.items() if kind.endswith("new")) >= CUTS // 3
    sys.stdout.write(f"{CUTS} cuts within {takes_s:.1f} s: {dict(sorted(found.items()))}\n")
