"""What the rig's detector sends, read by the car's own reader."""

import numpy as np
import pytest

from onboard.detector.object_list import ObjectListReader
from onboard.observations import DetectionList
from sim_rig.cars.vehicle_camera import FPS, VehicleCamera
from sim_rig.cars.vehicle_detector import LATENCY_S, ExternalDetector
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import VehicleCameraSettings


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
        [0.03 + k / FPS for k in range(len(reported))]
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

    first, second = iter(reader.next_event, None)
    assert second.stamp_s - first.stamp_s == pytest.approx(1 / FPS)
    assert first.stamp_s == pytest.approx(0.03)


def test_images_before_the_start_are_skipped() -> None:
    device = detector()
    device.skip_to(77.0)

    assert device.get_timer() == pytest.approx(77.0 + LATENCY_S)
