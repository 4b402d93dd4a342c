"""The UTC of a daemon on loopback follows a file, as that of a computer is set."""

import os
import time
from pathlib import Path

import pytest

from sim_rig.processes.settable_clock import SettableClock


def test_the_clock_of_the_file_goes_on_from_when_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "utc"
    file.write_text("1500000000.5\n")
    os.utime(file, (0.0, time.time() - 10.0))
    assert SettableClock(file)() == pytest.approx(1_500_000_010.5, abs=5.0)


def test_without_a_file_it_is_the_clock_of_the_computer(tmp_path: Path) -> None:
    clock = SettableClock(tmp_path / "utc")
    assert clock() == pytest.approx(time.time(), abs=5.0)


def test_a_file_that_is_being_written_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "utc").write_text("")
    assert SettableClock(tmp_path / "utc")() == pytest.approx(time.time(), abs=5.0)
