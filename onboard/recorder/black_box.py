"""Records a drive without waiting for the disk: a bounded queue, and a thread that writes.

If the disk is full, read-only or too slow, records are lost, counted and reported; warnings are not
delayed.
"""

import contextlib
import queue
import stat
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from onboard.errors import UserError
from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import CameraImage, RecordedMessage, RecorderState, RecordingGap
from onboard.recorder.repair import repair
from onboard.recorder.segment import IMAGES
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings

QUEUE_RECORDS: Final = 20_000
"""Size of the queue: more than ten seconds in dense traffic."""
FLUSH_S: Final = 0.4
"""Time between flushes in s; with the time to write, a power cut loses less than a second.

The thread sleeps in between. If each record woke it, it would compete for the interpreter with the
step of the cores that made the record.
"""
RETRY_S: Final = 5.0
"""Time after a write error until the next attempt in s."""
STOP_S: Final = 0.8
"""Longest wait for the last records at the end of a drive in s."""
SLICE_RECORDS: Final = 8
"""Number of records that are written in a row: some tenths of a millisecond, in which the loop of
the cores may wait for the interpreter."""
SLICE_PAUSE_S: Final = 0.002
"""Pause after them in s. At the 2,000 records a second of dense traffic, half of the time is left.

The thread has the priority of the loop: one of lower priority that holds the interpreter's lock
would keep the loop waiting while other programs have the processor.
"""

TOO_SLOW: Final = "the disk does not keep up"


class BlackBox:
    """Records one drive."""

    def __init__(
        self, settings: RecorderSettings, on_state: Callable[[RecorderState], None]
    ) -> None:
        """Open no file yet; records are queued until `start`.

        Args:
            settings: what is recorded, and where.
            on_state: called when recording begins or ends, and when records were lost; from the
                writing thread, or from a caller of `record` when the queue is full.
        """
        self.settings = settings
        self._on_state = on_state
        self._queue: queue.SimpleQueue[RecordedMessage] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._count_lock = threading.Lock()
        self._lost = 0
        """Number of records that did not fit into the queue since the last `RecordingGap`."""
        self._dropped = 0
        """Number of records lost since the start."""
        self._unwritten = 0
        """Number of records lost on disk, for the gap at the start of the next segment."""
        self._reported: tuple[str | None, int] = (None, 0)
        self._report_lock = threading.Lock()
        self._segments: Segments | None = None
        self._thread = threading.Thread(target=self._run, name="black-box", daemon=True)

    def begin(self, header: RecordingHeader) -> None:
        """Set the header of the recording, before the first record."""
        self._segments = Segments(self.settings, header)

    def start(self) -> None:
        """Start the writing thread; a folder that cannot be written to is tried again and again.

        Raises:
            UserError: every user may write to the folder.
        """
        folder = self.settings.folder
        with contextlib.suppress(OSError):  # reported by the thread
            if (mode := folder.stat().st_mode) & stat.S_IWOTH and stat.S_ISDIR(mode):
                raise UserError(
                    f"recorder.folder: {folder}: every user may write to it (mode"
                    f" {stat.S_IMODE(mode):o}): allow it to its owner only (chmod 700)"
                )
        self._thread.start()

    def record(self, record: RecordedMessage) -> None:
        """Queue a record; returns at once, and may be called from any thread."""
        if self._lost:
            self._mark_gap(record)
        if self._lost or not self._put(record):
            self._count_lost()
            if self._reported[0] == "":
                self._report(TOO_SLOW)

    def _put(self, record: RecordedMessage) -> bool:
        """Queue a record; returns whether there was room: threads at once may find one too much."""
        if self._queue.qsize() >= QUEUE_RECORDS:
            return False
        self._queue.put(record)
        return True

    def _mark_gap(self, record: RecordedMessage) -> None:
        """Queue a gap for the records that were lost before this one, if there is room."""
        with self._count_lock:
            gap = RecordingGap(record.value.stamp_s, self._lost)
            if self._lost and self._put(
                RecordedMessage("/recorder/recording_gap", record.utc_s, gap)
            ):
                self._lost = 0

    def record_picture(self, stamp_s: float, jpeg: bytes) -> None:
        """Record a camera image.

        Args:
            stamp_s: time of the image in s, on the monotonic clock.
            jpeg: the image, encoded.
        """
        utc_s = time.time() - (time.monotonic() - stamp_s)
        self.record(RecordedMessage(IMAGES, utc_s, CameraImage(stamp_s, jpeg)))

    def close(self) -> None:
        """Write the queued records and finish the file; wait at most `STOP_S`."""
        if self._thread.is_alive():
            self._closing.set()
            self._thread.join(STOP_S)
            if self._thread.is_alive():
                self._count_abandoned()

    def _count_abandoned(self) -> None:
        """Count the records that are lost when the process ends now."""
        unflushed = self._segments.unflushed_records if self._segments is not None else 0
        with self._count_lock:
            self._dropped += unflushed + self._queue.qsize()
        self._report(TOO_SLOW)

    # ---- in the thread --------------------------------------------------------------------

    def _run(self) -> None:
        segments = self._segments
        assert segments is not None  # noqa: S101 (`begin` comes first)
        while True:
            try:
                self._write_until_closed(segments)
            except Exception as error:  # noqa: BLE001 (reported; the daemon must run on)
                self._count_unwritten(segments.abandon(time.monotonic()))
                strerror = error.strerror if isinstance(error, OSError) else None
                reason = strerror or repr(error)
                self._report(reason)
                is_closing = self._closing.wait(RETRY_S)
                self._count_unwritten(self._queued())
                if is_closing:
                    self._report(reason)
                    return
            else:
                return

    def _write_until_closed(self, segments: Segments) -> None:
        now, utc_s = time.monotonic(), time.time()
        self.settings.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        segments.open(now, utc_s)
        if self._unwritten:
            gap = RecordedMessage(
                "/recorder/recording_gap", utc_s, RecordingGap(now, self._unwritten)
            )
            self._unwritten = 0
            segments.write(gap)
            segments.flush()
        self._report("")
        repair(self.settings.folder, segments.path)
        is_closing = False
        while not is_closing:
            is_closing = self._closing.wait(FLUSH_S)
            for number, record in enumerate(self._queued(), start=1):
                segments.write(record)
                if number % SLICE_RECORDS == 0:
                    self._closing.wait(SLICE_PAUSE_S)
            if not is_closing:
                segments.flush()
                self._report("")
        segments.close(time.monotonic())
        self._report("")

    def _queued(self) -> Iterator[RecordedMessage]:
        """Take the records that are in the queue now."""
        for _ in range(self._queue.qsize()):
            yield self._queue.get_nowait()

    def _count_lost(self) -> None:
        with self._count_lock:
            self._lost += 1
            self._dropped += 1

    def _count_unwritten(self, records: Iterable[RecordedMessage]) -> None:
        """Count records lost on disk, for the gap at the start of the next segment."""
        for record in records:
            if isinstance(record.value, RecordingGap):
                self._unwritten += record.value.dropped  # already counted as dropped
            else:
                self._unwritten += 1
                with self._count_lock:
                    self._dropped += 1

    def _report(self, reason: str) -> None:
        with self._report_lock:
            if self._reported == (reason, self._dropped):
                return
            self._reported = (reason, self._dropped)
        self._on_state(RecorderState(time.monotonic(), not reason, reason, self._dropped))
