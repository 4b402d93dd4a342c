"""Frames from files and from live streams on 127.0.0.1, valid and broken."""

import http.server
import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.stream import VideoStream
from typing_extensions import override

from onboard.observations import Discarded, Lead, SensorLost
from onboard.vision.camera import open_frames
from onboard.vision.camera_process import CameraWork
from onboard.vision.frames import CameraError, Frame, decode_image
from onboard.vision.recorded_camera import recorded_camera
from onboard.vision.recordings import VideoFile
from onboard.vision.seen import Event, Seen
from onboard.vision.settings import CameraSettings
from sim_rig.rendering.scene import Scene
from tests.typed import a
from tests.vision.drive import CAMERA, TAGS, frames

BOUNDARY = b"picture"


def uniform_image(level: int, size: tuple[int, int] = (48, 64)) -> np.ndarray:
    return np.full((*size, 3), level, np.uint8)


def jpeg(image: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", image)[1].tobytes()


def settings(source: str | Path, fps: float | None = None) -> CameraSettings:
    return CAMERA.model_copy(update={"source": str(source), "fps": fps})


def write_images(folder: Path, names: list[str]) -> None:
    for index, name in enumerate(names):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(jpeg(uniform_image(10 * index)))


def write_video(path: Path, count: int, fps: int) -> None:
    write_video_at(path, [index / fps for index in range(count)], fps)


def write_video_at(
    path: Path, times_s: list[float], fps: int = 25, *, codec: str = "mpeg4"
) -> None:
    with av.open(str(path), "w") as container:
        stream = a(VideoStream, container.add_stream(codec, rate=fps))
        stream.width, stream.height = 64, 48
        stream.codec_context.time_base = Fraction(1, 1000)
        for index, time_s in enumerate(times_s):
            frame = av.VideoFrame.from_ndarray(uniform_image(20 * index), format="bgr24")
            frame.pts, frame.time_base = round(1000 * time_s), Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


@pytest.fixture
def serve() -> Iterator[Callable[[list[list[bytes]]], str]]:
    """Serve each list of bytes to one connection after the other; the last is kept open."""
    servers = []

    def start(connections: list[list[bytes]]) -> str:
        waiting = deque(connections)
        done = threading.Event()

        class Camera(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                kind = f"multipart/x-mixed-replace; boundary={BOUNDARY.decode()}"
                self.send_header("Content-Type", kind)
                self.end_headers()
                with suppress(ConnectionError):  # the reader may hang up first
                    for data in waiting.popleft() if waiting else []:
                        self.wfile.write(data)
                if not waiting:
                    done.wait(10.0)

            @override
            def log_message(self, *_: object) -> None:
                pass

        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Camera)
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        servers.append((server, done))
        return f"http://127.0.0.1:{server.server_address[1]}/video"

    yield start
    for server, done in servers:
        done.set()
        server.shutdown()
        server.server_close()


def part(body: bytes) -> bytes:
    head = b"--%s\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"
    return head % (BOUNDARY, len(body)) + body + b"\r\n"


def test_images_of_a_folder_are_sorted_by_number(tmp_path: Path) -> None:
    write_images(tmp_path, ["f10.jpg", "f2.jpg", "f1.png"])
    (tmp_path / "truth.csv").write_text("file\n")

    source = open_frames(settings(tmp_path, fps=5.0))

    assert not source.live
    drive = list(source)
    assert [frame.name for frame in drive] == ["f1.png", "f2.jpg", "f10.jpg"]
    assert [frame.stamp_s for frame in drive] == pytest.approx([0.0, 0.2, 0.4])
    assert all(frame.image.shape == (48, 64, 3) for frame in drive)


def test_images_in_subfolders_are_named_relative_to_the_given_folder(tmp_path: Path) -> None:
    write_images(tmp_path, ["us/1.jpg", "eu/2.jpg"])

    assert [frame.name for frame in open_frames(settings(tmp_path))] == ["eu/2.jpg", "us/1.jpg"]


@pytest.mark.parametrize(
    ("pattern", "names"),
    [("*/*.jpg", ["eu/2.jpg", "us/1.jpg"]), ("us/*", ["1.jpg"]), ("us/1.jpg", ["1.jpg"])],
)
def test_a_glob_selects_images(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pattern: str, names: list[str]
) -> None:
    write_images(tmp_path, ["us/1.jpg", "eu/2.jpg"])
    monkeypatch.chdir(tmp_path)

    assert [frame.name for frame in open_frames(settings(tmp_path / pattern))] == names
    assert [frame.name for frame in open_frames(settings(pattern))] == names


def test_stamps_of_a_video_count_from_zero_at_its_stated_rate(tmp_path: Path) -> None:
    write_video(tmp_path / "video.mp4", 5, fps=10)

    stamps = [frame.stamp_s for frame in open_frames(settings(tmp_path / "video.mp4"))]

    assert stamps == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_a_given_rate_overrides_the_stated_one(tmp_path: Path) -> None:
    write_video(tmp_path / "video.mp4", 3, fps=10)

    stamps = [frame.stamp_s for frame in open_frames(settings(tmp_path / "video.mp4", fps=20.0))]

    assert stamps == pytest.approx([0.0, 0.05, 0.1])


@pytest.mark.parametrize("ending", ["mp4", "mkv"])
def test_frames_of_a_video_have_the_stamps_of_the_file(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"video.{ending}"
    write_video_at(path, [5.0, 5.04, 5.2, 5.24, 6.0])

    source = open_frames(settings(path))

    assert [frame.stamp_s for frame in source] == pytest.approx([0.0, 0.04, 0.2, 0.24, 1.0])
    assert isinstance(source, VideoFile)
    assert source.even_from is None


def test_a_pause_of_minutes_in_a_video_is_implausible(tmp_path: Path) -> None:
    write_video_at(tmp_path / "video.mp4", [0.0, 0.5, 300.0, 300.1])

    source = open_frames(settings(tmp_path / "video.mp4"))
    stamps = [frame.stamp_s for frame in source]

    assert isinstance(source, VideoFile)
    assert source.even_from == 2
    assert stamps == pytest.approx([0.0, 0.5, 0.5 + 1 / source.fps, 0.5 + 2 / source.fps])


def test_frames_of_a_raw_stream_without_stamps_are_spaced_evenly(tmp_path: Path) -> None:
    write_video_at(tmp_path / "video.h264", [0.0, 0.04, 0.08], codec="h264")

    source = open_frames(settings(tmp_path / "video.h264"))
    stamps = [frame.stamp_s for frame in source]

    assert isinstance(source, VideoFile)
    assert source.even_from == 1
    assert stamps == pytest.approx([0.0, 1 / source.fps, 2 / source.fps])


def test_broken_images_are_frames_without_an_image(tmp_path: Path) -> None:
    sound = jpeg(uniform_image(90))
    for index, data in enumerate([sound, sound[: len(sound) // 2], b"", b"no picture", sound]):
        (tmp_path / f"{index}.jpg").write_bytes(data)

    sizes = [frame.image.size for frame in open_frames(settings(tmp_path))]

    assert sizes == [48 * 64 * 3, 0, 0, 0, 48 * 64 * 3]


def test_a_truncated_png_is_not_decoded() -> None:
    data = cv2.imencode(".png", np.random.default_rng(1).integers(0, 255, (48, 64, 3)))[1].tobytes()

    assert decode_image(data).size > 0
    assert decode_image(data[:20]).size == 0


@pytest.mark.parametrize(
    "source",
    ["missing.mp4", "missing/*.jpg", "/dev/video77", "http://127.0.0.1:1/video", "http://[bad"],
)
def test_a_missing_camera_is_an_error_when_it_is_opened(source: str, capfd: object) -> None:
    with pytest.raises(CameraError, match=r"camera\.source: "):
        open_frames(settings(source))


def test_the_error_for_a_folder_without_images_names_their_suffixes(tmp_path: Path) -> None:
    (tmp_path / "IMG_0001.HEIC").write_bytes(b"")

    with pytest.raises(CameraError, match=r"no image in this folder; .*\.jpg"):
        open_frames(settings(tmp_path))
    with pytest.raises(CameraError, match=r"no image matches; .*\.jpg"):
        open_frames(settings(tmp_path / "*"))


def test_the_error_for_an_unknown_stream_names_what_is_possible() -> None:
    with pytest.raises(CameraError, match=r"rtsp://127\.0\.0\.1/cam: .*http://"):
        open_frames(settings("rtsp://127.0.0.1/cam"))


def test_a_file_that_is_no_video_is_an_error(tmp_path: Path, capfd: object) -> None:
    (tmp_path / "video.mp4").write_text("no video")
    with pytest.raises(CameraError, match="not a video"):
        open_frames(settings(tmp_path / "video.mp4"))


def test_a_web_page_is_no_camera(tmp_path: Path) -> None:
    server = http.server.HTTPServer(
        ("127.0.0.1", 0), lambda *a: http.server.SimpleHTTPRequestHandler(*a, directory=tmp_path)
    )
    threading.Thread(target=server.handle_request, daemon=True).start()
    with pytest.raises(CameraError, match=r"camera\.source: http"):
        open_frames(settings(f"http://127.0.0.1:{server.server_address[1]}/"))
    server.server_close()


def test_a_live_stream_gives_the_newest_frame_on_the_monotonic_clock(
    serve: Callable[..., str],
) -> None:
    before_s = time.monotonic()
    source = open_frames(
        settings(serve([[part(jpeg(uniform_image(level))) for level in range(0, 250, 5)]]))
    )

    assert source.live
    observed: list[Frame] = []
    for frame in source:
        observed.append(frame)
        if frame.image[0, 0, 0] > 240:
            source.close()
    assert len(observed) <= 50
    stamps = [before_s, *(frame.stamp_s for frame in observed), time.monotonic()]
    assert stamps == sorted(stamps)


def test_a_truncated_image_in_a_live_stream_is_an_empty_frame(serve: Callable[..., str]) -> None:
    torn = jpeg(uniform_image(90))[:-40]
    source = open_frames(settings(serve([[part(torn), b"--picture"]])))

    assert next(iter(source)).image.size == 0
    source.close()


def test_a_stream_that_ends_is_reopened(serve: Callable[..., str]) -> None:
    url = serve(
        [
            [part(jpeg(uniform_image(50)))],
            [part(jpeg(uniform_image(100)))],
            [part(jpeg(uniform_image(200)))],
        ]
    )
    source = open_frames(settings(url))

    levels = []
    for frame in source:
        levels.append(int(frame.image[0, 0, 0]))
        if levels[-1] == 200:
            source.close()
    assert levels[-1] == 200


def test_a_recorded_camera_plays_its_recording_and_reports_its_end(tmp_path: Path) -> None:
    for index, (_, image) in enumerate(frames(lambda _: Scene(), 0.5)):
        (tmp_path / f"{index}.jpg").write_bytes(jpeg(image) if index != 2 else b"broken")

    events: list[Event] = []
    is_over = threading.Event()

    def collect(seen: Seen) -> None:
        events.extend(seen.events)
        if any(isinstance(event, SensorLost) for event in seen.events):
            is_over.set()

    work = CameraWork(settings(tmp_path, fps=100.0), TAGS, None)
    camera = recorded_camera(work, collect)
    camera.start()
    assert is_over.wait(20.0)
    camera.close()

    assert a(SensorLost, events[-1]).reason == "end_of_recording"
    assert [event.reason for event in events if isinstance(event, Discarded)] == ["corrupt_frame"]
    stamps = [event.stamp_s for event in events if isinstance(event, Lead)]
    assert len(stamps) == 4
    assert [later - sooner for sooner, later in itertools.pairwise(stamps)] == pytest.approx(
        [0.01, 0.02, 0.01]
    )
