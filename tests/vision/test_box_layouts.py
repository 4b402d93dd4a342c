"""Detectors of the user's with the layouts of NanoDet and SSD, and with hostile outputs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.errors import UserError
from onboard.observations import ImageBox
from onboard.vision.box_model import BoxModel
from onboard.vision.settings import BoxModelSettings
from tests.vision.onnx_by_hand import write_answers, write_greedy, write_referring

SIDE_PX = 64
PICTURE = np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8)
NAME = "vision.vehicle_model"


def settings(file: Path, **changes: Any) -> BoxModelSettings:
    given: dict[str, Any] = {
        "file": file,
        "input_width_px": SIDE_PX,
        "input_height_px": SIDE_PX,
    }
    return BoxModelSettings(**(given | changes))


def nanodet_rows(classes: int, cell: int, *, reach: tuple[int, int, int, int]) -> np.ndarray:
    """Rows of which one has the score 0.8 of the last class.

    Args:
        classes: that the model has.
        cell: of that row.
        reach: left, top, right and bottom in cells, up to 7.
    """
    rows = np.zeros((8 * 8 + 4 * 4 + 2 * 2 + 1, classes + 32), np.float32)
    rows[cell, classes - 1] = 0.8
    for side, bins in enumerate(reach):
        rows[cell, classes + 8 * side + bins] = 50.0
    return rows[None]


def nanodet(tmp_path: Path, rows: np.ndarray, **changes: Any) -> BoxModel:
    file = tmp_path / "nanodet.onnx"
    write_answers(file, {"output": rows}, [1, 3, SIDE_PX, SIDE_PX])
    return BoxModel(settings(file, layout="nanodet", **({"classes": (2,)} | changes)), NAME)


def test_a_row_of_nanodet_reaches_from_its_cell_to_each_side(tmp_path: Path) -> None:
    # The cell in row 2, column 3 of 16 by 16 pixels begins at (48, 32).
    found = nanodet(tmp_path, nanodet_rows(3, 64 + 2 * 4 + 3, reach=(2, 1, 0, 1))).find(PICTURE)

    ((box, score),) = found
    assert (box.x_px, box.y_px, box.w_px, box.h_px) == pytest.approx((16, 16, 32, 32), abs=1e-3)
    assert score == pytest.approx(0.8)


def test_a_side_of_nanodet_between_two_bins_is_between_them(tmp_path: Path) -> None:
    rows = nanodet_rows(3, 0, reach=(0, 0, 2, 2))
    rows[0, 0, 3 + 8 * 2 + 3] = 50.0

    ((box, _),) = nanodet(tmp_path, rows).find(PICTURE)

    assert (box.w_px, box.h_px) == pytest.approx((2.5 * 8, 2 * 8), abs=1e-3)


def test_a_class_that_a_nanodet_does_not_have_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(
        UserError, match=r"vehicle_model\.layout: output of shape \(1, 85, 35\).*36"
    ):
        nanodet(tmp_path, nanodet_rows(3, 0, reach=(1, 1, 1, 1)), classes=(3,))


def test_a_nanodet_for_another_size_is_an_error(tmp_path: Path) -> None:
    rows = nanodet_rows(3, 0, reach=(1, 1, 1, 1))[:, :-1]
    with pytest.raises(
        UserError, match=r"nanodet has 85 rows for an input of 64 x 64 px.*gives 84"
    ):
        nanodet(tmp_path, rows)


SSD = {
    "detection_boxes:0": np.array([[(0.25, 0.5, 0.75, 1.0), (0, 0, 1, 1), (0, 0, 0.5, 0.5)]]),
    "detection_scores:0": np.array([[0.9, 0.8, 0.2]]),
    "detection_classes:0": np.array([[3.0, 1.0, 3.0]]),
    "num_detections:0": np.array([3.0]),
}
"""A car, a person, and a car below the least score; y stands before x."""


def ssd(tmp_path: Path, answers: dict[str, np.ndarray]) -> BoxModel:
    file = tmp_path / "ssd.onnx"
    floats = {name: values.astype(np.float32) for name, values in answers.items()}
    write_answers(file, floats, [1, SIDE_PX, SIDE_PX, 3], of_bytes=True)
    return BoxModel(settings(file, layout="ssd", classes=(3, 6, 8)), NAME)


def test_boxes_of_an_ssd_are_shares_of_the_image_and_of_the_classes_that_count(
    tmp_path: Path,
) -> None:
    found = ssd(tmp_path, SSD).find(np.zeros((128, 256, 3), np.uint8))

    # The image is 64 by 32 pixels of the input, and the rest of that is grey.
    ((box, score),) = found
    assert box == ImageBox(128.0, 64.0, 128.0, 128.0)
    assert score == pytest.approx(0.9)


def test_outputs_that_no_ssd_has_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        UserError, match=r"vehicle_model\.layout: outputs boxes, but detection_boxes"
    ):
        ssd(tmp_path, {"boxes": SSD["detection_boxes:0"]})


@pytest.mark.parametrize(
    "boxes",
    [np.zeros((1, 2, 4)), np.zeros((1, 3, 5)), np.zeros((2, 3, 4)), np.zeros(3)],
    ids=["too few", "five sides", "two images", "no boxes"],
)
def test_shapes_that_no_ssd_has_are_an_error(tmp_path: Path, boxes: np.ndarray) -> None:
    with pytest.raises(UserError, match=r"vehicle_model"):
        ssd(tmp_path, SSD | {"detection_boxes:0": boxes})


def test_sides_that_are_no_numbers_are_left_out(tmp_path: Path) -> None:
    boxes = SSD["detection_boxes:0"].copy()
    boxes[0, 0, 1] = np.nan

    assert ssd(tmp_path, SSD | {"detection_boxes:0": boxes}).find(PICTURE) == []


def test_a_picture_full_of_boxes_ends_in_time(tmp_path: Path) -> None:
    """Each compared with all others, 200,000 boxes did not end in 100 s."""
    count = 200_000
    low = np.random.default_rng(1).random((count, 2)) * 0.9
    flood = {
        "detection_boxes:0": np.hstack([low, low + 1e-3])[None],
        "detection_scores:0": np.linspace(0.5, 1.0, count)[None],
        "detection_classes:0": np.full((1, count), 3.0),
    }

    found = ssd(tmp_path, flood).find(PICTURE)

    assert 0 < len(found) <= 1000
    assert found[0][1] == pytest.approx(1.0)


def test_a_model_that_wants_more_memory_than_there_is_is_an_error(tmp_path: Path) -> None:
    write_greedy(tmp_path / "greedy.onnx", SIDE_PX)

    with pytest.raises(UserError, match=r"vehicle_model: .*greedy\.onnx: cannot run on an input"):
        BoxModel(settings(tmp_path / "greedy.onnx"), NAME)


def test_a_model_that_refers_to_another_file_is_an_error(tmp_path: Path) -> None:
    write_referring(tmp_path / "referring.onnx", SIDE_PX)

    with pytest.raises(UserError, match=r"vehicle_model\.file: .*referring\.onnx: not a model"):
        BoxModel(settings(tmp_path / "referring.onnx"), NAME)
