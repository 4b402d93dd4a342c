"""The shipped vehicle detector on rendered streets that it was not trained on."""

import cv2
import numpy as np
import pytest

from onboard.observations import ImageBox, VehicleDetection
from onboard.vision.perception import Perception
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.sized_camera import Networks
from onboard.vision.vehicle_finder import VehicleFinder, overlap
from onboard.vision.vehicle_network import VehicleKind
from sim_rig.rendering.street.canvas import FINE, Canvas, Daylight, RoadCamera
from sim_rig.rendering.street.ground import RoadLayout, draw_ground
from sim_rig.rendering.street.roadside import gantry
from sim_rig.rendering.street.street import SeenVehicle, StreetLight, random_street
from sim_rig.rendering.street.windscreen import burn_in

_SIZE = (640, 360)
_FINDER = VehicleFinder()
_DAY = Daylight(
    ambient=0.6,
    sun=0.4,
    towards_sun=(0.0, 0.3, 0.95),
    headlamps=0.0,
    haze_bgr=(235.0, 230.0, 225.0),
    sight_m=900.0,
    sky_bgr=(220.0, 190.0, 150.0),
    is_dark=False,
)
_ROAD = RoadLayout(
    lane_width_m=3.5,
    lanes_left=1,
    lanes_right=1,
    lanes_oncoming=0,
    median_m=2.0,
    shoulder_m=2.0,
    offset_m=0.0,
)


def _box(vehicle: SeenVehicle) -> ImageBox:
    left, top, right, bottom = vehicle.box_px
    return ImageBox(left, top, right - left, bottom - top)


def _is_plain(vehicle: SeenVehicle) -> bool:
    """Whether it is in the picture as a whole, unhidden, and neither tiny nor all of it."""
    left, top, right, bottom = vehicle.box_px
    is_inside = left >= 0 and top >= 0 and right <= _SIZE[0] and bottom <= _SIZE[1]
    return is_inside and vehicle.visible > 0.85 and 32 <= right - left <= 300


@pytest.mark.long
@pytest.mark.parametrize("kind", list(VehicleKind))
def test_vehicles_of_each_kind_are_found(kind: VehicleKind) -> None:
    rng = np.random.default_rng(5)
    found: list[bool] = []
    while len(found) < 10:
        street = random_street(_SIZE, rng, light=StreetLight.OVERCAST, kinds=(kind,))
        boxes = [vehicle.box for vehicle in _FINDER.find(street.image)]
        found += [
            any(overlap(box, _box(vehicle)) >= 0.4 for box in boxes)
            for vehicle in street.vehicles
            if _is_plain(vehicle)
        ]
    assert np.mean(found) >= 0.5


@pytest.mark.long
@pytest.mark.parametrize("seed", range(5))
def test_a_gantry_and_a_date_stamp_are_no_vehicles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = _SIZE[0] * FINE, _SIZE[1] * FINE
    canvas = Canvas(RoadCamera(size, size[0], (size[0] / 2, size[1] / 2)), _DAY)
    draw_ground(canvas, _ROAD, rng)
    for ahead_m in (60.0, 25.0):
        gantry(canvas, ahead_m, _ROAD, rng)
    image = np.asarray(cv2.resize(canvas.image, _SIZE, interpolation=cv2.INTER_AREA), np.uint8)
    burn_in(image, rng)
    calibration = Calibration(
        width_px=_SIZE[0],
        height_px=_SIZE[1],
        focal_x_px=_SIZE[0],
        focal_y_px=_SIZE[0],
        principal_x_px=_SIZE[0] / 2,
        principal_y_px=_SIZE[1] / 2,
        pitch_rad=0.0,
    )
    settings = VisionSettings(plates=False, tag_dictionary=None, vehicles=True)
    perception = Perception(calibration, settings, Networks(vehicle_model=_FINDER))
    for number in range(12):
        noisy = np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)
        perception.receive_frame(noisy, 0.1 * number)
        while (event := perception.next_event()) is not None:
            assert not isinstance(event, VehicleDetection)
