"""Whether the own driver brakes, and how hard at least: from coarse speeds, and from the pedal."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.units import KM_H
from onboard.observations import BrakePedal, Speed
from onboard.sensors.host_braking import HostBraking

WINDOW_S = 0.6
BRAKING_M_S2 = 5.0


def speed(at_s: float, speed_m_s: float, *, step_m_s: float = 0.01, source: str = "dbc") -> Speed:
    return Speed(at_s, speed_m_s, step_m_s, source)


def braking_until(until_s: float, *, step_m_s: float = 0.01, hz: int = 20) -> HostBraking:
    """From 25 m/s, cut off to whole steps as ECUs do."""
    own = HostBraking(WINDOW_S)
    for k in range(round(until_s * hz) + 1):
        exact_m_s = 25.0 - BRAKING_M_S2 * k / hz
        cut_m_s = math.floor(exact_m_s / step_m_s + 1e-9) * step_m_s
        own.receive_speed(speed(k / hz, cut_m_s, step_m_s=step_m_s))
    return own


Event = Callable[[HostBraking], None]
NOTHING: Event = lambda own: None  # noqa: E731 (one of a table)
EVENTS: dict[str, Event] = {
    "nothing": NOTHING,
    "the next sample": lambda own: own.receive_speed(speed(1.05, 25.0 - 5.0 * 1.05)),
    "an old sample": lambda own: own.receive_speed(speed(0.5, 70.0)),
    "a step that no car drives": lambda own: own.receive_speed(speed(1.05, 10.0)),
    "another source": lambda own: own.receive_speed(speed(1.05, 19.75, source="obd:7E8")),
    "the pedal pressed": lambda own: own.receive_pedal(BrakePedal(1.0, pressed=True, source="dbc")),
    "the pedal released": lambda own: own.receive_pedal(BrakePedal(1.0, pressed=False, source="d")),
}
KNOWN, NOT_KNOWN, NONE_AT_ALL = BRAKING_M_S2, None, 0.0


@pytest.mark.parametrize(
    ("event", "from_unknown", "from_known"),
    [
        ("nothing", NOT_KNOWN, KNOWN),
        ("the next sample", NOT_KNOWN, KNOWN),
        ("an old sample", NOT_KNOWN, KNOWN),
        ("a step that no car drives", NOT_KNOWN, NOT_KNOWN),
        ("another source", NOT_KNOWN, NOT_KNOWN),
        ("the pedal pressed", NOT_KNOWN, KNOWN),
        ("the pedal released", NOT_KNOWN, NONE_AT_ALL),
    ],
)
def test_every_event_in_every_state(
    event: str, from_unknown: float | None, from_known: float | None
) -> None:
    unknown, known = HostBraking(WINDOW_S), braking_until(1.0)
    for own in (unknown, known):
        EVENTS[event](own)

    assert unknown.at_least_m_s2(1.05) == from_unknown
    assert known.at_least_m_s2(1.05) == pytest.approx(from_known, abs=0.05)


def test_it_is_known_after_half_a_window_and_until_a_whole_one_without_a_sample() -> None:
    known_from_s = next(
        k / 20 for k in range(30) if braking_until(k / 20).at_least_m_s2(k / 20) is not None
    )
    own = braking_until(1.0)

    assert known_from_s == pytest.approx(WINDOW_S / 2)
    assert own.at_least_m_s2(1.0 + WINDOW_S - 0.01) == pytest.approx(BRAKING_M_S2, abs=0.05)
    assert own.at_least_m_s2(1.0 + WINDOW_S + 0.01) is None


def test_two_samples_a_second_tell_nothing() -> None:
    assert braking_until(4.0, hz=2).at_least_m_s2(4.0) is None


def test_a_pedal_state_that_is_too_old_is_not_used() -> None:
    own = braking_until(1.0)
    own.receive_pedal(BrakePedal(0.3, pressed=False, source="dbc"))

    assert own.at_least_m_s2(1.0) == pytest.approx(BRAKING_M_S2, abs=0.05)


def test_one_stamp_far_ahead_costs_the_window_and_no_more() -> None:
    own = braking_until(1.0)
    own.receive_speed(speed(1e6, 20.0))
    for k in range(21, 40):
        own.receive_speed(speed(k / 20, 25.0 - BRAKING_M_S2 * k / 20))

    assert own.at_least_m_s2(1.95) == pytest.approx(BRAKING_M_S2, abs=0.05)


def test_who_gains_speed_does_not_brake() -> None:
    own = HostBraking(WINDOW_S)
    for k in range(20):
        own.receive_speed(speed(k / 20, 10.0 + 2.0 * k / 20))

    assert own.at_least_m_s2(0.95) == 0.0


@pytest.mark.parametrize("step_m_s", [KM_H, 0.01])
def test_who_ceases_to_brake_is_known_to_brake_by_less_than_the_step_in_the_time_since(
    step_m_s: float,
) -> None:
    """The slope over the whole window would show 2 m/s^2 yet."""
    own = braking_until(1.0, step_m_s=step_m_s)
    ceased_m_s = math.floor((25.0 - BRAKING_M_S2) / step_m_s + 1e-9) * step_m_s
    for k in range(21, 27):
        own.receive_speed(speed(k / 20, ceased_m_s, step_m_s=step_m_s))

    estimate = own.at_least_m_s2(1.3)

    assert estimate is not None
    assert estimate <= step_m_s / 0.3 + 1e-9


@given(
    braking=st.floats(0.0, 9.0),
    begin_m_s=st.floats(12.0, 40.0),
    hz=st.sampled_from([7, 10, 20, 50]),
    step_m_s=st.sampled_from([KM_H, 0.1, 0.01]),
)
def test_it_is_never_more_than_the_car_brakes(
    braking: float, begin_m_s: float, hz: int, step_m_s: float
) -> None:
    """However coarse the speeds; and with whole km/h at 20 Hz within 1.4 m/s^2 of it."""
    own, estimate = HostBraking(WINDOW_S), None
    for k in range(hz + 1):
        exact_m_s = begin_m_s - braking * k / hz
        own.receive_speed(
            speed(k / hz, math.floor(exact_m_s / step_m_s) * step_m_s, step_m_s=step_m_s)
        )
        estimate = own.at_least_m_s2(k / hz)
        assert estimate is None or estimate <= braking + 1e-9
    assert estimate is not None
    if hz >= 20:
        assert estimate >= braking - 1.4
