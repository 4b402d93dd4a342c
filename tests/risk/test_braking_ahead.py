"""Hard braking ahead: who is ahead in the own lane, by place and by motion."""

import math

import numpy as np
import pytest

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.observations import Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.alarm_table import row_of
from onboard.risk.braking_ahead import BRAKING_AHEAD
from onboard.risk.eebl import EEBL, FLAG_HOLD_S
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from tests.risk.bends import LANE_M, Road, Scene

BENDS = {"straight": lambda way_m: 0.0, "bend": lambda way_m: 1.0 / 600.0}
"""Curvature."""
SEEDS = range(5)
OTHER = bytes(4)


def levels(monitor: RiskMonitor) -> list[Level]:
    """Of the alarms of this cause since the last call."""
    return [
        event.level
        for event in iter(monitor.next_event, None)
        if isinstance(event, Alarm) and event.cause == BRAKING_AHEAD
    ]


def is_cautioned(scene: Scene) -> bool:
    monitor, own, other, now = scene.drive(300.0)
    monitor.assess(own, [other], now)
    return levels(monitor) == [Level.CAUTION]


@pytest.mark.parametrize("bend", BENDS)
def test_a_vehicle_far_ahead_in_the_own_lane(bend: str) -> None:
    road = Road(BENDS[bend])

    assert all(is_cautioned(Scene(road, 180.0, lambda _: 0.0, seed=seed)) for seed in SEEDS)


@pytest.mark.parametrize("ahead_m", [45.0, 180.0])
@pytest.mark.parametrize("bend", BENDS)
def test_a_vehicle_in_the_lane_beside(bend: str, ahead_m: float) -> None:
    road = Road(BENDS[bend])

    assert not any(
        is_cautioned(Scene(road, ahead_m, lambda _: LANE_M, seed=seed)) for seed in SEEDS
    )


def test_a_vehicle_of_which_eebl_warns_raises_no_second_alarm() -> None:
    monitor, own, other, now = Scene(Road(BENDS["straight"]), 45.0, lambda _: 0.0).drive(300.0)
    monitor.assess(own, [other], now)

    events = [event for event in iter(monitor.next_event, None) if isinstance(event, Alarm)]
    assert [event.cause for event in events] == [EEBL]


def test_a_vehicle_behind() -> None:
    assert not is_cautioned(Scene(Road(BENDS["straight"]), -45.0, lambda _: 0.0))


class Stream:
    """The host vehicle and another one without receivers, whose speeds vary."""

    def __init__(self, lag_s: float, *, seed: int = 1, steady: bool = False) -> None:
        """The host repeats the other's speed after `lag_s`; infinite: it does not."""
        rng = np.random.default_rng(seed)
        sigma = 0.0 if steady else 0.35
        walks = [25.0 + self._walk(rng, sigma) for _ in range(2)]
        self._monitor = RiskMonitor(RiskSettings(), 4.8, 1.8)
        self._other_m_s = walks[0]
        shift = 0 if math.isinf(lag_s) else round(10.0 * lag_s)
        self._own_m_s = walks[1] if math.isinf(lag_s) else np.roll(walks[0], shift)
        self._step = 200

    @staticmethod
    def _walk(
        rng: np.random.Generator, sigma: float
    ) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
        kept, speeds = math.exp(-0.1 / 10.0), [0.0]
        for draw in rng.standard_normal(1199):
            speeds.append(kept * speeds[-1] + 3.0 * sigma * math.sqrt(1 - kept**2) * draw)
        return np.array(speeds)

    def drive(self, seconds: float, *, brakes: bool = False) -> list[Level]:
        """Drive on and return the new levels."""
        for _ in range(round(10.0 * seconds)):
            now, self._step = self._step / 10.0, self._step + 1
            own_m_s, other_m_s = self._own_m_s[self._step], self._other_m_s[self._step]
            events = VehicleEventFlags.HARD_BRAKING if brakes else None
            core = CoreData(1, OTHER, speed_m_s=float(other_m_s))
            safety = VehicleSafetyExtensions(events)
            self._monitor.host.receive_observation(Speed(now, float(own_m_s), 0.28, "obd:7E8"))
            self._monitor.receive_bsm(BasicSafetyMessage(core, safety), now)
            self._monitor.assess(None, [], now)
        return levels(self._monitor)


def test_without_a_position_whom_the_host_vehicle_repeats() -> None:
    streams = [Stream(4.0, seed=seed) for seed in SEEDS]

    assert [each.drive(70.0) for each in streams] == [[]] * len(SEEDS)
    assert [each.drive(0.2, brakes=True) for each in streams] == [[Level.CAUTION]] * len(SEEDS)


@pytest.mark.parametrize("lag_s", [-4.0, math.inf])
def test_not_who_repeats_the_host_vehicle_nor_a_stranger(lag_s: float) -> None:
    for seed in SEEDS:
        stream = Stream(lag_s, seed=seed)
        stream.drive(70.0)
        assert stream.drive(0.2, brakes=True) == []


def test_at_constant_speed_motion_tells_nothing() -> None:
    stream = Stream(4.0, steady=True)
    stream.drive(70.0)

    assert stream.drive(1.0, brakes=True) == []


def test_the_caution_ends_with_the_flag() -> None:
    stream = Stream(4.0)
    stream.drive(70.0)
    assert stream.drive(2.0, brakes=True) == [Level.CAUTION]

    assert stream.drive(FLAG_HOLD_S + 1.5) == [Level.NONE]


def test_it_never_brakes() -> None:
    assert not row_of(BRAKING_AHEAD).may_brake
