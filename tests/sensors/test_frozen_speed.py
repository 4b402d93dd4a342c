"""A speed of the bus that stays the same while the receiver's is another."""

import pytest

from onboard.observations import Position, Speed
from onboard.sensors.frozen_speed import FrozenSpeed


def frozen_s(
    bus_m_s: list[float], receiver_m_s: list[float | None], fixes_hz: int = 10, late_s: float = 0.1
) -> list[float]:
    """When samples at 10 Hz are frozen; both speeds change evenly over their lists."""
    check, found = FrozenSpeed(), []
    for step in range(100):
        now = step / 10
        if step % (10 // fixes_hz) == 0:
            speed_m_s = receiver_m_s[step * len(receiver_m_s) // 100]
            check.receive_position(Position(now - late_s, 48.0, 11.0, None, 1.0, speed_m_s, 0.0))
        if check.receive_speed(Speed(now, bus_m_s[step * len(bus_m_s) // 100], 0.28, "obd:7E8")):
            found.append(now)
    return found


@pytest.mark.parametrize(("fixes_hz", "late_s"), [(10, 0.1), (1, 0.4)])
@pytest.mark.parametrize(("bus_m_s", "receiver_m_s"), [(14.0, 0.0), (0.0, 8.0), (30.0, 22.0)])
def test_a_speed_that_freezes_while_the_receivers_is_another_is_found(
    bus_m_s: float, receiver_m_s: float, fixes_hz: int, late_s: float
) -> None:
    found = frozen_s([bus_m_s], [receiver_m_s], fixes_hz, late_s)

    assert found[0] == pytest.approx(2.0 + late_s, abs=1.0 / fixes_hz + 1e-9)
    assert len(found) == 100 - round(found[0] * 10)


def test_a_speed_that_changes_again_is_believed_at_once() -> None:
    thaws = [14.0] * 50 + [13.0 - step / 10 for step in range(50)]
    found = frozen_s(thaws, [5.0])

    assert found[0] == pytest.approx(2.1)
    assert found[-1] == pytest.approx(4.9)


@pytest.mark.parametrize(
    ("bus_m_s", "receiver_m_s"),
    [
        ([20.0], [20.0]),
        ([50.0], [45.5]),  # a speedometer that shows 10 % too much
        ([20.0], [None]),  # a receiver that tells no speed
        ([float(step) for step in range(100)], [0.0]),  # it moves: the receiver is wrong
        ([0.0], [1.5]),  # multipath at rest
    ],
)
def test_other_speeds_are_not(bus_m_s: list[float], receiver_m_s: list[float | None]) -> None:
    assert frozen_s(bus_m_s, receiver_m_s) == []


def test_a_receiver_that_is_silent_contradicts_nothing() -> None:
    check = FrozenSpeed()
    check.receive_speed(Speed(0.0, 14.0, 0.28, "obd:7E8"))
    check.receive_position(Position(3.0, 48.0, 11.0, None, 1.0, 0.0, 0.0))

    assert check.receive_speed(Speed(3.1, 14.0, 0.28, "obd:7E8"))
    assert not check.receive_speed(Speed(5.0, 14.0, 0.28, "obd:7E8"))
    assert not check.receive_speed(Speed(3.2, 14.0, 0.28, "obd:7E9")), "another source"
