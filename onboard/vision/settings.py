"""What a user may set about the camera and about what is looked for in its pictures."""

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


class Calibration(Settings):
    """Lens and place of the camera, as `onboard calibrate` writes them.

    A pinhole camera at height `mounting_height_m` over a flat road, pitched down by `pitch_rad` and
    turned to the right by `yaw_rad`. Pixels count from the outer corner of the top left one.
    """

    width_px: int = Field(1280, ge=64, le=8192)
    """Of the picture that the other values belong to."""
    height_px: int = Field(720, ge=64, le=8192)
    focal_x_px: float = Field(1100.0, gt=10.0, le=50_000.0)
    """Focal length in pixels: that in mm times `width_px` by the sensor's width in mm."""
    focal_y_px: float = Field(1100.0, gt=10.0, le=50_000.0)
    principal_x_px: float = 640.0
    """Where the optical axis meets the picture."""
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
    """Lens over the road."""
    pitch_rad: float = Field(0.0, ge=-0.5, le=0.5)
    """Positive where the camera looks down."""
    yaw_rad: float = Field(0.0, ge=-0.5, le=0.5)
    """Positive where the camera looks to the right of the car's heading."""

    @model_validator(mode="after")
    def _principal_point_is_near_the_middle(self) -> Self:
        for name, value, side, side_px in (
            ("principal_x_px", self.principal_x_px, "width_px", self.width_px),
            ("principal_y_px", self.principal_y_px, "height_px", self.height_px),
        ):
            if not 0.35 * side_px <= value <= 0.65 * side_px:
                raise ValueError(
                    f"{name} is {value:g}, but lies in the middle 30 % of the picture, "
                    f"whose {side} is {side_px}"
                )
        return self

    @property
    def has_lens(self) -> bool:
        """Whether somebody said what the lens is like; else distances are a guess."""
        return "focal_x_px" in self.model_fields_set

    @property
    def is_placed(self) -> bool:
        """Whether somebody said how far the camera looks down; else level is only the likeliest."""
        return "pitch_rad" in self.model_fields_set

    def for_size(self, width_px: int, height_px: int) -> "Calibration | None":
        """The same camera delivering pictures of another size, whole and not cropped.

        `None` if their shape is another: then nobody knows which part of the view they show.
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
    """Of a camera that nobody calibrated: 60 degrees wide, looking straight ahead."""
    focal_px = 0.5 * width_px / math.tan(math.radians(30))
    return Calibration(
        width_px=width_px,
        height_px=height_px,
        focal_x_px=focal_px,
        focal_y_px=focal_px,
        principal_x_px=width_px / 2,
        principal_y_px=height_px / 2,
    )


class CameraSettings(Calibration):
    """A camera and how its pictures come."""

    source: str = Field(min_length=1)
    """`/dev/video0` or its number; `http://` of an MJPEG stream; a video file; a folder or glob of
    pictures."""
    fps: float | None = Field(None, gt=0.0, le=1000.0)
    """Of pictures (25 where not given), and of a video that states a wrong one. A device is asked
    for it."""


TagDictionary = Literal["4X4_50", "4X4_100", "4X4_250", "5X5_100", "5X5_250", "6X6_250", "7X7_250"]


def _is_pattern(text: str) -> str:
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"not a regular expression: {error}") from error
    return text


class BoxModelSettings(Settings):
    """A detector that the user brings: ONNX, as the YOLO family exports it.

    Its output is (1, rows, values) or its transpose; a row is the centre, width and height of a box
    in pixels of the input, then a score for each class.
    """

    file: Path
    input_width_px: int = Field(640, ge=32, le=4096)
    input_height_px: int = Field(640, ge=32, le=4096)
    has_objectness: bool = False
    """Whether a score for "any object" comes before those of the classes, as in YOLOv5."""
    classes: tuple[int, ...] = (0,)
    """Rows of these count."""
    least_score: float = Field(0.4, gt=0.0, lt=1.0)


class VehicleModelSettings(BoxModelSettings):
    """One that finds vehicles."""

    classes: tuple[int, ...] = (2, 3, 5, 7)
    """Rows of these count as vehicles. In COCO: car, motorcycle, bus, truck."""
    every_n_frames: int = Field(3, ge=1, le=100)
    """Such a model is heavy: it looks at each n-th frame."""
    vehicle_width_m: float = Field(1.8, gt=0.1, le=4.0)
    """Of a common car; the filter allows 10 % about it."""


class VisionSettings(Settings):
    """What is looked for in the pictures, and when it is believed."""

    plates: bool = True
    """Look for number plates."""
    plate_width_m: float | None = Field(None, gt=0.02, le=1.0)
    """`None`: told from the plate's shape (0.305 m in North America, 0.40 in Brazil, 0.52 in
    Europe)."""
    plate_patterns: tuple[Annotated[str, AfterValidator(_is_pattern)], ...] = ()
    """Regular expressions of the plates there are, such as `[A-Z]{2}[0-9]{3}[A-Z]{2}`; a text that
    fits none in full is not believed. Empty: all are."""
    tag_dictionary: TagDictionary | None = "4X4_50"
    """Of the ArUco tags to look for; `None` looks for none."""
    tag_side_m: float = Field(0.2, gt=0.01, le=2.0)
    """Of a tag's black square."""
    identity_confidence: float = Field(0.9, ge=0.5, lt=1.0)
    """Share of the votes, weighted by confidence, that a text needs to be the lead's identity."""
    lane_width_m: float = Field(3.5, gt=0.05, le=6.0)
    """Where no markings say otherwise."""
    search_every_s: float = Field(0.5, gt=0.0, le=10.0)
    """How often the whole picture is searched while a lead is tracked; otherwise the regions
    around what is tracked."""
    search_without_lead_every_s: float = Field(0.2, gt=0.0, le=10.0)
    """How often while there is none."""
    read_every_s: float = Field(0.5, ge=0.0, le=10.0)
    """How often a plate is read; the lead's, until it is known, in every frame."""
    read_known_every_s: float = Field(1.0, ge=0.0, le=10.0)
    """How often one that is known, as long as it reads as it did."""
    keep_s: float = Field(1.5, gt=0.0, le=10.0)
    """How long a car is believed to be there after it was last seen."""
    keep_unread_s: float = Field(10.0, gt=0.0, le=60.0)
    """How long while its rear is still there, but no plate, tag or vehicle is found in it."""
    frozen_s: float = Field(0.6, gt=0.0, le=10.0)
    """The same picture for this long is a lost camera."""
    plate_model: BoxModelSettings | None = None
    """Finds plates in the place of the detector that comes with the package; theirs are its
    corners all the same."""
    vehicle_model: VehicleModelSettings | None = None
