"""What the rig makes of a recording: a trace on the rig's clock, or why it is not judged."""

from dataclasses import replace
from pathlib import Path

import pytest

from onboard.observations import Position
from onboard.recorder.build import present_build
from onboard.recorder.records import CameraImage, RecordedMessage
from onboard.recorder.segment import IMAGES, Segment
from sim_rig.boxes.box_computer import TimeWithoutPower
from sim_rig.boxes.box_configuration import differences
from sim_rig.boxes.box_log import FramesOfRun, box_log, other_identity
from sim_rig.boxes.box_recording import read_box_recordings
from sim_rig.boxes.sent_messages import sent_messages
from sim_rig.run_log.run_log import Record
from sim_rig.scenario.car_config import car_config
from sim_rig.scenario.schema import load_scenario
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
    box = next(iter(read_box_recordings(recorded)))
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
    (clock,) = log.clocks
    assert abs(clock.offset_s - OFFSET_S) <= clock.uncertainty_s < 0.001
    own = next(iter(read_box_recordings(recorded))).records
    assert {"transition", "warning"} <= {record["kind"] for record in own}
    for ours, its in zip(log.records, own, strict=True):
        assert ours["stamp_s"] - its["stamp_s"] == pytest.approx(clock.offset_s)
    copied = sorted(file.name for file in (tmp_path / "copy").iterdir())
    assert copied == sorted(file.name for file in recorded.iterdir())


def test_images_and_positions_for_viewers_are_no_part_of_the_trace(tmp_path: Path) -> None:
    segment = Segment(tmp_path / "20260101T000000.000Z-0000.mcap", HEADER, 0)
    position = Position(1000.0, 52.1, 13.2, 34.0, 1.5, 10.0, 0.1)
    segment.add(RecordedMessage(IMAGES, HEADER.utc_s, CameraImage(1000.0, b"\xff\xd8")))
    segment.add(RecordedMessage("/in/position", HEADER.utc_s, position))
    segment.close()
    assert [record["kind"] for record in next(iter(read_box_recordings(tmp_path))).records] == [
        "position"
    ]


def test_a_clock_that_is_wrong_by_an_hour_is_named(
    recorded: Path, seen: FramesOfRun, tmp_path: Path
) -> None:
    rig = replace(seen, utc_offset_s=seen.utc_offset_s - 3600.0)
    why = box_log(recorded, rig, tmp_path / "copy").why_not_judged
    assert why == "its UTC is +3600.0 s from the rig's; 2 s are allowed"


def test_a_box_whose_recording_lacks_frames_is_not_judged(
    recorded: Path, seen: FramesOfRun, tmp_path: Path
) -> None:
    before = {f"frame {n}".encode(): seen.start_s + 0.1 * n for n in (1, 2, 3)}
    rig = replace(seen, from_box=before | dict(seen.from_box))
    log = box_log(recorded, rig, tmp_path / "copy")
    assert log.records == ()
    assert log.why_not_judged is not None
    assert "3 frames of the box are not in its recording, from 0.1 to 0.3 s" in log.why_not_judged


RESTART_S = 7.0
"""From the first start of the box to the second, after which its monotonic clock begins again."""
CUT = TimeWithoutPower(*(START_S + OFFSET_S + at for at in (3.8, 4.0, 6.5)))


@pytest.fixture(scope="module")
def restarted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the drive before a power cut, and the one after."""
    folder = tmp_path_factory.mktemp("restarted")
    record_drive(folder, DURATION_S, signed=True)
    return record_drive(folder, DURATION_S, signed=True, start_utc_s=START_UTC_S + RESTART_S)


@pytest.fixture
def seen_twice(restarted: Path, seen: FramesOfRun) -> FramesOfRun:
    """The frames of both, and one that was sent just before the power cut and not recorded."""
    from_box, to_box = {b"last": seen.start_s + 3.9}, dict[bytes, float]()
    for drive, start_s in zip(read_box_recordings(restarted), (RESTART_S, 0.0), strict=True):
        offset_s = OFFSET_S + start_s
        from_box |= {wsm: at + offset_s + LATENCY_S for wsm, at in drive.sent.items()}
        to_box |= {wsm: at + offset_s - LATENCY_S for wsm, at in drive.received.items()}
    end_s = seen.start_s + RESTART_S + DURATION_S
    return replace(seen, from_box=from_box, to_box=to_box, end_s=end_s, power_cuts=[CUT])


def test_the_trace_of_a_box_whose_power_was_cut_has_both_starts(
    restarted: Path, seen_twice: FramesOfRun, tmp_path: Path
) -> None:
    log = box_log(restarted, seen_twice, tmp_path / "copy")

    assert log.why_not_judged is None
    offsets_s = [clock.offset_s for clock in log.clocks]
    assert offsets_s == pytest.approx([OFFSET_S, OFFSET_S + RESTART_S], abs=0.001)
    stamps_s = [each["stamp_s"] - seen_twice.start_s for each in log.records]
    assert max(each for each in stamps_s if each < 5.0) == pytest.approx(DURATION_S, abs=0.06)
    assert min(each for each in stamps_s if each > 5.0) == pytest.approx(RESTART_S, abs=0.06)
    assert len(list((tmp_path / "copy").iterdir())) == 2


@pytest.mark.parametrize(
    ("power_cuts", "why"),
    [
        ([], "it restarted in the run, at 7.0 s, unasked"),
        ([replace(CUT, cut_s=CUT.cut_s + 2.0)], "frames of the box are not in its rec"),
        ([replace(CUT, off_s=CUT.cut_s - 2.0)], "the command does not cut its power"),
    ],
)
def test_a_restart_that_nobody_asked_for_is_not_judged(
    restarted: Path,
    seen_twice: FramesOfRun,
    tmp_path: Path,
    power_cuts: list[TimeWithoutPower],
    why: str,
) -> None:
    rig = replace(seen_twice, power_cuts=power_cuts)
    log = box_log(restarted, rig, tmp_path / "copy")
    assert log.records == ()
    assert why in str(log.why_not_judged)


def test_a_box_that_stays_off_is_judged_by_its_first_start(
    recorded: Path, seen: FramesOfRun, tmp_path: Path
) -> None:
    rig = replace(seen, end_s=seen.start_s + 20.0, power_cuts=[CUT])
    log = box_log(recorded, rig, tmp_path / "copy")
    assert (log.why_not_judged, len(log.clocks)) == (None, 1)


def test_a_folder_without_a_recording_is_named(seen: FramesOfRun, tmp_path: Path) -> None:
    why = box_log(tmp_path, seen, tmp_path / "copy").why_not_judged
    assert why == f"{tmp_path}: no recording; the box needs `recorder.folder`"


def test_messages_that_the_rig_received_are_a_trace_of_what_was_sent(recorded: Path) -> None:
    (drive,) = read_box_recordings(recorded)
    traced = [each for each in drive.records if each["kind"] == "sent"]

    found = sent_messages({b"no WSM": 0.0} | drive.sent)

    def content(record: Record) -> tuple[object, object]:
        return record["message"], record["content"]

    assert {each["message"] for each in found} == {"inquiry", "join"}
    repeated = [each for n, each in enumerate(traced) if content(each) in map(content, traced[:n])]
    assert len(found) == len(traced) - len(repeated)
    assert all(content(each) in map(content, traced) for each in found)


def test_a_box_with_another_plate_is_not_judged(recorded: Path) -> None:
    (drive,) = read_box_recordings(recorded)
    own = next(each["content"]["sender_id"] for each in drive.records if each["kind"] == "sent")
    assert other_identity(drive.records, [own], START_S) is None
    assert other_identity([], [own], START_S) is None
    # IDs of an epoch before the run are unknown.
    assert other_identity(drive.records, ["ab"], START_S + DURATION_S) is None
    why = other_identity(drive.records, ["ab"], START_S)
    assert why is not None
    assert why.startswith(f"it sends as {own}, which is not of the scenario's plate: `car.plate`")


def test_another_build_or_configuration_is_named(recorded: Path) -> None:
    scenario = load_scenario("fig4")
    config = car_config(scenario, "red", seed=0) | {"car": {"plate": "X1", "length_m": 4.5}}
    same = HEADER.model_copy(update={"software": present_build().name, "config": config})
    assert list(differences(same, scenario, "red")) == []
    other = config | {"lcca": {"join_headway_s": 1.5}, "beacons": False}
    found = differences(
        HEADER.model_copy(update={"software": "0.0.1", "config": other}), scenario, "red"
    )
    headway = f"lcca.join_headway_s 1.5 ({scenario.lcca.join_headway_s})"
    assert list(found) == [
        f"its onboard is 0.0.1, the rig's {present_build().name}",
        f"its configuration (and a process's): beacons False (True), {headway}",
    ]
    newer = HEADER.model_copy(update={"config": config | {"lidar": {}}})
    assert (
        "this version cannot read its configuration" in list(differences(newer, scenario, "red"))[1]
    )
