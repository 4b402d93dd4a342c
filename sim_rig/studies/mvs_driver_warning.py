"""Warnings of the simulated drivers: the risk monitor, and FCW for every perceived object ahead.

In a car, FCW uses the gap that the camera measures. Here it uses the gap to every perceived object
ahead on the host vehicle's path, with the same thresholds, so that shared objects count too, and
the braking that a remote vehicle reports. No warning is given before the host vehicle's own
deceleration is known, since radios are switched on in the middle of a drive.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from onboard.kinematics.acceleration import AccelerationEstimator
from onboard.mvs.perceived_object import PerceivedObject
from onboard.observations import Speed
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.bsm_data import DEFAULT_LENGTH_M
from onboard.risk.fcw import (
    CONFIRM_S,
    LEAD_WINDOW_S,
    SETTLED_SIGMA_M_S,
    LeadMotion,
    fcw_level,
    settled_closing_speed_m_s,
)
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings

_LATERAL_LIMIT_M = 1.6
_RANGE_M = 70.0
_HEADING_LIMIT_RAD = 0.5
_LEAST_UPDATES = 3
"""Updates of a gap before it can raise a warning."""


@dataclass(slots=True)
class _LeadTrack:
    """One car ahead over time."""

    motion: LeadMotion
    updates: int = 0
    critical_since: float | None = None
    """Since when its gap has been at the warning level without a break."""


@dataclass(frozen=True, slots=True)
class DriverWarning:
    """An active warning of one perceived object."""

    cause: Cause
    target: PerceivedObject
    """In the frame of the warned car."""


class WarningModel:
    """Computes the warnings of one car."""

    def __init__(self, settings: RiskSettings, length_m: float, width_m: float) -> None:
        """Start without warnings.

        Args:
            settings: of the risk monitor.
            length_m: length of the car.
            width_m: width of the car.
        """
        self._settings = settings
        self._length_m = length_m
        self._acceleration = AccelerationEstimator(LEAD_WINDOW_S)
        self._monitor = RiskMonitor(settings, length_m, width_m)
        self._leads: dict[str, _LeadTrack] = {}
        self._active: dict[Cause, DriverWarning] = {}
        """Active warnings of the monitor."""

    def assess(
        self,
        own: PerceivedObject | None,
        cars: Sequence[PerceivedObject],
        speed_m_s: float,
        now: float,
    ) -> DriverWarning | None:
        """Evaluate all perceived objects.

        Args:
            own: the host vehicle; None without a position.
            cars: its perceived objects.
            speed_m_s: of the host vehicle.
            now: time of the evaluation.

        Returns:
            An active warning, or None.
        """
        self._acceleration.receive(now, speed_m_s)
        self._monitor.receive_speed(Speed(now, speed_m_s, 0.02, "study"))
        self._monitor.assess(own, cars, now)
        while (event := self._monitor.next_event()) is not None:
            if isinstance(event, Alarm):
                self._active.pop(event.cause, None)
                if event.level is Level.WARNING:
                    target = next(car for car in cars if car.name == event.reasons[-1].name)
                    self._active[event.cause] = DriverWarning(event.cause, target)
        warned = next(iter(self._active.values()), None)
        if warned is None and own is not None and speed_m_s >= self._settings.least_speed_m_s:
            warned = self._forward_collision(own, cars, speed_m_s, now)
        return warned

    def _forward_collision(
        self, own: PerceivedObject, cars: Sequence[PerceivedObject], speed_m_s: float, now: float
    ) -> DriverWarning | None:
        settings = self._settings.fcw
        acceleration_m_s2 = self._acceleration.acceleration_m_s2
        braking_m_s2 = math.inf if acceleration_m_s2 is None else max(-acceleration_m_s2, 0.0)
        leads = {}
        warned = None
        for car in cars:
            gap_m, along_m_s = self._gap_and_speed(own, car)
            if gap_m is None:
                continue
            lead = leads[car.name] = self._leads.get(car.name) or _LeadTrack(LeadMotion())
            sigma_m_s = _sigma_m_s(own, car)
            if sigma_m_s > SETTLED_SIGMA_M_S:
                lead.motion.clear()  # a settling speed looks like braking
            lead.motion.receive(now, gap_m, along_m_s)
            lead.updates += 1
            if lead.updates < _LEAST_UPDATES or gap_m <= 0.0:
                continue
            closing_m_s = settled_closing_speed_m_s(speed_m_s - along_m_s, sigma_m_s)
            lead_m_s2 = max(lead.motion.deceleration_m_s2, -(car.acceleration_m_s2 or 0.0))
            level, _ = fcw_level(
                gap_m, speed_m_s, closing_m_s, lead_m_s2, braking_m_s2, settings=settings
            )
            if level is not Level.WARNING:
                lead.critical_since = None
                continue
            if lead.critical_since is None:
                lead.critical_since = now
            if now - lead.critical_since >= CONFIRM_S:
                warned = DriverWarning(Cause.FCW, car)
        self._leads = leads
        return warned

    def _gap_and_speed(
        self, own: PerceivedObject, car: PerceivedObject
    ) -> tuple[float | None, float]:
        """Gap, None off the host vehicle's path, and speed along its heading."""
        heading = math.atan2(own.state[3], own.state[2])
        cosine, sine = math.cos(heading), math.sin(heading)
        east_m, north_m = car.state[0] - own.state[0], car.state[1] - own.state[1]
        ahead_m = east_m * cosine + north_m * sine
        beside_m = north_m * cosine - east_m * sine
        along_m_s = car.state[2] * cosine + car.state[3] * sine
        if not 0.0 < ahead_m <= _RANGE_M or abs(beside_m) > _LATERAL_LIMIT_M:
            return None, 0.0
        if math.hypot(*car.state[2:]) > 3.0:
            heading_difference_rad = math.atan2(car.state[3], car.state[2]) - heading
            if math.cos(heading_difference_rad) < math.cos(_HEADING_LIMIT_RAD):
                return None, 0.0
        length_m = (self._length_m + DEFAULT_LENGTH_M) / 2.0
        return ahead_m - length_m, max(along_m_s, 0.0)


def _sigma_m_s(own: PerceivedObject, car: PerceivedObject) -> float:
    """Sigma of a car's speed along the host vehicle's heading."""
    heading = math.atan2(own.state[3], own.state[2])
    cosine, sine = math.cos(heading), math.sin(heading)
    (a, b), (_, c) = (row[2:] for row in car.covariance[2:])
    return math.sqrt(max(cosine * cosine * a + 2.0 * cosine * sine * b + sine * sine * c, 0.0))
