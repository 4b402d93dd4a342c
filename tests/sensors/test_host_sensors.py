"""Which observations are used, and which of them keep a sensor from being lost."""

import pytest

from onboard.kinematics.units import KM_H
from onboard.observations import (
    DetectionList,
    ImageBox,
    Plate,
    Position,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.sensors.host_sensors import HostSensors
from onboard.step import Observation
from tests.leads import known_lead

SEEN = VehicleDetection(0.9, 7, 20.0, 0.3, 0.0, 0.01)
FIX = Position(0.9, 48.0, 11.0, None, 1.0, 14.0, 0.0)


def sensors(*fitted: Sensor) -> HostSensors:
    return HostSensors(dict.fromkeys(fitted, 1.0), now=0.0)


@pytest.mark.parametrize(
    ("sensor", "observation"),
    [
        (Sensor.SPEED, Speed(0.9, 14.0, KM_H, "obd:7E8")),
        (Sensor.CAMERA, known_lead(0.9, "AAA1")),
        (Sensor.POSITION, FIX),
        (Sensor.DETECTOR, DetectionList(0.9, ())),
        (Sensor.RADIO, SensorRecovered(0.9, Sensor.RADIO)),
    ],
)
def test_an_observation_restarts_the_timeout_of_its_sensor(
    sensor: Sensor, observation: Observation
) -> None:
    of_car = sensors(sensor)

    used = of_car.receive_observation(observation, 0.9)

    assert of_car.get_timer() == pytest.approx(1.9)
    assert used == (sensor is not Sensor.RADIO)


def test_a_sensor_that_its_edge_reports_as_lost_is_lost() -> None:
    of_car = sensors(Sensor.RADIO)

    assert not of_car.receive_observation(SensorLost(0.5, Sensor.RADIO, None, "no route"), 0.5)

    assert of_car.next_event() == SensorLost(0.5, Sensor.RADIO, None, "no route")


def test_a_frozen_speed_is_lost_and_not_used() -> None:
    of_car = sensors(Sensor.SPEED)
    used = []
    for tenth in range(25):
        now = tenth / 10
        of_car.receive_observation(Position(now, 48.0, 11.0, None, 1.0, 5.0, 0.0), now)
        used.append(of_car.receive_observation(Speed(now, 14.0, KM_H, "obd:7E8"), now))

    assert used == [True] * 20 + [False] * 5
    loss = of_car.next_event()
    assert isinstance(loss, SensorLost)
    assert (loss.stamp_s, loss.reason) == (2.0, "frozen")


def test_the_camera_s_vehicles_are_used_only_without_a_detector() -> None:
    assert sensors(Sensor.CAMERA).receive_observation(SEEN, 0.9)
    assert not sensors(Sensor.CAMERA, Sensor.DETECTOR).receive_observation(SEEN, 0.9)


@pytest.mark.parametrize(("text", "used"), [("AAA1", True), (None, False)])
def test_a_plate_without_a_text_is_not_used(text: str | None, *, used: bool) -> None:
    assert (
        sensors(Sensor.CAMERA).receive_observation(
            Plate(0.9, ImageBox(0.0, 0.0, 9.0, 2.0), text, 0.9, is_lead=False), 0.9
        )
        == used
    )
