"""The path prediction is the circle that the car drives on, with its confidence."""

import math
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from onboard.bsm_transmission.path_prediction import PathPredictor
from onboard.bsm_transmission.transmitter import BsmTransmitter
from onboard.gnss.nmea import NmeaReader
from onboard.messages import bsm
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.bsm_safety import PathPrediction
from onboard.observations import Position
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState
from tests.typed import about


def fix(stamp_s: float, course_rad: float | None, speed_m_s: float | None = 10.0) -> Position:
    if course_rad is not None:
        course_rad %= math.tau
    return Position(stamp_s, 48.0, 11.0, None, 1.0, speed_m_s, course_rad)


def driven(fixes: Iterable[Position]) -> PathPredictor:
    predictor = PathPredictor()
    for each in fixes:
        predictor.receive_position(each)
    return predictor


def turning(
    course_rad: Callable[[float], float], hz: float, speed_m_s: float = 10.0
) -> PathPredictor:
    return driven(fix(t, course_rad(t), speed_m_s) for t in np.arange(0.0, 6.0, 1 / hz))


@pytest.mark.parametrize("hz", [1, 2, 5, 10])
@pytest.mark.parametrize("radius_m", [-30.0, 75.0, 2000.0])
def test_the_prediction_on_a_circle_is_that_circle_with_full_confidence(
    hz: float, radius_m: float
) -> None:
    """Beginning north, so that the course jumps from 0 to 2 pi or back."""
    predictor = turning(lambda t: 0.01 + 10.0 * t / radius_m, hz)

    assert predictor.yaw_rate_rad_s == pytest.approx(10.0 / radius_m)
    assert predictor.prediction == PathPrediction(about(radius_m), about(1.0))


@pytest.mark.parametrize("radius_m", [2600.0, -2600.0, math.inf])
def test_a_circle_of_large_radius_is_predicted_as_straight(radius_m: float) -> None:
    predictor = turning(lambda t: 1.0 + 10.0 * t / radius_m, 10)

    assert predictor.prediction == PathPrediction(None, about(1.0))


@pytest.mark.parametrize(
    ("change_deg_s2", "confidence"), [(1.25, 0.75), (-2.5, 0.5), (5.0, 0.4), (15.0, 0.2), (30, 0.0)]
)
def test_a_changing_yaw_rate_lowers_the_confidence(change_deg_s2: float, confidence: float) -> None:
    """Table A3 of SAE J2945/1, from 0 % at 25 degrees/s2 to 100 % at none."""
    predictor = turning(lambda t: math.radians(change_deg_s2) * t**2 / 2, 10)

    assert predictor.prediction is not None
    assert predictor.prediction.confidence == pytest.approx(confidence, abs=0.01)


def test_at_standstill_the_prediction_is_straight_for_any_course() -> None:
    noise = np.random.default_rng(1).uniform(0.0, math.tau, 30)
    predictor = driven(fix(t / 10, course, 0.3) for t, course in enumerate(noise))

    assert predictor.prediction == PathPrediction(None, 1.0)
    assert predictor.yaw_rate_rad_s is None


@pytest.mark.parametrize(
    "fixes",
    [
        [],
        [fix(0.0, 1.0)],
        [fix(t / 10, 1.0) for t in range(12)],
        [fix(t / 10, None) for t in range(40)],
        [fix(t / 10, 1.0, None) for t in range(40)],
        [fix(3.0 * t, 1.0) for t in range(20)],
        [*[fix(t / 10, 1.0) for t in range(40)], fix(9.0, 1.0)],
    ],
    ids=["none", "one", "too short", "no course", "no speed", "far apart", "after a silence"],
)
def test_no_prediction_is_made_without_course_and_speed(fixes: list[Position]) -> None:
    assert driven(fixes).prediction is None


def test_a_late_fix_is_ignored() -> None:
    fixes = [fix(t / 10, t / 100) for t in range(40)]

    late = driven([*fixes, fixes[20], fix(3.9, 3.0), fix(3.0, None)])

    assert late.prediction == driven(fixes).prediction is not None


def test_the_host_vehicles_bsm_has_prediction_and_yaw_rate() -> None:
    who = Pseudonym(bytes(8), b"abcd", 5, None, 300.0)
    host = HostState()
    beacon = BsmTransmitter(VehicleSize(1.8, 4.5), who, np.random.default_rng(1), 0.0, host)
    for t in range(40):
        host.receive_observation(fix(t / 10, t / 100))
        beacon.receive_position(fix(t / 10, t / 100))

    on_the_air = bsm.decode(bsm.encode(beacon.bsm(None, 4.0, 4.0)))
    long_after = beacon.bsm(None, 9.0, 9.0)

    assert on_the_air.core.acceleration.yaw_rate_rad_s == pytest.approx(0.1, abs=1e-4)
    assert on_the_air.safety is not None
    assert on_the_air.safety.path_prediction == PathPrediction(about(100.0), 1.0)
    assert long_after.safety is None
    assert long_after.core.acceleration.yaw_rate_rad_s == 0.0


def test_a_receiver_at_1_hz_gives_every_bsm_a_position() -> None:
    """Each fix arrives half a second late, so it is up to 1.5 s old."""
    who = Pseudonym(bytes(8), b"abcd", 5, None, 300.0)
    host = HostState()
    beacon = BsmTransmitter(VehicleSize(1.8, 4.5), who, np.random.default_rng(1), 0.0, host)
    for tenth in range(5, 60):
        if tenth % 10 == 5:
            host.receive_observation(fix(tenth / 10 - 0.5, 1.0))
            beacon.receive_position(fix(tenth / 10 - 0.5, 1.0))
        said = beacon.bsm(None, tenth / 10, tenth / 10).core
        assert said.latitude_deg is not None
        assert said.sec_mark_s == pytest.approx((tenth - 5) // 10)


@pytest.mark.realdata
def test_on_a_real_drive_the_prediction_is_better_than_a_straight_line(rig_data: Path) -> None:
    reader, predictor = NmeaReader(), PathPredictor()
    reader.receive_bytes((rig_data / "gnss" / "drive-a.nmea").read_bytes())
    fixes: list[Position] = []
    while (event := reader.next_event()) is not None:
        if isinstance(event, Position) and event.course_rad is not None:
            fixes.append(event)
    missed_deg: dict[str, list[float]] = {"circle": [], "straight": []}
    for now, later in pairwise(fixes):
        predictor.receive_position(now)
        sent = predictor.prediction
        if sent is None or sent.radius_of_curve_m is None or sent.confidence < 0.5:
            continue
        assert now.speed_m_s is not None
        assert now.course_rad is not None
        assert later.course_rad is not None
        turned = math.remainder(later.course_rad - now.course_rad, math.tau)
        foretold = now.speed_m_s / sent.radius_of_curve_m * (later.stamp_s - now.stamp_s)
        missed_deg["circle"].append(abs(math.degrees(turned - foretold)))
        missed_deg["straight"].append(abs(math.degrees(turned)))
    assert len(missed_deg["circle"]) > 100
    assert np.mean(missed_deg["circle"]) < 0.75 * np.mean(missed_deg["straight"])


def test_one_stamp_far_ahead_costs_only_the_window() -> None:
    stamps = [0.0, 0.5, 1e6, *np.arange(1.0, 6.0, 0.5).tolist()]

    predictor = driven(fix(stamp_s, 0.1 * stamp_s) for stamp_s in stamps)

    assert predictor.yaw_rate_rad_s == pytest.approx(0.1)
