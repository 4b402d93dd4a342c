"""Where the box of a track is drawn in frames in which its vehicle was not found."""

from dataclasses import replace

import numpy as np
import pytest

from onboard.vision.detection import DetectionKind
from onboard.vision.perspective import Perspective, bounding_box
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.vehicle_track import VehicleTrack
from tests.vision.drive import CAMERA
from tests.vision.test_lead import detection


def test_a_box_stays_on_a_vehicle_whose_plate_and_rear_tell_other_distances() -> None:
    corners = np.array([[300, 200], [340, 200], [340, 210], [300, 210]], np.float32)
    plate = replace(
        detection(20.0, kind=DetectionKind.PLATE), corners_px=corners, ahead_sigma_m=6.0
    )
    rear = detection(26.0, text=None, kind=DetectionKind.VEHICLE)
    track = VehicleTrack(1, plate, 0.0, PlateFormats())
    for step in range(1, 20):
        track.predict(0.1 * step)
        track.update(plate if step % 2 else rear, 0.1 * step)

    track.predict(2.0)

    expected, found = track.box_at(2.0, Perspective(CAMERA)), bounding_box(corners)
    assert expected.w_px == pytest.approx(found.w_px, rel=0.05)
    assert expected.centre_px == pytest.approx(found.centre_px, abs=1.0)
