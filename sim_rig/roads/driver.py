"""A driver in a recording to whom something happens, and what he does from then on.

Who sees something on his way that was not there stops accelerating, brakes after his own reaction
time, and follows the intelligent driver model from then on. A warned one brakes, and not only until
the warning ends if he would still meet somebody who crosses his way. Where the recording waits at a
light, he waits too. He keeps his way; only his speed changes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Cars
from sim_rig.roads.events import SETTING_OFF_M_S2, SETTING_OFF_TO_M_S
from sim_rig.roads.paths import DrivePath, blocked_at_m, would_meet
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.scenario.setting_types import NotNegative, Positive, Span

SEEN_M = 75.0
"""Who is farther away is nothing to react to."""
STANDS_M_S = 0.5
_WARNING_HELD_S = 0.5
"""After the last word of a warning a driver lets go of the brake."""
_NEEDED_M_S2 = 1.0
"""Who is not on his own way by the recording reacts to what asks for so much more braking."""
_AHEAD_S = np.arange(0.2, 5.1, 0.2)
"""A driver who looks out for others looks so far ahead."""
_ROUNDING_S = 1e-9
"""Moments that differ by less are the same."""


class ReactionSettings(Settings):
    """How drivers react; of each driver drawn once. Times are log-normal."""

    unwarned_median_s: float = Field(1.3, gt=0.0, le=5.0)
    """To a car ahead that unexpectedly brakes (Green, Transportation Human Factors 2, 2000)."""
    unwarned_sigma: float = Field(0.4, ge=0.0, le=1.5)
    """Of the logarithm."""
    distracted: float = Field(0.25, ge=0.0, le=1.0)
    """Part of the drivers who look elsewhere at first."""
    distracted_s: Span[NotNegative] = (0.5, 2.5)
    """For how long, evenly."""
    warned_median_s: float = Field(0.9, gt=0.0, le=5.0)
    """From the warning to the brake."""
    warned_sigma: float = Field(0.3, ge=0.0, le=1.5)
    braking_m_s2: Span[Positive] = (4.0, 8.0)
    """Of a warned driver, evenly between these."""
    following: CarFollowing = CarFollowing()


class Obstacle(NamedTuple):
    """What is next on a driver's way."""

    gap_m: float
    """Infinite, if nothing is."""
    closing_m_s: float
    """How fast the gap shrinks."""


@dataclass(slots=True)
class SimulatedDriver:
    """One who has left the recording, or is about to. `at` is his place in `cars`, everywhere."""

    unwarned_s: float
    warned_s: float
    braking_m_s2: float
    path: DrivePath
    following: CarFollowing
    """With brakes without a bound: what two situations ask for is compared beyond what they can."""
    hardest_braking_m_s2: float
    """What they can."""
    sooner_s: float = 0.0
    """Than the recording has him."""
    way_m: float = 0.0
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    is_off: bool = False
    """The recording."""
    runs: bool = False
    """A red light: keeps his speed until he notices."""
    sets_off: bool = False
    """At a red light: drives on from standing."""
    noticed: bool = False
    """That he runs a light, or what he was warned of: looks out for who crosses his way."""
    reacts_at_s: float = -math.inf
    """To what made him leave the recording; until then he does not accelerate, and brakes only
    where the recording does."""
    event_braking_m_s2: float = 0.0
    needed_since_s: float = math.inf
    """Since when he would have to brake harder than he does."""
    brakes_at_s: float = math.inf
    """When he brakes because he was warned."""
    brakes_until_s: float = -math.inf

    @classmethod
    def drawn(
        cls,
        reactions: ReactionSettings,
        rng: np.random.Generator,
        drive: Trajectory,
        sooner_s: float,
    ) -> "SimulatedDriver":
        """Draw how he reacts."""
        is_distracted = rng.random() < reactions.distracted
        away_s = rng.uniform(*reactions.distracted_s)
        unwarned_s = reactions.unwarned_median_s * math.exp(reactions.unwarned_sigma * rng.normal())
        warned_s = reactions.warned_median_s * math.exp(reactions.warned_sigma * rng.normal())
        unbounded = {"hardest_deceleration_m_s2": math.inf}
        return cls(
            unwarned_s=unwarned_s + (away_s if is_distracted else 0.0),
            warned_s=warned_s,
            braking_m_s2=rng.uniform(*reactions.braking_m_s2),
            path=DrivePath(drive),
            following=reactions.following.model_copy(update=unbounded),
            hardest_braking_m_s2=reactions.following.hardest_deceleration_m_s2,
            sooner_s=sooner_s,
        )

    @property
    def has_seen(self) -> bool:
        """Whether he reacts already to what others do."""
        return self.is_off and (self.noticed or not self.runs)

    def recorded_s(self, now: float) -> float:
        """The moment of his drive that would be now: another for one who is moved in time."""
        return now + self.sooner_s

    def way_at_m(self, now: float) -> float:
        """How far he has come on his way."""
        return self.way_m if self.is_off else self.path.way_m(self.recorded_s(now))

    def car(self, at_s: float) -> Cars | None:
        """His car, once he is off the recording; `None` beyond the end of his way."""
        if self.way_m > self.path.length_m:
            return None
        middle, heading = self.path.places(np.array([self.way_m]))
        drive = self.path.drive
        return Cars(
            at_s, (drive.name,), middle, heading, np.array([self.speed_m_s]),
            np.array([self.acceleration_m_s2]),
            np.array([drive.length_m]), np.array([drive.width_m]),
        )  # fmt: skip

    def leave(self, cars: Cars, at: int) -> None:
        """Keep to the recording no longer."""
        self.way_m = self.way_at_m(cars.at_s)
        self.is_off = True
        self.speed_m_s = float(cars.speed_m_s[at])

    def warn(self, at_s: float) -> None:
        """He is warned at this moment, and brakes for as long as that lasts."""
        reacts_s = at_s + self.warned_s
        if at_s > self.brakes_until_s:
            self.brakes_at_s = reacts_s
        self.brakes_until_s = reacts_s + _WARNING_HELD_S

    def needs_to_brake(self, wish_m_s2: float, planned_m_s2: float, now: float) -> bool:
        """Whether he has had to brake harder than planned for as long as he takes to see it."""
        if wish_m_s2 > min(planned_m_s2, 0.0) - _NEEDED_M_S2:
            self.needed_since_s = math.inf
            return False
        self.needed_since_s = min(self.needed_since_s, now)
        return now - self.needed_since_s >= self.unwarned_s - _ROUNDING_S

    def ahead(self, cars: Cars, at: int, others: NDArray[np.intp]) -> Obstacle:
        """Whoever of `others` is nearest on his way."""
        gaps = blocked_at_m(self.path, self.way_at_m(cars.at_s), cars, at, others)
        if not np.isfinite(gaps).any():
            return Obstacle(math.inf, 0.0)
        nearest = int(others[gaps.argmin()])
        along = math.cos(cars.heading_rad[nearest] - cars.heading_rad[at])
        closing = float(cars.speed_m_s[at]) - float(cars.speed_m_s[nearest]) * max(along, 0.0)
        return Obstacle(max(float(gaps.min()), 0.1), closing)

    def follow_m_s2(self, cars: Cars, at: int, ahead: Obstacle) -> float:
        """What the gap ahead asks for of the intelligent driver, be it more than brakes can do."""
        speed = float(cars.speed_m_s[at])
        wished = max(self.path.speed_m_s(self.way_at_m(cars.at_s)), 2.0)
        return float(
            idm_acceleration(
                np.array(speed), np.array(max(wished, speed)), np.array(ahead.gap_m),
                np.array(ahead.closing_m_s), COMFORTABLE_M_S2, self.following,
            )
        )  # fmt: skip

    def wish_m_s2(self, cars: Cars, at: int, is_disturbed: Callable[[str], bool]) -> float:
        """What he does in the next step; `is_disturbed` says who is where he was not recorded."""
        if self.event_braking_m_s2 > 0.0:
            return -self.event_braking_m_s2
        is_warned = self.brakes_at_s <= cars.at_s <= self.brakes_until_s
        self.noticed |= is_warned
        if self.runs and not self.noticed:
            gathers = self.sets_off and self.speed_m_s < SETTING_OFF_TO_M_S
            return SETTING_OFF_M_S2 if gathers else 0.0
        if cars.at_s < self.reacts_at_s - _ROUNDING_S and not self.noticed:
            return min(self.path.acceleration_m_s2(self.recorded_s(cars.at_s)), 0.0)
        near = np.hypot(*(cars.middle_m - cars.middle_m[at]).T) < SEEN_M
        near[at] = False
        others = np.flatnonzero(near)
        follows = self.follow_m_s2(cars, at, self._ahead_or_light(cars, at, others))
        wish = max(follows, -self.hardest_braking_m_s2)
        if is_warned:
            wish = min(wish, -self.braking_m_s2)
        if self.speed_m_s >= STANDS_M_S and not self.runs:
            if not self.noticed:
                return wish
            others = np.array([i for i in others if is_disturbed(cars.names[i])], np.intp)
        ways_m = self.way_m + self.speed_m_s * _AHEAD_S + max(wish, 0.0) * _AHEAD_S**2 / 2.0
        meets = would_meet(self.path, ways_m, _AHEAD_S, cars, at, others)
        return min(wish, -self.braking_m_s2) if meets else wish

    def drive(self, acceleration_m_s2: float) -> None:
        """Drive for one step."""
        faster = max(self.speed_m_s + acceleration_m_s2 * STEP_S, 0.0)
        self.way_m += (self.speed_m_s + faster) / 2.0 * STEP_S
        self.acceleration_m_s2 = (faster - self.speed_m_s) / STEP_S
        self.speed_m_s = faster

    def _ahead_or_light(self, cars: Cars, at: int, others: NDArray[np.intp]) -> Obstacle:
        """Whoever of `others` is nearest on his way, or where the recording waits before that."""
        ahead = self.ahead(cars, at, others)
        waits_m = self.path.waits_m(self.way_m, self.recorded_s(cars.at_s))
        waits_m = max(waits_m + self.following.standing_gap_m, 0.1)
        return Obstacle(waits_m, self.speed_m_s) if waits_m < ahead.gap_m else ahead
