"""Misbehaviour detection: BSMs agree with earlier ones, and hard braking with the speeds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.kinematics.units import KM_H
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.misbehaviour.misbehaviour_detection import (
    ID_KEPT_S,
    MAX_IDS,
    SENDER_TIMEOUT_S,
    Misbehaviour,
    MisbehaviourDetector,
)

CORE = CoreData(0, b"abcd", latitude_deg=25.0, longitude_deg=121.5, speed_m_s=20.0)
BRAKING = VehicleSafetyExtensions(events=VehicleEventFlags.HARD_BRAKING)
METRE_DEG = 1 / 111_195


def _bsm(
    speed_m_s: float | None = 20.0, north_m: float = 0.0, braking: bool = False
) -> BasicSafetyMessage:
    core = replace(CORE, speed_m_s=speed_m_s, latitude_deg=25.0 + north_m * METRE_DEG)
    return BasicSafetyMessage(core, BRAKING if braking else None)


def _drive(
    speeds_m_s: NDArray[np.float64],
    detector: MisbehaviourDetector,
    braking_from: int | None = None,
    interval_s: float = 0.1,
) -> list[Misbehaviour | None]:
    """Receive BSMs of these speeds; return the check that each failed."""
    north_m, doubts = 0.0, []
    for i, speed_m_s in enumerate(speeds_m_s):
        braking = braking_from is not None and i >= braking_from
        message = _bsm(speed_m_s, north_m, braking)
        doubts.append(detector.receive_bsm(b"car", message, i * interval_s, i * interval_s))
        north_m += speed_m_s * interval_s
    return doubts


@pytest.mark.parametrize("deceleration_m_s2", [4.0, 6.0, 9.0])
@pytest.mark.parametrize("step_m_s", [0.01, KM_H], ids=["fine", "whole km/h"])
def test_genuine_hard_braking_is_accepted_from_the_first_flag(
    deceleration_m_s2: float, step_m_s: float
) -> None:
    """The sender sets the flag half a second into the braking."""
    times = np.arange(0, 3, 0.1)
    speeds = np.clip(25.0 - deceleration_m_s2 * np.clip(times - 1.0, 0, None), 0, None)
    coarse = np.round(speeds / step_m_s) * step_m_s
    assert _drive(coarse, MisbehaviourDetector(), braking_from=15) == [None] * 30


@pytest.mark.parametrize(
    "speeds_m_s",
    [
        pytest.param(np.full(30, 20.0), id="steady"),
        pytest.param(np.linspace(20, 25, 30), id="accelerating"),
        pytest.param(np.linspace(20, 17, 30), id="coasting, 1 m/s2"),
        pytest.param(20.0 + KM_H * (np.arange(30) % 2), id="rounding to and fro"),
        pytest.param(np.zeros(30), id="parked"),
    ],
)
def test_hard_braking_that_the_senders_speeds_contradict_is_implausible(
    speeds_m_s: NDArray[np.float64],
) -> None:
    doubts = _drive(speeds_m_s, MisbehaviourDetector(), braking_from=15)
    assert doubts == [None] * 15 + ["implausible_brake"] * 15


def test_the_first_bsm_of_a_sender_is_accepted() -> None:
    assert MisbehaviourDetector().receive_bsm(b"new", _bsm(braking=True), 0.0, 0.0) is None


def test_an_impossible_speed_is_implausible() -> None:
    assert MisbehaviourDetector().receive_bsm(b"car", _bsm(91.0), 0.0, 0.0) == "implausible_speed"


@pytest.mark.parametrize(
    ("after_s", "speed_m_s", "doubt"),
    [
        (0.1, 22.1, None),
        (0.1, 22.3, "implausible_acceleration"),
        (0.1, 17.7, "implausible_acceleration"),
        (1.0, 30.0, None),
        (1.0, 34.0, "implausible_acceleration"),
        (1.0, None, None),
    ],
)
def test_a_speed_that_does_not_follow_from_the_one_before_is_implausible(
    after_s: float, speed_m_s: float | None, doubt: str | None
) -> None:
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"car", _bsm(20.0), 0.0, 0.0)
    assert detector.receive_bsm(b"car", _bsm(speed_m_s), after_s, after_s) == doubt


@pytest.mark.parametrize(
    ("after_s", "north_m", "doubt"),
    [
        (0.1, 2.0, None),
        (0.1, 21.9, None),
        (0.1, 25.0, "implausible_position"),
        (0.1, -500.0, "implausible_position"),
        (60.0, 1200.0, None),
    ],
)
def test_a_position_out_of_reach_of_the_one_before_is_implausible(
    after_s: float, north_m: float, doubt: str | None
) -> None:
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"car", _bsm(), 0.0, 0.0)
    assert detector.receive_bsm(b"car", _bsm(north_m=north_m), after_s, after_s) == doubt


def test_after_a_position_jump_the_next_bsms_are_accepted() -> None:
    detector = MisbehaviourDetector()
    doubts = [
        detector.receive_bsm(b"car", _bsm(north_m=north_m), i / 10, i / 10)
        for i, north_m in enumerate((0.0, 300.0, 302.0))
    ]
    assert doubts == [None, "implausible_position", None]


def test_crossing_the_date_line_is_not_a_position_jump() -> None:
    detector = MisbehaviourDetector()
    for i, longitude_deg in enumerate((179.99999, -179.99999)):
        message = BasicSafetyMessage(replace(CORE, longitude_deg=longitude_deg))
        assert detector.receive_bsm(b"car", message, i / 10, i / 10) is None


def test_each_sender_is_compared_with_its_own_bsms_only() -> None:
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"one", _bsm(10.0), 0.0, 0.0)
    other = replace(_bsm(30.0, north_m=900.0).core, temporary_id=b"efgh")
    assert detector.receive_bsm(b"two", BasicSafetyMessage(other), 0.1, 0.1) is None


def test_two_senders_with_one_temporary_id_are_two_vehicles() -> None:
    detector = MisbehaviourDetector()
    assert detector.remote_id(b"one", b"abcd") == b"abcd"
    second = detector.remote_id(b"two", b"abcd")
    assert second not in (b"abcd", detector.remote_id(b"three", b"abcd"))
    assert detector.remote_id(b"one", b"abcd") == b"abcd"
    assert detector.remote_id(b"two", b"abcd") == second


def _named(temporary_id: bytes) -> BasicSafetyMessage:
    return BasicSafetyMessage(replace(CORE, temporary_id=temporary_id, speed_m_s=0.0))


def test_one_signer_is_not_hundreds_of_vehicles() -> None:
    """With 400 IDs a second, one certificate filled the table of vehicles: others were silenced."""
    detector = MisbehaviourDetector()
    ids = [bytes((0, 0, 1, number)) for number in range(200)]
    found = [
        detector.receive_bsm(b"evil", _named(each), 0.01 * number, 0.01 * number)
        for number, each in enumerate(ids)
    ]
    assert found == [None] * MAX_IDS + [Misbehaviour.IDENTITY] * (200 - MAX_IDS)


def test_a_signer_may_change_its_temporary_id_again_and_again() -> None:
    detector = MisbehaviourDetector()
    for change in range(3 * MAX_IDS):
        at = change * ID_KEPT_S / MAX_IDS
        assert detector.receive_bsm(b"car", _named(bytes((0, 0, 2, change))), at, at) is None


def test_implausible_speeds_do_not_confirm_braking() -> None:
    detector = MisbehaviourDetector()
    _drive(np.full(15, 15.0), detector)
    detector.receive_car_id(b"car", b"plate id")
    for speed_m_s in (150.0, 15.0):
        assert detector.receive_bsm(b"car", _bsm(speed_m_s, 25.0), 1.5, 1.5) is not None
    assert detector.check_warning(b"plate id", braked_at_s=1.5) == "implausible_brake"


def test_an_out_of_order_bsm_is_checked_and_not_kept() -> None:
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"car", _bsm(20.0, north_m=10.0), 1.0, 1.0)
    assert detector.receive_bsm(b"car", _bsm(20.0, north_m=8.0), 0.9, 0.9) is None
    assert detector.receive_bsm(b"car", _bsm(20.0, north_m=12.0), 1.1, 1.1) is None
    detector.receive_car_id(b"car", b"plate id")
    assert not detector.has_speed_since(b"plate id", 1.1, 1.1)


@pytest.mark.parametrize(
    ("way_m", "reported_after_s", "doubt"),
    [
        (60.0, 1.0, None),
        (60.0, 0.1, "implausible_position"),
        (300.0, 30.0, "implausible_position"),
        (60.0, -1.0, "implausible_position"),
    ],
    ids=["a second on", "at once", "made up", "back"],
)
def test_a_receiver_at_1_hz_may_advance_by_a_second_between_two_bsms(
    way_m: float, reported_after_s: float, doubt: str | None
) -> None:
    """Ten BSMs have one `sec_mark`, the next ten another, across the end of a minute."""
    detector, reasons = MisbehaviourDetector(), []
    for tenth, (north_m, sec_mark_s) in enumerate(
        [(0.0, 59.4)] * 9 + [(way_m, 59.4 + reported_after_s)]
    ):
        said = _bsm(40.0, north_m)
        core = replace(said.core, sec_mark_s=sec_mark_s % 60.0)
        now = tenth / 10
        reasons.append(detector.receive_bsm(b"car", replace(said, core=core), now, now))
    assert reasons[-1] == doubt


@pytest.mark.parametrize(
    ("message", "doubt"),
    [
        (_bsm(40.0, north_m=50.0), "implausible_acceleration"),
        (_bsm(20.0, north_m=900.0), "implausible_position"),
        (_bsm(20.0, north_m=57.0, braking=True), "implausible_brake"),
    ],
)
def test_backdated_bsms_are_checked_too(message: BasicSafetyMessage, doubt: str) -> None:
    detector = MisbehaviourDetector()
    _drive(np.full(30, 20.0), detector)
    assert detector.receive_bsm(b"car", message, 2.85, 2.85) == doubt


# ---- warnings of a group ------------------------------------------------------------------------


def test_a_warning_is_checked_against_the_bsms_of_the_braking_car() -> None:
    attacked, honest = MisbehaviourDetector(), MisbehaviourDetector()
    _drive(np.full(30, 20.0), attacked)
    _drive(np.concatenate([np.full(15, 20.0), np.linspace(20, 11, 15)]), honest)
    for detector in (attacked, honest):
        detector.receive_car_id(b"car", b"plate id")
    assert attacked.check_warning(b"plate id", braked_at_s=2.0) == "implausible_brake"
    assert honest.check_warning(b"plate id", braked_at_s=2.0) is None


def test_a_warning_of_a_car_without_received_bsms_is_accepted() -> None:
    """The car is several hops ahead, beyond the range of its BSMs."""
    detector = MisbehaviourDetector()
    _drive(np.full(30, 20.0), detector)
    assert detector.check_warning(b"far away", braked_at_s=2.0) is None


def test_many_forged_senders_take_bounded_memory() -> None:
    detector = MisbehaviourDetector()
    for i in range(3000):
        core = replace(CORE, temporary_id=i.to_bytes(4))
        detector.receive_bsm(i.to_bytes(8), BasicSafetyMessage(core), 0.0, 0.0)
        detector.receive_car_id(i.to_bytes(8), i.to_bytes(8))
    assert len(detector._senders) <= 512
    assert len(detector._car_ids) <= 512
    assert len(detector._temporary_ids) <= 512


def test_silent_senders_are_dropped() -> None:
    detector = MisbehaviourDetector()
    for number in range(10):
        core = replace(CORE, temporary_id=number.to_bytes(4))
        detector.receive_bsm(
            number.to_bytes(8), BasicSafetyMessage(core), float(number), float(number)
        )
    detector.receive_bsm(b"another.", _bsm(), SENDER_TIMEOUT_S + 4.5, SENDER_TIMEOUT_S + 4.5)

    assert list(detector._senders) == [*(n.to_bytes(8) for n in range(5, 10)), b"another."]
