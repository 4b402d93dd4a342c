"""What the rig makes of a recording: a trace on the rig's clock, or why it is not judged."""

from dataclasses import replace
from pathlib import Path

import pytest

from onboard.observations import Position
from onboard.recorder.records import CameraImage, RecordedMessage
from onboard.recorder.segment import IMAGES, Segment
from sim_rig.boxes.box_log import FramesOfRun, box_log
from sim_rig.boxes.box_recording import read_box_recording
from tests.recorder.drive import START_S, START_UTC_S, record_drive
from tests.recorder.headers import HEADER

OFFSET_S = -4900.25
"""Rig time minus box time."""
LATENCY_S = 0.0003
DURATION_S = 4.0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("recorded"), DURATION_S)


@pytest.fixture
def seen(recorded: Path) -> FramesOfRun:
    """The frames of this drive as a rig notes them, whose UTC is the box's."""
    box = read_box_recording(recorded)
    return FramesOfRun(
        {wsm: at + OFFSET_S + LATENCY_S for wsm, at in box.sent.items()},
        {wsm: at + OFFSET_S - LATENCY_S for wsm, at in box.received.items()},
        START_S + OFFSET_S,
        START_S + OFFSET_S + DURATION_S,
        START_UTC_S - START_S - OFFSET_S,
    )


def test_the_trace_is_on_the_rig_s_clock(recorded: Path, seen: FramesOfRun, tmp_path: Path) -> None:
    log = box_log(recorded, seen, tmp_path / "copy")

    assert log.why_not_judged is None
    assert log.clock is not None
    assert abs(log.clock.offset_s - OFFSET_S) <= log.clock.uncertainty_s < 0.001
    own = read_box_recording(recorded).records
    assert {"transition", "warning"} <= {record["kind"] for record in own}
    for ours, its in zip(log.records, own, strict=True):
        assert ours["stamp_s"] - its["stamp_s"] == pytest.approx(log.clock.offset_s)
    copied = sorted(file.name for file in (tmp_path / "copy").iterdir())
    assert copied == sorted(file.name for file in recorded.iterdir())


def test_images_and_positions_for_viewers_are_no_part_of_the_trace(tmp_path: Path) -> None:
    segment = Segment(tmp_path / "20260101T000000.000Z-0000.mcap", HEADER, 0)
    position = Position(1000.0, 52.1, 13.2, 34.0, 1.5, 10.0, 0.1)
    segment.add(RecordedMessage(IMAGES, HEADER.utc_s, CameraImage(1000.0, b"\xff\xd8")))
    segment.add(RecordedMessage("/in/position", HEADER.utc_s, position))
    segment.close()
    assert [record["kind"] for record in read_box_recording(tmp_path).records] == ["position"]


def test_a_clock_that_is_wrong_by_an_hour_is_named(
    recorded: Path, seen: FramesOfRun, tmp_path: Path
) -> None:
    rig = replace(seen, utc_offset_s=seen.utc_offset_s - 3600.0)
    why = box_log(recorded, rig, tmp_path / "copy").why_not_judged
    assert why == "its UTC is +3600.0 s from the rig's; 2 s are allowed"


def test_a_box_that_restarted_in_the_run_is_not_judged(
    recorded: Path, seen: FramesOfRun, tmp_path: Path
) -> None:
    before = {f"frame {n}".encode(): seen.start_s + 0.1 * n for n in (1, 2, 3)}
    rig = replace(seen, from_box=before | dict(seen.from_box))
    log = box_log(recorded, rig, tmp_path / "copy")
    assert log.records == ()
    assert log.why_not_judged is not None
    assert "3 frames of the box are not in its recording, from 0.1 to 0.3 s" in log.why_not_judged


def test_a_folder_without_a_recording_is_named(seen: FramesOfRun, tmp_path: Path) -> None:
    why = box_log(tmp_path, seen, tmp_path / "copy").why_not_judged
    assert why == f"{tmp_path}: no recording; the box needs `recorder.folder`"
