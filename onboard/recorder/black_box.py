"""Takes notes for the disk and never waits for it: a bounded queue, and a thread that writes.

A disk that is full or slower than the car loses notes, which are counted and told; it does not
hold up a warning.
"""

import errno
import os
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from onboard.errors import UserError
from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import CameraImage, RecordedMessage, RecorderState, RecordingGap
from onboard.recorder.repair import repair
from onboard.recorder.segment import IMAGES
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings

QUEUE_NOTES: Final = 20_000
"""Ten seconds and more of a busy road."""
FLUSH_S: Final = 0.4
"""What a power cut may take, beside what the disk needs to write: less than a second in all.

The thread sleeps in between: woken by every note it would want the interpreter at the very moment
that the car has something to decide.
"""
RETRY_S: Final = 5.0
"""After the disk took no more, until it is tried again."""
STOP_S: Final = 0.8
"""How long the last notes may take when the car stops."""
NICENESS: Final = 5
"""Of the writing thread: its notes can wait for a moment."""
FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""A disk that takes no more is no mistake of the user's: the car drives without a black box."""

TOO_SLOW: Final = "the disk does not keep up"


class BlackBox:
    """Records one drive."""

    def __init__(
        self, settings: RecorderSettings, on_state: Callable[[RecorderState], None]
    ) -> None:
        """Open nothing yet; notes may come already.

        `on_state` is called when recording begins or ends, and when notes were lost: from the
        writing thread, or from whoever brings a note that a hanging disk has left no room for.
        """
        self.settings = settings
        self._on_state = on_state
        self._queue: queue.Queue[RecordedMessage] = queue.Queue(QUEUE_NOTES)
        self._ending = threading.Event()
        self._counting = threading.Lock()
        self._lost = 0
        """Of those that found no room, since the last gap among the notes."""
        self._dropped = 0
        self._missing = 0
        """Before the first note of the next segment."""
        self._picture_at = 0.0
        self._told: tuple[str | None, int] = (None, 0)
        self._telling = threading.Lock()
        self._segments: Segments | None = None
        self._thread = threading.Thread(target=self._run, name="black-box", daemon=True)

    def begin(self, head: RecordingHeader) -> None:
        """Say what the drive begins with, before the first note."""
        self._segments = Segments(self.settings, head)

    def start(self) -> None:
        """Record from now on.

        Raises:
            UserError: the folder cannot be made or written to.
        """
        folder = self.settings.folder
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            if error.errno not in FULL:
                raise UserError(f"recorder.folder: {folder}: {error.strerror}") from error
        if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
            raise UserError(f"recorder.folder: {folder}: {os.strerror(errno.EACCES)}")
        self._thread.start()

    def note(self, note: RecordedMessage) -> None:
        """Have it written. From any thread; returns at once."""
        try:
            if self._lost:
                self._mark_gap(note)
            self._queue.put_nowait(note)
        except queue.Full:
            self._lose()
            if self._told[0] == "":
                self._tell(TOO_SLOW)

    def _mark_gap(self, note: RecordedMessage) -> None:
        """Have it written that notes are missing before this one."""
        with self._counting:
            if self._lost:
                gap = RecordingGap(note.value.stamp_s, self._lost)
                self._queue.put_nowait(RecordedMessage("/recorder/recording_gap", note.utc_s, gap))
                self._lost = 0

    def note_picture(self, image: NDArray[np.uint8], stamp_s: float) -> None:
        """Have a picture written, (height, width, 3) in BGR, if it is time for one.

        From the camera's thread, which makes a JPEG of it.
        """
        if stamp_s < self._picture_at:
            return
        self._picture_at = stamp_s + 1.0 / self.settings.pictures_hz
        quality = [cv2.IMWRITE_JPEG_QUALITY, self.settings.picture_quality]
        _, jpeg = cv2.imencode(".jpg", image, quality)
        utc_s = time.time() - (time.monotonic() - stamp_s)
        self.note(RecordedMessage(IMAGES, utc_s, CameraImage(stamp_s, jpeg.tobytes())))

    def close(self) -> None:
        """Write what is left, finish the file, and stop; a disk that hangs is not waited for."""
        if self._thread.is_alive():
            self._ending.set()
            self._thread.join(STOP_S)
            if self._thread.is_alive():
                self._give_up()

    def _give_up(self) -> None:
        """What the disk has still to take ends with the process."""
        unsafe = self._segments.unsafe_notes if self._segments is not None else 0
        with self._counting:
            self._dropped += unsafe + self._queue.qsize()
        self._tell(TOO_SLOW)

    # ---- in the thread --------------------------------------------------------------------

    def _run(self) -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        segments = self._segments
        assert segments is not None  # noqa: S101 (`begin` comes first)
        while True:
            try:
                self._record(segments)
            except Exception as error:  # noqa: BLE001 (whatever it is, it is told, and the car drives)
                self._miss(segments.abandon(time.monotonic()))
                strerror = error.strerror if isinstance(error, OSError) else None
                why_not = strerror or repr(error)
                self._tell(why_not)
                has_ended = self._ending.wait(RETRY_S)
                self._miss(self._waiting())
                if has_ended:
                    self._tell(why_not)
                    return
            else:
                return

    def _record(self, segments: Segments) -> None:
        """Write until `close`."""
        now, utc_s = time.monotonic(), time.time()
        segments.open(now, utc_s)
        if self._missing:
            gap = RecordedMessage(
                "/recorder/recording_gap", utc_s, RecordingGap(now, self._missing)
            )
            self._missing = 0
            segments.write(gap)
            segments.flush()
        self._tell("")
        repair(self.settings.folder, segments.path)
        ending = False
        while not ending:
            ending = self._ending.wait(FLUSH_S)
            for note in self._waiting():
                segments.write(note)
            if not ending:
                segments.flush()
                self._tell("")
        segments.close(time.monotonic())
        self._tell("")

    def _waiting(self) -> Iterator[RecordedMessage]:
        """The notes that have come so far."""
        for _ in range(self._queue.qsize()):
            yield self._queue.get_nowait()

    def _lose(self) -> None:
        with self._counting:
            self._lost += 1
            self._dropped += 1

    def _miss(self, notes: Iterable[RecordedMessage]) -> None:
        """Count what does not come onto the disk, for the gap that the next segment begins with."""
        for note in notes:
            if isinstance(note.value, RecordingGap):
                self._missing += note.value.dropped  # lost, and told, before
            else:
                self._missing += 1
                with self._counting:
                    self._dropped += 1

    def _tell(self, why_not: str) -> None:
        with self._telling:
            if self._told == (why_not, self._dropped):
                return
            self._told = (why_not, self._dropped)
        self._on_state(RecorderState(time.monotonic(), not why_not, why_not, self._dropped))
