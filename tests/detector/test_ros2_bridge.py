"""The ROS 2 bridge of the examples, against the real codecs; its node runs only where ROS 2 is."""

import importlib.util
import json
import math
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.detector.object_list import ObjectListReader
from onboard.observations import DetectionList
from onboard.risk.fcw import FCW

PATH = Path(__file__).parents[2] / "examples" / "ros2_bridge.py"
SPEC = importlib.util.spec_from_file_location("ros2_bridge", PATH)
assert SPEC is not None
assert SPEC.loader is not None
bridge = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(bridge)


def detection(x: float, y: float, **given: Any) -> Message:
    """A vehicle of 4 x 2 m as a `vision_msgs/Detection3D`."""
    yaw_rad = given.get("yaw_rad", 0.0)
    turn = Message(x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2))
    covariance = given.get("covariance")
    return Message(
        id=given.get("id", "a"),
        bbox=Message(
            center=Message(position=Message(x=x, y=y, z=0.0), orientation=turn),
            size=Message(x=4.0, y=2.0, z=1.5),
        ),
        results=[] if covariance is None else [Message(pose=Message(covariance=covariance))],
    )


def received(*detections: Message) -> DetectionList:
    data = bridge.object_list(detections, bridge.VehicleNumbers(), age_s=0.1, sent_s=50.0)
    reader = ObjectListReader()
    reader.receive_bytes(data, now=7.0)
    event = reader.next_event()
    assert isinstance(event, DetectionList)
    return event


def test_a_vehicle_ahead_is_as_far_as_its_rear() -> None:
    (vehicle,) = received(detection(20.0, 0.0)).cars
    assert vehicle.range_m == pytest.approx(18.0)
    assert vehicle.bearing_rad == 0.0


def test_a_vehicle_on_the_left_has_a_negative_bearing() -> None:
    (vehicle,) = received(detection(10.0, 10.0, yaw_rad=math.pi / 4)).cars
    assert vehicle.bearing_rad == pytest.approx(-math.pi / 4)
    assert vehicle.range_m == pytest.approx(math.hypot(10, 10) - 2.0)


def test_a_crossing_vehicle_is_as_far_as_its_side() -> None:
    (vehicle,) = received(detection(20.0, 0.0, yaw_rad=math.pi / 2)).cars
    assert vehicle.range_m == pytest.approx(19.0)


def test_the_covariance_of_the_pose_is_turned_to_range_and_bearing() -> None:
    covariance = [0.0] * 36
    covariance[0], covariance[7] = 0.25, 0.04
    (ahead,) = received(detection(20.0, 0.0, covariance=covariance)).cars
    assert (ahead.range_sigma_m, ahead.bearing_sigma_rad) == pytest.approx((0.5, 0.01))
    (aside,) = received(detection(0.0, 20.0, covariance=covariance)).cars
    assert (aside.range_sigma_m, aside.bearing_sigma_rad) == pytest.approx((0.2, 0.025))


@pytest.mark.parametrize("variances", [(math.nan, 0.04), (-0.25, 0.04), (0.25, 0.0), (1e6, 1.0)])
def test_a_covariance_that_is_none_leaves_the_sigmas_of_a_detection_without(
    variances: tuple[float, float],
) -> None:
    covariance = [0.0] * 36
    covariance[0], covariance[7] = variances
    (vehicle,) = received(detection(20.0, 0.0, covariance=covariance)).cars
    assert (vehicle.range_sigma_m, vehicle.bearing_sigma_rad) == (1.5, 0.02)


def test_vehicles_keep_their_numbers_and_the_unusable_are_left_out() -> None:
    numbers = bridge.VehicleNumbers()
    sweeps = [
        [detection(20.0, 0.0, id="x"), detection(30.0, 3.0, id="y")],
        [detection(29.0, 3.0, id="y"), detection(1.0, 0.0, id="host"), detection(9.0, 0.0, id="")],
        [],
    ]
    lists = [json.loads(bridge.object_list(each, numbers, 0.1, 5.0))["cars"] for each in sweeps]
    assert [[car["id"] for car in cars] for cars in lists] == [[0, 1], [1], []]


@given(x=st.floats(-200, 200), y=st.floats(-200, 200), yaw_rad=st.floats(-math.pi, math.pi))
def test_the_range_ends_on_the_box(x: float, y: float, yaw_rad: float) -> None:
    each = detection(x, y, yaw_rad=yaw_rad)
    away_m = math.hypot(x, y)
    if away_m < 3.0:
        return
    left_m = away_m - bridge._range_m(each)
    cosine, sine = math.cos(math.atan2(y, x) - yaw_rad), math.sin(math.atan2(y, x) - yaw_rad)
    on_side = max(abs(left_m * cosine) / 2.0, abs(left_m * sine) / 1.0)
    assert on_side == pytest.approx(1.0, abs=1e-6)


def request(deceleration_m_s2: float) -> bytes:
    return datagram.encode(BrakeRequest(1.0, deceleration_m_s2, 0.9, 0.3, 17, (FCW,)))


def test_a_request_to_brake_is_a_negative_acceleration_until_it_is_too_old() -> None:
    brake = bridge.BrakeAcceleration()
    assert brake.receive_request(request(5.25), now=10.0) == -5.25
    assert brake.receive_request(request(4.0), now=10.2) == -4.0
    assert [brake.has_ended(now) for now in (10.3, 10.5, 10.51, 10.6)] == [
        False,
        False,
        True,
        False,
    ]


def test_a_request_that_ends_is_not_ended_again() -> None:
    brake = bridge.BrakeAcceleration()
    brake.receive_request(request(5.25), now=10.0)
    assert brake.receive_request(request(0.0), now=10.1) == 0.0
    assert not brake.has_ended(11.0)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{",
        b"[]",
        b"{}",
        b'{"deceleration_m_s2": [1]}',
        b"\xff",
        b"[" * 60_000,
        b'{"deceleration_m_s2": -3.0, "valid_s": 0.3}',
        b'{"deceleration_m_s2": NaN, "valid_s": 0.3}',
        b'{"deceleration_m_s2": 1e999, "valid_s": 0.3}',
        b'{"deceleration_m_s2": 3.0, "valid_s": Infinity}',
        b'{"deceleration_m_s2": 3.0, "valid_s": 1' + b"0" * 400 + b"}",
    ],
)
def test_other_datagrams_are_refused_and_end_nothing(data: bytes) -> None:
    brake = bridge.BrakeAcceleration()
    brake.receive_request(request(5.25), now=10.0)
    with pytest.raises(ValueError, match=r"."):
        brake.receive_request(data, now=10.1)
    assert not brake.has_ended(10.3)
    assert brake.has_ended(10.31)
