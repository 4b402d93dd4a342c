"""The camera's process: opens the source of frames, and puts out what perception sees in them.

    python -m onboard.vision.camera_worker DESCRIPTOR

`onboard.vision.camera_process` starts it, and gives it a `CameraWork` over the socket DESCRIPTOR.
The answer is a `Seen` for each frame, an empty one once the camera is open and while no frame
comes, and a text where the camera cannot be opened or the process must end.
"""

import contextlib
import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path

import cv2

from onboard.errors import UserError
from onboard.thread_priority import lower_thread_priority
from onboard.vision.camera import open_frames
from onboard.vision.camera_process import CameraWork
from onboard.vision.frame_observer import FrameObserver
from onboard.vision.frames import CameraError
from onboard.vision.live_frames import LiveFrames
from onboard.vision.networks import load_perception
from onboard.vision.seen import Seen

NICENESS = 10
"""Niceness of the thread that sees: warnings take precedence over frames."""

OOM_SCORE = 500
"""When memory is short, the kernel ends this process, not the daemon (proc(5), oom_score_adj)."""

MOST_MEMORY_BYTES = 500 * 2**20
"""Resident memory with which the process ends, to be started anew."""


def main() -> None:
    """Work until the daemon is gone; see the docstring of this module."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the daemon, and that this process
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(OOM_SCORE), "ascii")
    cv2.setNumThreads(1)  # leaves the other cores to the rest
    connection = Connection(int(sys.argv[1]))
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        work: CameraWork = connection.recv()
        try:
            _work(work, connection)
        except UserError as error:
            connection.send(str(error))


def _work(work: CameraWork, connection: Connection) -> None:
    """Put out what is seen, until memory is short.

    Raises:
        UserError: the camera or a model cannot be opened, or memory is short.
    """
    observer = FrameObserver(load_perception(work.camera, work.vision), work.pictures)
    source = open_frames(work.camera)
    if not isinstance(source, LiveFrames):
        raise CameraError(f"camera.source: {work.camera.source}: is a recording")
    follower = threading.Thread(target=_follow_daemon, args=(connection, observer), daemon=True)
    follower.start()
    connection.send(Seen())
    lower_thread_priority(NICENESS)  # now that no one waits for it
    while (memory_bytes := resident_bytes()) <= MOST_MEMORY_BYTES:
        frame = source.next_frame()
        if frame is None:
            connection.send(Seen())
            continue
        started_s = time.monotonic()
        connection.send(observer.receive_frame(frame.image, frame.stamp_s))
        observer.receive_duration(time.monotonic() - started_s)
    raise UserError(f"out of memory: {memory_bytes / 2**20:.0f} MiB")


def _follow_daemon(connection: Connection, observer: FrameObserver) -> None:
    """Take each curvature of the path, until the daemon has ended; then end this process."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            observer.receive_curvature(connection.recv())
    os._exit(0)


def resident_bytes() -> int:
    """Memory that this process has in RAM (proc(5), statm)."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main()
