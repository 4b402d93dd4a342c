"""The format of a track's plate, which does not follow the shape of single frames."""

import math
from dataclasses import replace

import numpy as np
import pytest

from onboard.vision.detection import Detection, DetectionKind
from onboard.vision.perspective import RoadPosition
from onboard.vision.plate_formats import (
    PLATE_FORMATS,
    MeanAppearance,
    PlateFormats,
    TrackPlateFormat,
)
from onboard.vision.tracker import Tracker

FOCAL_PX = 1400.0
EUROPE_M, BRAZIL_M, AMERICA_M = 0.52, 0.4, 0.305


def detection(
    formats: PlateFormats, ahead_m: float, true_width_m: float, shape: float
) -> Detection:
    """A detected plate, with its width in the image and its shape in this frame."""
    width_px = FOCAL_PX * true_width_m / ahead_m
    x, y = width_px / 2, width_px / 2 / shape
    places = {
        width_m: RoadPosition(FOCAL_PX * width_m / width_px, 0.0, 0.6)
        for width_m in formats.widths_m
    }
    width_m = formats.likely_width_m(shape, width_px)
    return Detection(
        kind=DetectionKind.PLATE,
        corners_px=np.array([(-x, -y), (x, -y), (x, y), (-x, y)], np.float32),
        position=places[width_m],
        ahead_sigma_m=0.02 * places[width_m].ahead_m,
        right_sigma_m=0.1,
        shape=shape,
        width_m=width_m,
        positions=places,
    )


def test_a_wrong_shape_in_single_frames_makes_no_second_track_and_no_jump() -> None:
    formats = PlateFormats()
    tracker = Tracker(3.5, formats=formats)
    gaps_m = []
    for index in range(30):
        shape = 3.6 if index % 5 == 4 else 5.0
        observed = detection(formats, 10.0, EUROPE_M, shape)
        tracker.receive_detections([observed], index / 10)
        gaps_m += [track.ahead.position_m for track in tracker.tracks]

    assert gaps_m == pytest.approx([10.0] * 30)


def test_the_format_of_a_plate_that_was_too_long_while_small_is_right_when_near() -> None:
    formats = PlateFormats()
    tracker = Tracker(3.5, formats=formats)
    for index in range(60):
        ahead_m = 12.0 - 0.12 * index
        shape = 2.9 if ahead_m > 9.0 else 2.1
        tracker.receive_detections([detection(formats, ahead_m, AMERICA_M, shape)], index / 10)

    (track,) = tracker.tracks
    assert track.ahead.position_m == pytest.approx(12.0 - 0.12 * 59, rel=0.02)
    assert track.ahead.rate_m_s == pytest.approx(-1.2, abs=0.2)


def test_near_detections_outweigh_many_distant_ones() -> None:
    shape = MeanAppearance()
    for _ in range(100):
        shape.add(2.9, 35.0)
    for _ in range(5):
        shape.add(2.1, 120.0)

    assert math.exp(shape.log_shape) == pytest.approx(2.1, rel=0.1)


def known(
    formats: PlateFormats, shape: float, width_px: float, detections: int = 20
) -> TrackPlateFormat:
    """The format of a plate that was detected so often with the same shape."""
    car = TrackPlateFormat(formats)
    for _ in range(detections):
        car.add(shape, width_px)
    return car


BETWEEN = math.sqrt(PLATE_FORMATS[0][1] * PLATE_FORMATS[1][1])


def test_the_prior_of_a_drive_counts_and_a_chosen_format_is_kept_in_doubt() -> None:
    formats = PlateFormats()
    known(formats, 3.25, 100.0)
    assert formats.likely_width_m(BETWEEN, 40.0) == BRAZIL_M

    for shape, width_m in ((5.0, EUROPE_M), (2.9, BRAZIL_M)):
        car = known(PlateFormats(), shape, 40.0, detections=3)
        assert source(car, BETWEEN, 40.0) == width_m


def source(car: TrackPlateFormat, shape: float, width_px: float) -> float:
    """The width of a plate after many more detections of that shape."""
    return [car.add(shape, width_px) for _ in range(100)][-1]


def test_a_tracks_own_detections_do_not_confirm_its_first_format() -> None:
    car = known(PlateFormats(), 3.3, 30.0, detections=60)
    assert car.width_m == BRAZIL_M

    assert source(car, 4.3, 60.0) == EUROPE_M


def test_small_plates_add_little_to_the_prior() -> None:
    """On light vehicles they have the shape of Brazilian plates."""
    formats = PlateFormats()
    for _ in range(10):
        known(formats, 3.4, 27.0)

    assert formats.likely_width_m(4.3, 80.0) == EUROPE_M
    known(formats, 4.5, 100.0)
    assert formats.likely_width_m(3.7, 27.0) == EUROPE_M


def test_the_plate_width_has_a_large_sigma_while_the_plate_is_small() -> None:
    far, near = known(PlateFormats(), 3.5, 27.0), known(PlateFormats(), 4.5, 90.0)

    assert (far.width_m, near.width_m) == (BRAZIL_M, EUROPE_M)
    assert far.sigma * BRAZIL_M > 0.5 * (EUROPE_M - BRAZIL_M)
    assert near.sigma < 0.05
    assert known(PlateFormats(EUROPE_M), 3.5, 27.0).sigma == 0.0


def test_a_blue_band_decides_for_europe_when_the_shape_is_ambiguous() -> None:
    for has_band, width_m in ((False, BRAZIL_M), (True, EUROPE_M)):
        car = TrackPlateFormat(PlateFormats())
        for _ in range(20):
            car.add(3.4, 27.0, has_band=has_band)
        assert car.width_m == width_m
    assert PlateFormats().likely_width_m(2.1, 60.0, has_band=True) == AMERICA_M


def test_a_plate_width_of_the_settings_is_that_of_all_plates() -> None:
    formats = PlateFormats(0.44)

    assert formats.widths_m == (0.44,)
    assert formats.likely_width_m(5.0, 100.0) == 0.44


def test_a_fragment_of_a_plate_is_no_second_track() -> None:
    formats = PlateFormats(EUROPE_M)
    tracker = Tracker(3.5, formats=formats)
    for index in range(20):
        observed = detection(formats, 10.0 if index % 6 != 5 else 15.5, EUROPE_M, 5.0)
        tracker.receive_detections([observed], index / 10)

    (track,) = tracker.tracks
    assert track.ahead.position_m == pytest.approx(10.0, rel=0.08)


def test_a_plate_that_was_cut_off_for_a_moment_stays_tracked() -> None:
    formats = PlateFormats()
    tracker = Tracker(3.5, formats=formats)
    whole = detection(formats, 10.0, EUROPE_M, 5.0)
    for index, observed in enumerate([whole, whole, replace(whole, positions={}), whole, whole]):
        tracker.receive_detections([observed], index / 10)

    (track,) = tracker.tracks
    assert track.ahead.position_m == pytest.approx(10.0)
