"""The thread and its disk: killed, full, slow, in the daemon and by itself."""

import json
import resource
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import yaml

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.recorder import black_box
from onboard.recorder.black_box import BlackBox
from onboard.recorder.reader import RecordedDrive, is_finished
from onboard.recorder.records import RecordedMessage, RecorderState
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings
from onboard.replay.replay import compare
from onboard.step import BrakeButton
from tests.recorder import headers

HEAD = headers.HEAD.model_copy(update={"now_s": time.monotonic()})
"""Of a drive that begins now: the writing thread goes by the real clock."""
WITHIN_S = 20.0
"""Until something must have come; far more than it takes."""


def until(holds: Callable[[], bool]) -> None:
    give_up_at = time.monotonic() + WITHIN_S
    while not holds():
        assert time.monotonic() < give_up_at, "it did not come"
        time.sleep(0.01)


def frame(number: int, size: int = 8) -> RecordedMessage:
    data = number.to_bytes(4) + secrets.token_bytes(size - 4)
    return RecordedMessage(
        "/in/can",
        HEAD.utc_s + number,
        CanFrame(HEAD.now_s + number * 1e-3, 0x123, is_extended_id=False, data=data),
    )


def numbers(of: Path) -> list[int]:
    return [
        int.from_bytes(bytes.fromhex(entry.record["data"])[:4])
        for entry in RecordedDrive([of]).entries()
        if entry.topic == "/in/can"
    ]


def gaps(of: Path) -> list[int]:
    return [
        entry.record["dropped"]
        for entry in RecordedDrive([of]).entries()
        if entry.topic == "/recorder/recording_gap"
    ]


class Running:
    """A black box that records, and what it tells."""

    def __init__(self, folder: Path, **settings: object) -> None:
        self.states: list[RecorderState] = []
        tree = {"folder": folder, **settings}
        self.box = BlackBox(RecorderSettings.model_validate(tree), self.states.append)
        self.box.begin(HEAD)
        self.box.start()

    def fill(self, full_disk: Callable[[int], None]) -> None:
        """Bring 500 notes to a disk that does not take them all."""
        until(lambda: bool(self.states))
        full_disk(20_000)
        for number in range(500):
            self.box.note(frame(number, size=64))
        until(lambda: any(not state.is_recording for state in self.states))


@pytest.fixture
def record() -> Iterator[Callable[..., Running]]:
    """Start black boxes; close those that the test leaves open."""
    with ExitStack() as stack:

        def start(folder: Path, **settings: object) -> Running:
            running = Running(folder, **settings)
            stack.callback(running.box.close)
            return running

        yield start


class HangingDisk:
    """Flushes wait for `release`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._released, self._reached = threading.Event(), threading.Event()
        self._monkeypatch = monkeypatch

    def hang(self) -> None:
        """From the next flush on, which it waits for."""
        flush = Segments.flush

        def wait(segments: Segments) -> None:
            self._reached.set()
            self._released.wait(WITHIN_S)
            flush(segments)

        self._monkeypatch.setattr(Segments, "flush", wait)

    def wait_until_reached(self) -> None:
        assert self._reached.wait(WITHIN_S), "no flush came"

    def release(self) -> None:
        self._released.set()


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[HangingDisk]:
    disk = HangingDisk(monkeypatch)
    yield disk
    disk.release()


def test_all_notes_are_written_in_order_and_the_file_is_finished(
    tmp_path: Path, record: Callable[..., Running]
) -> None:
    running = record(tmp_path / "new" / "box")
    for number in range(2000):
        running.box.note(frame(number))
    running.box.close()

    assert numbers(tmp_path / "new" / "box") == list(range(2000))
    assert is_finished(next((tmp_path / "new" / "box").iterdir()))
    assert (tmp_path / "new" / "box").stat().st_mode & 0o777 == 0o700


def test_pictures_come_at_their_own_rate_and_are_jpeg(
    tmp_path: Path, record: Callable[..., Running]
) -> None:
    running = record(tmp_path, pictures_hz=2.0)
    image = np.full((36, 64, 3), 90, np.uint8)
    for number in range(30):
        running.box.note_picture(image, HEAD.now_s + number / 10)
    running.box.close()

    pictures = [entry for entry in RecordedDrive([tmp_path]).entries() if entry.topic == "/camera"]
    assert len(pictures) == 6
    assert pictures[0].record["format"] == "jpeg"
    assert pictures[0].record["data"].startswith("/9j/")


def test_a_disk_slower_than_the_car_loses_notes_and_says_how_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The queue is full at once; `note` returns all the same."""
    monkeypatch.setattr(black_box, "QUEUE_NOTES", 10)
    states: list[RecorderState] = []
    box = BlackBox(RecorderSettings(folder=tmp_path), states.append)
    box.begin(HEAD)
    for number in range(100):
        box.note(frame(number))
    box.start()
    until(box._queue.empty)
    box.note(frame(100))
    box.close()

    assert numbers(tmp_path) == [*range(10), 100]
    assert gaps(tmp_path) == [90]
    assert states[-1].dropped == 90


def test_a_disk_that_hangs_is_told_by_whoever_brings_the_notes(
    tmp_path: Path,
    record: Callable[..., Running],
    disk: HangingDisk,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(black_box, "QUEUE_NOTES", 10)
    running = record(tmp_path)
    until(lambda: bool(running.states))
    disk.hang()
    disk.wait_until_reached()
    for number in range(100):
        running.box.note(frame(number))

    told = running.states[-1]
    disk.release()
    running.box.close()
    assert not told.is_recording
    assert told.reason == "the disk does not keep up"
    assert running.states[-1].is_recording, "it has come back"
    assert running.states[-1].dropped == 90


def test_a_disk_that_still_hangs_when_the_drive_ends_takes_all_that_waits(
    tmp_path: Path,
    record: Callable[..., Running],
    disk: HangingDisk,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nobody waits for it for long; what it may have lost is told."""
    monkeypatch.setattr(black_box, "STOP_S", 0.01)
    running = record(tmp_path)
    until(lambda: bool(running.states))
    disk.hang()
    running.box.note(frame(0))
    until(running.box._queue.empty)
    disk.wait_until_reached()
    for number in range(1, 100):
        running.box.note(frame(number))
    running.box.close()

    told = running.states[-1]
    disk.release()
    running.box._thread.join(WITHIN_S)
    assert (told.is_recording, told.reason) == (False, "the disk does not keep up")
    assert told.dropped == 100


def test_what_a_full_disk_took_is_counted_to_the_last_note(
    tmp_path: Path,
    record: Callable[..., Running],
    full_disk: Callable[[int], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every note is on the disk, or counted in a gap."""
    monkeypatch.setattr(black_box, "RETRY_S", 0.05)
    running = record(tmp_path)
    running.fill(full_disk)
    full_disk(resource.RLIM_INFINITY)
    until(lambda: running.states[-1].is_recording)
    running.box.close()

    missing = sum(gaps(tmp_path))
    # Some of the write that failed may be on the disk all the same.
    assert len(numbers(tmp_path)) + missing >= 500
    assert missing == running.states[-1].dropped <= 500


def test_the_note_that_begins_a_segment_is_not_safe_before_the_next_flush(tmp_path: Path) -> None:
    segments = Segments(RecorderSettings(folder=tmp_path, segment_s=1.0), HEAD)
    segments.open(HEAD.now_s, HEAD.utc_s)
    segments.write(frame(0))
    begins, next_one = frame(1000), frame(1001)
    segments.write(begins)
    segments.write(next_one)

    assert len(list(tmp_path.iterdir())) == 2
    assert segments.abandon(HEAD.now_s + 2.0) == [begins, next_one]


def test_a_note_whose_segment_cannot_be_begun_is_counted(tmp_path: Path) -> None:
    folder = tmp_path / "box"
    folder.mkdir()
    segments = Segments(RecorderSettings(folder=folder, segment_s=1.0), HEAD)
    segments.open(HEAD.now_s, HEAD.utc_s)
    segments.write(frame(0))
    folder.rename(tmp_path / "elsewhere")
    begins = frame(1000)
    with pytest.raises(FileNotFoundError):
        segments.write(begins)

    assert segments.abandon(HEAD.now_s + 2.0) == [begins]


def test_what_a_full_disk_took_is_counted_when_the_drive_ends(
    tmp_path: Path, record: Callable[..., Running], full_disk: Callable[[int], None]
) -> None:
    """Also what still waited for the disk."""
    running = record(tmp_path)
    running.fill(full_disk)
    lost_by_then = running.states[-1].dropped
    for number in range(500, 700):
        running.box.note(frame(number))
    running.box.close()

    assert not running.states[-1].is_recording
    assert running.states[-1].dropped >= lost_by_then + 200


def test_a_lost_gap_does_not_take_its_count_with_it(
    tmp_path: Path,
    record: Callable[..., Running],
    full_disk: Callable[[int], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is no note of the car's either: nothing is counted twice."""
    monkeypatch.setattr(black_box, "RETRY_S", 0.05)
    running = record(tmp_path)
    until(lambda: bool(running.states))
    with running.box._counting:
        running.box._lost = running.box._dropped = 90
    running.fill(full_disk)
    full_disk(resource.RLIM_INFINITY)
    until(lambda: running.states[-1].is_recording)
    running.box.close()

    assert running.states[-1].dropped == sum(gaps(tmp_path))
    assert 90 < running.states[-1].dropped <= 590


def test_a_segment_that_was_taken_away_is_not_missed(tmp_path: Path) -> None:
    segments = Segments(RecorderSettings(folder=tmp_path, segment_s=1.0), HEAD)
    segments.open(HEAD.now_s, HEAD.utc_s)
    for number in range(1500):
        segments.write(frame(number))
    first, *_ = sorted(tmp_path.iterdir())
    first.rename(tmp_path.parent / "elsewhere.mcap")

    segments.write(
        RecordedMessage("/in/brake_button", HEAD.utc_s + 1.5, BrakeButton(HEAD.now_s + 1.5))
    )
    segments.close(HEAD.now_s + 1.6)

    (left,) = tmp_path.iterdir()
    assert left.stem.endswith("-kept")


def test_what_is_not_ours_stays_as_it_is(tmp_path: Path, record: Callable[..., Running]) -> None:
    """Somebody's recordings, and the one that another daemon is writing."""
    theirs = tmp_path / "rosbag.mcap"
    theirs.write_bytes(b"\x89MCAP0\r\n unfinished")
    folder = tmp_path / "20200101T000000.000Z-0000.mcap"
    folder.mkdir()
    head = HEAD.model_copy(update={"drive": "20250615T160640.000Z"})
    other = Segments(RecorderSettings(folder=tmp_path), head)
    other.open(HEAD.now_s, HEAD.utc_s)
    other.write(frame(1))
    running = record(tmp_path, ring_mib=1.0, ring_s=60.0)
    until(lambda: bool(running.states))
    running.box.close()
    other.close(HEAD.now_s + 1.0)

    folder.rmdir()
    assert theirs.read_bytes().endswith(b"unfinished")
    theirs.unlink()
    (neighbour,) = tmp_path.glob(f"{head.drive}-*")
    assert 1 in numbers(neighbour)
    assert running.states[-1].is_recording


def test_a_folder_that_cannot_be_made_is_the_users_mistake(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    box = BlackBox(RecorderSettings(folder=tmp_path / "file" / "box"), lambda _: None)

    with pytest.raises(UserError, match=r"recorder.folder: .*file/box: Not a directory"):
        box.start()


@pytest.fixture
def full_disk() -> Iterator[Callable[[int], None]]:
    """Files of this process may be so large and no larger: the kernel's own refusal."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_ends_the_recording_until_there_is_room_again(
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
    until(lambda: running.states[-1].is_recording)
    running.box.note(frame(1000))
    running.box.close()

    assert numbers(tmp_path)[-1] == 1000
    assert all(is_finished(path) for path in tmp_path.glob("*.mcap")), "the broken one is mended"
    assert gaps(tmp_path)


def test_a_power_cut_takes_only_what_was_not_flushed(tmp_path: Path) -> None:
    """Whatever was flushed is in the file, without any help of the one who wrote it."""
    segments = Segments(RecorderSettings(folder=tmp_path), HEAD)
    segments.open(HEAD.now_s, HEAD.utc_s)
    for number in range(100):
        segments.write(frame(number))
    segments.flush()
    for number in range(100, 120):
        segments.write(frame(number))
    left = tmp_path / "left"
    left.mkdir()
    (left / "as-it-was.mcap").write_bytes(segments.path.read_bytes())
    segments.close(HEAD.now_s)

    assert numbers(left) == list(range(100))


# ---- in the daemon ------------------------------------------------------------------------


class Car:
    """A real daemon with a radio and a black box."""

    def __init__(self, folder: Path, **limits: int) -> None:
        folder.mkdir(exist_ok=True)
        self.box = folder / "box"
        self.trace = folder / "trace.jsonl"
        self.wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.wire.bind(("127.0.0.1", 0))
        self.wire.settimeout(WITHIN_S)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        tree = {
            "car": {"plate": "ABC123"},
            "radio": {
                "endpoint": "iwcu",
                "listen_port": self.port,
                "unit_port": self.wire.getsockname()[1],
            },
            "trace": {"file": str(self.trace)},
            "recorder": {"folder": str(self.box)},
        }
        (folder / "car.yaml").write_text(yaml.safe_dump(tree))
        limit = f"ulimit -f {limits['blocks']}; " if limits else ""
        daemon = [sys.executable, "-m", "onboard", "run", folder / "car.yaml"]
        self.process = subprocess.Popen(
            ["sh", "-c", f'{limit}exec "$@"', "sh", *daemon], stderr=subprocess.DEVNULL
        )

    def hear(self) -> bytes:
        """The next BSM of the car."""
        return self.wire.recv(2048)

    def send(self, wsm: bytes) -> None:
        self.wire.sendto(wsm, ("127.0.0.1", self.port))

    def traced(self, kind: str) -> list[dict[str, object]]:
        lines = self.trace.read_text().split("\n")[:-1]
        return [record for record in map(json.loads, lines) if record["kind"] == kind]

    def end(self, number: signal.Signals) -> int:
        self.process.send_signal(number)
        self.wire.close()
        return self.process.wait(WITHIN_S)

    def release(self) -> None:
        """End what the test left running, and close the socket."""
        self.process.kill()
        self.process.wait()
        self.wire.close()


@pytest.fixture
def start_car(tmp_path: Path) -> Iterator[Callable[..., Car]]:
    """Start daemons that send; none outlives the test, however it ends."""
    with ExitStack() as stack:

        def start(**limits: int) -> Car:
            car = Car(tmp_path, **limits)
            stack.callback(car.release)
            car.hear()
            return car

        yield start


def test_a_killed_daemon_leaves_all_but_the_last_second(start_car: Callable[..., Car]) -> None:
    car = start_car()
    heard_at = [time.time() for _ in range(25) if car.hear()]
    car.end(signal.SIGKILL)

    box = RecordedDrive([car.box])
    sent = [entry.utc_s for entry in box.entries() if entry.topic == "/out/wsm"]
    assert sent[-1] > heard_at[-1] - 1.0
    assert compare(box).difference is None


def test_a_daemon_that_is_stopped_finishes_its_recording(start_car: Callable[..., Car]) -> None:
    car = start_car()
    until(lambda: bool(car.traced("recorder")))
    began_at = time.monotonic()
    assert car.end(signal.SIGTERM) == 0

    assert time.monotonic() - began_at < 2.0
    assert is_finished(next(car.box.iterdir()))
    assert [state["is_recording"] for state in car.traced("recorder")] == [True]


def test_a_daemon_whose_disk_is_full_says_so_and_drives_on(start_car: Callable[..., Car]) -> None:
    car = start_car(blocks=128)  # of 512 bytes
    for _ in range(150):
        car.send(secrets.token_bytes(1000))
        time.sleep(0.002)
    until(lambda: len(car.traced("recorder")) > 1)
    stopped = car.traced("recorder")[1]
    for _ in range(5):
        assert car.hear()

    assert car.end(signal.SIGTERM) == 0
    assert (stopped["is_recording"], stopped["reason"]) == (False, "File too large")


def test_a_daemon_that_is_stopped_tells_what_the_full_disk_took_to_the_end(
    start_car: Callable[..., Car],
) -> None:
    """Its trace outlives the black box: the last state counts what still waited for the disk."""
    car = start_car(blocks=128)  # of 512 bytes

    def has_filled_the_disk() -> bool:
        car.send(secrets.token_bytes(1000))
        return len(car.traced("recorder")) > 1

    until(has_filled_the_disk)
    for _ in range(5):
        assert car.hear()
    assert car.end(signal.SIGTERM) == 0

    _, stopped, at_the_end = (state["dropped"] for state in car.traced("recorder"))
    assert isinstance(stopped, int)
    assert isinstance(at_the_end, int)
    assert at_the_end > stopped
