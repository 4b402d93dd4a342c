"""P_C of merging paths against trajectories that are stepped, and in the study's approaches."""

import numpy as np
import pytest

from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.driver_behaviour import Behaviour
from onboard.risk.trajectory import travelled_m
from sim_rig.studies.joerer.criticality import BEHAVIOURS, UNAVOIDABLE, criticality
from sim_rig.studies.joerer.merging import YCrossing, merging
from sim_rig.studies.joerer.traffic import ApproachOutcome, TrafficSettings, simulate_approaches
from tests.risk.test_collision_probability import CAR, TRIANGULAR, UNIFORM, approach, overlap

MERGED_M = 15.0


def stepped_share(a: Approach, b: Approach, angle_rad: float, drawn: list[np.ndarray]) -> float:
    """Share of pairs of accelerations that collide within 30 s, in steps of 0.02 s."""
    time_s = np.arange(0.0, 30.0, 0.02)
    s_a, s_b = (
        -car.distance_m + travelled_m(time_s, each[:, None], car.speed_m_s, car.top_speed_m_s)
        for car, each in zip((a, b), drawn, strict=True)
    )
    heading = np.where(s_b < 0.0, angle_rad, 0.0)
    touching = overlap(s_a, s_b * np.cos(heading), s_b * np.sin(heading), heading)
    return float((touching & (s_a <= MERGED_M)).any(axis=1).mean())


@pytest.mark.long
@pytest.mark.parametrize("behaviour", [UNIFORM, TRIANGULAR], ids=["uniform", "triangular"])
@pytest.mark.parametrize("angle_deg", [10.0, 40.0, -70.0])
@pytest.mark.parametrize(
    ("a", "b"),
    [((25.0, 12.0), (27.0, 12.0)), ((12.0, 6.0), (20.0, 10.0)), ((30.0, 8.0), (8.0, 1.0))],
)
def test_agrees_with_monte_carlo_over_stepped_trajectories(
    behaviour: Behaviour, angle_deg: float, a: tuple[float, float], b: tuple[float, float]
) -> None:
    rng = np.random.default_rng(9)
    n, angle_rad = 1_000, np.deg2rad(angle_deg)
    one, other = approach(*a, behaviour), approach(*b, behaviour)
    drawn = [behaviour.quantile(rng.uniform(size=n)) for _ in "ab"]

    share = stepped_share(one, other, angle_rad, drawn)

    standard_error = np.sqrt(max(share * (1 - share), 1 / n) / n)
    zone = YCrossing(CAR, CAR, np.array(angle_rad), np.array(MERGED_M))
    p_c = float(collision_probability(one, other, zone)[0])
    assert p_c == pytest.approx(share, abs=4 * standard_error)


def test_what_is_beyond_the_junction_counts_for_a_while() -> None:
    """In line behind the junction, the second car drives up to the first."""

    def p_c(s_m: float) -> float:
        ahead, behind = approach(-s_m, 1.0), approach(7.0 - s_m, 16.0)
        zone = YCrossing(CAR, CAR, np.array(0.5), np.array(MERGED_M))
        return float(collision_probability(ahead, behind, zone)[0])

    assert p_c(5.0) > 0.5
    assert p_c(MERGED_M + 1.0) == 0.0


@pytest.mark.long
@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_every_crash_on_merging_paths_reaches_100_percent_and_others_do_not(behaviour: str) -> None:
    traffic = TrafficSettings(approaches=150, start_m=(60.0, 110.0))
    zone = YCrossing(CAR, CAR, np.array(0.5), np.array(MERGED_M))
    merged = merging(simulate_approaches(traffic, np.random.default_rng(5)), zone)

    highest = np.nanmax(criticality(merged, behaviour, traffic, zone), axis=1)

    is_crash = merged.outcome == ApproachOutcome.CRASH
    assert is_crash.sum() >= 5
    assert (highest[is_crash] >= UNAVOIDABLE).all()
    assert (highest[~is_crash] < UNAVOIDABLE).all()
