"""`onboard see`: perception of a recording, as CSV, video and scores."""

import contextlib
import csv
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Annotated

import cv2
import typer

from onboard.errors import UserError
from onboard.observations import Discarded
from onboard.settings import load_settings, parse_settings
from onboard.tools.see.annotated_frame import COLUMNS, AnnotatedFrame, annotate_frames
from onboard.tools.see.ground_truth import GroundTruth
from onboard.tools.see.printed_plates import PlatesOfDrive, PlatesOfImages
from onboard.tools.see.score import Scores
from onboard.vision.camera import open_recorded
from onboard.vision.networks import load_perception
from onboard.vision.outputs import keep_inputs, writing
from onboard.vision.parameters import DEFAULT_PARAMETERS, PerceptionParameters
from onboard.vision.plate_reader import CERTAIN
from onboard.vision.recordings import ImageSequence, VideoFile
from onboard.vision.settings import Calibration, CameraSettings, VisionSettings

Use = Callable[[AnnotatedFrame], None]
EVERY_FRAME = PerceptionParameters(
    search_period_s=1e-3,
    search_period_without_lead_s=1e-3,
    seldom_period_s=1e-3,
    read_period_s=0.0,
    read_period_identified_s=0.0,
)
"""Searches all of every frame, and reads every plate, which no car has the time for."""
STANDARD_OUTPUT = Path("-")
ENOUGH_FRAMES = 0.9
"""Share of the stated frames from which a video is complete; containers without a count estimate
it."""


def see(
    recording: Annotated[str, typer.Argument(help="A video, or a folder or glob of images.")],
    *,
    fps: Annotated[
        float | None,
        typer.Option(
            help="Frames a second, if the images are one drive; without it, each is independent."
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(help="The file of `onboard calibrate`; without it, gaps are rough."),
    ] = None,
    vision: Annotated[
        Path | None, typer.Option(help="Settings of the section `vision`, as YAML.")
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="Write a CSV with a row for each plate and frame; - prints it."),
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(
            help="Write a video with all detections drawn in: .webm, or .mp4, which takes longer."
        ),
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="A CSV of the true plates, to score against.")
    ] = None,
    every_frame: Annotated[
        bool,
        typer.Option(
            "--every-frame",
            help="Search all of every frame of a drive, and not as often only as in a car.",
        ),
    ] = False,
) -> None:
    """Find vehicles and plates in a video or in images, as a car does.

    Each plate is printed with its confidence and width: of independent images, with its place; of a
    drive, with when it was read.
    """
    settings = load_settings(vision, VisionSettings) if vision is not None else VisionSettings()
    calibration = load_settings(camera, Calibration) if camera is not None else None
    given = {"source": recording, "fps": fps}
    source = open_recorded(parse_settings(given, CameraSettings, "onboard see"))
    alone = isinstance(source, ImageSequence) and fps is None
    if alone:
        typer.echo("each image is independent; --fps makes them one drive, with a lead", err=True)
    if calibration is None:
        typer.echo("no --camera: a lens of 60 degrees is assumed, gaps are rough", err=True)
    scores = Scores(GroundTruth.read(truth), CERTAIN) if truth is not None else None
    keep_inputs((Path(recording), camera, vision, truth), (csv_file, video))
    tally, printed = PlateTally(), PlatesOfImages() if alone else PlatesOfDrive()
    with contextlib.ExitStack() as files:
        uses: list[Use] = [tally.add, printed.add]
        if scores is not None:
            uses.append(scores.add)
        if csv_file is not None:
            uses.append(_csv_writer(csv_file, files))
        if video is not None:
            uses.append(_video_writer(video, source.fps, files))
        parameters = EVERY_FRAME if alone or every_frame else DEFAULT_PARAMETERS
        frames = annotate_frames(
            source, load_perception(calibration, settings, parameters), alone=alone
        )
        for frame in files.enter_context(_progress(frames, source.stated_frames)):
            for use in uses:
                use(frame)
    # A printed CSV is for another program.
    report = partial(typer.echo, err=csv_file == STANDARD_OUTPUT)
    if csv_file != STANDARD_OUTPUT:
        for sentence in printed.sentences():
            report(sentence)
    _print_summary(recording, source, tally, report)
    if scores is not None:
        if not scores.frames:
            raise UserError(
                f"{truth}: has rows for {scores.truth.example}, and for none of these frames, "
                f"such as {tally.example}"
            )
        _print_table(list(scores.rows()), report)


def _progress(
    frames: Iterable[AnnotatedFrame], count: int
) -> contextlib.AbstractContextManager[Iterable[AnnotatedFrame]]:
    """The same frames, with a progress bar if stderr is a terminal."""
    hidden = not sys.stderr.isatty()
    return typer.progressbar(
        frames, length=count or None, label="frames", file=sys.stderr, hidden=hidden
    )


def _print_summary(
    recording: str,
    source: VideoFile | ImageSequence,
    tally: "PlateTally",
    report: Callable[[str], None],
) -> None:
    if not tally.processed:
        raise UserError(f"{recording}: no frame could be processed ({tally.text()})")
    report(tally.text())
    if not isinstance(source, VideoFile):
        return
    if tally.frames < ENOUGH_FRAMES * source.stated_frames:
        typer.echo(
            f"{recording}: states {source.stated_frames} frames, and {tally.frames} could be read: "
            "it is damaged or truncated",
            err=True,
        )
    if source.even_from is not None:
        typer.echo(
            f"{recording}: has no plausible times of its frames; from frame {source.even_from} on "
            f"they are spaced evenly, {source.fps:g} a second",
            err=True,
        )


class PlateTally:
    """Counts of a recording, in one line."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter(frames=0)
        self._first: dict[str, str] = {}
        self.processed = 0
        """Frames that were not discarded."""
        self.example = "nothing"
        """Name and number of the last frame."""

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self._counts["frames"]

    def add(self, frame: AnnotatedFrame) -> None:
        """Count one frame."""
        self.example = f"{frame.frame.name}, frame {frame.index}"
        self.processed += frame.lead is not None
        self._counts["frames"] += 1
        self._counts["plates"] += len(frame.plates)
        self._counts["plates read"] += sum(plate.text is not None for plate in frame.plates)
        if frame.lead is not None and frame.lead.gap_m is not None:
            self._counts["frames with a lead"] += 1
            self._counts["frames with a known lead"] += frame.lead.text is not None
        if frame.is_frozen:
            self._counts["frozen"] += 1
            self._first.setdefault("frozen", f" (first {self.example})")
        for event in frame.events:
            if isinstance(event, Discarded):
                detail = f" ({event.detail})" if event.reason == "frame_size" else ""
                self._counts[name := f"discarded: {event.reason}{detail}"] += 1
                self._first.setdefault(name, f" (first {self.example})")

    def text(self) -> str:
        """The counts, for the terminal."""
        counts = self._counts.items()
        return ", ".join(f"{name}: {count}{self._first.get(name, '')}" for name, count in counts)


def _csv_writer(path: Path, files: contextlib.ExitStack) -> Use:
    is_printed = path == STANDARD_OUTPUT
    with writing(path):
        file = sys.stdout if is_printed else path.open("w", newline="", encoding="utf-8")

    def close() -> None:
        with writing(path), contextlib.nullcontext() if is_printed else file:
            file.flush()

    files.callback(close)
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS)

    def write(frame: AnnotatedFrame) -> None:
        with writing(path):
            writer.writerows(frame.rows())

    return write


_VIDEO_CODECS = {".mp4": "vp09", ".webm": "VP80"}
"""By the ending of the file, as pages play it and the FFmpeg in OpenCV has it: VP9, and VP8, which
takes a third of the time."""


def _video_writer(path: Path, fps: float, files: contextlib.ExitStack) -> Use:
    """Write frames in the size of the first one; others are scaled to it."""
    codec = _VIDEO_CODECS.get(path.suffix)
    with writing(path):
        if codec is None:
            raise ValueError(f"its name must end in {' or '.join(_VIDEO_CODECS)}")
        path.open("ab").close()  # OpenCV opens it with the first frame only
    writer = cv2.VideoWriter()
    size, written = (0, 0), 0

    def close() -> None:
        writer.release()
        # OpenCV reports no error of writing.
        with writing(path):
            if written and not _is_whole(path, written):
                raise ValueError("it is not whole; is the disk full?")

    files.callback(close)

    def write(frame: AnnotatedFrame) -> None:
        nonlocal size, written
        image = frame.annotated()
        if min(image.shape[:2]) < 2:
            return
        if not writer.isOpened():
            height_px, width_px = image.shape[:2]
            size = width_px - width_px % 2, height_px - height_px % 2  # of 4:2:0, even
            with writing(path):
                if not writer.open(str(path), cv2.VideoWriter.fourcc(*codec), fps, size):
                    raise ValueError(f"no video of {size[0]}x{size[1]} at {fps:g} a second")
        writer.write(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
        written += 1

    return write


def _is_whole(video: Path, frames: int) -> bool:
    """Whether a file has its last frame, and their number, which is written at its end."""
    file = cv2.VideoCapture(str(video))
    return (
        file.get(cv2.CAP_PROP_FRAME_COUNT) > 0
        and file.set(cv2.CAP_PROP_POS_FRAMES, frames - 1)
        and file.grab()
    )


def _print_table(rows: list[dict[str, str]], report: Callable[[str], None]) -> None:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, *([row.get(name, "") for name in columns] for row in rows)]
    widths = [max(len(line[index]) for line in lines) for index in range(len(columns))]
    for line in lines:
        report("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))
