"""Model of a driver that leaves the recording because of an event or a warning.

A driver with an unexpected obstacle on its path stops accelerating, brakes after its reaction time,
and follows the intelligent driver model (IDM) from then on. A warned driver brakes, beyond the end
of the warning too if it would still collide with a crossing car. Recorded waits at lights are kept.
The path stays; only the speed changes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Cars
from sim_rig.roads.events import SETTING_OFF_M_S2, SETTING_OFF_TO_M_S
from sim_rig.roads.paths import DrivePath, blocked_at_m, would_collide
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.scenario.setting_types import NotNegative, Positive, Span

SEEN_M = 75.0
"""Drivers react to cars within this distance."""
STANDS_M_S = 0.5
"""Slower cars count as standing."""
_WARNING_HELD_S = 0.5
"""A driver releases the brake this long after the last warning."""
_NEEDED_M_S2 = 1.0
"""A driver off the recording reacts if the needed deceleration exceeds the planned by this."""
_AHEAD_S = np.arange(0.2, 5.1, 0.2)
"""Times ahead at which a driver checks for crossing cars."""
_ROUNDING_S = 1e-9
"""Tolerance for rounding: times that differ by less are equal."""


class ReactionSettings(Settings):
    """Distribution of reactions; drawn once per driver. Times are log-normal."""

    unwarned_median_s: float = Field(1.3, gt=0.0, le=5.0)
    """To a lead that unexpectedly brakes (Green, Transportation Human Factors 2, 2000)."""
    unwarned_sigma: float = Field(0.4, ge=0.0, le=1.5)
    """Standard deviation of the logarithm."""
    distracted: float = Field(0.25, ge=0.0, le=1.0)
    """Share of distracted drivers."""
    distracted_s: Span[NotNegative] = (0.5, 2.5)
    """Duration of the distraction, uniform."""
    warned_median_s: float = Field(0.9, gt=0.0, le=5.0)
    """From the warning to the brake."""
    warned_sigma: float = Field(0.3, ge=0.0, le=1.5)
    """Standard deviation of the logarithm of that time."""
    braking_m_s2: Span[Positive] = (4.0, 8.0)
    """Deceleration of a warned driver, uniform between these."""
    following: CarFollowing = CarFollowing()
    """How drivers follow the lead once they leave the recording."""


class Obstacle(NamedTuple):
    """Nearest obstacle on a driver's path."""

    gap_m: float
    """Infinite without an obstacle."""
    closing_m_s: float
    """Closing speed."""


@dataclass(slots=True)
class SimulatedDriver:
    """A driver that has left the recording, or may soon.

    In all methods, `at` is the index of its car in `cars`.
    """

    unwarned_s: float
    warned_s: float
    braking_m_s2: float
    path: DrivePath
    following: CarFollowing
    """IDM without a bound on deceleration, so that needs beyond the brakes can be compared."""
    hardest_braking_m_s2: float
    """Largest deceleration of the brakes."""
    sooner_s: float = 0.0
    """Shift in time against the recording."""
    way_m: float = 0.0
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    is_off: bool = False
    """Whether it has left the recording."""
    runs: bool = False
    """Whether it runs a red light; it keeps its speed until `noticed`."""
    sets_off: bool = False
    """Whether it departs at a red light from standing."""
    noticed: bool = False
    """Whether it is aware of its red light or was warned; it then checks for crossing cars."""
    reacts_at_s: float = -math.inf
    """End of its reaction time; until then it does not accelerate, and brakes as recorded."""
    event_braking_m_s2: float = 0.0
    needed_since_s: float = math.inf
    """Since when it needs to brake harder than planned."""
    brakes_at_s: float = math.inf
    """Start of braking after a warning."""
    brakes_until_s: float = -math.inf
    requests: list[tuple[float, float, float]] = field(default_factory=list)
    """Brakings of the car itself: begin, end, and deceleration."""

    @classmethod
    def drawn(
        cls,
        reactions: ReactionSettings,
        rng: np.random.Generator,
        drive: Trajectory,
        sooner_s: float,
    ) -> "SimulatedDriver":
        """Draw a driver.

        Args:
            reactions: distribution of the reactions.
            rng: source of the draws.
            drive: recorded trajectory of its car.
            sooner_s: shift in time against the recording, s.
        """
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
        """Whether it already reacts to other cars."""
        return self.is_off and (self.noticed or not self.runs)

    def recorded_s(self, now: float) -> float:
        """Time in the recorded trajectory at `now`, with the shift in time, s."""
        return now + self.sooner_s

    def way_at_m(self, now: float) -> float:
        """Distance from the start of the path, m."""
        return self.way_m if self.is_off else self.path.way_m(self.recorded_s(now))

    def car(self, at_s: float) -> Cars | None:
        """State of its car off the recording; `None` beyond the end of the path."""
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
        """Leave the recording."""
        self.way_m = self.way_at_m(cars.at_s)
        self.is_off = True
        self.speed_m_s = float(cars.speed_m_s[at])

    def warn(self, at_s: float) -> None:
        """Receive a warning; the driver brakes while warnings last."""
        reacts_s = at_s + self.warned_s
        if at_s > self.brakes_until_s:
            self.brakes_at_s = reacts_s
        self.brakes_until_s = reacts_s + _WARNING_HELD_S

    def request(self, begin_s: float, until_s: float, deceleration_m_s2: float) -> None:
        """Let the car brake by itself; replaces what earlier calls ask for from `begin_s` on."""
        self.requests.append((begin_s, until_s, deceleration_m_s2))

    def requested_m_s2(self, at_s: float) -> float:
        """Deceleration of the car's own braking, m/s^2; 0 without one."""
        begun = [each for each in self.requests if each[0] <= at_s + _ROUNDING_S]
        _, until_s, deceleration_m_s2 = max(begun, default=(0.0, -math.inf, 0.0))
        return deceleration_m_s2 if at_s <= until_s else 0.0

    def needs_to_brake(self, wish_m_s2: float, planned_m_s2: float, now: float) -> bool:
        """Whether harder braking than planned was needed for its reaction time.

        Args:
            wish_m_s2: acceleration that the situation needs.
            planned_m_s2: acceleration that is planned.
            now: time, s.
        """
        if wish_m_s2 > min(planned_m_s2, 0.0) - _NEEDED_M_S2:
            self.needed_since_s = math.inf
            return False
        self.needed_since_s = min(self.needed_since_s, now)
        return now - self.needed_since_s >= self.unwarned_s - _ROUNDING_S

    def ahead(self, cars: Cars, at: int, others: NDArray[np.intp]) -> Obstacle:
        """Return the nearest of `others` on its path.

        Args:
            cars: all cars.
            at: index of its car.
            others: (n,) indices of the cars to check.
        """
        gaps = blocked_at_m(self.path, self.way_at_m(cars.at_s), cars, at, others)
        if not np.isfinite(gaps).any():
            return Obstacle(math.inf, 0.0)
        nearest = int(others[gaps.argmin()])
        along = math.cos(cars.heading_rad[nearest] - cars.heading_rad[at])
        closing = float(cars.speed_m_s[at]) - float(cars.speed_m_s[nearest]) * max(along, 0.0)
        return Obstacle(max(float(gaps.min()), 0.1), closing)

    def follow_m_s2(self, cars: Cars, at: int, ahead: Obstacle) -> float:
        """Acceleration of the IDM behind an obstacle, m/s^2, without a bound on deceleration.

        Args:
            cars: all cars.
            at: index of its car.
            ahead: the obstacle.
        """
        speed = float(cars.speed_m_s[at])
        wished = max(self.path.speed_m_s(self.way_at_m(cars.at_s)), 2.0)
        return float(
            idm_acceleration(
                np.array(speed), np.array(max(wished, speed)), np.array(ahead.gap_m),
                np.array(ahead.closing_m_s), COMFORTABLE_M_S2, self.following,
            )
        )  # fmt: skip

    def wish_m_s2(self, cars: Cars, at: int, is_disturbed: Callable[[str], bool]) -> float:
        """Acceleration in the next step, m/s^2: the car may brake harder than its driver.

        Args:
            cars: all cars.
            at: index of its car.
            is_disturbed: whether a car, by name, has left the recording.
        """
        wish = self._driver_wish_m_s2(cars, at, is_disturbed)
        requested = self.requested_m_s2(cars.at_s)
        return min(wish, -requested) if requested > 0.0 else wish

    def _driver_wish_m_s2(self, cars: Cars, at: int, is_disturbed: Callable[[str], bool]) -> float:
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
        meets = would_collide(self.path, ways_m, _AHEAD_S, cars, at, others)
        return min(wish, -self.braking_m_s2) if meets else wish

    def drive(self, acceleration_m_s2: float) -> None:
        """Advance the car by one step."""
        faster = max(self.speed_m_s + acceleration_m_s2 * STEP_S, 0.0)
        self.way_m += (self.speed_m_s + faster) / 2.0 * STEP_S
        self.acceleration_m_s2 = (faster - self.speed_m_s) / STEP_S
        self.speed_m_s = faster

    def _ahead_or_light(self, cars: Cars, at: int, others: NDArray[np.intp]) -> Obstacle:
        """Return the nearest of `others` on its path, or the recorded wait before it."""
        ahead = self.ahead(cars, at, others)
        waits_m = self.path.waits_m(self.way_m, self.recorded_s(cars.at_s))
        waits_m = max(waits_m + self.following.standing_gap_m, 0.1)
        return Obstacle(waits_m, self.speed_m_s) if waits_m < ahead.gap_m else ahead
