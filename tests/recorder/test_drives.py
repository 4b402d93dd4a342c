"""Drives that were recorded, decided again by the cores of today.

Where one differs and the change is meant, `make drives` records them anew.
"""

from pathlib import Path

import pytest

from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import compare

DRIVES = sorted((Path(__file__).parents[1] / "drives").glob("*.mcap"))
LARGEST_BYTES = 300_000
OTHER_PROCESSOR = 1e-9
"""The last digit of a number is not the same on every kind of processor."""


def test_there_are_drives_with_a_warning_a_lost_sensor_and_signatures() -> None:
    entries = [entry for path in DRIVES for entry in RecordedDrive([path]).entries()]

    assert {"/out/warning", "/out/sensor_lost", "/out/discarded"} <= {e.topic for e in entries}
    assert any(RecordedDrive([path]).head.certificates for path in DRIVES)


@pytest.mark.parametrize("path", DRIVES, ids=lambda path: str(path.stem))
def test_the_drive_is_decided_again(path: Path) -> None:
    comparison = compare(RecordedDrive([path]), OTHER_PROCESSOR)

    assert comparison.difference is None
    assert comparison.outputs > 100
    assert path.stat().st_size < LARGEST_BYTES
