"""A live camera in a process of its own: whatever happens to it, the daemon only loses a sensor."""

import errno
import http.server
import itertools
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing import Pipe
from typing import Any

import cv2
import psutil
import pytest
from typing_extensions import override

from onboard.errors import UserError
from onboard.observations import Lead, SensorLost
from onboard.vision import camera_process, camera_worker
from onboard.vision.camera_process import CameraProcess, CameraWork
from onboard.vision.seen import Event, PictureRate, Seen
from sim_rig.rendering.scene import Scene, SceneCar
from tests.recorder.waiting import wait_until
from tests.vision.drive import CAMERA, FPS, TAGS, frames

HEAD = b"--picture\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"


def drive() -> list[bytes]:
    scene = Scene(cars=(SceneCar(12.0, tag_id=4, tag_side_m=0.4),))
    return [cv2.imencode(".jpg", image)[1].tobytes() for _, image in frames(lambda _: scene, 1.0)]


@pytest.fixture(scope="module")
def stream() -> Iterator[str]:
    """Serve the same drive again and again, to any number of readers."""
    images = drive()
    is_over = threading.Event()

    class Camera(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=picture")
            self.end_headers()
            with suppress(ConnectionError):
                for image in itertools.cycle(images):
                    self.wfile.write(HEAD % len(image) + image + b"\r\n")
                    if is_over.wait(1.0 / FPS):
                        return

        @override
        def log_message(self, *_: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Camera)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/video"
    is_over.set()
    server.shutdown()
    server.server_close()


def work(source: str, pictures: PictureRate | None = None) -> CameraWork:
    return CameraWork(CAMERA.model_copy(update={"source": source}), TAGS, pictures)


class Running:
    """A camera's process, and what it has put out."""

    def __init__(self, given: CameraWork) -> None:
        self.seen: list[Seen] = []
        self.camera = CameraProcess(given, self.seen.append)
        self.camera.spawn()

    @property
    def events(self) -> list[Event]:
        return [event for each in self.seen for event in each.events]

    @property
    def losses(self) -> list[str]:
        return [event.reason for event in self.events if isinstance(event, SensorLost)]

    def until_lead(self) -> None:
        """Wait for a lead that is not seen yet."""
        before = len(self.events)
        wait_until(lambda: any(isinstance(event, Lead) for event in self.events[before:]))

    @property
    def process(self) -> psutil.Process:
        (process,) = camera_processes()
        return process


def camera_processes() -> list[psutil.Process]:
    """Those of this process: what runs the tests may have others."""
    children = psutil.Process().children()
    return [each for each in children if camera_worker.__name__ in each.cmdline()]


@pytest.fixture
def run() -> Iterator[Callable[[CameraWork], Running]]:
    started: list[Running] = []

    def start(given: CameraWork) -> Running:
        started.append(Running(given))
        return started[-1]

    yield start
    for each in started:
        each.camera.close()
    assert camera_processes() == []


Run = Callable[[CameraWork], Running]


def test_it_finds_the_lead_and_encodes_pictures(run: Run, stream: str) -> None:
    running = run(work(stream, PictureRate(hz=1.0, quality=60)))
    running.camera.start()

    wait_until(lambda: any(getattr(event, "text", None) == "TAG4" for event in running.events))

    assert running.losses == []
    assert any(each.picture is not None for each in running.seen)
    stamps = [event.stamp_s for event in running.events if isinstance(event, Lead)]
    assert stamps == sorted(stamps)
    assert stamps[-1] < time.monotonic()
    assert running.process.nice() >= camera_worker.NICENESS


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("http://127.0.0.1:9/", "camera.source: http://127.0.0.1:9/: .*refused"),
        ("rtsp://127.0.0.1/", "the only streams are MJPEG"),
        ("/dev/nosuchcamera", "no such camera"),
    ],
)
def test_a_camera_that_cannot_be_opened_is_the_users_mistake(
    run: Run, source: str, why: str
) -> None:
    running = run(work(source))

    with pytest.raises(UserError, match=why):
        running.camera.start()


def test_a_process_that_is_killed_is_a_lost_sensor_until_it_has_started_again(
    run: Run, stream: str
) -> None:
    running = run(work(stream))
    running.camera.start()
    running.until_lead()

    running.process.kill()
    wait_until(lambda: running.losses != [])
    running.until_lead()

    assert running.losses == ["process ended"]


@pytest.mark.long
def test_a_process_that_is_stopped_is_ended_and_started_again(
    run: Run, stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As is one that needs ten seconds for an image, or waits for memory from the disk."""
    monkeypatch.setattr(camera_process, "SILENT_S", 2.5)
    running = run(work(stream))
    running.camera.start()
    running.until_lead()
    stopped = running.process

    stopped.send_signal(signal.SIGSTOP)
    wait_until(lambda: running.losses != [])
    running.until_lead()

    assert running.losses == ["process silent for 2.5 s"]
    assert running.process != stopped


def test_a_process_that_leaks_ends_itself_and_names_the_memory(stream: str) -> None:
    program = (
        "from onboard.vision import camera_worker as it; it.MOST_MEMORY_BYTES = 2**20; it.main()"
    )
    own, given = Pipe()
    own.send(work(stream))
    with subprocess.Popen(
        [sys.executable, "-c", program, str(given.fileno())], pass_fds=(given.fileno(),)
    ):
        assert own.recv() == Seen()
        assert re.fullmatch("out of memory: [0-9]+ MiB", own.recv())


def test_memory_that_is_held_counts() -> None:
    before = camera_worker.resident_bytes()
    held = b"?" * 2**26

    assert camera_worker.resident_bytes() - before > 0.9 * len(held)


def test_a_camera_that_is_lost_for_good_is_reported_once(
    run: Run, stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = run(work(stream))
    running.camera.start()
    running.until_lead()
    started: list[Any] = []
    start = subprocess.Popen

    def without_camera(command: list[str], **given: Any) -> Any:
        started.append(start([sys.executable, "-c", ""], **given))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", without_camera)
    running.process.kill()
    wait_until(lambda: len(started) == 3)

    assert running.losses == ["process ended"]


@pytest.mark.long
def test_a_busy_processor_ends_no_process_again_and_again(
    run: Run, stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a process that is started again, imports and the first picture take as long as they do."""
    monkeypatch.setattr(camera_process, "SILENT_S", 0.5 / FPS)
    running = run(work(stream))
    running.camera.start()
    running.until_lead()

    assert all(reason.startswith("process silent for 0.0") for reason in running.losses)


@pytest.mark.long
def test_where_no_process_can_be_started_it_is_tried_again(
    run: Run, stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a machine without memory, or with too many processes."""
    monkeypatch.setattr(camera_process, "RESTART_S", (0.01, 0.05))
    running = run(work(stream))
    running.camera.start()
    running.until_lead()
    refused: list[None] = []
    start = subprocess.Popen

    def without_memory(*command: Any, **given: Any) -> Any:
        if len(refused) < 3:
            refused.append(None)
            raise OSError(errno.ENOMEM, "Cannot allocate memory")
        return start(*command, **given)

    monkeypatch.setattr(subprocess, "Popen", without_memory)
    running.process.kill()
    wait_until(lambda: running.losses != [])
    running.until_lead()
    assert running.losses == ["process ended"]


@pytest.mark.long
def test_the_process_ends_with_its_daemon_however_that_ends(stream: str) -> None:
    program = (
        "import sys, time; from tests.vision.test_camera_process import Running, work\n"
        f"running = Running(work({stream!r})); running.camera.start()\n"
        "print(running.process.pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as daemon:
        assert daemon.stdout is not None
        camera = psutil.Process(int(daemon.stdout.readline()))
        os.kill(daemon.pid, signal.SIGKILL)

    wait_until(lambda: not camera.is_running())
