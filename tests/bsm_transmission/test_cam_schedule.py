"""When CAMs are sent: by changes of the motion, and by their intervals."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from onboard.bsm_transmission.cam_schedule import CamSchedule, Motion

DEGREES_PER_M = 1.0 / 111_195


def driven(motion: Callable[[float], Motion], until_s: float, max_s: float = 1.0) -> list[float]:
    """Times of the CAMs, after the first two seconds."""
    schedule = CamSchedule(np.random.default_rng(1), 0.0, motion)
    schedule.receive_max_interval(max_s, 0.0)
    sent = []
    while (now := schedule.get_timer()) < until_s:
        if schedule.take_due(now):
            sent.append(now)
    return [at for at in sent if at > 2.0]


def straight(speed_m_s: float) -> Callable[[float], Motion]:
    return lambda now: Motion(48.0 + now * speed_m_s * DEGREES_PER_M, 11.0, 0.0, speed_m_s)


@pytest.mark.parametrize(
    ("speed_m_s", "interval_s"), [(0.0, 1.0), (3.0, 1.0), (15.0, 0.3), (25.0, 0.2), (45.0, 0.1)]
)
def test_a_car_on_a_straight_road_sends_every_four_metres_within_the_limits(
    speed_m_s: float, interval_s: float
) -> None:
    intervals = np.diff(driven(straight(speed_m_s), 20.0))
    assert intervals == pytest.approx(interval_s, abs=0.001)


def test_a_turn_and_a_change_of_speed_are_reasons_too() -> None:
    turning = driven(lambda now: Motion(48.0, 11.0, 0.5 * now % math.tau, 2.0), 10.0)
    assert np.diff(turning) == pytest.approx(0.2, abs=0.001)  # 28.6 degrees a second
    braking = driven(lambda now: Motion(48.0, 11.0, 0.0, 60.0 - 6.0 * now), 9.0)
    assert np.diff(braking) == pytest.approx(0.1, abs=0.001)


def test_after_a_change_three_cams_follow_at_its_interval() -> None:
    """EN 302 637-2, 6.1.3: then T_GenCam is T_GenCamMax again."""
    stops = driven(lambda now: Motion(48.0, 11.0, 0.0, max(0.0, 30.0 - 6.0 * now)), 9.0)
    after = [round(b - a, 3) for a, b in pairwise(stops) if b > 5.05]
    assert after[:4] == [0.1, 0.1, 0.1, 1.0]


def test_channel_access_can_shorten_the_longest_interval() -> None:
    assert np.diff(driven(straight(0.0), 9.0, max_s=0.3)) == pytest.approx(0.3, abs=0.001)


def test_without_a_position_it_sends_once_a_second() -> None:
    unknown = driven(lambda _: Motion(None, None, None, None), 9.0)
    assert np.diff(unknown) == pytest.approx(1.0, abs=0.001)
