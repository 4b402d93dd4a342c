"""`onboard calibrate`: lens and mounting of a camera."""

import math
from pathlib import Path
from typing import Annotated

import cv2
import typer
import yaml

from onboard.errors import UserError
from onboard.tools.calibrate.calibration import (
    Board,
    CharucoBoard,
    Chessboard,
    Fit,
    calibrate_by_plates,
    calibrate_lens,
    mount_by_board,
)
from onboard.vision.camera import open_frames
from onboard.vision.frames import Frame, Image
from onboard.vision.live_frames import LiveFrames
from onboard.vision.outputs import keep_inputs, writing
from onboard.vision.perspective import Perspective
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plate_ends import refine_ends
from onboard.vision.plates import whole_plate
from onboard.vision.recordings import VideoFile
from onboard.vision.settings import Calibration, CameraSettings, guessed_calibration

MAX_OF_VIDEO = 60
"""Most frames of a video that are used, evenly spaced: all frames of a minute take 5 GB."""


def calibrate(
    images: Annotated[str, typer.Argument(help="A folder or glob of images, or a video.")],
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
        typer.Option(help="An image of the board standing on the road, straight ahead."),
    ] = None,
    lowest_corners_m: Annotated[
        float | None,
        typer.Option(help="In that image: height of the lowest inner corners over the road."),
    ] = None,
    plate_at_m: Annotated[
        str | None,
        typer.Option(help="Without a board: distance of a plate in each image, as 4,6,8,12."),
    ] = None,
    plate_width_m: Annotated[float, typer.Option(help="Width of that plate.")] = 0.52,
    plate_height_m: Annotated[
        float | None, typer.Option(help="Height of that plate's middle over the road.")
    ] = None,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("CALIBRATION.yaml"),
) -> None:
    """Find the camera's lens and mounting. Images show a chessboard or a plate."""
    if (upright is None) != (lowest_corners_m is None):
        raise UserError("--upright and --lowest-corners-m go together")
    shown = _still_frames(upright) if upright is not None else []
    if len(shown) > 1:
        raise UserError(f"--upright: must be one image ({len(shown)} given)")
    for option, length_m in (("square", square_m), ("plate-width", plate_width_m)):
        if not 0.001 <= length_m <= 1.0:
            raise UserError(f"--{option}-m: must be 0.001 to 1 m (given {length_m:g})")
    keep_inputs((Path(images), Path(upright) if upright is not None else None), (out,))
    arrays = [frame.image for frame in _still_frames(images)]
    if plate_at_m is not None and plate_height_m is not None:
        fit = _fit_by_plates(arrays, plate_at_m, plate_width_m, plate_height_m)
    elif board is not None:
        pattern = _board(board, square_m, charuco_tag_m, charuco_dictionary)
        fit = calibrate_lens(arrays, pattern)
        if fit.is_doubtful:
            typer.echo(
                f"{fit.rms_px:.2f} px RMS is high: was the board bent or moving, "
                "or the camera zoomed?",
                err=True,
            )
        if upright is not None and lowest_corners_m is not None:
            typer.echo(_summary(fit))
            fit = mount_by_board(fit.calibration, shown[0].image, pattern, lowest_corners_m)
    else:
        raise UserError("give what the images show: --board, or --plate-at-m and --plate-height-m")
    with writing(out):
        out.write_text(_yaml(fit.calibration), encoding="utf-8")
    typer.echo(f"{_summary(fit)}; written to {out}")


def _summary(fit: Fit) -> str:
    """The values of a fit that people can check."""
    lens = fit.calibration
    wide = math.degrees(2 * math.atan(0.5 * lens.width_px / lens.focal_x_px))
    summary = f"{fit.used} images, {fit.rms_px:.2f} px RMS: a lens of {wide:.0f} degrees"
    if not lens.has_mounting:
        return summary
    down, right = math.degrees(lens.pitch_rad), math.degrees(lens.yaw_rad)
    direction = f"pointing {down:.1f} degrees down and {right:.1f} to the right"
    return f"{summary}, {lens.mounting_height_m:.2f} m high, {direction}"


def _still_frames(images: str) -> list[Frame]:
    source = open_frames(CameraSettings(source=images))
    if isinstance(source, LiveFrames):
        raise UserError(f"{images}: is a live camera; record images first")
    frames, step = [], 1
    for index, frame in enumerate(source):
        if not frame.image.size:
            typer.echo(f"{frame.name}: not an image that can be read; left out", err=True)
        elif index % step == 0:
            frames.append(frame)
        if isinstance(source, VideoFile) and len(frames) > MAX_OF_VIDEO:
            frames, step = frames[::2], 2 * step
    if not frames:
        raise UserError(f"{images}: no image could be read")
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
        raise UserError(f"--plate-at-m: distances must be above 0 (given {plate_at_m!r})")
    if len({image.shape for image in images}) != 1:
        raise UserError("the images must be of one size")
    if len(distances_m) != len(images):
        raise UserError(f"--plate-at-m: {len(distances_m)} distances for {len(images)} images")
    size_px = (images[0].shape[1], images[0].shape[0])
    # The shape of a plate straight ahead does not depend on the lens, so an assumed one will do.
    finder, perspective = PlateDetector(), Perspective(guessed_calibration(*size_px))
    plates = []
    for index, (distance_m, image) in enumerate(zip(distances_m, images, strict=True)):
        found = finder.find(image)
        if not found:
            raise UserError(f"image {index + 1}, at {distance_m:g} m: no plate was found")
        whole = whole_plate(image, found[0], perspective)
        plates.append((distance_m, refine_ends(image, whole.corners_px)))
    return calibrate_by_plates(size_px, plates, plate_width_m, plate_height_m)


def _yaml(calibration: Calibration) -> str:
    head = "# Written by `onboard calibrate`; also fits under `camera:` in a car's configuration.\n"
    # Values that the images do not determine, such as the mounting by a lens alone, are left out.
    values = calibration.model_dump(mode="json", exclude_unset=True)
    return head + yaml.safe_dump(values, sort_keys=False, default_flow_style=None)
