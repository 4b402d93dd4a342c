"""A vehicle model that the user brings: loaded by OpenCV, its boxes put into metres."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from onboard.errors import UserError
from onboard.observations import LeadIdentity
from onboard.vision.perspective import Perspective
from onboard.vision.settings import VehicleModelSettings, VisionSettings
from onboard.vision.sight import Sight
from onboard.vision.sighting import Search
from onboard.vision.vehicle_detector import VehicleDetector, Vehicles
from tests.vision.drive import CAMERA
from tests.vision.onnx_by_hand import write_red_square_detector


def model(tmp_path: Path, **changes: object) -> VehicleModelSettings:
    write_red_square_detector(tmp_path / "squares.onnx", box_px=8.0)
    given = {
        "file": tmp_path / "squares.onnx",
        "input_width_px": 64,
        "input_height_px": 64,
        "classes": (0,),
        "least_score": 0.4,
        "every_n_frames": 1,
        "vehicle_width_m": 1.8,
    }
    return VehicleModelSettings(**(given | changes))


def red_square(x: int, y: int, side: int, size: tuple[int, int] = (540, 960)) -> np.ndarray:
    image = np.full((*size, 3), 90, np.uint8)
    cv2.rectangle(image, (x, y), (x + side - 1, y + side - 1), (20, 20, 240), cv2.FILLED)
    return image


def test_boxes_come_back_in_the_pictures_own_pixels(tmp_path: Path) -> None:
    # 960 px wide into 64: a cell of the model is 120 px of the picture.
    found = VehicleDetector(model(tmp_path)).find(red_square(480, 240, 120))

    assert len(found) == 1
    box = found[0]
    assert (box.x_px, box.y_px, box.w_px, box.h_px) == pytest.approx((480, 240, 120, 120), abs=1)


def test_a_picture_without_vehicles_has_none(tmp_path: Path) -> None:
    assert VehicleDetector(model(tmp_path)).find(np.full((540, 960, 3), 90, np.uint8)) == []


def test_a_missing_model_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"vehicle_model\.file.*no such file"):
        VehicleDetector(model(tmp_path, file=tmp_path / "none.onnx"))


def test_a_file_that_is_no_model_is_told(tmp_path: Path, capfd: object) -> None:
    (tmp_path / "text.onnx").write_text("not a model")
    with pytest.raises(UserError, match=r"vehicle_model\.file.*not a model"):
        VehicleDetector(model(tmp_path, file=tmp_path / "text.onnx"))


@pytest.mark.parametrize("changes", [{"classes": (7,)}, {"has_objectness": True}])
def test_an_output_that_does_not_fit_the_settings_is_told(
    tmp_path: Path, changes: dict[str, object]
) -> None:
    with pytest.raises(UserError, match="output of shape"):
        VehicleDetector(model(tmp_path, **changes))


def test_width_and_foot_agree_on_where_a_car_is(tmp_path: Path) -> None:
    settings = model(tmp_path)
    vehicles = Vehicles(VehicleDetector(settings), settings, Perspective(CAMERA))
    # The only cell that the model has there spans u 480 to 600 and ends at v = 360: 1.8 m at
    # 825 px of focal length and 120 px are 12.4 m, the road at v = 360 begins at
    # 1.3 m / (90 / 825 + 0.02) = 10.1 m.
    (sighting,) = vehicles.find(red_square(480, 240, 120), Search())

    assert 10.1 < sighting.place.ahead_m < 12.4
    assert sighting.ahead_sigma_m < 0.1 * sighting.place.ahead_m
    assert sighting.place.right_m == pytest.approx(60 / 825 * sighting.place.ahead_m, rel=0.05)


def test_it_looks_at_each_nth_frame(tmp_path: Path) -> None:
    settings = model(tmp_path, every_n_frames=3)
    vehicles = Vehicles(VehicleDetector(settings), settings, Perspective(CAMERA))

    counts = [len(vehicles.find(red_square(480, 240, 120), Search())) for _ in range(7)]

    assert counts == [1, 0, 0, 1, 0, 0, 1]


def test_a_lead_without_any_plate_is_a_lead_of_unknown_identity(tmp_path: Path) -> None:
    settings = VisionSettings(plates=False, vehicle_model=model(tmp_path))
    sight = Sight(CAMERA, settings)
    rng = np.random.default_rng(1)
    leads = []
    for index in range(10):
        image = red_square(420, 240, 120)
        noisy = np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
        sight.receive_frame(noisy, 0.1 * index)
        while (event := sight.next_event()) is not None:
            if event.kind == "lead":
                leads.append(event)
            assert event.kind != "plate"

    assert leads[-1].identity is LeadIdentity.UNKNOWN
    assert leads[-1].text is None
    assert 9.0 < leads[-1].gap_m < 13.0
