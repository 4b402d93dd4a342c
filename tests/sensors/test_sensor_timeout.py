"""A silent sensor is shown as lost, within its limit, and recovers by itself."""

import math

import pytest

from onboard.observations import Sensor, SensorLost, SensorRecovered
from onboard.sensors.sensor_timeout import SensorTimeouts


@pytest.fixture
def watch() -> SensorTimeouts:
    return SensorTimeouts({Sensor.SPEED: 0.8, Sensor.CAMERA: 1.0}, now=100.0)


def test_a_sensor_that_never_spoke_is_lost_after_its_limit(watch: SensorTimeouts) -> None:
    assert watch.get_timer() == pytest.approx(100.8)

    watch.handle_timer(100.8)

    assert watch.next_event() == SensorLost(100.8, Sensor.SPEED, silent_s=None, reason="silent")
    assert watch.next_event() is None
    assert watch.lost == {Sensor.SPEED}


def test_each_sample_renews_the_limit(watch: SensorTimeouts) -> None:
    watch.receive_sample(Sensor.SPEED, 100.7, 100.7)
    watch.receive_sample(Sensor.CAMERA, 100.7, 100.7)

    watch.handle_timer(101.4)

    assert watch.next_event() is None
    assert watch.get_timer() == pytest.approx(101.5)


def test_it_is_said_once_that_a_sensor_is_lost_and_how_long_it_was_silent(
    watch: SensorTimeouts,
) -> None:
    watch.receive_sample(Sensor.SPEED, 100.5, 100.5)
    watch.receive_sample(Sensor.CAMERA, 101.5, 101.5)

    watch.handle_timer(101.5)
    watch.handle_timer(101.6)

    assert watch.next_event() == SensorLost(101.5, Sensor.SPEED, silent_s=1.0, reason="silent")
    assert watch.next_event() is None
    assert watch.get_timer() == pytest.approx(102.5), "only the camera is waited for"


def test_the_first_sample_after_a_loss_brings_it_back(watch: SensorTimeouts) -> None:
    watch.handle_timer(100.8)
    watch.next_event()

    watch.receive_sample(Sensor.SPEED, 130.0, 130.0)

    assert watch.next_event() == SensorRecovered(130.0, Sensor.SPEED)
    assert watch.lost == frozenset()
    assert watch.get_timer() == pytest.approx(101.0)


def test_samples_that_all_come_too_late_do_not_bring_a_sensor_back(watch: SensorTimeouts) -> None:
    """A camera whose pictures take longer than its limit to look at."""
    watch.receive_sample(Sensor.SPEED, 104.0, 104.0)
    told = []
    for tenth in range(1, 40):
        now = 100.0 + tenth / 10
        watch.receive_sample(Sensor.CAMERA, now - 1.2, now)
        watch.handle_timer(now)
        while (event := watch.next_event()) is not None:
            told.append(event)

    assert told == [SensorLost(101.0, Sensor.CAMERA, silent_s=None, reason="silent")]


def test_a_room_may_know_of_a_loss_before_the_limit(watch: SensorTimeouts) -> None:
    watch.receive_sample(Sensor.CAMERA, 100.2, 100.2)

    watch.receive_loss(Sensor.CAMERA, "frozen", 100.4)
    watch.receive_loss(Sensor.CAMERA, "frozen", 100.5)

    lost = watch.next_event()
    assert isinstance(lost, SensorLost)
    assert lost.reason == "frozen"
    assert lost.silent_s == pytest.approx(0.2)
    assert watch.next_event() is None


def test_a_sensor_that_the_car_does_not_have_is_never_lost(watch: SensorTimeouts) -> None:
    watch.receive_loss(Sensor.POSITION, "unplugged", 100.1)
    watch.receive_sample(Sensor.POSITION, 100.2, 100.2)

    assert watch.next_event() is None


def test_a_sensor_that_may_be_silent_is_lost_by_its_room_alone() -> None:
    watch = SensorTimeouts({Sensor.RADIO: math.inf}, now=100.0)
    watch.handle_timer(9000.0)
    assert watch.next_event() is None

    for lost_at in (9000.0, 9100.0):
        watch.receive_loss(Sensor.RADIO, "Connection refused", lost_at)
        assert watch.next_event() == SensorLost(
            lost_at, Sensor.RADIO, silent_s=None, reason="Connection refused"
        )
        watch.receive_sample(Sensor.RADIO, lost_at + 4.0, lost_at + 4.0)
        assert watch.next_event() == SensorRecovered(lost_at + 4.0, Sensor.RADIO)
