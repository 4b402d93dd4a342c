"""`onboard see`, what the camera makes of a recording, and `onboard calibrate`, what it is."""

import contextlib
import csv
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
import yaml

from onboard.errors import UserError
from onboard.observations import Discarded
from onboard.settings import load_settings, parse_settings
from onboard.vision.calibrate import (
    Board,
    CharucoBoard,
    Chessboard,
    Fit,
    calibrate_by_plates,
    calibrate_lens,
    place_by_board,
)
from onboard.vision.camera import open_frames
from onboard.vision.ends import refine_ends
from onboard.vision.frames import Frame, Image
from onboard.vision.live_frames import LiveFrames
from onboard.vision.perspective import Perspective
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plates import whole_plate
from onboard.vision.recordings import Clip, Pictures
from onboard.vision.score import Scores
from onboard.vision.seen_frame import COLUMNS, SeenFrame, see_frames
from onboard.vision.settings import (
    Calibration,
    CameraSettings,
    VisionSettings,
    guessed_calibration,
)
from onboard.vision.sight import Sight
from onboard.vision.truth import Truth

Use = Callable[[SeenFrame], None]
ENOUGH_FRAMES = 0.9
"""Of those that a video says it has; containers that do not count them estimate."""
MOST_OF_VIDEO = 60
"""Frames of a video that a calibration takes, evenly spaced: all of one minute are 5 GB."""


def see(
    recording: Annotated[str, typer.Argument(help="A video, or a folder or glob of pictures.")],
    *,
    fps: Annotated[
        float | None,
        typer.Option(help="Frames a second, if pictures are of one drive; else each stands alone."),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(help="The file that `onboard calibrate` wrote; without it gaps are rough."),
    ] = None,
    vision: Annotated[
        Path | None, typer.Option(help="Settings of the section `vision`, as YAML.")
    ] = None,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="Write a CSV with a row for each plate and frame.")
    ] = None,
    video: Annotated[
        Path | None, typer.Option(help="Write a video with everything found drawn in.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="A CSV of the true plates, to score against.")
    ] = None,
) -> None:
    """Find, read and follow plates in a video or in pictures. Searches all of every frame."""
    settings = load_settings(vision, VisionSettings) if vision is not None else VisionSettings()
    settings = settings.model_copy(
        update={
            "search_every_s": 1e-3,
            "search_without_lead_every_s": 1e-3,
            "read_every_s": 0.0,
            "read_known_every_s": 0.0,
        }
    )
    calibration = load_settings(camera, Calibration) if camera is not None else None
    given = {"source": recording, "fps": fps}
    source = open_frames(parse_settings(given, CameraSettings, "onboard see"))
    if isinstance(source, LiveFrames):
        raise UserError(f"{recording}: a live camera has no end; record it first")
    alone = isinstance(source, Pictures) and fps is None
    if alone:
        typer.echo("each picture by itself; --fps makes them a drive, with a lead", err=True)
    if calibration is None:
        typer.echo("no --camera: a lens of 60 degrees is guessed, gaps are rough", err=True)
    scores = Scores(Truth.read(truth), settings.identity_confidence) if truth is not None else None
    _keep((Path(recording), camera, vision, truth), (csv_file, video))
    tally = Tally()
    with contextlib.ExitStack() as files:
        uses: list[Use] = [tally.add]
        if scores is not None:
            uses.append(scores.add)
        if csv_file is not None:
            uses.append(_csv_writer(csv_file, files))
        if video is not None:
            uses.append(_video_writer(video, source.fps, files))
        for seen in see_frames(source, Sight(calibration, settings), alone=alone):
            for use in uses:
                use(seen)
    _tell(recording, source, tally)
    if scores is not None:
        if not scores.frames:
            told = f"{truth}: tells of {scores.truth.example}, and of none of these frames"
            raise UserError(f"{told}, such as {tally.example}")
        _print_table(list(scores.rows()))


def _keep(inputs: Iterable[Path | None], outputs: Iterable[Path | None]) -> None:
    """See that no output would overwrite an input."""
    read = [path for path in inputs if path is not None and path.exists()]
    for path in outputs:
        if path is not None and path.exists() and any(map(path.samefile, read)):
            raise UserError(f"{path}: is to be read and would be overwritten; write another file")


def _tell(recording: str, source: Clip | Pictures, tally: "Tally") -> None:
    if not tally.looked_at:
        raise UserError(f"{recording}: no frame could be looked at ({tally.text()})")
    typer.echo(tally.text())
    if not isinstance(source, Clip):
        return
    if tally.frames < ENOUGH_FRAMES * source.stated_frames:
        told = f"says that it has {source.stated_frames} frames, and {tally.frames} could be read"
        typer.echo(f"{recording}: {told}: it is damaged or torn off", err=True)
    if source.even_from is not None:
        even = f"from frame {source.even_from} on they stand evenly, {source.fps:g} a second"
        typer.echo(f"{recording}: does not tell when its frames were taken; {even}", err=True)


class Tally:
    """What a recording held, in one line."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter(frames=0)
        self._first: dict[str, str] = {}
        self.looked_at = 0
        """Frames that were not discarded."""
        self.example = "nothing"
        """Name and number of the last frame."""

    @property
    def frames(self) -> int:
        """Of the recording."""
        return self._counts["frames"]

    def add(self, seen: SeenFrame) -> None:
        """Count one frame."""
        self.example = f"{seen.frame.name}, frame {seen.index}"
        self.looked_at += seen.lead is not None
        self._counts["frames"] += 1
        self._counts["plates"] += len(seen.plates)
        self._counts["plates read"] += sum(plate.text is not None for plate in seen.plates)
        if seen.lead is not None and seen.lead.gap_m is not None:
            self._counts["frames with a lead"] += 1
            self._counts["frames with a known lead"] += seen.lead.text is not None
        if seen.is_frozen:
            self._counts["frozen"] += 1
            self._first.setdefault("frozen", f" (first {self.example})")
        for event in seen.events:
            if isinstance(event, Discarded):
                why = f" ({event.detail})" if event.reason == "picture_size" else ""
                self._counts[name := f"discarded: {event.reason}{why}"] += 1
                self._first.setdefault(name, f" (first {self.example})")

    def text(self) -> str:
        """For people."""
        counts = self._counts.items()
        return ", ".join(f"{name}: {count}{self._first.get(name, '')}" for name, count in counts)


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Tell the user why `path` cannot be written."""
    try:
        yield
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise UserError(f"{path}: cannot be written: {why}") from error


def _csv_writer(path: Path, files: contextlib.ExitStack) -> Use:
    with _writing(path):
        file = path.open("w", newline="", encoding="utf-8")

    def close() -> None:
        with _writing(path), file:
            file.flush()

    files.callback(close)
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS)

    def write(seen: SeenFrame) -> None:
        with _writing(path):
            writer.writerows(seen.rows())

    return write


def _video_writer(path: Path, fps: float, files: contextlib.ExitStack) -> Use:
    """H.264 in the size of the first picture; others are fitted into it."""
    try:
        import av  # noqa: PLC0415 (in the rig extra: a car writes no video)
    except ImportError as error:
        raise UserError("--video needs PyAV: pip install 'onboard[rig]'") from error
    with _writing(path):
        container = av.open(str(path), "w")
        stream = container.add_stream("h264", rate=Fraction(fps).limit_denominator(1001))
        stream.pix_fmt = "yuv420p"
        path.open("ab").close()  # PyAV opens it with the first picture only

    def close() -> None:
        with _writing(path), container:
            container.mux(stream.encode())

    files.callback(close)

    def write(seen: SeenFrame) -> None:
        image = seen.annotated()
        if min(image.shape[:2]) < 2:
            return
        if not stream.codec_context.is_open:
            # H.264 in 4:2:0 has even sides.
            stream.height, stream.width = (side - side % 2 for side in image.shape[:2])
        size = (stream.width, stream.height)
        fitted = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        with _writing(path):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(fitted, format="bgr24")))

    return write


def _print_table(rows: list[dict[str, str]]) -> None:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, *([row.get(name, "") for name in columns] for row in rows)]
    widths = [max(len(line[index]) for line in lines) for index in range(len(columns))]
    for line in lines:
        typer.echo("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def calibrate(
    pictures: Annotated[str, typer.Argument(help="A folder or glob of pictures, or a video.")],
    *,
    board: Annotated[
        str | None,
        typer.Option(
            help="COLUMNSxROWS: inner corners of a chessboard, squares of a ChArUco board."
        ),
    ] = None,
    square_m: Annotated[float, typer.Option(help="Side of a square of the board.")] = 0.03,
    charuco_tag_m: Annotated[
        float | None, typer.Option(help="If the board is ChArUco: side of its tags.")
    ] = None,
    charuco_dictionary: Annotated[
        str, typer.Option(help="The ArUco dictionary of those tags.")
    ] = "5X5_100",
    upright: Annotated[
        str | None,
        typer.Option(help="A picture of the board standing on the road, straight ahead."),
    ] = None,
    lowest_corners_m: Annotated[
        float | None,
        typer.Option(help="In that picture: height of the lowest inner corners over the road."),
    ] = None,
    plate_at_m: Annotated[
        str | None,
        typer.Option(help="Without a board: distance of a plate in each picture, as 4,6,8,12."),
    ] = None,
    plate_width_m: Annotated[float, typer.Option(help="Width of that plate.")] = 0.52,
    plate_height_m: Annotated[
        float | None, typer.Option(help="Height of that plate's middle over the road.")
    ] = None,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("CALIBRATION.yaml"),
) -> None:
    """Find the camera's lens and mounting, from pictures of a chessboard or of a plate."""
    if (upright is None) != (lowest_corners_m is None):
        raise UserError("--upright and --lowest-corners-m go together")
    shown = _still_frames(upright) if upright is not None else []
    if len(shown) > 1:
        raise UserError(f"--upright: must be one picture ({len(shown)} given)")
    for option, length_m in (("square", square_m), ("plate-width", plate_width_m)):
        if not 0.001 <= length_m <= 1.0:
            raise UserError(f"--{option}-m: is in metres, 0.001 to 1 (given {length_m:g})")
    _keep((Path(pictures), Path(upright) if upright is not None else None), (out,))
    images = [frame.image for frame in _still_frames(pictures)]
    if plate_at_m is not None and plate_height_m is not None:
        fit = _fit_by_plates(images, plate_at_m, plate_width_m, plate_height_m)
    elif board is not None:
        pattern = _board(board, square_m, charuco_tag_m, charuco_dictionary)
        fit = calibrate_lens(images, pattern)
        if fit.is_doubtful:
            why = "was the board bent or moving, or the camera zoomed?"
            typer.echo(f"{fit.rms_px:.2f} px RMS are much: {why}", err=True)
        if upright is not None and lowest_corners_m is not None:
            typer.echo(_told(fit))
            fit = place_by_board(fit.calibration, shown[0].image, pattern, lowest_corners_m)
    else:
        raise UserError("say what the pictures show: --board, or --plate-at-m and --plate-height-m")
    with _writing(out):
        out.write_text(_yaml(fit.calibration), encoding="utf-8")
    typer.echo(f"{_told(fit)}; written to {out}")


def _told(fit: Fit) -> str:
    """A fit as people check it."""
    lens = fit.calibration
    wide = math.degrees(2 * math.atan(0.5 * lens.width_px / lens.focal_x_px))
    told = f"{fit.used} pictures, {fit.rms_px:.2f} px RMS: a lens of {wide:.0f} degrees"
    if not lens.is_placed:
        return told
    down, right = math.degrees(lens.pitch_rad), math.degrees(lens.yaw_rad)
    looks = f"looking {down:.1f} degrees down and {right:.1f} to the right"
    return f"{told}, {lens.mounting_height_m:.2f} m high, {looks}"


def _still_frames(pictures: str) -> list[Frame]:
    source = open_frames(CameraSettings(source=pictures))
    if isinstance(source, LiveFrames):
        raise UserError(f"{pictures}: take pictures first")
    frames, step = [], 1
    for index, frame in enumerate(source):
        if not frame.image.size:
            typer.echo(f"{frame.name}: not a picture that can be read; left out", err=True)
        elif index % step == 0:
            frames.append(frame)
        if isinstance(source, Clip) and len(frames) > MOST_OF_VIDEO:
            frames, step = frames[::2], 2 * step
    if not frames:
        raise UserError(f"{pictures}: no picture could be read")
    return frames


def _board(board: str, square_m: float, tag_m: float | None, dictionary: str) -> Board:
    parts = board.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and 3 <= int(part) <= 99 for part in parts):
        raise UserError(f"--board: must be like 9x6, from 3 to 99 each way (given {board!r})")
    columns, rows = (int(part) for part in parts)
    if tag_m is None:
        return Chessboard(columns, rows, square_m)
    if not 0.0 < tag_m < square_m:
        raise UserError(
            f"--charuco-tag-m: must be less than the square's {square_m:g} (given {tag_m:g})"
        )
    known = sorted(n.removeprefix("DICT_") for n in dir(cv2.aruco) if n.startswith("DICT_"))
    if dictionary not in known:
        raise UserError(
            f"--charuco-dictionary: must be one of {', '.join(known)} (given {dictionary!r})"
        )
    return CharucoBoard(columns, rows, square_m, tag_m, dictionary)


def _fit_by_plates(
    images: list[Image], plate_at_m: str, plate_width_m: float, plate_height_m: float
) -> Fit:
    try:
        distances_m = [float(part) for part in plate_at_m.split(",")]
    except ValueError as error:
        raise UserError(f"--plate-at-m: must be like 4,6,8 (given {plate_at_m!r})") from error
    if not all(0.0 < distance_m < 1000.0 for distance_m in distances_m):
        raise UserError(f"--plate-at-m: distances are above 0 (given {plate_at_m!r})")
    if len({image.shape for image in images}) != 1:
        raise UserError("the pictures must be of one size")
    if len(distances_m) != len(images):
        raise UserError(f"--plate-at-m: {len(distances_m)} distances for {len(images)} pictures")
    size_px = (images[0].shape[1], images[0].shape[0])
    # No lens changes the shape of a plate straight ahead, so a guessed one tells it.
    finder, perspective = PlateDetector(), Perspective(guessed_calibration(*size_px))
    plates = []
    for index, (distance_m, image) in enumerate(zip(distances_m, images, strict=True)):
        found = finder.find(image)
        if not found:
            raise UserError(f"picture {index + 1}, at {distance_m:g} m: no plate was found")
        whole = whole_plate(image, found[0], perspective)
        plates.append((distance_m, refine_ends(image, whole.corners_px)))
    return calibrate_by_plates(size_px, plates, plate_width_m, plate_height_m)


def _yaml(calibration: Calibration) -> str:
    head = "# Written by `onboard calibrate`; also fits under `camera:` in a car's configuration.\n"
    # What the pictures did not say, such as the place by a lens alone, is left open.
    values = calibration.model_dump(mode="json", exclude_unset=True)
    return head + yaml.safe_dump(values, sort_keys=False, default_flow_style=None)
