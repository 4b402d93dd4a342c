"""`onboard see`: what the camera's half of the car makes of a recording."""

import contextlib
import csv
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

from onboard.errors import UserError
from onboard.observations import Discarded
from onboard.settings import load_settings
from onboard.vision.frames import LiveFrames, Pictures, open_frames
from onboard.vision.score import Scores, Truth
from onboard.vision.seen_frame import COLUMNS, SeenFrame, see_frames
from onboard.vision.settings import Calibration, CameraSettings, VisionSettings
from onboard.vision.sight import Sight

Use = Callable[[SeenFrame], None]


def see(
    recording: Annotated[str, typer.Argument(help="A video, or a folder or glob of pictures.")],
    *,
    fps: Annotated[
        float | None,
        typer.Option(help="Pictures are frames of one drive; without it each stands alone."),
    ] = None,
    camera: Annotated[
        Path | None, typer.Option(help="What `onboard calibrate` wrote; else it is guessed.")
    ] = None,
    vision: Annotated[Path | None, typer.Option(help="Vision settings, YAML.")] = None,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="Write a row for each plate and frame.")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Write the recording, annotated.")] = None,
    truth: Annotated[Path | None, typer.Option(help="A table of what is true, to score.")] = None,
) -> None:
    """Find, read and follow plates in a recording; the whole of every frame is searched."""
    settings = load_settings(vision, VisionSettings) if vision is not None else VisionSettings()
    settings = settings.model_copy(
        update={"search_every_s": 1e-3, "search_without_lead_every_s": 1e-3}
    )
    calibration = load_settings(camera, Calibration) if camera is not None else None
    source = open_frames(CameraSettings(source=recording, fps=fps))
    if isinstance(source, LiveFrames):
        raise UserError(f"{recording}: a live camera has no end; record it first")
    scores = Scores(Truth.read(truth), settings.identity_confidence) if truth is not None else None
    tally = Tally()
    with contextlib.ExitStack() as files:
        uses: list[Use] = [tally.add]
        if scores is not None:
            uses.append(scores.add)
        if csv_file is not None:
            uses.append(_csv_writer(csv_file, files))
        if video is not None:
            uses.append(_video_writer(video, source.fps, files))
        alone = isinstance(source, Pictures) and fps is None
        for seen in see_frames(source, Sight(calibration, settings), alone=alone):
            for use in uses:
                use(seen)
    typer.echo(tally.text())
    if scores is not None:
        _print_table(list(scores.rows()))


class Tally:
    """What a recording held, in one line."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def add(self, seen: SeenFrame) -> None:
        """Count one frame."""
        self._counts["frames"] += 1
        self._counts["plates"] += len(seen.plates)
        self._counts["plates read"] += sum(plate.text is not None for plate in seen.plates)
        if seen.lead is not None and seen.lead.gap_m is not None:
            self._counts["frames with a lead"] += 1
            self._counts["frames with a known lead"] += seen.lead.text is not None
        for event in seen.events:
            if isinstance(event, Discarded):
                self._counts[f"discarded: {event.reason}"] += 1

    def text(self) -> str:
        """For people."""
        return ", ".join(f"{name}: {count}" for name, count in self._counts.items())


def _csv_writer(path: Path, files: contextlib.ExitStack) -> Use:
    try:
        file = files.enter_context(path.open("w", newline="", encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from error
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS)
    return lambda seen: writer.writerows(seen.rows())


def _video_writer(path: Path, fps: float, files: contextlib.ExitStack) -> Use:
    """H.264 in the size of the first picture; others are fitted into it."""
    try:
        import av  # noqa: PLC0415 (in the rig extra: a car writes no video)
    except ImportError as error:
        raise UserError("--video needs PyAV: pip install 'onboard[rig]'") from error
    try:
        container = files.enter_context(av.open(str(path), "w"))
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be written: {error}") from error
    stream = container.add_stream("h264", rate=Fraction(fps).limit_denominator(1001))
    stream.pix_fmt = "yuv420p"
    files.callback(lambda: container.mux(stream.encode()))

    def write(seen: SeenFrame) -> None:
        image = seen.annotated()
        if image.size == 0:
            return
        if not stream.codec_context.is_open:
            # H.264 in 4:2:0 has even sides.
            stream.height, stream.width = (side - side % 2 for side in image.shape[:2])
        size = (stream.width, stream.height)
        fitted = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        container.mux(stream.encode(av.VideoFrame.from_ndarray(fitted, format="bgr24")))

    return write


def _print_table(rows: list[dict[str, str]]) -> None:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, *([row.get(name, "") for name in columns] for row in rows)]
    widths = [max(len(line[index]) for line in lines) for index in range(len(columns))]
    for line in lines:
        typer.echo("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))
