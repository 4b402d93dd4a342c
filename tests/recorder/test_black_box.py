"""Recording with a full, slow or hanging disk."""

import resource
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.recorder import black_box
from onboard.recorder.black_box import BlackBox
from onboard.recorder.reader import RecordedDrive, is_finished
from onboard.recorder.records import RecordedMessage, RecorderState
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings
from onboard.step import BrakeButton
from tests.recorder import headers
from tests.recorder.waiting import WITHIN_S, wait_until

HEADER = headers.HEADER.model_copy(update={"now_s": time.monotonic()})
"""Header of a drive that starts now, since the writing thread uses the monotonic clock."""


def frame(number: int, size: int = 8) -> RecordedMessage:
    data = number.to_bytes(4) + secrets.token_bytes(size - 4)
    return RecordedMessage(
        "/in/can",
        HEADER.utc_s + number,
        CanFrame(HEADER.now_s + number * 1e-3, 0x123, is_extended_id=False, data=data),
    )


def numbers(path: Path) -> list[int]:
    return [
        int.from_bytes(bytes.fromhex(entry.record["data"])[:4])
        for entry in RecordedDrive([path]).entries()
        if entry.topic == "/in/can"
    ]


def gaps(path: Path) -> list[int]:
    return [
        entry.record["dropped"]
        for entry in RecordedDrive([path]).entries()
        if entry.topic == "/recorder/recording_gap"
    ]


class Running:
    """A recording black box and the states it reported."""

    def __init__(self, folder: Path, **settings: object) -> None:
        self.states: list[RecorderState] = []
        tree = {"folder": folder, **settings}
        self.box = BlackBox(RecorderSettings.model_validate(tree), self.states.append)
        self.box.begin(HEADER)
        self.box.start()

    def fill(self, full_disk: Callable[[int], None]) -> None:
        """Record 500 frames on a disk that becomes full."""
        wait_until(lambda: bool(self.states))
        full_disk(20_000)
        for number in range(500):
            self.box.record(frame(number, size=64))
        wait_until(lambda: any(not state.is_recording for state in self.states))


@pytest.fixture(autouse=True)
def without_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may write for longer than a driver would wait at the end of a drive."""
    monkeypatch.setattr(black_box, "STOP_S", 60.0)


@pytest.fixture
def record() -> Iterator[Callable[..., Running]]:
    """Start black boxes; close them after the test."""
    with ExitStack() as stack:

        def start(folder: Path, **settings: object) -> Running:
            running = Running(folder, **settings)
            stack.callback(running.box.close)
            return running

        yield start


class HangingDisk:
    """A disk whose flushes can be held up."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._released, self._reached = threading.Event(), threading.Event()
        self._monkeypatch = monkeypatch

    def hang(self) -> None:
        """Make every flush from now on wait for `release`."""
        flush = Segments.flush

        def wait(segments: Segments) -> None:
            self._reached.set()
            self._released.wait(WITHIN_S)
            flush(segments)

        self._monkeypatch.setattr(Segments, "flush", wait)

    def wait_until_reached(self) -> None:
        assert self._reached.wait(WITHIN_S), "no flush in time"

    def release(self) -> None:
        self._released.set()


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[HangingDisk]:
    disk = HangingDisk(monkeypatch)
    yield disk
    disk.release()


def test_all_records_are_written_in_order_and_the_file_is_finished(
    tmp_path: Path, record: Callable[..., Running]
) -> None:
    running = record(tmp_path / "new" / "box")
    for number in range(2000):
        running.box.record(frame(number))
    running.box.close()

    assert numbers(tmp_path / "new" / "box") == list(range(2000))
    assert is_finished(next((tmp_path / "new" / "box").iterdir()))
    assert (tmp_path / "new" / "box").stat().st_mode & 0o777 == 0o700


def test_a_picture_of_the_camera_is_recorded_as_jpeg(
    tmp_path: Path, record: Callable[..., Running]
) -> None:
    running = record(tmp_path)
    running.box.record_picture(HEADER.now_s, b"\xff\xd8\xff\xd9")
    running.box.close()

    (image,) = (each for each in RecordedDrive([tmp_path]).entries() if each.topic == "/camera")
    assert (image.record["format"], image.record["data"]) == ("jpeg", "/9j/2Q==")


def test_records_are_written_in_slices_between_which_the_loop_has_its_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(black_box, "SLICE_PAUSE_S", 60.0)
    box = BlackBox(RecorderSettings(folder=tmp_path), lambda _state: None)
    box.begin(HEADER)
    for number in range(20):
        box.record(frame(number))
    box.start()

    wait_until(lambda: box._queue.qsize() == 20 - black_box.SLICE_RECORDS)
    box.close()

    assert numbers(tmp_path) == list(range(20))


def test_a_full_queue_drops_records_and_reports_their_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`record` returns at once even if the queue is full."""
    monkeypatch.setattr(black_box, "QUEUE_RECORDS", 10)
    states: list[RecorderState] = []
    box = BlackBox(RecorderSettings(folder=tmp_path), states.append)
    box.begin(HEADER)
    for number in range(100):
        box.record(frame(number))
    box.start()
    wait_until(box._queue.empty)
    box.record(frame(100))
    box.close()

    assert numbers(tmp_path) == [*range(10), 100]
    assert gaps(tmp_path) == [90]
    assert states[-1].dropped == 90


def test_a_hanging_disk_is_reported_by_the_recording_thread(
    tmp_path: Path,
    record: Callable[..., Running],
    disk: HangingDisk,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(black_box, "QUEUE_RECORDS", 10)
    running = record(tmp_path)
    wait_until(lambda: bool(running.states))
    disk.hang()
    disk.wait_until_reached()
    for number in range(100):
        running.box.record(frame(number))

    state = running.states[-1]
    disk.release()
    running.box.close()
    assert not state.is_recording
    assert state.reason == "the disk does not keep up"
    assert running.states[-1].is_recording, "recording continues after the disk recovers"
    assert running.states[-1].dropped == 90


def test_records_waiting_for_a_hanging_disk_at_the_end_are_counted_as_lost(
    tmp_path: Path,
    record: Callable[..., Running],
    disk: HangingDisk,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`close` waits `STOP_S` and reports the records that may be lost."""
    monkeypatch.setattr(black_box, "STOP_S", 0.01)
    running = record(tmp_path)
    wait_until(lambda: bool(running.states))
    disk.hang()
    running.box.record(frame(0))
    wait_until(running.box._queue.empty)
    disk.wait_until_reached()
    for number in range(1, 100):
        running.box.record(frame(number))
    running.box.close()

    state = running.states[-1]
    disk.release()
    running.box._thread.join(WITHIN_S)
    assert (state.is_recording, state.reason) == (False, "the disk does not keep up")
    assert state.dropped == 100


def test_every_record_lost_on_a_full_disk_is_counted(
    tmp_path: Path,
    record: Callable[..., Running],
    full_disk: Callable[[int], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every record is on the disk, or counted in a gap."""
    monkeypatch.setattr(black_box, "RETRY_S", 0.05)
    running = record(tmp_path)
    running.fill(full_disk)
    full_disk(resource.RLIM_INFINITY)
    wait_until(lambda: running.states[-1].is_recording)
    running.box.close()

    missing = sum(gaps(tmp_path))
    # Part of the failed write may be on the disk.
    assert len(numbers(tmp_path)) + missing >= 500
    assert missing == running.states[-1].dropped <= 500


def test_the_first_record_of_a_segment_may_be_lost_before_the_next_flush(tmp_path: Path) -> None:
    segments = Segments(RecorderSettings(folder=tmp_path, segment_s=1.0), HEADER)
    segments.open(HEADER.now_s, HEADER.utc_s)
    segments.write(frame(0))
    first, next_one = frame(1000), frame(1001)
    segments.write(first)
    segments.write(next_one)

    assert len(list(tmp_path.iterdir())) == 2
    assert segments.abandon(HEADER.now_s + 2.0) == [first, next_one]


def test_a_record_whose_segment_cannot_be_created_is_returned_as_lost(tmp_path: Path) -> None:
    folder = tmp_path / "box"
    folder.mkdir()
    segments = Segments(RecorderSettings(folder=folder, segment_s=1.0), HEADER)
    segments.open(HEADER.now_s, HEADER.utc_s)
    segments.write(frame(0))
    folder.rename(tmp_path / "elsewhere")
    first = frame(1000)
    with pytest.raises(FileNotFoundError):
        segments.write(first)

    assert segments.abandon(HEADER.now_s + 2.0) == [first]


def test_records_lost_on_a_full_disk_are_counted_at_the_end_of_the_drive(
    tmp_path: Path, record: Callable[..., Running], full_disk: Callable[[int], None]
) -> None:
    """The count includes records still in the queue."""
    running = record(tmp_path)
    running.fill(full_disk)
    lost_before = running.states[-1].dropped
    for number in range(500, 700):
        running.box.record(frame(number))
    running.box.close()

    assert not running.states[-1].is_recording
    assert running.states[-1].dropped >= lost_before + 200


def test_the_count_of_a_lost_gap_record_is_kept(
    tmp_path: Path,
    record: Callable[..., Running],
    full_disk: Callable[[int], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The gap record itself is not counted as lost."""
    monkeypatch.setattr(black_box, "RETRY_S", 0.05)
    running = record(tmp_path)
    wait_until(lambda: bool(running.states))
    with running.box._count_lock:
        running.box._lost = running.box._dropped = 90
    running.fill(full_disk)
    full_disk(resource.RLIM_INFINITY)
    wait_until(lambda: running.states[-1].is_recording)
    running.box.close()

    assert running.states[-1].dropped == sum(gaps(tmp_path))
    assert 90 < running.states[-1].dropped <= 590


def test_a_segment_moved_by_another_program_is_ignored(tmp_path: Path) -> None:
    segments = Segments(RecorderSettings(folder=tmp_path, segment_s=1.0), HEADER)
    segments.open(HEADER.now_s, HEADER.utc_s)
    for number in range(1500):
        segments.write(frame(number))
    first, *_ = sorted(tmp_path.iterdir())
    first.rename(tmp_path.parent / "elsewhere.mcap")

    segments.write(
        RecordedMessage("/in/brake_button", HEADER.utc_s + 1.5, BrakeButton(HEADER.now_s + 1.5))
    )
    segments.close(HEADER.now_s + 1.6)

    (left,) = tmp_path.iterdir()
    assert left.stem.endswith("-kept")


def test_files_of_other_programs_and_daemons_are_left_alone(
    tmp_path: Path, record: Callable[..., Running]
) -> None:
    """Recordings by other software, and the segment that another daemon is writing."""
    foreign = tmp_path / "rosbag.mcap"
    foreign.write_bytes(b"\x89MCAP0\r\n unfinished")
    folder = tmp_path / "20200101T000000.000Z-0000.mcap"
    folder.mkdir()
    header = HEADER.model_copy(update={"drive": "20250615T160640.000Z"})
    other = Segments(RecorderSettings(folder=tmp_path), header)
    other.open(HEADER.now_s, HEADER.utc_s)
    other.write(frame(1))
    running = record(tmp_path, ring_mib=1.0, ring_s=60.0)
    wait_until(lambda: bool(running.states))
    running.box.close()
    other.close(HEADER.now_s + 1.0)

    folder.rmdir()
    assert foreign.read_bytes().endswith(b"unfinished")
    foreign.unlink()
    (neighbour,) = tmp_path.glob(f"{header.drive}-*")
    assert 1 in numbers(neighbour)
    assert running.states[-1].is_recording


def test_a_folder_to_which_every_user_may_write_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "box"
    folder.mkdir()
    folder.chmod(0o777)
    box = BlackBox(RecorderSettings(folder=folder), lambda _state: None)
    with pytest.raises(UserError, match=r"box: every user may write to it \(mode 777\)"):
        box.start()


def test_a_folder_that_cannot_be_created_is_reported_and_tried_again(
    tmp_path: Path, record: Callable[..., Running], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is read-only or not there at the start: the vehicle drives on without it."""
    monkeypatch.setattr(black_box, "RETRY_S", 0.05)
    disk = tmp_path / "disk"
    disk.write_text("")
    running = record(disk / "box")
    wait_until(lambda: bool(running.states))
    assert (running.states[0].is_recording, running.states[0].reason) == (False, "Not a directory")

    disk.unlink()
    wait_until(lambda: running.states[-1].is_recording)


@pytest.fixture
def full_disk() -> Iterator[Callable[[int], None]]:
    """Limit the size of files of this process, which the kernel enforces as a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_stops_the_recording_until_there_is_space_again(
    tmp_path: Path,
    record: Callable[..., Running],
    full_disk: Callable[[int], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(black_box, "RETRY_S", 0.05)
    running = record(tmp_path)
    running.fill(full_disk)
    stopped = next(state for state in running.states if not state.is_recording)
    assert stopped.reason == "File too large"

    full_disk(resource.RLIM_INFINITY)
    wait_until(lambda: running.states[-1].is_recording)
    running.box.record(frame(1000))
    running.box.close()

    assert numbers(tmp_path)[-1] == 1000
    assert all(is_finished(path) for path in tmp_path.glob("*.mcap")), (
        "the unfinished segment is repaired"
    )
    assert gaps(tmp_path)


def test_a_power_cut_loses_only_records_that_were_not_flushed(tmp_path: Path) -> None:
    """Flushed records are in the file before its writer closes it."""
    segments = Segments(RecorderSettings(folder=tmp_path), HEADER)
    segments.open(HEADER.now_s, HEADER.utc_s)
    for number in range(100):
        segments.write(frame(number))
    segments.flush()
    for number in range(100, 120):
        segments.write(frame(number))
    left = tmp_path / "left"
    left.mkdir()
    (left / "as-it-was.mcap").write_bytes(segments.path.read_bytes())
    segments.close(HEADER.now_s)

    assert numbers(left) == list(range(100))
