"""Tests of the camera, its light, and its calibration."""

import contextlib
import math
import threading
from dataclasses import dataclass
from itertools import islice

import numpy as np

from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.vision.blur import BLURRED, blur_of, detail
from onboard.vision.camera import open_frames
from onboard.vision.frame_check import FrameCheck, FrameFault
from onboard.vision.frames import CameraError, Frame
from onboard.vision.settings import CameraSettings

MOST_FRAMES = 100
LEAST_RATE_HZ = 8.0
"""Frame rate below which a closing gap is detected late."""
DARK, GLARING = 40.0, 215.0
"""Mean grey levels between which plates can be read; a lit road by night has some 20."""

LENS = ("focal_x_px", "focal_y_px")
"""Settings that only a calibration gives."""

NO_CAMERA = (
    "`ls -l /dev/video* /dev/onboard-camera` shows the cameras; only one program at a time can use"
    " one: stop onboard first with `systemctl stop onboard`"
)
FROZEN = "the camera repeats one image: unplug it and plug it in again"
UNREADABLE = "test the camera with another program, another cable, another USB port"
UNFOCUSED = "clean lens and windscreen, focus the lens; dim light makes exposures long"
TOO_SLOW = "reduce the resolution, add light (long exposures are slow), use a USB 3 port"
COVERED = "take the cap off; the image has one colour only"
TOO_DARK = "normal by night; by day open the iris, or set automatic exposure"
TOO_BRIGHT = "clean the windscreen, keep the sun out, or set automatic exposure"
UNCALIBRATED = "`onboard calibrate` (docs: in-the-car.md); until then gaps are wrong by tens of %"
OTHER_SHAPE = "calibrate with images of this size, or set width_px and height_px"


@dataclass(frozen=True, slots=True)
class _FrameStatistics:
    """Statistics of the frames of some seconds."""

    count: int
    """Number of frames that could be decoded."""
    rate_hz: float
    faults: frozenset[FrameFault]
    is_frozen: bool
    grey: float
    """Mean grey level of the last frame, 0 to 255."""
    blur: float
    """Of the last frame, 0 to 1."""
    is_over_exposed: bool
    """Whether most frames are."""
    width_px: int
    height_px: int


def examine_camera(camera: CameraSettings, patience_s: float) -> list[Finding]:
    """Read frames for `patience_s`; blocks for as long."""
    try:
        statistics = _statistics(camera, patience_s)
    except CameraError as error:
        return [
            Finding("camera", FindingLevel.MISSING, str(error), NO_CAMERA),
            Finding("light", FindingLevel.MISSING, "not tested without a camera"),
            _calibration(camera, None),
        ]
    return [
        _camera(statistics, patience_s),
        _light(statistics),
        _calibration(camera, statistics),
    ]


def _statistics(camera: CameraSettings, patience_s: float) -> _FrameStatistics:
    source = open_frames(camera)
    closing = threading.Timer(patience_s, source.close)
    closing.start()
    check = FrameCheck()
    frames: list[Frame] = []
    faults: set[FrameFault] = set()
    repeats = over_exposed = 0
    with contextlib.closing(source):
        for frame in islice(source, MOST_FRAMES):
            verdict = check.check(frame.image)
            if verdict.fault is not None:
                faults.add(verdict.fault)
            repeats += verdict.is_repeat
            over_exposed += verdict.is_over_exposed
            if verdict.fault is not FrameFault.CORRUPT:
                frames.append(frame)
    closing.cancel()
    if not frames:
        return _FrameStatistics(
            0,
            0.0,
            frozenset(faults),
            is_frozen=False,
            grey=0.0,
            blur=0.0,
            is_over_exposed=False,
            width_px=0,
            height_px=0,
        )
    took_s = frames[-1].stamp_s - frames[0].stamp_s
    image = frames[-1].image
    return _FrameStatistics(
        count=len(frames),
        rate_hz=(len(frames) - 1) / took_s if took_s > 0 else 0.0,
        faults=frozenset(faults),
        is_frozen=len(frames) > 1 and repeats == len(frames) - 1,
        grey=float(np.mean(image)),
        blur=blur_of(detail(image)),
        is_over_exposed=2 * over_exposed > len(frames),
        width_px=image.shape[1],
        height_px=image.shape[0],
    )


def _camera(statistics: _FrameStatistics, patience_s: float) -> Finding:
    if statistics.count == 0:
        if FrameFault.CORRUPT in statistics.faults:
            return Finding("camera", FindingLevel.MISSING, "no image can be decoded", UNREADABLE)
        return Finding("camera", FindingLevel.MISSING, f"no image in {patience_s:g} s", NO_CAMERA)
    summary = f"{statistics.width_px} x {statistics.height_px}, {statistics.rate_hz:.1f} frames/s"
    if statistics.is_frozen and FrameFault.BLANK not in statistics.faults:
        return Finding("camera", FindingLevel.MISSING, f"{summary}, all equal", FROZEN)
    if statistics.rate_hz < LEAST_RATE_HZ:
        return Finding("camera", FindingLevel.DOUBTFUL, summary, TOO_SLOW)
    if statistics.blur >= BLURRED:
        return Finding("camera", FindingLevel.DOUBTFUL, f"{summary}, blurred", UNFOCUSED)
    return Finding("camera", FindingLevel.GOOD, summary)


def _light(statistics: _FrameStatistics) -> Finding:
    detail = f"mean grey {statistics.grey:.0f} of 255"
    if statistics.count == 0:
        return Finding("light", FindingLevel.MISSING, "not tested without an image")
    if FrameFault.BLANK in statistics.faults:
        return Finding("light", FindingLevel.MISSING, f"{detail}, one colour only", COVERED)
    if statistics.grey < DARK:
        return Finding("light", FindingLevel.DOUBTFUL, detail, TOO_DARK)
    if statistics.grey > GLARING or statistics.is_over_exposed:
        return Finding("light", FindingLevel.DOUBTFUL, detail, TOO_BRIGHT)
    return Finding("light", FindingLevel.GOOD, detail)


def _calibration(camera: CameraSettings, statistics: _FrameStatistics | None) -> Finding:
    if (
        statistics is not None
        and statistics.count
        and not camera.for_size(statistics.width_px, statistics.height_px)
    ):
        detail = (
            f"for images of {camera.width_px} x {camera.height_px},"
            f" the camera sends {statistics.width_px} x {statistics.height_px}"
        )
        return Finding("calibration", FindingLevel.MISSING, detail, OTHER_SHAPE)
    angle_deg = math.degrees(2 * math.atan(camera.width_px / 2 / camera.focal_x_px))
    detail = (
        f"{angle_deg:.0f} degrees wide, {camera.mounting_height_m:g} m high,"
        f" pitched {math.degrees(camera.pitch_rad):.1f} degrees"
    )
    if not camera.model_fields_set.issuperset(LENS):
        return Finding(
            "calibration", FindingLevel.DOUBTFUL, f"default values: {detail}", UNCALIBRATED
        )
    return Finding("calibration", FindingLevel.GOOD, detail)
