"""What a box decided on a played drive is compared only if it was asked the same."""

import shutil
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from onboard.recorder.reader import RecordedDrive
from sim_rig.boxes.box_recording import BoxRecording, read_box_recordings
from sim_rig.boxes.played_decisions import (
    BoxDecisions,
    DriveSource,
    NotPlayedError,
    compare_decisions,
)
from sim_rig.boxes.played_drive import Wire, of_black_box
from sim_rig.boxes.player import Played

LIVE = Path(__file__).parents[2] / "drives" / "live.mcap"


@pytest.fixture
def recording(tmp_path: Path) -> BoxRecording:
    """A box that recorded the very drive."""
    shutil.copy(LIVE, tmp_path / "20261124T162213.198Z-0000.mcap")
    return next(read_box_recordings(tmp_path))


def compared(recording: BoxRecording, seed: int, *more: Wire) -> BoxDecisions:
    """Compare it with a drive of `seed`, which has these wires too."""
    drive = of_black_box(RecordedDrive([LIVE]))
    played = Played(list(islice(drive.inputs(), 100)), 0.0, (), 0, None)
    header = recording.header.model_copy(update={"seed": (seed,)})
    source = DriveSource(replace(drive, wires=drive.wires | set(more)), lambda: iter(()), header)
    return compare_decisions("red", source, recording, played)


def test_a_box_with_another_seed_has_asked_other_questions(recording: BoxRecording) -> None:
    with pytest.raises(NotPlayedError, match="the questions of `seed: 5`, which the box's"):
        compared(recording, 5, "camera")


def test_without_pictures_it_asks_nothing_and_may_have_any_seed(recording: BoxRecording) -> None:
    assert compared(recording, 5).decisions.first is None
