"""What a recorded drive puts on the wires of a box, and when."""

from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from onboard.detector.object_list import ObjectListReader
from onboard.errors import UserError
from onboard.gnss.nmea import NmeaReader
from onboard.obd.can_frame import CanFrame
from onboard.observations import DetectionList, Position, VehicleDetection
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.records import CameraImage, RecordedMessage, StepEnd
from onboard.recorder.segment import IMAGES, Segment
from onboard.replay import replay
from onboard.tools.export import write_candump, write_pcap
from onboard.tools.replay import RawRecording
from onboard.trace.trace_line import Event
from sim_rig.boxes.played_drive import (
    PlayedEntries,
    PlayedInput,
    Received,
    of_black_box,
    of_raw_recordings,
    own_ids,
    start_on_clock_of,
)
from tests.recorder.headers import HEADER
from tests.typed import about

DRIVES = Path(__file__).parents[2] / "drives"
LIVE = DRIVES / "live.mcap"
ANSWER = CanFrame(0.0, 0x7E8, is_extended_id=False, data=bytes([3, 0x41, 13, 50, 0, 0, 0, 0]))


def candump(path: Path, *lines: str) -> Path:
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def test_a_black_box_recording_is_played_in_its_own_time_base() -> None:
    recorded = RecordedDrive([LIVE])
    drive = of_black_box(recorded)
    played = list(drive.inputs())

    topics = Counter(entry.topic for entry in recorded.entries())
    by_wire = Counter(each.wire for each in played)
    assert by_wire == {"bus": topics["/in/can"], "radio": topics["/in/wsm"]}
    assert played[0].at_s == 0.0
    assert played == sorted(played, key=lambda each: each.at_s)
    steps = [entry.record["stamp_s"] for entry in recorded.entries() if entry.topic == "/in/step"]
    assert {each.at_s + drive.start_s for each in played} <= set(steps) | {drive.start_s}
    begins_s = drive.start_s - recorded.header.now_s
    assert drive.start_utc_s == pytest.approx(recorded.header.utc_s + begins_s)
    assert drive.before_s == pytest.approx(begins_s)


def test_what_is_on_no_wire_is_left_out_of_the_replay_too() -> None:
    assert of_black_box(RecordedDrive([LIVE])).left_out == ("lead", "plate", "vehicle_detection")
    decided = {event.kind for step in replay.play(PlayedEntries([LIVE])) for event in step.events}
    assert "received" in decided
    assert "lead" not in decided


def recording_of(path: Path, *values: tuple[float, str, Event]) -> RecordedDrive:
    """Write a recording of values, each with its time in the drive and its topic."""
    segment = Segment(path, HEADER, 0)
    for at_s, topic, value in values:
        segment.add(RecordedMessage(topic, HEADER.utc_s + at_s, value))
    segment.close()
    return RecordedDrive([path])


def test_pictures_positions_and_detections_of_a_black_box_are_played(tmp_path: Path) -> None:
    begin_s = HEADER.now_s
    seen = VehicleDetection(begin_s + 0.15, 7, 20.0, 1.0, 0.1, 0.01)
    fix = Position(begin_s + 0.2, 56.0, 10.0, None, 1.5, 15.0, 0.5)
    drive = of_black_box(
        recording_of(
            tmp_path / "drive-0000.mcap",
            (0.3, "/in/detection_list", DetectionList(begin_s + 0.15, (seen,))),
            (0.3, "/in/position", fix),
            (0.3, "/in/step", StepEnd(begin_s + 0.3, HEADER.utc_s + 0.3)),
            # A picture is recorded when it has been looked at.
            (0.1, IMAGES, CameraImage(begin_s + 0.1, b"jpeg")),
        )
    )
    played = list(drive.inputs())
    found = [(each.wire, about(each.at_s, 1e-6)) for each in played]
    assert found == [("camera", 0.0), ("detector", 0.2), ("satellites", 0.2)]
    assert played[0].data == b"jpeg"

    reader = ObjectListReader()
    reader.receive_bytes(played[1].data, now=5000.0)
    detections = reader.next_event()
    assert isinstance(detections, DetectionList)
    assert [each.range_m for each in detections.cars] == [20.0]
    gnss = NmeaReader()
    gnss.receive_bytes(played[2].data)
    gnss.receive_end()
    received = gnss.next_event()
    assert isinstance(received, Position)
    assert received.stamp_s == pytest.approx(HEADER.utc_s + 0.2, abs=0.01)
    assert (received.altitude_m, received.sigma_m) == (None, 1.5)


def test_a_recording_that_is_cut_in_the_middle_is_played_up_to_the_cut(tmp_path: Path) -> None:
    whole = list(of_black_box(RecordedDrive([LIVE])).inputs())
    (tmp_path / "cut.mcap").write_bytes(LIVE.read_bytes()[: LIVE.stat().st_size // 2])
    played = list(of_black_box(RecordedDrive([tmp_path / "cut.mcap"])).inputs())
    assert len(whole) / 10 < len(played) < len(whole)
    assert played == whole[: len(played)]


def test_after_a_clock_step_fixes_have_the_utc_of_the_new_clock(tmp_path: Path) -> None:
    begin_s, stepped_s = HEADER.now_s, HEADER.utc_s + 600.0
    steps = [(0.2, HEADER.utc_s), (1.2, stepped_s), (2.2, stepped_s)]
    values: list[tuple[float, str, Event]] = []
    for at_s, utc_s in steps:
        fix = Position(begin_s + at_s - 0.1, 56.0, 10.0, None, 1.5, 15.0, 0.5)
        values.append((at_s, "/in/position", fix))
        values.append((at_s, "/in/step", StepEnd(begin_s + at_s, utc_s + at_s)))
    drive = of_black_box(recording_of(tmp_path / "drive-0000.mcap", *values))
    played = list(drive.inputs())
    assert [about(each.at_s, 1e-6) for each in played] == [0.0, 1.0, 2.0], "the drive goes on"
    gnss = NmeaReader()
    gnss.receive_bytes(played[-1].data)
    gnss.receive_end()
    received = gnss.next_event()
    assert isinstance(received, Position)
    assert received.stamp_s == pytest.approx(stepped_s + 2.1, abs=0.01)


def test_logs_and_capture_are_played_in_one_time_base(tmp_path: Path) -> None:
    recorded = RecordedDrive([LIVE])
    with (tmp_path / "bus.log").open("wb") as bus, (tmp_path / "radio.pcap").open("wb") as radio:
        write_candump(recorded, bus)
        write_pcap(recorded, radio)
    drive = of_raw_recordings(RawRecording(can=tmp_path / "bus.log", pcap=tmp_path / "radio.pcap"))

    played = list(drive.inputs())
    assert {each.wire for each in played} == drive.wires == {"bus", "radio"}
    of_box = [each for each in of_black_box(recorded).inputs() if each.wire == "radio"]
    of_capture = [each for each in played if each.wire == "radio"]
    assert [each.data for each in of_capture] == [each.data for each in of_box]


def test_a_clip_starts_with_the_first_can_frame(tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((36, 64, 3), 40 * number, np.uint8))
    log = candump(
        tmp_path / "bus.log",
        "(1700000000.000000) can0 7E8#03410D32",
        "(1700000000.150000) can0 7E8#03410D32",
    )
    drive = of_raw_recordings(RawRecording(can=log, clip=f"{tmp_path}/*.png", fps=10.0))
    played = list(drive.inputs())
    found = [(each.wire, about(each.at_s, 1e-6)) for each in played]
    assert found == [
        ("bus", 0.0), ("camera", 0.0), ("camera", 0.1), ("bus", 0.15), ("camera", 0.2),
    ]  # fmt: skip
    image = cv2.imdecode(np.frombuffer(played[2].data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert abs(float(image.mean()) - 40.0) < 1.0
    assert drive.start_utc_s == 1_700_000_000.0


def test_a_fix_is_played_as_sentences_that_have_its_values(tmp_path: Path) -> None:
    log = tmp_path / "drive.nmea"
    log.write_text(
        "$GNRMC,045000.34,A,5606.25716,N,01008.71506,E,30.567,12.00,260721,,,A*7C\r\n"
        "$GNGGA,045000.34,5606.25716,N,01008.71506,E,1,10,1.0,0.0,M,0.0,M,,*4A\r\n"
    )
    (played,) = of_raw_recordings(RawRecording(gnss=log)).inputs()
    reader = NmeaReader()
    reader.receive_bytes(played.data)
    reader.receive_end()
    fix = reader.next_event()
    assert isinstance(fix, Position)
    assert fix.stamp_s == pytest.approx(1627275000.34)
    assert fix.latitude_deg == pytest.approx(56 + 6.25716 / 60, abs=1e-9)
    assert fix.speed_m_s == pytest.approx(30.567 * 1852 / 3600, abs=1e-3)


def test_recordings_without_utc_say_so(tmp_path: Path) -> None:
    log = candump(tmp_path / "bus.log", "(5.000000) can0 7E8#03410D32")
    assert of_raw_recordings(RawRecording(can=log)).start_utc_s is None


def test_a_recording_without_an_input_of_a_wire_cannot_be_played(tmp_path: Path) -> None:
    log = candump(tmp_path / "bus.log")
    with pytest.raises(UserError, match="nothing to play"):
        of_raw_recordings(RawRecording(can=log))


def test_the_start_is_found_by_the_first_frame_that_both_ends_have() -> None:
    other = CanFrame(0.0, 0x009, is_extended_id=False, data=b"\x01")
    sent = [PlayedInput(0.0, "bus", other), PlayedInput(0.25, "bus", ANSWER)]
    # The daemon's filter has kept the other frame from it.
    received = [Received("bus", CanFrame(1000.26, 0x7E8, False, ANSWER.data), 1000.26)]
    assert start_on_clock_of(received, sent) == pytest.approx(1000.01)
    assert start_on_clock_of([], sent) is None


def test_what_a_receiver_decodes_is_found_by_its_wire() -> None:
    sent = [PlayedInput(0.0, "bus", ANSWER), PlayedInput(0.4, "camera", b"jpeg")]
    assert start_on_clock_of([Received("camera", object(), 50.5)], sent) == pytest.approx(50.1)


def test_the_communication_ids_of_a_vehicle_are_in_its_recording() -> None:
    own = own_ids(RecordedDrive([LIVE]))
    sent = [
        entry.record["content"]["sender_id"]
        for entry in RecordedDrive([LIVE]).entries()
        if entry.topic == "/out/sent" and "sender_id" in entry.record["content"]
    ]
    assert set(sent) <= {each.hex() for each in own}
    assert 1 <= len(set(sent)) <= len(own) <= 2  # a drive may begin in one epoch and end in another
