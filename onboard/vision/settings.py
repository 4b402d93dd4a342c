"""Settings of the camera and of what is detected in its frames."""

import math
import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from onboard.settings import Settings


def _with_k3(distortion: object) -> object:
    if not isinstance(distortion, list | tuple):
        return distortion
    return (*distortion, 0.0) if len(distortion) == 4 else tuple(distortion)


_WIDEST_LENS = 0.25
"""Shortest focal length as a share of the image's side: 127 degrees, beyond a pinhole camera."""


class Calibration(Settings):
    """Lens and mounting of the camera, as `onboard calibrate` writes them.

    A pinhole camera at height `mounting_height_m` over a flat road, pitched down by `pitch_rad` and
    turned to the right by `yaw_rad`. Pixels count from the outer corner of the top left one.
    """

    width_px: int = Field(1280, ge=64, le=8192)
    """Width of the frames that the other values belong to."""
    height_px: int = Field(720, ge=64, le=8192)
    focal_x_px: float = Field(1100.0, gt=10.0, le=50_000.0)
    """Focal length in pixels: that in mm times `width_px`, divided by the sensor's width in mm."""
    focal_y_px: float = Field(1100.0, gt=10.0, le=50_000.0)
    principal_x_px: float = 640.0
    """Where the optical axis meets the image."""
    principal_y_px: float = 360.0
    distortion: Annotated[tuple[float, float, float, float, float], BeforeValidator(_with_k3)] = (
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    """k1, k2, p1, p2, k3 of the Brown-Conrady model, as OpenCV orders them; k3 may be left out."""
    mounting_height_m: float = Field(1.3, gt=0.01, le=5.0)
    """Height of the lens over the road."""
    pitch_rad: float = Field(0.0, ge=-0.5, le=0.5)
    """Positive if the camera points down."""
    yaw_rad: float = Field(0.0, ge=-0.5, le=0.5)
    """Positive if the camera points to the right of the vehicle's heading."""

    @model_validator(mode="after")
    def _principal_point_is_near_the_middle(self) -> Self:
        for name, value, side, side_px in (
            ("principal_x_px", self.principal_x_px, "width_px", self.width_px),
            ("principal_y_px", self.principal_y_px, "height_px", self.height_px),
        ):
            if not 0.35 * side_px <= value <= 0.65 * side_px:
                raise ValueError(
                    f"{name} is {value:g}, but must be in the middle 30 % of the image, "
                    f"whose {side} is {side_px}"
                )
        return self

    @model_validator(mode="after")
    def _focal_length_is_in_pixels(self) -> Self:
        for name, value, side, side_px in (
            ("focal_x_px", self.focal_x_px, "width_px", self.width_px),
            ("focal_y_px", self.focal_y_px, "height_px", self.height_px),
        ):
            if value < _WIDEST_LENS * side_px:
                raise ValueError(
                    f"{name} is {value:g}, but must be at least {_WIDEST_LENS:g} of {side}, which "
                    f"is {side_px}: it is in pixels, not in mm"
                )
        return self

    @property
    def has_lens(self) -> bool:
        """Whether the focal length is given; without it, distances are rough."""
        return "focal_x_px" in self.model_fields_set

    @property
    def has_mounting(self) -> bool:
        """Whether the pitch is given; without it, the camera is assumed to be level."""
        return "pitch_rad" in self.model_fields_set

    def for_size(self, width_px: int, height_px: int) -> "Calibration | None":
        """The same camera with frames of another size, scaled and not cropped.

        `None` if the aspect ratio differs: then it is unknown which part of the view they show.
        """
        scale_x, scale_y = width_px / self.width_px, height_px / self.height_px
        if not 0.99 <= scale_x / scale_y <= 1.01:
            return None
        return Calibration(
            width_px=width_px,
            height_px=height_px,
            focal_x_px=self.focal_x_px * scale_x,
            focal_y_px=self.focal_y_px * scale_y,
            principal_x_px=self.principal_x_px * scale_x,
            principal_y_px=self.principal_y_px * scale_y,
            distortion=self.distortion,
            mounting_height_m=self.mounting_height_m,
            pitch_rad=self.pitch_rad,
            yaw_rad=self.yaw_rad,
        )


def guessed_calibration(width_px: int, height_px: int) -> Calibration:
    """Calibration that is assumed without a given one: level, straight ahead.

    The longer side of the picture sees 60 degrees.
    """
    focal_px = 0.5 * max(width_px, height_px) / math.tan(math.radians(30))
    return Calibration(
        width_px=width_px,
        height_px=height_px,
        focal_x_px=focal_px,
        focal_y_px=focal_px,
        principal_x_px=width_px / 2,
        principal_y_px=height_px / 2,
    )


class CameraSettings(Calibration):
    """A camera and the source of its frames."""

    source: str = Field(min_length=1)
    """`/dev/video0` or its number; `http://` of an MJPEG stream; a video file; a folder or glob of
    images."""
    fps: float | None = Field(None, gt=0.0, le=1000.0)
    """Frames a second of images (default 25), or of a video that states a wrong rate; requested of
    a device."""

    @property
    def is_live(self) -> bool:
        """Whether the source is a device or a stream, and not a recording."""
        source = self.source
        return "://" in source or source.isdigit() or source.startswith("/dev/")


TagDictionary = Literal["4X4_50", "4X4_100", "4X4_250", "5X5_100", "5X5_250", "6X6_250", "7X7_250"]


def _is_pattern(text: str) -> str:
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"not a regular expression: {error}") from error
    return text


ClassNumbers = Annotated[tuple[Annotated[int, Field(ge=0, le=9999)], ...], Field(min_length=1)]


class BoxModelSettings(Settings):
    """A detector of the user's: an ONNX model of one of the usual layouts."""

    file: Path
    """The ONNX file."""
    layout: Literal["yolo", "yolox", "nanodet", "ssd"] = "yolo"
    """`yolo`: the output is (1, rows, values) or its transpose; a row is the centre, width and
    height of a box in pixels of the input, then a score for each class. `yolox`: rows are offsets
    in cells and logarithms of sides, always with objectness. `nanodet`: NanoDet-Plus. `ssd`: of the
    TensorFlow Object Detection API, whose classes count from 1."""
    input_width_px: int = Field(640, ge=32, le=4096)
    """Size of the model's input; frames are scaled to it."""
    input_height_px: int = Field(640, ge=32, le=4096)
    has_objectness: bool = False
    """Whether a score for "any object" comes before those of the classes, as in YOLOv5."""
    classes: ClassNumbers = (0,)
    """Classes that count."""
    least_score: float = Field(0.4, gt=0.0, lt=1.0)
    """Score below which a box is dropped."""


class VehicleModelSettings(BoxModelSettings):
    """A detector of the user's that finds vehicles."""

    classes: ClassNumbers = (2, 3, 5, 7)
    """Classes that count as vehicles. In COCO: car, motorcycle, bus, truck."""
    every_n_frames: int = Field(3, ge=1, le=100)
    """The model runs on each n-th frame, since it is slow."""


class VisionSettings(Settings):
    """What is detected in the frames."""

    plates: bool = True
    """Whether to detect number plates."""
    vehicles: bool | None = None
    """Whether to detect whole vehicles by the shipped detector; `None`: where plates are detected,
    since model vehicles bear tags."""
    plate_width_m: float | None = Field(None, gt=0.02, le=1.0)
    """Width of all plates; `None` derives it from each plate's shape (0.305 m in North America,
    0.40 in Brazil, 0.52 in Europe)."""
    plate_patterns: tuple[Annotated[str, AfterValidator(_is_pattern)], ...] = ()
    """Regular expressions of valid plates, such as `[A-Z]{2}[0-9]{3}[A-Z]{2}`; other texts are not
    used. Empty: all texts are valid."""
    tag_dictionary: TagDictionary | None = "4X4_50"
    """Dictionary of ArUco tags to detect; `None` detects none."""
    tag_side_m: float = Field(0.2, gt=0.01, le=2.0)
    """Side of a tag's black square."""
    lane_width_m: float = Field(3.5, gt=0.05, le=6.0)
    """Width of the lane where no markings are found."""
    plate_model: BoxModelSettings | None = None
    """Finds plates instead of the shipped detector, which then only refines their corners."""
    vehicle_model: VehicleModelSettings | None = None
    """Detects whole vehicles instead of the shipped detector."""

    @property
    def detects_vehicles(self) -> bool:
        """Whether the shipped detector of vehicles runs, unless `vehicle_model` replaces it."""
        return self.plates if self.vehicles is None else self.vehicles
