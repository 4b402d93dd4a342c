"""When a car's driver is warned: the car's own risk monitor, and its closing gap to known cars.

In a car, the gap ahead is what the camera measures. Here it is judged, with the same thresholds,
to every known car ahead on the own path, so that what others tell of counts as well, and what a
car with a radio says of its own braking. Nobody is told anything before it is known whether he
brakes already: radios begin in the middle of a drive.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from onboard.kinematics.acceleration import AccelerationEstimator
from onboard.mvs.perceived_object import PerceivedObject
from onboard.observations import Speed
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.fcw import LeadMotion, judged, settled_closing_speed_m_s
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings

_BESIDE_M = 1.6
_RANGE_M = 70.0
_HEADING_RAD = 0.5
_KNOWN_FOR = 3
"""A gap is judged once it has been seen so often."""


@dataclass(slots=True)
class _Lead:
    """What is known of one car ahead."""

    motion: LeadMotion
    times: int = 0
    """It has been seen so often."""
    short_since: float | None = None
    """Since when its gap asks for a warning, without a break."""


@dataclass(frozen=True, slots=True)
class Warned:
    """A driver is warned of a car, as of now."""

    cause: Cause
    of: PerceivedObject
    """In the warned car's own frame."""


class Warner:
    """One car's."""

    def __init__(self, settings: RiskSettings, length_m: float, width_m: float) -> None:
        """For a car of the given size."""
        self._settings = settings
        self._length_m = length_m
        self._trend = AccelerationEstimator(settings.fcw.lead_window_s)
        self._monitor = RiskMonitor(settings, length_m, width_m)
        self._leads: dict[str, _Lead] = {}
        self._held: dict[Cause, Warned] = {}
        """Warnings of the monitor that are on."""

    def assess(
        self,
        own: PerceivedObject | None,
        cars: Sequence[PerceivedObject],
        speed_m_s: float,
        now: float,
    ) -> Warned | None:
        """Judge what is known now; returns a warning that is on, if any."""
        self._trend.receive(now, speed_m_s)
        self._monitor.receive_speed(Speed(now, speed_m_s, 0.02, "study"))
        self._monitor.assess(own, cars, now)
        while (event := self._monitor.next_event()) is not None:
            if isinstance(event, Alarm):
                self._held.pop(event.cause, None)
                if event.level is Level.WARNING:
                    of = next(car for car in cars if car.name == event.reasons[-1].name)
                    self._held[event.cause] = Warned(event.cause, of)
        warned = next(iter(self._held.values()), None)
        if warned is None and own is not None and speed_m_s >= self._settings.least_speed_m_s:
            warned = self._ahead(own, cars, speed_m_s, now)
        return warned

    def _ahead(
        self, own: PerceivedObject, cars: Sequence[PerceivedObject], speed_m_s: float, now: float
    ) -> Warned | None:
        settings = self._settings.fcw
        slope = self._trend.acceleration_m_s2
        braking_m_s2 = math.inf if slope is None else max(-slope, 0.0)
        leads = {}
        warned = None
        for car in cars:
            gap_m, along_m_s = self._gap_and_speed(own, car)
            if gap_m is None:
                continue
            lead = leads[car.name] = self._leads.get(car.name) or _Lead(LeadMotion(settings))
            sigma_m_s = _sigma_m_s(own, car)
            if sigma_m_s > settings.settled_sigma_m_s:
                lead.motion.clear()  # what settles is no braking
            lead.motion.receive(now, gap_m, along_m_s)
            lead.times += 1
            if lead.times < _KNOWN_FOR or gap_m <= 0.0:
                continue
            closing_m_s = settled_closing_speed_m_s(speed_m_s - along_m_s, sigma_m_s, settings)
            lead_m_s2 = max(lead.motion.deceleration_m_s2, -(car.acceleration_m_s2 or 0.0))
            seen, _ = judged(
                gap_m, speed_m_s, closing_m_s, lead_m_s2, braking_m_s2, settings=settings
            )
            if seen is not Level.WARNING:
                lead.short_since = None
                continue
            if lead.short_since is None:
                lead.short_since = now
            if now - lead.short_since >= settings.confirm_s:
                warned = Warned(Cause.FCW, car)
        self._leads = leads
        return warned

    def _gap_and_speed(
        self, own: PerceivedObject, car: PerceivedObject
    ) -> tuple[float | None, float]:
        """Bumper to bumper and the speed along the own heading, of a car on the own path."""
        heading = math.atan2(own.state[3], own.state[2])
        cosine, sine = math.cos(heading), math.sin(heading)
        east_m, north_m = car.state[0] - own.state[0], car.state[1] - own.state[1]
        ahead_m = east_m * cosine + north_m * sine
        beside_m = north_m * cosine - east_m * sine
        along_m_s = car.state[2] * cosine + car.state[3] * sine
        if not 0.0 < ahead_m <= _RANGE_M or abs(beside_m) > _BESIDE_M:
            return None, 0.0
        if math.hypot(*car.state[2:]) > 3.0:
            turned = math.atan2(car.state[3], car.state[2]) - heading
            if math.cos(turned) < math.cos(_HEADING_RAD):
                return None, 0.0
        length_m = (self._length_m + self._settings.other_length_m) / 2.0
        return ahead_m - length_m, max(along_m_s, 0.0)


def _sigma_m_s(own: PerceivedObject, car: PerceivedObject) -> float:
    """Of the speed of a car along the own heading."""
    heading = math.atan2(own.state[3], own.state[2])
    cosine, sine = math.cos(heading), math.sin(heading)
    (a, b), (_, c) = (row[2:] for row in car.covariance[2:])
    return math.sqrt(max(cosine * cosine * a + 2.0 * cosine * sine * b + sine * sine * c, 0.0))
