"""Frames a second of the camera and perception, on one core, and their memory.

The drive is rendered: a lead with a plate 60 px wide, and a vehicle in each lane beside it. The
reference is the least work of any camera input: decoding the same frames from H.264, by one thread.

`python -m bench vision` prints the figures, `python -m bench.vision` writes them into
`docs/vision.md`: the medians of several runs.
"""

import statistics
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path

import av
import cv2
import numpy as np
import numpy.typing as npt
import psutil

from bench import Figure
from bench._tables import write_tables
from onboard.vision.networks import load_perception
from onboard.vision.parameters import DEFAULT_PARAMETERS, PerceptionParameters
from onboard.vision.settings import CameraSettings, VisionSettings
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar

CAMERA = CameraSettings(
    source="rendered", focal_x_px=1800.0, focal_y_px=1800.0, mounting_height_m=1.3, pitch_rad=0.02
)
LARGE_CAMERA = CAMERA.model_copy(
    update={
        "width_px": 3840,
        "height_px": 2160,
        "focal_x_px": 5400.0,
        "focal_y_px": 5400.0,
        "principal_x_px": 1920.0,
        "principal_y_px": 1080.0,
    }
)
FPS, LARGE_FPS = 15.0, 10.0
FRAMES, LARGE_FRAMES = 60, 30
_EVERYWHERE = PerceptionParameters(
    search_period_s=1e-3, search_period_without_lead_s=1e-3, seldom_period_s=1e-3
)
PAGE = Path(__file__).parents[1] / "docs" / "vision.md"
_RUNS = 5
_REFERENCE = "H.264 decode of the same frames, one thread"

Image = npt.NDArray[np.uint8]


def measure() -> Iterator[Figure]:
    """Frame rates with full and regional search, the core's share at 15 fps, and memory."""
    cv2.setNumThreads(1)
    clip = encoded(list(drive()))
    frames, decode_fps = _decoded_in_time(clip)
    everywhere_fps = perception_fps(frames, _EVERYWHERE)
    tracked_fps = perception_fps(frames)
    for name, value in (("vision.whole", everywhere_fps), ("vision.tracked", tracked_fps)):
        yield Figure(name, value, "frames/s", FRAMES, _REFERENCE, decode_fps)
    yield Figure(
        "vision.core_share_at_15_fps",
        FPS / tracked_fps,
        "cores",
        FRAMES,
        _REFERENCE,
        FPS / decode_fps,
    )
    yield _share_of_large_frames()
    with_perception, without = (_memory_mb(clip, what) for what in ("perception", "decode"))
    yield Figure("vision.memory", with_perception, "MB", 1, "a process that only decodes", without)


def _decoded_in_time(clip: bytes) -> tuple[list[Image], float]:
    """The frames of a clip, and how many of them are decoded in a second of CPU time."""
    started = time.process_time()
    frames = list(decoded(clip))
    return frames, len(frames) / (time.process_time() - started)


def _share_of_large_frames() -> Figure:
    """Share of a core for 3840x2160."""
    frames, decode_fps = _decoded_in_time(encoded(list(drive(LARGE_CAMERA, LARGE_FRAMES))))
    fps = perception_fps(frames, camera=LARGE_CAMERA, rate=LARGE_FPS)
    return Figure(
        "vision.core_share_of_3840x2160_at_10_fps",
        LARGE_FPS / fps,
        "cores",
        LARGE_FRAMES,
        _REFERENCE,
        LARGE_FPS / decode_fps,
    )


def _memory_mb(clip: bytes, what: str) -> float:
    """Memory of a process that decodes the clip, with or without perception."""
    command = [sys.executable, "-m", "bench.vision", what]
    return float(subprocess.run(command, input=clip, check=True, stdout=subprocess.PIPE).stdout)


def drive(camera: CameraSettings = CAMERA, frames: int = FRAMES) -> Iterator[Image]:
    """Frames of a slow approach to a lead, between two other vehicles."""
    renderer, rng = CameraRenderer(camera), np.random.default_rng(1)
    for index in range(frames):
        cars = (
            SceneCar(15.0 - 0.02 * index, plate="GN417KB"),
            SceneCar(11.0 + 0.05 * index, 3.5, plate="RD288HX"),
            SceneCar(24.0, -3.5, plate="BL635TN"),
        )
        yield renderer.draw(Scene(cars, travelled_m=1.2 * index), rng)


def encoded(frames: list[Image]) -> bytes:
    """An H.264 clip of the frames."""
    file = BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("h264", rate=15)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="bgr24")))
        container.mux(stream.encode())
    return file.getvalue()


def decoded(clip: bytes) -> Iterator[Image]:
    """The frames of a clip, as BGR."""
    with av.open(BytesIO(clip), "r") as container:
        container.streams.video[0].thread_count = 1
        for frame in container.decode(video=0):
            yield np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)


def perception_fps(
    frames: Iterable[Image],
    parameters: PerceptionParameters = DEFAULT_PARAMETERS,
    camera: CameraSettings = CAMERA,
    rate: float = FPS,
) -> float:
    """Frames a second of CPU time, once the lead is identified, of a camera with this rate."""
    perception = load_perception(camera, VisionSettings(), parameters)
    spent_s = []
    for index, frame in enumerate(frames):
        started = time.process_time()
        perception.receive_frame(frame, index / rate)
        while perception.next_event() is not None:
            pass
        spent_s.append(time.process_time() - started)
    settled = spent_s[10:]
    return len(settled) / sum(settled)


def table(runs: Sequence[Sequence[Figure]]) -> str:
    """The medians of several runs, as Markdown."""
    lines = [f"| on one core, 1280x720 | ours | {_REFERENCE} |", "|---|---|---|"]
    for name, what in _ROWS.items():
        figures = [figure for run in runs for figure in run if figure.name == name]
        ours, reference = (
            f"{statistics.median(values):.3g} {figures[0].unit}"
            for values in zip(*((f.value, f.reference_value) for f in figures), strict=True)
        )
        lines.append(f"| {what} | {ours} | {reference} |")
    return "\n".join(lines) + "\n"


_ROWS = {
    "vision.whole": "every frame searched in full",
    "vision.tracked": "as in the car: regions around what is tracked",
    "vision.core_share_at_15_fps": "the same, at 15 frames a second",
    "vision.core_share_of_3840x2160_at_10_fps": "3840x2160 at 10 frames a second",
    "vision.memory": "memory of a process with perception",
}


def main() -> None:
    """Write the table into the page, between its marks."""
    write_tables(PAGE, {"speed": table([list(measure()) for _ in range(_RUNS)])})


def _print_memory(what: str) -> None:
    """Run in a process of its own: decode, with or without perception."""
    cv2.setNumThreads(1)
    frames = decoded(sys.stdin.buffer.read())
    if what == "perception":
        perception_fps(frames)
    else:
        for _ in frames:
            pass
    print(psutil.Process().memory_info().rss / 1e6)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        _print_memory(sys.argv[1])
    else:
        main()
