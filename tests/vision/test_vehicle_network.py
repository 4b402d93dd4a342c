"""Vehicles from the output of the network: cells of 8 px to boxes."""

from pathlib import Path

import numpy as np
import pytest

from onboard.vision.vehicle_network import (
    CELL_PX,
    SIDE_UNIT_PX,
    StreetNetwork,
    VehicleKind,
    decode,
)

_ROWS, _COLUMNS = 12, 20
_KINDS = list(VehicleKind)


def _empty() -> np.ndarray:
    answer = np.zeros((12, _ROWS, _COLUMNS), np.float32)
    answer[0] = -9.0
    return answer


def _put(
    answer: np.ndarray,
    cell: tuple[int, int],
    box: tuple[float, float, float, float],
    logit: float,
    kind: VehicleKind = VehicleKind.CAR,
) -> None:
    """Let a cell know a box (left, top, right, bottom), whose rear is its right two thirds."""
    row, column = cell
    x, y = (column + 0.5) * CELL_PX, (row + 0.5) * CELL_PX
    left, top, right, bottom = box
    end = left + (right - left) / 3
    sides = left - x, top - y, right - x, bottom - y, end - x, right - x
    answer[0, row, column] = logit
    answer[1:7, row, column] = np.asarray(sides) / SIDE_UNIT_PX
    answer[7 + _KINDS.index(kind), row, column] = 5.0


def test_an_empty_map_shows_no_vehicle() -> None:
    assert decode(_empty(), 0.4) == []


def test_a_cell_gives_box_rear_kind_and_score() -> None:
    answer = _empty()
    _put(answer, (5, 7), (40.0, 30.0, 88.0, 66.0), 2.0, VehicleKind.BUS)
    (vehicle,) = decode(answer, 0.4)
    box = vehicle.box
    assert (box.x_px, box.y_px, box.w_px, box.h_px) == pytest.approx((40, 30, 48, 36), abs=1e-4)
    assert vehicle.end_px == pytest.approx((56, 88), abs=1e-4)
    assert vehicle.kind is VehicleKind.BUS
    assert vehicle.score == pytest.approx(1 / (1 + np.exp(-2.0)))


def test_cells_of_one_vehicle_are_merged_by_their_scores() -> None:
    answer = _empty()
    _put(answer, (5, 7), (40.0, 30.0, 88.0, 66.0), 3.0)
    _put(answer, (5, 8), (44.0, 30.0, 88.0, 66.0), 1.0)
    (vehicle,) = decode(answer, 0.4)
    strong, weak = (1 / (1 + np.exp(-logit)) for logit in (3.0, 1.0))
    left = (40 * strong**2 + 44 * weak**2) / (strong**2 + weak**2)
    assert vehicle.box.x_px == pytest.approx(left, abs=1e-3)


def test_two_vehicles_beside_each_other_stay_two() -> None:
    answer = _empty()
    _put(answer, (5, 4), (20.0, 30.0, 56.0, 60.0), 1.0)
    _put(answer, (5, 9), (60.0, 30.0, 96.0, 60.0), 2.0)
    assert [vehicle.box.x_px for vehicle in decode(answer, 0.4)] == pytest.approx([60, 20])


def test_a_low_score_is_no_vehicle() -> None:
    answer = _empty()
    _put(answer, (5, 7), (40.0, 30.0, 88.0, 66.0), -1.0)
    assert decode(answer, 0.4) == []
    assert len(decode(answer, 0.2)) == 1


def test_a_missing_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no network at .*nothing\.onnx"):
        StreetNetwork(tmp_path / "nothing.onnx")
