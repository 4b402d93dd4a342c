"""The host vehicle's last samples: how old they may be is the reader's word."""

from collections.abc import Callable

import pytest

from onboard.observations import BrakePedal, Position, Side, Speed, TurnSignal
from onboard.sensors.host_state import (
    BRAKING_SPEED_VALID_S,
    PEDAL_VALID_S,
    POSITION_VALID_S,
    SPEED_VALID_S,
    HostState,
)

SPEED = Speed(10.0, 20.0, 0.28, "obd:7E8")
PEDAL = BrakePedal(10.0, True, "dbc")
FIX = Position(10.0, 48.0, 11.0, None, 1.0, 20.0, 0.0)
READERS: dict[str, tuple[Callable[[HostState, float], object], object, float]] = {
    "speed": (lambda host, now: host.speed(now), SPEED, SPEED_VALID_S),
    "speed that brakes": (
        lambda host, now: host.speed(now, BRAKING_SPEED_VALID_S), SPEED, BRAKING_SPEED_VALID_S,
    ),
    "pedal": (lambda host, now: host.pedal(now), PEDAL, PEDAL_VALID_S),
    "position": (lambda host, now: host.position(now), FIX, POSITION_VALID_S),
}  # fmt: skip


@pytest.mark.parametrize("name", READERS)
def test_a_sample_is_valid_as_long_as_its_reader_allows(name: str) -> None:
    read, sample, valid_s = READERS[name]
    host = HostState()
    assert read(host, 10.0) is None

    for each in (SPEED, PEDAL, FIX):
        host.receive_observation(each)

    assert read(host, 10.0 + valid_s - 0.01) is sample
    assert read(host, 10.0 + valid_s + 0.01) is None
    assert read(host, 10.0 - valid_s - 0.01) is None  # dated ahead


@pytest.mark.parametrize(
    ("on", "expected"), [(("left",), {"left"}), (("left", "right"), {"left", "right"}), ((), set())]
)
def test_turn_signals_are_on_until_a_period_after_their_lamps(
    on: tuple[Side, ...], expected: set[Side]
) -> None:
    host = HostState()
    for side in on:
        host.receive_observation(TurnSignal(10.0, side, True, "dbc"))
        host.receive_observation(TurnSignal(10.5, side, False, "dbc"))

    assert host.turn_signals(10.9) == expected
    assert host.turn_signals(11.1) == set()


def test_acceleration_and_braking_follow_the_speeds() -> None:
    host = HostState()
    assert (host.acceleration_m_s2(10.0), host.braking_m_s2(10.0)) == (None, None)

    for k in range(20):
        host.receive_observation(Speed(10.0 + k / 20, 20.0 - 5.0 * k / 20, 0.01, "dbc"))

    assert host.acceleration_m_s2(10.95) == pytest.approx(-5.0)
    assert host.braking_m_s2(10.95) == pytest.approx(5.0, abs=0.05)
