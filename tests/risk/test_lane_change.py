"""BSW and LCW: who is beside or behind in the lane to which the driver signals."""

from dataclasses import replace

import numpy as np
import pytest

from onboard.observations import Side, TurnSignal
from onboard.risk.adjacent_lane import LEAST_SPEED_M_S, OLDEST_S
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.bsw import BSW
from onboard.risk.lcw import CLOSING_S, LCW
from onboard.tracking.perceived_object import PerceivedObject
from tests.risk.bends import LANE_M, Road, Scene

BENDS = {"straight": 0.0, "to the left": 1.0 / 300.0, "to the right": -1.0 / 300.0}
SEEDS = range(5)
LENGTH_M = 4.65
"""Mean of both vehicles."""


def raised(
    bend: str = "straight",
    *,
    behind_m: float,
    left_m: float = LANE_M,
    closing_m_s: float = 0.0,
    signals: tuple[Side, ...] = ("left",),
    speed_m_s: float = 16.0,
    age_s: float = 0.0,
    seed: int = 1,
) -> set[Cause]:
    """Return what is raised about a vehicle whose front is `behind_m` behind the host's rear."""
    road = Road(lambda _: BENDS[bend])
    scene = Scene(road, -behind_m - LENGTH_M, lambda _: left_m, speed_m_s, seed)
    monitor, own, other, now = scene.drive(300.0)
    for side in signals:
        monitor.host.receive_observation(TurnSignal(now, side, is_on=True, source="can"))
    monitor.assess(own, [replace(faster(other, closing_m_s), age_s=age_s)], now)
    return {each.cause for each in iter(monitor.next_event, None) if isinstance(each, Alarm)}


def faster(vehicle: PerceivedObject, by_m_s: float) -> PerceivedObject:
    velocity = np.array(vehicle.state[2:])
    velocity *= 1.0 + by_m_s / np.linalg.norm(velocity)
    return replace(vehicle, state=(*vehicle.state[:2], *velocity.tolist()))


@pytest.mark.parametrize("behind_m", [-5.0, 2.0])
@pytest.mark.parametrize("bend", BENDS)
def test_a_vehicle_beside_or_just_behind_is_in_the_blind_spot(bend: str, behind_m: float) -> None:
    assert all(raised(bend, behind_m=behind_m, seed=seed) == {BSW} for seed in SEEDS)


@pytest.mark.parametrize("bend", BENDS)
def test_a_vehicle_that_comes_up_is_warned_of_before_it_is_there(bend: str) -> None:
    late_m, soon_m = 10.0 * CLOSING_S - 4.0, 10.0 * CLOSING_S + 6.0

    assert all(raised(bend, behind_m=late_m, closing_m_s=10.0, seed=n) == {LCW} for n in SEEDS)
    assert not any(raised(bend, behind_m=soon_m, closing_m_s=10.0, seed=seed) for seed in SEEDS)


@pytest.mark.parametrize("left_m", [0.0, -LANE_M, 2.0 * LANE_M])
@pytest.mark.parametrize("bend", BENDS)
def test_a_vehicle_in_another_lane_concerns_nobody(bend: str, left_m: float) -> None:
    for behind_m, closing_m_s in ((2.0, 0.0), (20.0, 10.0)):
        for seed in SEEDS:
            causes = raised(
                bend, behind_m=behind_m, closing_m_s=closing_m_s, left_m=left_m, seed=seed
            )
            assert not causes & {BSW, LCW}


def test_to_the_right_it_is_the_same() -> None:
    assert raised(behind_m=2.0, left_m=-LANE_M, signals=("right",)) == {BSW}
    assert not raised(behind_m=2.0, signals=("right",))


@pytest.mark.parametrize("signals", [(), ("left", "right")])
def test_who_signals_nothing_or_a_hazard_is_not_warned(signals: tuple[Side, ...]) -> None:
    assert not raised(behind_m=2.0, signals=signals)


def test_who_has_passed_is_no_danger_and_who_falls_back_comes_not_up() -> None:
    assert not raised(behind_m=-2.0 * LENGTH_M - 1.0)
    assert not raised(behind_m=10.0, closing_m_s=-3.0)


def test_who_drives_slowly_is_about_to_turn_and_a_vehicle_that_is_silent_is_not_placed() -> None:
    assert not raised(behind_m=2.0, speed_m_s=LEAST_SPEED_M_S - 1.0)
    assert not raised(behind_m=2.0, age_s=OLDEST_S + 0.1)


def test_errors_of_positions_do_not_let_the_alarm_flicker() -> None:
    """Of both together a sigma of 1 m, correlated over 20 s: beside the host for a minute."""
    rng, off_m, ended = np.random.default_rng(3), 0.0, 0
    scene = Scene(Road(lambda _: 0.0), 2.0 - LENGTH_M, lambda _: LANE_M)
    monitor, own, other, now = scene.drive(300.0)
    sigma_m2 = tuple(map(tuple, np.diag([0.5, 0.5, 0.01, 0.01]).tolist()))
    own, other = (replace(each, covariance=sigma_m2) for each in (own, other))
    for step in range(600):
        off_m += -off_m / 200.0 + rng.normal(0.0, np.sqrt(2.0 / 200.0))
        east_m, north_m, *velocity = other.state
        moved = replace(other, state=(east_m, north_m + off_m, *velocity))
        monitor.host.receive_observation(
            TurnSignal(now + 0.1 * step, "left", is_on=True, source="can")
        )
        monitor.assess(own, [moved], now + 0.1 * step)
        ended += sum(
            isinstance(each, Alarm) and each.cause == BSW and each.level is Level.NONE
            for each in iter(monitor.next_event, None)
        )

    assert ended <= 1
