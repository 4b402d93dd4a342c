"""What the rig's detector sends, read by the car's own reader."""

import math
from dataclasses import replace

import numpy as np
import pytest

from onboard.detector.object_list import ObjectListReader
from onboard.observations import DetectionList
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import LATENCY_S, ExternalDetector
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import SENSOR_PROFILES, VehicleCameraSettings
from tests.typed import a, every


def detector(seed: int = 1) -> ExternalDetector:
    own = CarState(0.0, 0.0, 0.0, 0.0, 0.0, 10.0, 0.0, 4.5, 1.8, 1.5)
    other = CarState(3.0, 30.0, 1.0, 0.0, 0.0, 10.0, 0.0, 4.5, 1.8, 1.5)
    cars = {"own": own, "other": other}
    settings = VehicleCameraSettings(misses=0.5)
    camera = VehicleCamera(settings, "own", lambda _at: cars, np.random.default_rng(seed))
    return ExternalDetector(camera, phase_s=0.03)


def test_every_image_has_a_datagram_with_or_without_cars() -> None:
    device, reader = detector(), ObjectListReader()
    reported: list[DetectionList] = []
    while (now := device.get_timer()) < 2.0:
        assert device.bytes_to_send(now - 0.001) == b""
        reader.receive_bytes(device.bytes_to_send(now), now)
        event = reader.next_event()
        assert isinstance(event, DetectionList)
        reported.append(event)

    assert [each.stamp_s for each in reported] == pytest.approx(
        [0.03 + k / VehicleCameraSettings().rate_hz for k in range(len(reported))]
    )
    assert {len(each.cars) for each in reported} >= {0, 1}
    assert all(
        car.range_m == pytest.approx(28.0, abs=8.0) for each in reported for car in each.cars
    )


def test_a_late_datagram_has_the_age_of_its_image() -> None:
    device, reader = detector(), ObjectListReader()
    for late_s in (0.0, 0.3):
        now = device.get_timer() + late_s
        reader.receive_bytes(device.bytes_to_send(now), now)

    first, second = every(DetectionList, iter(reader.next_event, None))
    assert second.stamp_s - first.stamp_s == pytest.approx(1 / VehicleCameraSettings().rate_hz)
    assert first.stamp_s == pytest.approx(0.03)


def test_images_before_the_start_are_skipped() -> None:
    device = detector()
    device.skip_to(77.0)

    assert device.get_timer() == pytest.approx(77.0 + LATENCY_S)


def first_list(profile: str, other: CarState, seed: int = 1) -> DetectionList:
    own = CarState(0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 4.5, 1.8, 1.5)
    settings = SENSOR_PROFILES[profile].model_copy(update={"misses": 0.0})
    cars = {"own": own, "other": other}
    camera = VehicleCamera(settings, "own", lambda _at: cars, np.random.default_rng(seed))
    device, reader = ExternalDetector(camera, phase_s=0.0), ObjectListReader()
    now = device.get_timer()
    reader.receive_bytes(device.bytes_to_send(now), now)
    event = reader.next_event()
    assert isinstance(event, DetectionList)
    return event


@pytest.mark.parametrize(
    ("profile", "reach_m"),
    [
        ("plate-camera", 40),
        ("camera-60", 60),
        ("lidar-120", 120),
        ("radar-150", 150),
        ("corner-radar-80", 80),
    ],
)
def test_a_profile_reaches_as_far_as_it_says(profile: str, reach_m: float) -> None:
    def at(north_m: float) -> CarState:
        return CarState(0.0, north_m, 0.0, 0.0, 0.0, 15.0, 0.0, 4.5, 1.8, 1.5)

    assert first_list(profile, at(reach_m)).cars
    assert not first_list(profile, at(reach_m + 10.0)).cars


def test_only_the_plate_camera_needs_the_rear_of_a_car() -> None:
    oncoming = CarState(1.0, 30.0, math.pi, 0.0, 0.0, 15.0, 0.0, 4.5, 1.8, 1.5)

    assert not first_list("plate-camera", oncoming).cars
    assert first_list("camera-60", oncoming).cars


def test_radar_measures_the_range_rate() -> None:
    slower = CarState(0.0, 60.0, 0.0, 0.0, 0.0, 15.0, 0.0, 4.5, 1.8, 1.5)

    lists = [first_list("radar-150", slower, seed) for seed in range(50)]
    rates = [a(float, each.cars[0].range_rate_m_s) for each in lists]

    assert np.mean(rates) == pytest.approx(-5.0, abs=0.05)
    assert np.std(rates) == pytest.approx(0.1, rel=0.4)
    (without,) = first_list("camera-60", replace(slower, y_m=40.0)).cars
    assert without.range_rate_m_s is None
