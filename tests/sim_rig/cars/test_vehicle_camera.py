"""The vehicle detector of virtual runs: what is in view, what hides what, how far it is off."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from onboard.observations import VehicleDetection
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import VehicleCameraSettings


def car(x_m: float, y_m: float, heading_deg: float = 0.0, length_m: float = 4.5) -> CarState:
    return CarState(
        x_m, y_m, math.radians(heading_deg), 0.0, 0.0, 10.0, 0.0, length_m, 1.8, 1.5
    )  # fmt: skip


OWN = car(0.0, -2.25)
"""Its camera is at the origin and looks north."""


def camera(cars: Mapping[str, CarState], **settings: float) -> VehicleCamera:
    exact = {"misses": 0.0, "false_detections_per_s": 0.0, "range_sigma": 1e-9}
    return VehicleCamera(
        VehicleCameraSettings.model_validate({**exact, "bearing_sigma_rad": 1e-9, **settings}),
        "own",
        lambda _at: {"own": OWN, **cars},
        np.random.default_rng(1),
    )


def look(cars: Mapping[str, CarState], **settings: float) -> list[VehicleDetection]:
    return camera(cars, **settings).detect(0.0)


def test_range_is_to_the_side_that_shows_and_bearing_to_the_middle() -> None:
    (ahead,) = look({"a": car(0.0, 30.0)})
    (crossing,) = look({"a": car(15.0, 20.0, heading_deg=90 + 36.87)})

    assert (ahead.range_m, ahead.bearing_rad) == pytest.approx((30.0 - 2.25, 0.0), abs=1e-6)
    assert crossing.bearing_rad == pytest.approx(math.radians(36.87), abs=1e-4)
    assert crossing.range_m == pytest.approx(25.0 - 0.9, abs=1e-3)


@pytest.mark.parametrize(
    ("x_m", "y_m", "seen"),
    [
        (0.0, 60.0, True),
        (0.0, 90.0, False),
        (-20.0, 30.0, True),
        (-40.0, 30.0, False),
        (0.0, -20.0, False),
    ],
    ids=["ahead", "too far", "in view", "beside the view", "behind"],
)
def test_field_of_view(x_m: float, y_m: float, seen: bool) -> None:
    assert bool(look({"a": car(x_m, y_m)})) == seen


def test_a_nearer_car_hides_one_behind_it_and_not_one_beside() -> None:
    cars = {"near": car(0.0, 15.0), "behind": car(0.3, 30.0), "beside": car(5.0, 30.0)}

    seen = {round(each.range_m) for each in look(cars)}

    assert seen == {13, 28}
    assert {round(each.bearing_rad, 2) for each in look(cars)} == {0.0, 0.17}


def test_several_cars_hide_together_what_none_hides_alone() -> None:
    behind = {"behind": car(0.0, 40.0, heading_deg=90.0)}
    left, right = {"left": car(-1.1, 20.0)}, {"right": car(1.1, 20.0)}

    assert len(look(behind | left, hidden_share=0.7)) == 2
    assert len(look(behind | left | right, hidden_share=0.7)) == 2


def test_errors_grow_with_the_distance_as_stated() -> None:
    cars = {"a": car(0.0, 20.0 + 2.25), "b": car(12.0, 60.0)}
    of = camera(cars, range_sigma=0.05, bearing_sigma_rad=0.01)
    seen = [of.detect(0.0) for k in range(2000)]

    for at, true_m in ((0, 20.0), (1, None)):
        ranges = np.array([picture[at].range_m for picture in seen])
        bearings = np.array([picture[at].bearing_rad for picture in seen])
        stated = float(np.mean([picture[at].range_sigma_m for picture in seen]))
        assert ranges.std() == pytest.approx(stated * math.sqrt(0.8), rel=0.1)
        assert bearings.std() == pytest.approx(0.01, rel=0.1)
        if true_m is not None:
            assert stated == pytest.approx(1.0, rel=0.2)
            # A fifth of the variance is this car's own, and does not average out.
            assert abs(ranges.mean() - true_m) < 3 * math.sqrt(0.2)


def test_some_images_miss_a_car_and_some_have_a_false_detection() -> None:
    of = camera({"a": car(0.0, 20.0)}, misses=0.25, false_detections_per_s=2.0)
    seen = [of.detect(0.0) for k in range(2000)]

    true = [each for picture in seen for each in picture if each.track_id == 0]
    false = [each for picture in seen for each in picture if each.track_id != 0]
    assert len(true) == pytest.approx(1500, rel=0.05)
    assert len(false) == pytest.approx(400, rel=0.15)
    assert len({each.track_id for each in false}) == len(false)
