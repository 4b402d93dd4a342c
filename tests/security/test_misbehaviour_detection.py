"""What a car says has to agree with what it said before, and a hard brake with its own speeds."""

from dataclasses import replace

import numpy as np
import pytest

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.security.misbehaviour_detection import SENDER_TIMEOUT_S, MisbehaviourDetector
from onboard.units import KM_H

CORE = CoreData(0, b"abcd", latitude_deg=25.0, longitude_deg=121.5, speed_m_s=20.0)
BRAKING = VehicleSafetyExtensions(events=VehicleEventFlags.HARD_BRAKING)
METRE_DEG = 1 / 111_195


def _bsm(speed_m_s=20.0, north_m=0.0, braking=False):
    core = replace(CORE, speed_m_s=speed_m_s, latitude_deg=25.0 + north_m * METRE_DEG)
    return BasicSafetyMessage(core, BRAKING if braking else None)


def _drive(speeds_m_s, detector, braking_from=None, interval_s=0.1):
    """Send BSMs of these speeds; what was thought of each."""
    north_m, doubts = 0.0, []
    for i, speed_m_s in enumerate(speeds_m_s):
        braking = braking_from is not None and i >= braking_from
        message = _bsm(speed_m_s, north_m, braking)
        doubts.append(detector.receive_bsm(b"car", message, i * interval_s))
        north_m += speed_m_s * interval_s
    return doubts


@pytest.mark.parametrize("deceleration_m_s2", [4.0, 6.0, 9.0])
@pytest.mark.parametrize("step_m_s", [0.01, KM_H], ids=["fine", "whole km/h"])
def test_a_true_hard_brake_is_believed_from_its_first_flag(deceleration_m_s2, step_m_s):
    """The flag goes up once the sender's own detector is certain: half a second into the brake."""
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
def test_a_hard_brake_that_its_own_speeds_do_not_show_is_not_believed(speeds_m_s):
    doubts = _drive(speeds_m_s, MisbehaviourDetector(), braking_from=15)
    assert doubts == [None] * 15 + ["implausible_brake"] * 15


def test_a_car_heard_for_the_first_time_is_believed():
    assert MisbehaviourDetector().receive_bsm(b"new", _bsm(braking=True), 0.0) is None


def test_a_speed_that_no_car_has():
    assert MisbehaviourDetector().receive_bsm(b"car", _bsm(91.0), 0.0) == "implausible_speed"


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
def test_a_speed_follows_from_the_one_before(after_s, speed_m_s, doubt):
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"car", _bsm(20.0), 0.0)
    assert detector.receive_bsm(b"car", _bsm(speed_m_s), after_s) == doubt


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
def test_a_position_is_within_reach_of_the_one_before(after_s, north_m, doubt):
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"car", _bsm(), 0.0)
    assert detector.receive_bsm(b"car", _bsm(north_m=north_m), after_s) == doubt


def test_a_receiver_that_jumped_once_is_believed_again_from_where_it_is():
    detector = MisbehaviourDetector()
    doubts = [
        detector.receive_bsm(b"car", _bsm(north_m=north_m), i / 10)
        for i, north_m in enumerate((0.0, 300.0, 302.0))
    ]
    assert doubts == [None, "implausible_position", None]


def test_the_date_line_is_no_jump():
    detector = MisbehaviourDetector()
    for i, longitude_deg in enumerate((179.99999, -179.99999)):
        message = BasicSafetyMessage(replace(CORE, longitude_deg=longitude_deg))
        assert detector.receive_bsm(b"car", message, i / 10) is None


def test_cars_do_not_answer_for_each_other():
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"one", _bsm(10.0), 0.0)
    other = replace(_bsm(30.0, north_m=900.0).core, temporary_id=b"efgh")
    assert detector.receive_bsm(b"two", BasicSafetyMessage(other), 0.1) is None


def test_nobody_goes_by_the_temporary_id_of_another():
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"one", _bsm(), 0.0)
    assert detector.receive_bsm(b"two", _bsm(), 0.1) == "implausible_identity"
    assert detector.receive_bsm(b"one", _bsm(), 0.1) is None


def test_speeds_that_were_doubted_do_not_bear_out_a_brake():
    detector = MisbehaviourDetector()
    _drive(np.full(15, 15.0), detector)
    detector.receive_car_id(b"car", b"plate id")
    for speed_m_s in (150.0, 15.0):
        assert detector.receive_bsm(b"car", _bsm(speed_m_s, 25.0), 1.5) is not None
    assert detector.check_warning(b"plate id", braked_at_s=1.5) == "implausible_brake"


def test_a_message_overtaken_by_a_later_one_is_believed_and_not_remembered():
    detector = MisbehaviourDetector()
    detector.receive_bsm(b"car", _bsm(20.0, north_m=10.0), 1.0)
    assert detector.receive_bsm(b"car", _bsm(20.0, north_m=8.0), 0.9) is None
    assert detector.receive_bsm(b"car", _bsm(20.0, north_m=12.0), 1.1) is None
    detector.receive_car_id(b"car", b"plate id")
    assert not detector.has_speed_since(b"plate id", 1.1)


@pytest.mark.parametrize(
    ("way_m", "told_after_s", "doubt"),
    [
        (60.0, 1.0, None),
        (60.0, 0.1, "implausible_position"),
        (300.0, 30.0, "implausible_position"),
        (60.0, -1.0, "implausible_position"),
    ],
    ids=["a second on", "at once", "made up", "back"],
)
def test_a_receiver_of_one_fix_a_second_is_a_second_further_on_at_once(way_m, told_after_s, doubt):
    """Its messages tell ten times when one fix was true, then another, across a minute's end."""
    detector = MisbehaviourDetector()
    for tenth, (north_m, sec_mark_s) in enumerate(
        [(0.0, 59.4)] * 9 + [(way_m, 59.4 + told_after_s)]
    ):
        said = _bsm(40.0, north_m)
        core = replace(said.core, sec_mark_s=sec_mark_s % 60.0)
        told = detector.receive_bsm(b"car", replace(said, core=core), tenth / 10)
    assert told == doubt


@pytest.mark.parametrize(
    ("message", "doubt"),
    [
        (_bsm(40.0, north_m=50.0), "implausible_acceleration"),
        (_bsm(20.0, north_m=900.0), "implausible_position"),
        (_bsm(20.0, north_m=57.0, braking=True), "implausible_brake"),
    ],
)
def test_whoever_dates_his_messages_back_is_doubted_all_the_same(message, doubt):
    detector = MisbehaviourDetector()
    _drive(np.full(30, 20.0), detector)
    assert detector.receive_bsm(b"car", message, 2.85) == doubt


# ---- warnings of a group ------------------------------------------------------------------------


def test_a_warning_is_judged_by_the_bsms_of_the_car_that_is_said_to_brake():
    liar, honest = MisbehaviourDetector(), MisbehaviourDetector()
    _drive(np.full(30, 20.0), liar)
    _drive(np.concatenate([np.full(15, 20.0), np.linspace(20, 11, 15)]), honest)
    for detector in (liar, honest):
        detector.receive_car_id(b"car", b"plate id")
    assert liar.check_warning(b"plate id", braked_at_s=2.0) == "implausible_brake"
    assert honest.check_warning(b"plate id", braked_at_s=2.0) is None


def test_a_warning_of_a_car_that_was_never_heard_is_left_to_the_group():
    """It is several hops ahead, out of the reach of its BSMs: that is what forwarding is for."""
    detector = MisbehaviourDetector()
    _drive(np.full(30, 20.0), detector)
    assert detector.check_warning(b"far away", braked_at_s=2.0) is None


def test_many_forged_senders_take_bounded_memory():
    detector = MisbehaviourDetector()
    for i in range(3000):
        core = replace(CORE, temporary_id=i.to_bytes(4))
        detector.receive_bsm(i.to_bytes(8), BasicSafetyMessage(core), 0.0)
        detector.receive_car_id(i.to_bytes(8), i.to_bytes(8))
    assert len(detector._senders) <= 512
    assert len(detector._car_ids) <= 512
    assert len(detector._temporary_ids) <= 512


def test_who_has_not_been_heard_for_long_is_forgotten():
    detector = MisbehaviourDetector()
    for number in range(10):
        core = replace(CORE, temporary_id=number.to_bytes(4))
        detector.receive_bsm(number.to_bytes(8), BasicSafetyMessage(core), float(number))
    detector.receive_bsm(b"another.", _bsm(), SENDER_TIMEOUT_S + 4.5)

    assert list(detector._senders) == [*(n.to_bytes(8) for n in range(5, 10)), b"another."]
