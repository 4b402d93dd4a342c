"""Which segments go, and which are kept."""

from pathlib import Path

import numpy as np

from onboard.obd.can_frame import CanFrame
from onboard.observations import HardBrake
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.records import Identity, RecordedMessage
from onboard.recorder.retention import Stored, kept_path, to_delete
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings
from onboard.step import BrakeButton, ReceivedWsm
from tests.recorder.drive import Written
from tests.recorder.headers import HEAD

NOW_UTC_S = 1_750_000_000.0
MIB = 2**20


def stored(name: str, age_s: float, size_mib: float = 1.0) -> Stored:
    return Stored(Path(f"{name}.mcap"), NOW_UTC_S - age_s, round(size_mib * MIB))


def gone(*segments: Stored, writing_mib: float = 0.0, **settings: float) -> list[str]:
    chosen = RecorderSettings(folder=Path("/box"), **settings)
    return [p.stem for p in to_delete(segments, round(writing_mib * MIB), chosen, NOW_UTC_S)]


def test_what_is_older_than_the_ring_goes_and_what_is_kept_has_a_longer_life() -> None:
    old, kept, new = stored("old", 3700.0), stored("old-kept", 9000.0), stored("new", 3500.0)

    assert gone(old, kept, new, ring_s=3600.0) == ["old"]
    assert gone(old, kept, new, ring_s=3600.0, kept_ring_s=8000.0) == ["old", "old-kept"]


def test_the_oldest_go_until_the_rest_fits_and_kept_ones_last() -> None:
    segments = [stored("a-kept", 50.0), stored("b", 40.0), stored("c", 30.0), stored("d", 20.0)]

    assert gone(*segments, ring_mib=4.0) == []
    assert gone(*segments, ring_mib=3.0) == ["b"]
    assert gone(*segments, ring_mib=2.0, writing_mib=0.5) == ["b", "c", "d"]
    assert gone(*segments, ring_mib=1.0, writing_mib=0.5) == ["b", "c", "d", "a-kept"]


def test_a_name_says_once_that_it_is_kept() -> None:
    path = kept_path(Path("x-0001.mcap"))

    assert path == kept_path(path) == Path("x-0001-kept.mcap")


def names(folder: Path) -> list[str]:
    return sorted(path.stem.removeprefix(f"{HEAD.drive}-") for path in folder.iterdir())


def drive(written: Written, until_s: float, brakes_at: float) -> None:
    """A note a second; one segment takes 10 s."""
    written.begin(HEAD)
    for second in range(round(until_s)):
        now = HEAD.now_s + second
        frame = CanFrame(now, 0x7E8, is_extended_id=False, data=b"\x03\x41\x0d\x32")
        written.note(RecordedMessage("/in/can", HEAD.utc_s + second, frame))
        if second == brakes_at:
            brake = HardBrake(now, 5.0, "button")
            written.note(RecordedMessage("/out/hard_brake", HEAD.utc_s + second, brake))
    written.segments.close(HEAD.now_s + until_s)


def test_the_minutes_around_a_hard_brake_are_kept(tmp_path: Path) -> None:
    written = Written(tmp_path, segment_s=10.0, keep_s=12.0)
    drive(written, until_s=80.0, brakes_at=35)

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


def test_a_drive_longer_than_the_ring_keeps_its_end_and_what_happened(tmp_path: Path) -> None:
    written = Written(tmp_path, segment_s=10.0, keep_s=5.0, ring_s=65.0)
    drive(written, until_s=200.0, brakes_at=35)

    assert names(tmp_path)[0] == "0003-kept"
    assert names(tmp_path)[1:] == [f"{number:04}" for number in range(12, 20)]
    assert RecordedDrive([tmp_path]).missing == list(range(4, 12))


def test_the_ring_holds_while_one_long_segment_is_written(tmp_path: Path) -> None:
    old = Written(tmp_path, segment_s=10.0)
    drive(old, until_s=30.0, brakes_at=-1)
    settings = RecorderSettings(folder=tmp_path, ring_mib=1.0, segment_s=3600.0)
    new = Segments(settings, HEAD.model_copy(update={"drive": "20250615T160640.000Z"}))
    new.open(HEAD.now_s, HEAD.utc_s)
    for second in range(60):
        noise = np.random.default_rng(second).bytes(40_000)
        now = HEAD.now_s + second
        new.write(RecordedMessage("/in/wsm", HEAD.utc_s + second, ReceivedWsm(now, noise)))
        new.flush()
    new.close(HEAD.now_s + 60.0)

    assert [path.stem for path in tmp_path.iterdir()] == ["20250615T160640.000Z-0000"]


def test_each_segment_says_again_at_its_beginning_which_ids_hold(tmp_path: Path) -> None:
    written = Written(tmp_path, segment_s=10.0)
    written.begin(HEAD)
    identity = Identity(HEAD.now_s, "plate-1", 7, b"12345678")
    written.note(RecordedMessage("/in/identity", HEAD.utc_s, identity))
    drive_on = [
        RecordedMessage("/in/brake_button", HEAD.utc_s + at, BrakeButton(HEAD.now_s + at))
        for at in (5, 15, 25)
    ]
    for note in drive_on:
        written.note(note)
    written.segments.close(HEAD.now_s + 30.0)

    said = [each for each in RecordedDrive([tmp_path]).entries() if each.topic == "/in/identity"]
    assert [each.record["stamp_s"] - HEAD.now_s for each in said] == [0.0, 15.0, 25.0]
