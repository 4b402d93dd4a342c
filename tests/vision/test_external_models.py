"""Models of the user's: loaded by OpenCV, with their boxes located in metres."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from onboard.errors import UserError
from onboard.observations import ImageBox, Lead, LeadIdentity
from onboard.vision.box_model import LARGEST_BYTES, BoxModel
from onboard.vision.detection import SearchPlan
from onboard.vision.external_plate_detector import ExternalPlateDetector
from onboard.vision.networks import load_perception
from onboard.vision.perspective import Perspective
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.settings import BoxModelSettings, VehicleModelSettings, VisionSettings
from onboard.vision.vehicle_detector import VehicleBoxDetector
from sim_rig.rendering.plate_art import EU, draw_plate
from sim_rig.rendering.scene import opaque, warp_onto
from tests.typed import a
from tests.vision.drive import CAMERA, observe
from tests.vision.onnx_by_hand import (
    write_answers,
    write_red_square_detector,
    write_yolox_like,
)


def model(tmp_path: Path, **changes: Any) -> VehicleModelSettings:
    write_red_square_detector(tmp_path / "squares.onnx", box_px=8.0)
    given = {
        "file": tmp_path / "squares.onnx",
        "input_width_px": 64,
        "input_height_px": 64,
        "classes": (0,),
        "least_score": 0.4,
        "every_n_frames": 1,
    }
    return VehicleModelSettings.model_validate(given | changes)


def red_square(x: int, y: int, side: int, size: tuple[int, int] = (540, 960)) -> np.ndarray:
    image = np.full((*size, 3), 90, np.uint8)
    cv2.rectangle(image, (x, y), (x + side - 1, y + side - 1), (20, 20, 240), cv2.FILLED)
    return image


def test_boxes_are_in_pixels_of_the_image(tmp_path: Path) -> None:
    # 960 px wide into 64: a cell of the model is 120 px of the image.
    found = BoxModel(model(tmp_path), "vision.vehicle_model").find(red_square(480, 240, 120))

    ((box, score),) = found
    assert (box.x_px, box.y_px, box.w_px, box.h_px) == pytest.approx((480, 240, 120, 120), abs=1)
    assert 0.4 < score <= 1.0


def test_an_image_without_vehicles_has_no_boxes(tmp_path: Path) -> None:
    assert (
        BoxModel(model(tmp_path), "vision.vehicle_model").find(np.full((540, 960, 3), 90, np.uint8))
        == []
    )


def yolox(tmp_path: Path, **changes: object) -> VehicleModelSettings:
    write_yolox_like(tmp_path / "yolox.onnx")
    given = {"file": tmp_path / "yolox.onnx", "layout": "yolox", "classes": (1,)}
    return model(tmp_path, **(given | changes))


def test_rows_of_yolox_are_offsets_in_cells_and_logarithms_of_sides(tmp_path: Path) -> None:
    found = BoxModel(yolox(tmp_path), "vision.vehicle_model").find(np.zeros((64, 64, 3), np.uint8))

    ((box, score),) = found
    assert (box.x_px, box.y_px, box.w_px, box.h_px) == pytest.approx((4, 4, 16, 16), abs=0.01)
    assert score == pytest.approx(0.9, abs=0.01)


def test_a_class_that_a_yolox_does_not_have_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"output of shape.*classes"):
        BoxModel(yolox(tmp_path, classes=(2,)), "vision.vehicle_model")


def test_a_model_of_another_layout_is_an_error(tmp_path: Path) -> None:
    squares = tmp_path / "squares.onnx"
    write_red_square_detector(squares)
    # Six values a row, of another number of rows.
    with pytest.raises(UserError, match=r"vehicle_model"):
        BoxModel(yolox(tmp_path, file=squares, classes=(0,)), "vision.vehicle_model")


@pytest.mark.parametrize("classes", [(), (-3,)])
def test_classes_that_no_model_has_are_an_error(tmp_path: Path, classes: tuple[int, ...]) -> None:
    """A negative one counted from the last column."""
    with pytest.raises(ValidationError, match="classes"):
        model(tmp_path, classes=classes)


def test_rows_that_are_no_numbers_are_left_out(tmp_path: Path) -> None:
    settings = yolox(tmp_path)
    content = settings.file.read_bytes()
    side = np.float32(np.log(2.0)).tobytes()
    settings.file.write_bytes(content.replace(side, np.float32(np.nan).tobytes()))

    found = BoxModel(settings, "vision.vehicle_model").find(np.zeros((64, 64, 3), np.uint8))

    assert found == []


@pytest.mark.parametrize(
    "box", [(32, 32, 1e30, 1e30), (1e30, -1e30, 9, 9), (32, 32, -20, -20), (32, 32, 0, 0)]
)
def test_boxes_that_no_picture_has_end_no_drive(tmp_path: Path, box: tuple[float, ...]) -> None:
    rows = np.tile(np.asarray([*box, 0.9], np.float32), (1, 7, 1))
    write_answers(tmp_path / "boxes.onnx", {"found": rows}, [1, 3, 64, 64])
    settings = model(tmp_path, file=tmp_path / "boxes.onnx")
    perception = load_perception(CAMERA, VisionSettings(plates=False, vehicle_model=settings))
    rng = np.random.default_rng(1)
    drive = ((n / 10, rng.integers(0, 255, (540, 960, 3), np.uint8)) for n in range(5))

    assert [lead.gap_m for lead in observe(perception, drive).leads] == [None] * 5


def test_a_truncated_model_is_an_error(tmp_path: Path) -> None:
    whole = yolox(tmp_path)
    whole.file.write_bytes(whole.file.read_bytes()[:-200])
    with pytest.raises(UserError, match=r"vehicle_model"):
        BoxModel(whole, "vision.vehicle_model")


def test_a_huge_file_is_an_error(tmp_path: Path) -> None:
    huge = tmp_path / "huge.onnx"
    with huge.open("wb") as file:
        file.truncate(LARGEST_BYTES + 1)
    with pytest.raises(UserError, match=r"vehicle_model\.file.*at most 400,000,000"):
        BoxModel(yolox(tmp_path, file=huge), "vision.vehicle_model")


def test_a_missing_model_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"vehicle_model\.file.*no such file"):
        BoxModel(model(tmp_path, file=tmp_path / "none.onnx"), "vision.vehicle_model")


def test_a_file_that_is_no_model_is_an_error(tmp_path: Path, capfd: object) -> None:
    (tmp_path / "text.onnx").write_text("not a model")
    with pytest.raises(UserError, match=r"vehicle_model\.file.*not a model"):
        BoxModel(model(tmp_path, file=tmp_path / "text.onnx"), "vision.vehicle_model")


def test_a_model_with_another_input_size_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cannot run on an input of 64 x 32 px \(input_width_px"):
        BoxModel(model(tmp_path, input_height_px=32), "vision.vehicle_model")


@pytest.mark.parametrize("changes", [{"classes": (7,)}, {"has_objectness": True}])
def test_an_output_that_does_not_fit_the_settings_is_an_error(
    tmp_path: Path, changes: dict[str, object]
) -> None:
    with pytest.raises(UserError, match="output of shape"):
        BoxModel(model(tmp_path, **changes), "vision.vehicle_model")


def test_width_and_foot_point_agree_on_the_distance(tmp_path: Path) -> None:
    settings = model(tmp_path)
    vehicles = VehicleBoxDetector(
        BoxModel(settings, "vision.vehicle_model"), settings.every_n_frames, Perspective(CAMERA)
    )
    # The only cell that the model has there spans u 480 to 600 and ends at v = 360: 1.8 m at
    # 825 px of focal length and 120 px are 12.4 m, the road at v = 360 begins at
    # 1.3 m / (90 / 825 + 0.02) = 10.1 m.
    (detection,) = vehicles.find(red_square(480, 240, 120), SearchPlan())

    assert 10.1 < detection.position.ahead_m < 12.4
    assert detection.ahead_sigma_m < 0.1 * detection.position.ahead_m
    assert detection.position.right_m == pytest.approx(
        60 / 825 * detection.position.ahead_m, rel=0.05
    )


def test_the_model_runs_on_each_nth_frame(tmp_path: Path) -> None:
    settings = model(tmp_path, every_n_frames=3)
    vehicles = VehicleBoxDetector(
        BoxModel(settings, "vision.vehicle_model"), settings.every_n_frames, Perspective(CAMERA)
    )

    counts = [len(vehicles.find(red_square(480, 240, 120), SearchPlan())) for _ in range(7)]

    assert counts == [1, 0, 0, 1, 0, 0, 1]


def test_a_vehicle_without_a_plate_is_a_lead_of_unknown_identity(tmp_path: Path) -> None:
    settings = VisionSettings(plates=False, vehicle_model=model(tmp_path))
    perception = load_perception(CAMERA, settings)
    rng = np.random.default_rng(1)
    leads = []
    for index in range(10):
        image = red_square(420, 240, 120)
        noisy = np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
        perception.receive_frame(noisy, 0.1 * index)
        while (event := perception.next_event()) is not None:
            if event.kind == "lead":
                leads.append(event)
            assert event.kind != "plate"

    lead = a(Lead, leads[-1])
    assert lead.identity is LeadIdentity.UNKNOWN
    assert lead.text is None
    assert 9.0 < a(float, lead.gap_m) < 13.0


def plate_model(tmp_path: Path) -> BoxModelSettings:
    """A model that detects red squares: cells of 120 by 120 px in an image of 960 by 540."""
    settings = model(tmp_path)
    return BoxModelSettings(
        file=settings.file, input_width_px=64, input_height_px=64, least_score=0.4
    )


def test_corners_in_a_plate_models_box_are_those_of_the_shipped_detector(tmp_path: Path) -> None:
    found = ExternalPlateDetector(
        BoxModel(plate_model(tmp_path), "vision.plate_model"), PlateDetector()
    )
    image = red_square(480, 240, 120)
    art = draw_plate("GN417KB", EU)
    truth = np.array([(490, 290), (590, 290), (590, 311), (490, 311)], np.float32)
    warp_onto(image, opaque(art), truth)

    (plate,) = found.find(image)

    # Its box is the whole cell; Europe's blue band stays outside.
    assert plate.box.w_px == pytest.approx(95, abs=8)
    assert plate.box.centre_px == pytest.approx((543, 300), abs=6)
    assert found.find_again(image, plate.corners_px) is not None


def test_a_box_without_a_plate_for_the_shipped_detector_keeps_its_corners(tmp_path: Path) -> None:
    found = ExternalPlateDetector(
        BoxModel(plate_model(tmp_path), "vision.plate_model"), PlateDetector()
    )

    (plate,) = found.find(red_square(480, 240, 120))

    assert plate.box.w_px == pytest.approx(120, abs=1)
    in_region = found.find(red_square(480, 240, 120), ImageBox(360.0, 60.0, 600.0, 480.0))
    assert in_region
    for plate in in_region:
        x, y = plate.box.centre_px
        assert 480 <= x <= 600
        assert 240 <= y <= 360
    assert found.find(red_square(480, 240, 120), ImageBox(-50, -50, 20, 20)) == []


def test_a_plate_model_of_the_settings_is_loaded(tmp_path: Path) -> None:
    load_perception(CAMERA, VisionSettings(plate_model=plate_model(tmp_path)))
    missing = plate_model(tmp_path).model_copy(update={"file": tmp_path / "none.onnx"})
    with pytest.raises(UserError, match=r"plate_model\.file.*no such file"):
        load_perception(CAMERA, VisionSettings(plate_model=missing))
