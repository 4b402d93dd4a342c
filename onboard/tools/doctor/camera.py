"""The camera, the light that it has, and whether anybody has calibrated it."""

import contextlib
import math
import threading
from dataclasses import dataclass
from itertools import islice

import numpy as np

from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.vision.camera import open_frames
from onboard.vision.frame_check import Fault, PictureCheck
from onboard.vision.frames import CameraError, Frame
from onboard.vision.settings import CameraSettings

MOST_PICTURES = 100
LEAST_RATE_HZ = 8.0
"""Of pictures: below that a closing gap is seen late."""
DARK, GLARING = 40.0, 215.0
"""Mean grey levels between which plates can be read; by night the road with lamps has some 20."""

LENS = ("focal_x_px", "focal_y_px")
"""What only a calibration tells."""

NO_CAMERA = (
    "`ls -l /dev/video* /dev/onboard-camera` shows the cameras; only one program at a time can have"
    " one: `systemctl stop onboard` before this"
)
FROZEN = "the driver repeats one picture: plug the camera out and in"
UNREADABLE = "see whether another program can show the pictures; another cable, another USB port"
TOO_SLOW = "less resolution, more light (long exposures are slow), a USB 3 port"
COVERED = "take the cap off; the camera sees nothing but one colour"
TOO_DARK = "by night it is so; by day open the iris, or let the camera choose its exposure"
TOO_BRIGHT = "clean the windscreen, keep the sun out, or let the camera choose its exposure"
UNCALIBRATED = "`onboard calibrate` (docs: in-the-car.md); until then gaps are wrong by tens of %"
OTHER_SHAPE = "calibrate with pictures as the car takes them, or set width_px and height_px"


@dataclass(frozen=True, slots=True)
class _Look:
    """What the pictures of a few seconds were like."""

    count: int
    """Without those that could not be decoded."""
    rate_hz: float
    faults: frozenset[Fault]
    is_frozen: bool
    grey: float
    """Mean of the last."""
    width_px: int
    height_px: int


def examine_camera(camera: CameraSettings, patience_s: float) -> list[Finding]:
    """Take pictures for `patience_s`; blocks for as long."""
    try:
        look = _look(camera, patience_s)
    except CameraError as error:
        return [
            Finding("camera", FindingLevel.MISSING, str(error), NO_CAMERA),
            Finding("light", FindingLevel.MISSING, "not tested without a camera"),
            _calibration(camera, None),
        ]
    return [_camera(look, patience_s), _light(look), _calibration(camera, look)]


def _look(camera: CameraSettings, patience_s: float) -> _Look:
    source = open_frames(camera)
    closing = threading.Timer(patience_s, source.close)
    closing.start()
    check = PictureCheck()
    frames: list[Frame] = []
    faults: set[Fault] = set()
    repeats = 0
    with contextlib.closing(source):
        for frame in islice(source, MOST_PICTURES):
            verdict = check.look(frame.image)
            if verdict.fault is not None:
                faults.add(verdict.fault)
            repeats += verdict.is_repeat
            if verdict.fault is not Fault.CORRUPT:
                frames.append(frame)
    closing.cancel()
    if not frames:
        return _Look(0, 0.0, frozenset(faults), is_frozen=False, grey=0.0, width_px=0, height_px=0)
    took_s = frames[-1].stamp_s - frames[0].stamp_s
    image = frames[-1].image
    return _Look(
        count=len(frames),
        rate_hz=(len(frames) - 1) / took_s if took_s > 0 else 0.0,
        faults=frozenset(faults),
        is_frozen=len(frames) > 1 and repeats == len(frames) - 1,
        grey=float(np.mean(image)),
        width_px=image.shape[1],
        height_px=image.shape[0],
    )


def _camera(look: _Look, patience_s: float) -> Finding:
    if look.count == 0:
        if Fault.CORRUPT in look.faults:
            return Finding("camera", FindingLevel.MISSING, "no picture can be decoded", UNREADABLE)
        return Finding("camera", FindingLevel.MISSING, f"no picture in {patience_s:g} s", NO_CAMERA)
    detail = f"{look.width_px} x {look.height_px}, {look.rate_hz:.1f} pictures/s"
    if look.is_frozen and Fault.BLANK not in look.faults:
        return Finding("camera", FindingLevel.MISSING, f"{detail}, all the same", FROZEN)
    if look.rate_hz < LEAST_RATE_HZ:
        return Finding("camera", FindingLevel.DOUBTFUL, detail, TOO_SLOW)
    return Finding("camera", FindingLevel.GOOD, detail)


def _light(look: _Look) -> Finding:
    detail = f"mean grey {look.grey:.0f} of 255"
    if look.count == 0:
        return Finding("light", FindingLevel.MISSING, "not tested without a picture")
    if Fault.BLANK in look.faults:
        return Finding("light", FindingLevel.MISSING, f"{detail}, one colour all over", COVERED)
    if look.grey < DARK:
        return Finding("light", FindingLevel.DOUBTFUL, detail, TOO_DARK)
    if look.grey > GLARING:
        return Finding("light", FindingLevel.DOUBTFUL, detail, TOO_BRIGHT)
    return Finding("light", FindingLevel.GOOD, detail)


def _calibration(camera: CameraSettings, look: _Look | None) -> Finding:
    if look is not None and look.count and not camera.for_size(look.width_px, look.height_px):
        detail = (
            f"of pictures of {camera.width_px} x {camera.height_px},"
            f" these are {look.width_px} x {look.height_px}"
        )
        return Finding("calibration", FindingLevel.MISSING, detail, OTHER_SHAPE)
    angle_deg = math.degrees(2 * math.atan(camera.width_px / 2 / camera.focal_x_px))
    detail = (
        f"{angle_deg:.0f} degrees wide, {camera.mounting_height_m:g} m high,"
        f" pitched {math.degrees(camera.pitch_rad):.1f} degrees"
    )
    if not camera.model_fields_set.issuperset(LENS):
        return Finding("calibration", FindingLevel.DOUBTFUL, f"guessed: {detail}", UNCALIBRATED)
    return Finding("calibration", FindingLevel.GOOD, detail)
