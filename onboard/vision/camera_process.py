"""The edge of a live camera: a process that runs perception, started again whenever it ends.

In a thread beside the loop, perception would hold the interpreter's lock while other programs take
the processor from it; and a library that hangs, crashes or leaks would take the daemon with it.
"""

import contextlib
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from onboard.errors import UserError
from onboard.observations import Curvature, Sensor, SensorLost
from onboard.vision.seen import PictureRate, Seen
from onboard.vision.settings import CameraSettings, VisionSettings

OPENED_WITHIN_S = 30.0
"""Longest wait for the process to open the camera: it imports for a second on a quiet machine."""

SILENT_S = 5.0
"""Silence after which the process is ended: it answers each frame, and the lack of one after
`onboard.vision.live_frames.TIMEOUT_S`. Of one that is started again before any answer it is twice
that of the one before, up to `OPENED_WITHIN_S`: a processor may be as busy as that."""

RESTART_S = (0.1, 2.0)
"""Pause before the first restart, and the longest before later ones."""

JOIN_S = 1.0
"""Longest wait for the thread at the end; it may be deriving an ID."""


@dataclass(frozen=True, slots=True)
class CameraWork:
    """What the process is given."""

    camera: CameraSettings
    vision: VisionSettings
    pictures: PictureRate | None


class CameraProcess:
    """A process that sees, and a thread that receives what it has seen."""

    def __init__(
        self,
        work: CameraWork,
        on_seen: Callable[[Seen], None],
        worker: "CameraWorker | None" = None,
    ) -> None:
        """Start nothing yet.

        Args:
            work: what the process is given.
            on_seen: is called from the thread.
            worker: a process without work, for its first start.
        """
        self._work = work
        self._on_seen = on_seen
        self._closed = threading.Event()
        self._restarting = threading.Lock()
        self._worker = worker
        self._is_lost = False
        self._silent_s = SILENT_S
        self._curvature: Curvature | None = None
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def receive_curvature(self, curvature: Curvature | None) -> None:
        """Take the curvature of the vehicle's path, for the frame after the next answer."""
        self._curvature = curvature

    def spawn(self) -> None:
        """Let the process open the camera while the caller goes on."""
        if self._worker is None:
            self._worker = CameraWorker(self._silent_s)
        self._worker.send(self._work)

    def start(self) -> None:
        """Wait until the camera is open, and start the thread.

        Raises:
            UserError: camera or model cannot be opened.
        """
        assert self._worker is not None  # noqa: S101 (`spawn` comes first)
        try:
            self._worker.wait_for(OPENED_WITHIN_S)
            self._worker.next_seen()
        except _WorkerEndedError as ended:
            raise UserError(str(ended)) from ended
        self._thread.start()

    def close(self) -> None:
        """End process and thread."""
        with self._restarting:
            self._closed.set()
            if self._worker is not None:
                self._worker.end()
        if self._thread.ident is not None:
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        pause_s, longest_s = RESTART_S
        worker, is_open = self._worker, True
        while worker is not None:
            try:
                if not is_open:
                    worker.wait_for(OPENED_WITHIN_S)
                while True:
                    seen = worker.next_seen()
                    worker.send(self._curvature)
                    self._pass_on(seen)
                    if seen.events:
                        pause_s, self._silent_s = RESTART_S[0], SILENT_S
            except _WorkerEndedError as ended:
                worker.end()
                self._report_lost(str(ended))
            self._closed.wait(pause_s)
            pause_s = min(2 * pause_s, longest_s)
            self._silent_s = min(2 * self._silent_s, OPENED_WITHIN_S)
            worker, is_open = self._restarted(), False

    def _pass_on(self, seen: Seen) -> None:
        if seen.events:
            self._is_lost = False
            self._on_seen(seen)

    def _report_lost(self, why: str) -> None:
        """Report the camera lost, once until it sees again."""
        if not self._is_lost and not self._closed.is_set():
            self._is_lost = True
            self._on_seen(Seen((SensorLost(time.monotonic(), Sensor.CAMERA, None, why),)))

    def _restarted(self) -> "CameraWorker | None":
        """Start another process, once there is memory for one; `None` after the end."""
        while True:
            with self._restarting, contextlib.suppress(OSError):
                self._worker = None
                if not self._closed.is_set():
                    self.spawn()
                return self._worker
            self._closed.wait(RESTART_S[1])


class _WorkerEndedError(Exception):
    """The process has ended or must be ended; the text says why."""


class CameraWorker:
    """One process, and the socket to it; the process ends with the socket."""

    def __init__(self, silent_s: float = SILENT_S) -> None:
        """Start the process, which imports for a second, and then waits for its work.

        Args:
            silent_s: silence after which `next_seen` takes it for ended.
        """
        self._silent_s = silent_s
        own, given = socket.socketpair()
        with own, given:
            # Also within a message: a stopped process may have sent half of one.
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _timeval(silent_s))
            self._process = subprocess.Popen(  # noqa: S603 (this program)
                [sys.executable, "-P", "-m", "onboard.vision.camera_worker", str(given.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=(given.fileno(),),
                env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            )
            self._connection = Connection(own.detach())

    def send(self, message: CameraWork | Curvature | None) -> None:
        """Send what the process is given: first its work, then one curvature for each answer."""
        with contextlib.suppress(OSError):  # it has ended, as `next_seen` will find
            self._connection.send(message)

    def wait_for(self, longest_s: float) -> None:
        """Wait for a message for longer than `next_seen` does.

        Raises:
            _WorkerEndedError: none comes.
        """
        if not self._connection.poll(longest_s):
            raise _WorkerEndedError(f"camera: its process did not answer in {longest_s:g} s")

    def next_seen(self) -> Seen:
        """Return the next message.

        Raises:
            _WorkerEndedError: there will be none.
        """
        try:
            message: Seen | str = self._connection.recv()
        except BlockingIOError:
            raise _WorkerEndedError(f"process silent for {self._silent_s:g} s") from None
        except (EOFError, OSError):
            raise _WorkerEndedError("process ended") from None
        if isinstance(message, str):
            raise _WorkerEndedError(message)
        return message

    def end(self) -> None:
        """End the process at once: it has nothing to save."""
        self._process.kill()
        self._process.wait()


def _timeval(duration_s: float) -> bytes:
    """Encode a duration for the kernel (time(7), `struct timeval`)."""
    return struct.pack("ll", int(duration_s), int(duration_s % 1.0 * 1e6))
