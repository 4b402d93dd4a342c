"""Replay of raw recordings: observations with the time stamps of the drive."""

import csv
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from onboard.errors import UserError
from onboard.kinematics.units import KM_H
from onboard.observations import LeadIdentity, Sensor, SensorLost
from onboard.recorder.reader import RecordedDrive
from onboard.tools import replay_cli
from onboard.tools.export import write_pcap
from onboard.tools.replay import UNCONFIGURED, RawRecording, received_packets, replay
from onboard.vision.settings import CameraSettings


@pytest.mark.long
@pytest.mark.realdata
def test_every_obd_speed_of_a_real_drive_has_its_time_stamp(rig_data: Path) -> None:
    with (rig_data / "can" / "drive-a-obd-speed-kmh.csv").open() as file:
        truth = [(float(row["t"]), int(row["obd_kmh"])) for row in csv.DictReader(file)]

    events = replay(RawRecording(can=rig_data / "can" / "drive-a.log"), UNCONFIGURED)
    speeds = [(e.stamp_s, e.speed_m_s / KM_H) for e in events if e.kind == "speed"]  # type: ignore[attr-defined]

    assert [kmh for _, kmh in speeds] == pytest.approx([kmh for _, kmh in truth])
    assert [stamp for stamp, _ in speeds] == pytest.approx([stamp for stamp, _ in truth], abs=1e-3)


@pytest.mark.realdata
def test_a_bus_without_obd_is_reported_as_a_lost_speed_sensor(rig_data: Path) -> None:
    events = list(replay(RawRecording(can=rig_data / "can" / "no-obd.log"), UNCONFIGURED))

    assert [event.kind for event in events] == ["sensor_lost"]
    assert isinstance(events[0], SensorLost)
    assert events[0].sensor is Sensor.SPEED
    assert events[0].silent_s is None, "no speed was ever received"


@pytest.mark.long
@pytest.mark.realdata
@pytest.mark.parametrize("clip", ["motorway-720p.mp4", "empty-lane-540p.mp4"])
def test_dashcam_clips_without_legible_plates_give_no_plate(rig_data: Path, clip: str) -> None:
    events = list(replay(RawRecording(clip=str(rig_data / "clips" / clip)), UNCONFIGURED))

    leads = [event for event in events if event.kind == "lead"]
    assert leads, "one per frame"
    assert not [lead for lead in leads if lead.identity is LeadIdentity.KNOWN]  # type: ignore[attr-defined]
    assert [event for event in events if event.kind == "plate"] == []


@pytest.mark.long
@pytest.mark.realdata
def test_can_frames_and_positions_are_merged_in_order_of_time(rig_data: Path) -> None:
    recording = RawRecording(
        can=rig_data / "can" / "drive-a.log", gnss=rig_data / "gnss" / "drive-a.nmea"
    )
    kinds: Counter[str] = Counter()
    last_s = 0.0
    for event in replay(recording, UNCONFIGURED):
        kinds[event.kind] += 1
        assert event.stamp_s > last_s - 2.0, "at most the latency of a sensor"
        last_s = event.stamp_s

    assert kinds["speed"] == 1203
    assert kinds["position"] > 500


@pytest.mark.long
@pytest.mark.realdata
def test_an_nmea_log_cut_within_a_sentence_starts_at_its_first_fix(
    rig_data: Path, tmp_path: Path
) -> None:
    whole = (rig_data / "gnss" / "drive-a.nmea").read_bytes().splitlines(keepends=True)[:60]
    log = tmp_path / "cut.nmea"
    log.write_bytes(b"$GPRMC,bad*00\r\n" + b"".join(whole))

    events = list(replay(RawRecording(gnss=log), UNCONFIGURED))

    assert [event.kind for event in events][:2] == ["discarded", "position"]
    assert events[0].stamp_s == events[1].stamp_s > 1e9
    assert events[-1].stamp_s < events[0].stamp_s + 30.0


def test_a_recording_of_a_single_fix_is_replayed(tmp_path: Path) -> None:
    log = tmp_path / "fix.nmea"
    log.write_text("$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A")

    assert [event.kind for event in replay(RawRecording(gnss=log), UNCONFIGURED)] == ["position"]


@pytest.mark.long
@pytest.mark.realdata
def test_a_clip_without_a_can_log_starts_at_the_first_fix(rig_data: Path, tmp_path: Path) -> None:
    whole = (rig_data / "gnss" / "drive-a.nmea").read_bytes().splitlines(keepends=True)[:60]
    log = tmp_path / "drive.nmea"
    log.write_bytes(b"".join(whole))
    picture = np.random.default_rng(1).integers(0, 255, (180, 320, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "1.png"), picture)

    events = list(replay(RawRecording(clip=str(tmp_path / "1.png"), gnss=log), UNCONFIGURED))

    begins_s = {event.kind: event.stamp_s for event in reversed(events)}
    assert begins_s["lead"] == begins_s["position"]


@pytest.mark.realdata
def test_recordings_with_different_clocks_are_a_user_error(rig_data: Path, tmp_path: Path) -> None:
    bus = tmp_path / "drive.log"
    bus.write_text("(0.000000) can0 7E8#03410D3C00000000\n")
    recording = RawRecording(can=bus, gnss=rig_data / "gnss" / "drive-a.nmea")

    with pytest.raises(
        UserError, match=r"jumps from 0 to \d{10} s: its files must be of one drive"
    ):
        list(replay(recording, UNCONFIGURED))


def test_unreadable_log_lines_are_reported_anywhere_in_the_file(tmp_path: Path) -> None:
    bus = tmp_path / "drive.log"
    frame = "can0 7E8#03410D3C00000000"
    bus.write_text(f"nonsense\n(1.0) {frame}\nnonsense\n(1.1) {frame}\nnonsense\n")

    events = replay(RawRecording(can=bus), UNCONFIGURED)

    assert sum(getattr(event, "reason", "") == "log_line" for event in events) == 3


def test_an_empty_recording_is_a_user_error(tmp_path: Path) -> None:
    log = tmp_path / "drive.nmea"
    log.touch()
    with pytest.raises(UserError, match=r"drive\.nmea: nothing to replay"):
        list(replay(RawRecording(gnss=log), UNCONFIGURED))


def test_a_recording_without_a_fix_is_named_beside_one_that_can_be_read(tmp_path: Path) -> None:
    log = tmp_path / "notes.txt"
    log.write_text("hello\n", encoding="utf-8")
    can = Path(__file__).parents[2] / "examples/desk.log"

    with pytest.raises(UserError, match=r"notes\.txt: nothing to replay: no readable fix$"):
        list(replay(RawRecording(can=can, gnss=log), UNCONFIGURED))


def test_a_black_box_recording_takes_no_other_configuration() -> None:
    with pytest.raises(UserError, match="the black box has its own"):
        replay_cli.replay([Path("box")], config=Path("car.yaml"))


def test_a_negative_frame_rate_is_a_user_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"onboard replay: fps: Input should be greater than 0"):
        list(replay(RawRecording(clip=str(tmp_path), fps=-3.0), UNCONFIGURED))


def test_a_clip_of_another_shape_than_the_calibration_is_one_error(tmp_path: Path) -> None:
    """Each frame was discarded, in a line of its own, and the exit code was 0."""
    cv2.imwrite(str(tmp_path / "1.png"), np.full((180, 180, 3), 90, np.uint8))
    camera = CameraSettings(source="0", width_px=1280, height_px=720)
    config = UNCONFIGURED.model_copy(update={"camera": camera})

    with pytest.raises(UserError, match=r"1\.png: its images of 180 x 180 px.*1280 x 720"):
        list(replay(RawRecording(clip=str(tmp_path / "1.png")), config))


def test_a_missing_recording_is_an_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"drive\.log"):
        list(replay(RawRecording(can=tmp_path / "drive.log"), UNCONFIGURED))
    with pytest.raises(UserError, match=r"drive\.nmea: cannot be read: No such file"):
        list(replay(RawRecording(gnss=tmp_path / "drive.nmea"), UNCONFIGURED))


def test_the_wsms_of_a_capture_are_received_but_those_that_the_vehicle_sent(tmp_path: Path) -> None:
    drive = RecordedDrive([Path(__file__).parents[1] / "drives" / "lossy-radio.mcap"])
    with (tmp_path / "radio.pcap").open("wb") as file:
        write_pcap(drive, file)
    received = sum(entry.topic == "/in/wsm" for entry in drive.entries())

    assert sum(1 for _ in received_packets(tmp_path / "radio.pcap")) == received
    events = list(replay(RawRecording(pcap=tmp_path / "radio.pcap"), UNCONFIGURED))
    assert any(event.kind == "received" for event in events)


def test_a_file_that_is_no_capture_is_named(tmp_path: Path) -> None:
    (tmp_path / "radio.pcap").write_bytes(b"(1.0) can0 7E8#0")
    with pytest.raises(UserError, match=r"radio\.pcap: neither pcap nor pcapng"):
        next(replay(RawRecording(pcap=tmp_path / "radio.pcap"), UNCONFIGURED))
