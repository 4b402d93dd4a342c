"""Recorded drives, replayed by the present cores.

After an intended change of decisions, `make drives` records them again.
"""

from pathlib import Path

import pytest

from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import compare

DRIVES = sorted((Path(__file__).parents[1] / "drives").glob("*.mcap"))
LARGEST_BYTES = 300_000


def test_there_are_drives_with_a_warning_a_lost_sensor_and_signatures() -> None:
    entries = [entry for path in DRIVES for entry in RecordedDrive([path]).entries()]

    assert {"/out/warning", "/out/sensor_lost", "/out/discarded"} <= {e.topic for e in entries}
    assert any(RecordedDrive([path]).header.certificates for path in DRIVES)


@pytest.mark.parametrize("path", DRIVES, ids=lambda path: str(path.stem))
def test_the_replay_of_a_drive_equals_the_recording(path: Path) -> None:
    comparison = compare(RecordedDrive([path]))

    assert comparison.difference is None
    assert comparison.outputs > 100
    assert path.stat().st_size < LARGEST_BYTES
