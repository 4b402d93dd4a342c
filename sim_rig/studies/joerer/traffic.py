"""Two cars approach a crossing as in section IV of the paper; all approaches run at once.

Cars follow the intelligent driver model. One has the right of way; the other yields by stopping at
its stop line, unless it is one of the half that ignores the rules. What the paper leaves to its map
and to SUMO is a setting here.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.car_following import CarFollowing, idm_acceleration

Array = NDArray[np.float64]


class TrafficSettings(Settings):
    """Table I, and what the paper leaves open."""

    approaches: int = Field(5000, ge=1, le=100_000)
    """Number of approaches of two cars."""
    step_s: float = Field(0.005, gt=0.0, le=0.02)
    """Of the simulation."""
    ticks_every: int = Field(4, ge=1)
    """Steps between two recorded states."""
    near_crash_m: float = Field(0.4, ge=0.0)
    """Cars that come as near as this without a contact are a near crash."""
    length_m: float = Field(5.0, gt=0.0)
    """Of each car."""
    width_m: float = Field(1.75, gt=0.0)
    """Of each car."""
    top_speed_m_s: tuple[float, float] = (13.89, 2.92)
    """Mean and standard deviation."""
    desired_deceleration_m_s2: tuple[float, float] = (3.47, 2.76)
    """Mean and standard deviation."""
    most_sigmas: float = Field(1.0, gt=0.0)
    """Truncation of both distributions: the paper's largest step of 8.405 cm is that of 16.81 m/s,
    which is one standard deviation above the mean."""
    acceleration_m_s2: float = Field(2.1, gt=0.0)
    """a of the IDM."""
    hardest_deceleration_m_s2: float = Field(9.55, gt=0.0)
    """Limit of the braking."""
    ignoring: float = Field(0.5, ge=0.0, le=1.0)
    """Share of the second cars that ignore the right of way."""

    start_m: tuple[float, float] = (100.0, 250.0)
    """Range of the initial distance from the middle of the crossing."""
    stop_line_m: float = Field(6.0, gt=0.0)
    """Before the middle of the crossing."""
    headway_s: float = Field(1.0, ge=0.0)
    """T of the IDM, towards the stop line."""
    standing_gap_m: float = Field(1.0, gt=0.0)
    """s0 of the IDM, towards the stop line."""
    margin_s: float = Field(1.0, ge=0.0)
    """A yielding car crosses first only if it leaves this long before the other can enter."""


class ApproachOutcome(IntEnum):
    """Outcome of an approach."""

    CRASH = 0
    NEAR_CRASH = 1
    NO_CRASH = 2


@dataclass(frozen=True, slots=True)
class Approaches:
    """n approaches of two cars, the second of which has to yield."""

    outcome: NDArray[np.int64]
    """(n,) of `ApproachOutcome`."""
    end_s: Array
    """(n,) time of the contact, or else of the first car's leaving the conflict zone."""
    ignores_rules: NDArray[np.bool_]
    """(n,) whether the second car ignores the right of way."""
    tick_s: float
    distance_m: Array
    """(n, ticks, 2) from the middle of a car to the middle of the crossing; negative behind it."""
    speed_m_s: Array
    """(n, ticks, 2)"""
    acceleration_m_s2: Array
    """(n, ticks, 2)"""


class _Crossings:
    """Times at which each car enters the zone within `half_m` of the middle, and leaves it."""

    def __init__(self, half_m: float, n: int) -> None:
        self._half_m = half_m
        self.entered_s = np.full((n, 2), np.inf)
        self.left_s = np.full((n, 2), np.inf)

    def step(self, now_s: float, distance_m: Array, moved_m: Array, step_s: float) -> None:
        for edge_m, at_s in ((self._half_m, self.entered_s), (-self._half_m, self.left_s)):
            passed = (distance_m <= edge_m) & np.isinf(at_s)
            if passed.any():
                beyond = (edge_m - distance_m[passed]) / np.maximum(moved_m[passed], 1e-12)
                at_s[passed] = now_s - np.clip(beyond, 0.0, 1.0) * step_s

    @property
    def met(self) -> NDArray[np.bool_]:
        """(n,) whether both cars were inside at the same time."""
        met: NDArray[np.bool_] = self.entered_s.max(axis=1) < self.left_s.min(axis=1)
        return met


def simulate_approaches(settings: TrafficSettings, rng: np.random.Generator) -> Approaches:
    """Simulate all approaches until each is over."""
    n = settings.approaches
    top = draw(settings.top_speed_m_s, settings.most_sigmas, (n, 2), rng)
    desired = draw(settings.desired_deceleration_m_s2, settings.most_sigmas, (n, 2), rng)
    speed = rng.uniform(0.0, top)
    distance = rng.uniform(*settings.start_m, (n, 2))
    ignores = rng.random(n) < settings.ignoring
    yields = ~ignores
    half_m = 0.5 * (settings.length_m + settings.width_m)
    touching = _Crossings(half_m, n)
    close = _Crossings(half_m + settings.near_crash_m, n)
    step_s, step = settings.step_s, 0
    record: list[Array] = []
    while not np.all((close.left_s < np.inf).any(axis=1) | touching.met):
        if step % settings.ticks_every == 0:
            yields &= ~_may_cross_first(distance, speed, top, half_m, settings)
        acceleration = _idm(
            speed, top, desired, _gap_m(distance, yields, half_m, settings), settings
        )
        if step % settings.ticks_every == 0:
            record.append(np.stack([distance, speed, acceleration]).astype(np.float32))
        faster = np.maximum(speed + acceleration * step_s, 0.0)
        moved = 0.5 * (speed + faster) * step_s
        distance, speed, step = distance - moved, faster, step + 1
        for crossings in (touching, close):
            crossings.step(step * step_s, distance, moved, step_s)
    outcome = np.select(
        [touching.met, close.met],
        [ApproachOutcome.CRASH, ApproachOutcome.NEAR_CRASH],
        ApproachOutcome.NO_CRASH,
    )
    met_s = np.where(outcome == ApproachOutcome.CRASH, touching.entered_s.max(axis=1), np.inf)
    record_by_quantity = np.stack(record, axis=2)
    return Approaches(
        outcome,
        np.minimum(met_s, close.left_s.min(axis=1)),
        ignores,
        step_s * settings.ticks_every,
        *record_by_quantity,
    )


def draw(
    normal: tuple[float, float],
    most_sigmas: float,
    shape: tuple[int, ...],
    rng: np.random.Generator,
) -> Array:
    """Draw from a normal distribution, mean and sigma, truncated at `most_sigmas`."""
    drawn = rng.normal(size=shape)
    while (beyond := np.abs(drawn) > most_sigmas).any():
        drawn[beyond] = rng.normal(size=int(beyond.sum()))
    mean, sigma = normal
    return mean + sigma * drawn


def _may_cross_first(
    distance: Array, speed: Array, top: Array, half_m: float, settings: TrafficSettings
) -> NDArray[np.bool_]:
    """(n,) whether the second car, at its speed, leaves well before the first can enter."""
    first_m = np.maximum(distance[:, 0] - half_m, 0.0)
    gaining_s = (top[:, 0] - speed[:, 0]) / settings.acceleration_m_s2
    gaining_m = 0.5 * (top[:, 0] + speed[:, 0]) * gaining_s
    squared = speed[:, 0] ** 2 + 2.0 * settings.acceleration_m_s2 * first_m
    earliest_s = np.where(
        first_m < gaining_m,
        (np.sqrt(squared) - speed[:, 0]) / settings.acceleration_m_s2,
        gaining_s + (first_m - gaining_m) / top[:, 0],
    )
    out_s = (distance[:, 1] + half_m) / np.maximum(speed[:, 1], 0.1)
    return out_s + settings.margin_s < earliest_s


def _gap_m(
    distance: Array, yields: NDArray[np.bool_], half_m: float, settings: TrafficSettings
) -> Array:
    """Gaps (n, 2) to the stop line of a car that has to stop; else infinite."""
    gap = np.full_like(distance, np.inf)
    front_m = distance[:, 1] - 0.5 * settings.length_m
    stops = yields & (distance[:, 0] > -half_m) & (front_m > settings.stop_line_m - 1.0)
    gap[:, 1] = np.where(stops, front_m - settings.stop_line_m + settings.standing_gap_m, np.inf)
    return gap


def _idm(speed: Array, top: Array, desired: Array, gap: Array, settings: TrafficSettings) -> Array:
    """Acceleration of the IDM towards a standing obstacle at `gap`."""
    model = CarFollowing(
        acceleration_m_s2=settings.acceleration_m_s2,
        hardest_deceleration_m_s2=settings.hardest_deceleration_m_s2,
        headway_s=settings.headway_s,
        standing_gap_m=settings.standing_gap_m,
    )
    return idm_acceleration(speed, top, np.maximum(gap, 0.1), speed, desired, model)
