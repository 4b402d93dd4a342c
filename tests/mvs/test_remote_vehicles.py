"""What a BSM changes of its sender: everything together, or nothing."""

import numpy as np
import pytest

from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings
from onboard.observations import Discarded, Position

SENDER = b"-you"
NOW = 10.0


def fix(stamp_s: float, latitude_deg: float = 48.0) -> Position:
    return Position(stamp_s, latitude_deg, 11.0005, None, 1.0, 5.0, 0.0)


def braking() -> MultiVehicleSensing:
    """Knows the sender, which brakes with 6 m/s^2."""
    mvs = MultiVehicleSensing(MvsSettings(), b"--me", np.random.default_rng(1))
    mvs.receive_position(Position(NOW, 48.0, 11.0, None, 1.0, 5.0, 0.0))
    assert mvs.receive_bsm(SENDER, fix(NOW), None, NOW, -6.0)
    return mvs


def acceleration_m_s2(mvs: MultiVehicleSensing, now: float) -> float | None:
    (sender,) = mvs.kinematic_info(now)
    return sender.acceleration_m_s2


@pytest.mark.parametrize(
    ("refused", "reason"),
    [
        (fix(NOW + 5.0), "future"),
        (fix(NOW - 0.3), "older"),
        (fix(NOW + 0.1, 49.0), "sender_far"),
    ],
)
def test_a_bsm_that_is_not_used_leaves_the_acceleration(refused: Position, reason: str) -> None:
    mvs = braking()

    assert not mvs.receive_bsm(SENDER, refused, None, NOW + 0.1, -9.0)

    assert acceleration_m_s2(mvs, NOW + 0.1) == -6.0
    event = mvs.next_event()
    assert isinstance(event, Discarded)
    assert event.reason == reason


@pytest.mark.parametrize("said_m_s2", [-2.0, None])
def test_a_newer_bsm_replaces_it(said_m_s2: float | None) -> None:
    mvs = braking()

    assert mvs.receive_bsm(SENDER, fix(NOW + 0.1), None, NOW + 0.1, said_m_s2)

    assert acceleration_m_s2(mvs, NOW + 0.1) == said_m_s2


@pytest.mark.parametrize("ahead_s", [0.0, 0.3, 1.9])
@pytest.mark.parametrize("fixes_hz", [1, 10])
def test_whose_clock_is_ahead_is_where_its_bsms_say(ahead_s: float, fixes_hz: int) -> None:
    """Own clocks set by NMEA sentences are some tenths of a second behind."""
    mvs, step_m = braking(), 5.0 / 10
    for n in range(1, 40):
        now = NOW + n / 10
        of_fix = n // (10 // fixes_hz) * (10 // fixes_hz)
        there = fix(NOW + of_fix / 10 + ahead_s, 48.0 + of_fix * step_m / 111_200.0)
        mvs.receive_position(Position(now, 48.0, 11.0, None, 1.0, 5.0, 0.0))
        assert mvs.receive_bsm(b"-she", there, None, now, 0.0)
        (she,) = [each for each in mvs.kinematic_info(now) if each.name == b"-she".hex()]
        if n >= 10:  # with the first fix that is new, it is known by how much
            assert she.state[1] == pytest.approx(n * step_m, abs=0.1)


def test_one_stamp_that_is_ahead_makes_no_clock_ahead() -> None:
    mvs = braking()
    for n in range(1, 10):
        early_s = 1.5 if n == 5 else 0.0
        now = NOW + n / 10
        assert mvs.receive_bsm(SENDER, fix(now + early_s), None, now) == (n != 5)

    (sender,) = mvs.kinematic_info(NOW + 0.9)
    assert sender.age_s == pytest.approx(0.0)


def test_as_the_own_clock_catches_up_senders_are_less_ahead() -> None:
    mvs = braking()
    for n in range(1, 200):
        now, ahead_s = NOW + n / 10, max(0.4 - 0.03 * n / 10, 0.0)
        mvs.receive_position(Position(now, 48.0, 11.0, None, 1.0, 5.0, 0.0))
        assert mvs.receive_bsm(SENDER, fix(now + ahead_s), None, now)
        (sender,) = mvs.kinematic_info(now)
        assert sender.age_s == pytest.approx(0.0, abs=0.02)


def test_when_the_own_clock_is_set_right_no_sender_is_ahead_any_more() -> None:
    mvs = braking()
    assert mvs.receive_bsm(SENDER, fix(NOW + 0.6), None, NOW + 0.1)
    mvs.set_utc_offset(0.5)
    assert mvs.receive_bsm(SENDER, fix(NOW + 0.2), None, NOW + 0.2)
    (sender,) = mvs.kinematic_info(NOW + 0.2)
    assert sender.age_s == pytest.approx(0.0)


def test_an_echo_of_the_own_bsm_is_not_used() -> None:
    assert not braking().receive_bsm(b"--me", fix(NOW), None, NOW)


def test_a_bsm_with_the_same_fix_is_used_though_its_time_is_rounded() -> None:
    """The position may be the last one's, and its time differ by the resolution of `sec_mark`."""
    mvs = braking()

    assert mvs.receive_bsm(SENDER, fix(NOW - 0.001), None, NOW + 0.1, -2.0)

    assert acceleration_m_s2(mvs, NOW + 0.1) == -2.0


def test_a_vehicle_whose_first_fix_is_repeated_is_not_taken_for_its_own_successor() -> None:
    mvs = braking()
    assert mvs.receive_bsm(SENDER, fix(NOW - 0.001), None, NOW + 0.1, -2.0)
    mvs.update(NOW + 0.6)
    assert acceleration_m_s2(mvs, NOW + 0.6) == -2.0
