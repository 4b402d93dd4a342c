"""Retention of segments by age, total size and events."""

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from onboard.obd.can_frame import CanFrame
from onboard.observations import HardBrake
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.records import Identity, RecordedMessage
from onboard.recorder.retention import (
    LEAST_FREE_MIB,
    StoredSegment,
    kept_path,
    segments_to_delete,
)
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings
from onboard.step import BrakeButton, ReceivedWsm
from tests.recorder.drive import SegmentWriter
from tests.recorder.headers import HEADER

NOW_UTC_S = 1_750_000_000.0
MIB = 2**20


def stored(name: str, age_s: float, size_mib: float = 1.0) -> StoredSegment:
    return StoredSegment(Path(f"{name}.mcap"), NOW_UTC_S - age_s, round(size_mib * MIB))


def deleted(
    *segments: StoredSegment, writing_mib: float = 0.0, disk_mib: float = 1e6, **settings: Any
) -> list[str]:
    chosen = RecorderSettings(folder=Path("/box"), **settings)
    sizes = round(writing_mib * MIB), round(disk_mib * MIB)
    return [each.stem for each in segments_to_delete(segments, *sizes, chosen, NOW_UTC_S)]


def test_old_segments_are_deleted_later_if_near_an_event() -> None:
    old, kept, new = stored("old", 3700.0), stored("old-kept", 9000.0), stored("new", 3500.0)

    assert deleted(old, kept, new, ring_s=3600.0) == ["old"]
    assert deleted(old, kept, new, ring_s=3600.0, kept_ring_s=8000.0) == ["old", "old-kept"]


def test_the_oldest_segments_are_deleted_until_the_rest_fits_near_events_last() -> None:
    segments = [stored("a-kept", 50.0), stored("b", 40.0), stored("c", 30.0), stored("d", 20.0)]

    assert deleted(*segments, ring_mib=4.0) == []
    assert deleted(*segments, ring_mib=3.0) == ["b"]
    assert deleted(*segments, ring_mib=2.0, writing_mib=0.5) == ["b", "c", "d"]
    assert deleted(*segments, ring_mib=1.0, writing_mib=0.5) == ["b", "c", "d", "a-kept"]


def test_the_oldest_segments_are_deleted_until_the_disk_has_room() -> None:
    """Whatever `ring_mib` says: the disk may be smaller, or others may have filled it."""
    segments = [stored("a-kept", 50.0), stored("b", 40.0), stored("c", 30.0)]

    assert deleted(*segments, disk_mib=LEAST_FREE_MIB) == []
    assert deleted(*segments, disk_mib=LEAST_FREE_MIB - 0.5) == ["b"]
    assert deleted(*segments, disk_mib=0.0) == ["b", "c", "a-kept"]


def test_the_suffix_of_kept_segments_is_added_once() -> None:
    path = kept_path(Path("x-0001.mcap"))

    assert path == kept_path(path) == Path("x-0001-kept.mcap")


def names(folder: Path) -> list[str]:
    return sorted(path.stem.removeprefix(f"{HEADER.drive}-") for path in folder.iterdir())


def drive(
    recorder: SegmentWriter, until_s: float, brakes_at: float, brake_ends_at: float | None = None
) -> None:
    """Write one CAN frame per second, and a hard braking from `brakes_at` on."""
    recorder.begin(HEADER)
    for second in range(round(until_s)):
        now = HEADER.now_s + second
        frame = CanFrame(now, 0x7E8, is_extended_id=False, data=b"\x03\x41\x0d\x32")
        recorder.record(RecordedMessage("/in/can", HEADER.utc_s + second, frame))
        if second in {brakes_at, brake_ends_at}:
            brake = HardBrake(now, 5.0, "obd:7E8", is_over=second == brake_ends_at)
            recorder.record(RecordedMessage("/out/hard_brake", HEADER.utc_s + second, brake))
    recorder.segments.close(HEADER.now_s + until_s)


def test_segments_near_a_hard_brake_are_kept(tmp_path: Path) -> None:
    recorder = SegmentWriter(tmp_path, segment_s=10.0, keep_s=12.0)
    drive(recorder, until_s=80.0, brakes_at=35)

    assert names(tmp_path) == [
        "0000",
        "0001",
        "0002-kept",
        "0003-kept",
        "0004-kept",
        "0005",
        "0006",
        "0007",
    ]


def test_segments_near_the_end_of_a_hard_braking_are_kept_too(tmp_path: Path) -> None:
    recorder = SegmentWriter(tmp_path, segment_s=10.0, keep_s=12.0)
    drive(recorder, until_s=80.0, brakes_at=35, brake_ends_at=46)

    kept = [name for name in names(tmp_path) if name.endswith("-kept")]
    assert kept == ["0002-kept", "0003-kept", "0004-kept", "0005-kept"]


def test_a_long_drive_keeps_its_end_and_the_segments_near_events(tmp_path: Path) -> None:
    recorder = SegmentWriter(tmp_path, segment_s=10.0, keep_s=5.0, ring_s=65.0)
    drive(recorder, until_s=200.0, brakes_at=35)

    assert names(tmp_path)[0] == "0003-kept"
    assert names(tmp_path)[1:] == [f"{number:04}" for number in range(12, 20)]
    assert RecordedDrive([tmp_path]).missing == list(range(4, 12))


def test_a_clock_that_is_set_a_month_ahead_for_a_while_makes_no_segment_old(tmp_path: Path) -> None:
    old = SegmentWriter(tmp_path, segment_s=10.0)
    drive(old, until_s=30.0, brakes_at=15)
    kept = {path for path in tmp_path.iterdir() if path.stem.endswith("-kept")}
    for path in kept:
        os.utime(path, (HEADER.utc_s, HEADER.utc_s))
    settings = RecorderSettings(folder=tmp_path, segment_s=3600.0)
    new = Segments(settings, HEADER.model_copy(update={"drive": "20250615T160640.000Z"}))
    new.open(HEADER.now_s, HEADER.utc_s)

    def write(since_s: range, clock_error_s: float) -> None:
        for second in since_s:
            frame = CanFrame(HEADER.now_s + second, 0x7E8, is_extended_id=False, data=b"")
            utc_s = HEADER.utc_s + second + clock_error_s
            new.write(RecordedMessage("/in/can", utc_s, frame))

    write(range(200), 0.0)
    write(range(200, 260), 40 * 86_400.0)
    write(range(260, 300), 0.0)
    assert kept <= set(tmp_path.iterdir())

    write(range(300, 500), 40 * 86_400.0)
    new.close(HEADER.now_s + 500.0)
    assert kept.isdisjoint(tmp_path.iterdir())


def test_the_size_limit_includes_the_segment_being_written(tmp_path: Path) -> None:
    old = SegmentWriter(tmp_path, segment_s=10.0)
    drive(old, until_s=30.0, brakes_at=-1)
    settings = RecorderSettings(folder=tmp_path, ring_mib=1.0, segment_s=3600.0)
    new = Segments(settings, HEADER.model_copy(update={"drive": "20250615T160640.000Z"}))
    new.open(HEADER.now_s, HEADER.utc_s)
    for second in range(60):
        noise = np.random.default_rng(second).bytes(40_000)
        now = HEADER.now_s + second
        new.write(RecordedMessage("/in/wsm", HEADER.utc_s + second, ReceivedWsm(now, noise)))
        new.flush()
    new.close(HEADER.now_s + 60.0)

    assert [path.stem for path in tmp_path.iterdir()] == ["20250615T160640.000Z-0000"]


def test_each_segment_begins_with_the_valid_communication_ids(tmp_path: Path) -> None:
    recorder = SegmentWriter(tmp_path, segment_s=10.0)
    recorder.begin(HEADER)
    identity = Identity(HEADER.now_s, "plate-1", 7, b"12345678")
    recorder.record(RecordedMessage("/in/identity", HEADER.utc_s, identity))
    records = [
        RecordedMessage("/in/brake_button", HEADER.utc_s + at, BrakeButton(HEADER.now_s + at))
        for at in (5, 15, 25)
    ]
    for record in records:
        recorder.record(record)
    recorder.segments.close(HEADER.now_s + 30.0)

    repeated = [
        each for each in RecordedDrive([tmp_path]).entries() if each.topic == "/in/identity"
    ]
    assert [each.record["stamp_s"] - HEADER.now_s for each in repeated] == [0.0, 15.0, 25.0]


def test_a_full_disk_costs_the_oldest_segments_and_recording_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a disk with room for three segments."""

    def usage(folder: Path) -> SimpleNamespace:
        return SimpleNamespace(free=LEAST_FREE_MIB * MIB + 3 - len(names(folder)))

    monkeypatch.setattr("onboard.recorder.segments.shutil.disk_usage", usage)
    recorder = SegmentWriter(tmp_path, segment_s=10.0)
    drive(recorder, until_s=200.0, brakes_at=500)

    assert names(tmp_path)[-1] == "0019"
    assert len(names(tmp_path)) <= 4
