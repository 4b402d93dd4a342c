"""The power is cut at random moments of installations: what does the box start afterwards?"""

import shutil
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from deploy.power_cuts import NONE, CutInstallation, cut, with_other_name, write_table
from deploy.releases import Bundle
from tests.deploy.bundles import boot, install, make_bundle

CUTS = 50
OLD, NEW = "0.2.0+20261117.aaaaaaaaa", "0.3.0+20261124.bbbbbbbbb"


def test_a_folder_under_another_name_is_another_release(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "new", NEW)
    other = Bundle(with_other_name(bundle, tmp_path / "other"))
    assert other.name == f"{NEW}.before"
    assert Bundle(bundle).name == NEW


def test_the_table_counts_what_came_up(tmp_path: Path) -> None:
    done = [
        CutInstallation(0, "first", "3.00", "old"),
        CutInstallation(1, "update", "9.50", "new"),
        CutInstallation(2, "first", "4.25", "203/EXEC: No such file or directory"),
    ]
    write_table(tmp_path / "table.csv", done)
    assert (tmp_path / "table.csv").read_text().splitlines() == [
        "installation,cuts,old,new,neither,latest_cut_s",
        "first,2,1,0,1,4.2",
        "update,1,0,1,0,9.5",
    ]


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
        was_cut = cut(bundles[wanted] / "install.sh", root, rng.uniform(0.0, takes_s))
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
