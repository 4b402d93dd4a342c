"""A silent sensor is lost after its timeout, and recovers with its next sample."""

import math

import pytest

from onboard.observations import Sensor, SensorLost, SensorRecovered
from onboard.sensors.sensor_timeout import SensorTimeouts


@pytest.fixture
def timeouts() -> SensorTimeouts:
    return SensorTimeouts({Sensor.SPEED: 0.8, Sensor.CAMERA: 1.0}, now=100.0)


def test_a_sensor_without_samples_is_lost_after_its_timeout(timeouts: SensorTimeouts) -> None:
    assert timeouts.get_timer() == pytest.approx(100.8)

    timeouts.handle_timer(100.8)

    assert timeouts.next_event() == SensorLost(100.8, Sensor.SPEED, silent_s=None, reason="silent")
    assert timeouts.next_event() is None
    assert timeouts.lost == {Sensor.SPEED}


def test_each_sample_restarts_the_timeout(timeouts: SensorTimeouts) -> None:
    timeouts.receive_sample(Sensor.SPEED, 100.7, 100.7)
    timeouts.receive_sample(Sensor.CAMERA, 100.7, 100.7)

    timeouts.handle_timer(101.4)

    assert timeouts.next_event() is None
    assert timeouts.get_timer() == pytest.approx(101.5)


def test_a_loss_is_reported_once_with_the_duration_of_the_silence(
    timeouts: SensorTimeouts,
) -> None:
    timeouts.receive_sample(Sensor.SPEED, 100.5, 100.5)
    timeouts.receive_sample(Sensor.CAMERA, 101.5, 101.5)

    timeouts.handle_timer(101.5)
    timeouts.handle_timer(101.6)

    assert timeouts.next_event() == SensorLost(101.5, Sensor.SPEED, silent_s=1.0, reason="silent")
    assert timeouts.next_event() is None
    assert timeouts.get_timer() == pytest.approx(102.5), "only the camera can still time out"


def test_the_first_sample_after_a_loss_recovers_the_sensor(timeouts: SensorTimeouts) -> None:
    timeouts.handle_timer(100.8)
    timeouts.next_event()

    timeouts.receive_sample(Sensor.SPEED, 130.0, 130.0)

    assert timeouts.next_event() == SensorRecovered(130.0, Sensor.SPEED)
    assert timeouts.lost == frozenset()
    assert timeouts.get_timer() == pytest.approx(101.0)


def test_samples_older_than_the_timeout_do_not_recover_a_sensor(timeouts: SensorTimeouts) -> None:
    """A camera whose images take longer to process than its timeout."""
    timeouts.receive_sample(Sensor.SPEED, 104.0, 104.0)
    events = []
    for tenth in range(1, 40):
        now = 100.0 + tenth / 10
        timeouts.receive_sample(Sensor.CAMERA, now - 1.2, now)
        timeouts.handle_timer(now)
        while (event := timeouts.next_event()) is not None:
            events.append(event)

    assert events == [SensorLost(101.0, Sensor.CAMERA, silent_s=None, reason="silent")]


def test_a_component_can_report_a_loss_before_the_timeout(timeouts: SensorTimeouts) -> None:
    timeouts.receive_sample(Sensor.CAMERA, 100.2, 100.2)

    timeouts.receive_loss(Sensor.CAMERA, "frozen", 100.4)
    timeouts.receive_loss(Sensor.CAMERA, "frozen", 100.5)

    lost = timeouts.next_event()
    assert isinstance(lost, SensorLost)
    assert lost.reason == "frozen"
    assert lost.silent_s == pytest.approx(0.2)
    assert timeouts.next_event() is None


def test_a_sensor_that_is_not_monitored_is_never_lost(timeouts: SensorTimeouts) -> None:
    timeouts.receive_loss(Sensor.POSITION, "unplugged", 100.1)
    timeouts.receive_sample(Sensor.POSITION, 100.2, 100.2)

    assert timeouts.next_event() is None


def test_a_sensor_without_a_timeout_is_lost_only_if_its_component_reports_it() -> None:
    timeouts = SensorTimeouts({Sensor.RADIO: math.inf}, now=100.0)
    timeouts.handle_timer(9000.0)
    assert timeouts.next_event() is None

    for lost_at in (9000.0, 9100.0):
        timeouts.receive_loss(Sensor.RADIO, "Connection refused", lost_at)
        assert timeouts.next_event() == SensorLost(
            lost_at, Sensor.RADIO, silent_s=None, reason="Connection refused"
        )
        timeouts.receive_sample(Sensor.RADIO, lost_at + 4.0, lost_at + 4.0)
        assert timeouts.next_event() == SensorRecovered(lost_at + 4.0, Sensor.RADIO)
