"""The risk monitor: runs FCW, EEBL, IMA and LCCA warnings, each with its own alarms.

IMA and LTA have an alarm for each vehicle, the others have one at a time. IMA, LTA, EEBL and FCW of
perceived objects need the position of the host vehicle; FCW of the camera's lead vehicle and LCCA
warnings do not.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from typing_extensions import override

from onboard.core import Core
from onboard.kinematics.heading import Heading
from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.lcca import CarId
from onboard.observations import (
    BrakeCause,
    BrakePedal,
    Discarded,
    Lead,
    Position,
    Speed,
    TurnSignal,
)
from onboard.risk.alarm import (
    NOTHING,
    RELEASE_S,
    Alarm,
    AlarmReason,
    Assessment,
    Cause,
    Hysteresis,
    Level,
)
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.driver_reaction import for_driver
from onboard.risk.eebl import assess_eebl
from onboard.risk.expected_stop import RedLight, no_red_light
from onboard.risk.fcw import ForwardCollisionWarning
from onboard.risk.ima import CROSSING_CAUSES, IntersectionMovementAssist
from onboard.risk.path_ahead import PathAhead
from onboard.risk.settings import RiskSettings
from onboard.risk.vehicle_alarms import VehicleAlarms, urgency
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

SPEED_TIMEOUT_S = 1.0
"""Time for which a sample of the host vehicle's speed is valid."""

Permits = Callable[[Cause, Assessment, float], bool]
"""Whether the observations behind an assessment may raise an alarm of this cause now."""


class RiskMonitor(Core):
    """Receives observations and perceived objects, and reports changes of the alarms."""

    def __init__(
        self,
        settings: RiskSettings,
        length_m: float,
        width_m: float,
        permits: Permits = lambda _cause, _assessment, _now: True,
    ) -> None:
        """Start without alarms.

        Args:
            settings: the thresholds.
            length_m: of the host vehicle.
            width_m: of the host vehicle.
            permits: asked at each assessment that calls for an alarm.
        """
        self._permits = permits
        self._settings = settings
        self._fcw_settings = settings.fcw
        """For the driver's own reaction time, if it is known."""
        self._length_m = length_m
        self._speed: Speed | None = None
        self._fcw = ForwardCollisionWarning(settings.fcw, length_m)
        self._ima = IntersectionMovementAssist(
            settings.ima, length_m, width_m, settings.fcw.reaction_s
        )
        self._bsm_data = BsmDataStore()
        self._path = PathAhead()
        self._warnings: dict[tuple[CarId, int], WarningRaised] = {}
        """Of brakings that are not over, by vehicle and sequence number."""
        self._alarms: dict[Cause, Hysteresis] = {
            cause: Hysteresis(cause, RELEASE_S) for cause in Cause if cause not in CROSSING_CAUSES
        }
        self._crossing_alarms = [VehicleAlarms(cause) for cause in CROSSING_CAUSES]
        self._events: deque[Alarm | Discarded] = deque(maxlen=1024)
        self.assessments: dict[tuple[Cause, str], Assessment] = {}
        """The last of each alarm, by its cause and vehicle, before hysteresis."""

    def receive_speed(self, speed: Speed) -> None:
        """Take the host vehicle's speed."""
        self._speed = speed
        self._fcw.receive_speed(speed)
        self._ima.receive_speed(speed)

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """Take the state of the host vehicle's brake pedal."""
        self._fcw.receive_pedal(pedal)

    def receive_turn_signal(self, turn_signal: TurnSignal) -> None:
        """Take a turn signal of the host vehicle."""
        self._ima.receive_turn_signal(turn_signal)

    def receive_reaction_time(self, reaction_s: float) -> None:
        """Take the median of the driver's reaction times, which sets how early alarms are."""
        self._fcw_settings = for_driver(self._settings.fcw, reaction_s)
        self._fcw.settings = self._fcw_settings
        self._ima.reaction_s = self._fcw_settings.reaction_s

    def receive_position(self, position: Position) -> None:
        """Take the host vehicle's elevation and course; its state is given to `assess`."""
        self._bsm_data.receive_own_elevation(position.altitude_m)
        self._path.receive_position(position)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """Take an observation of the lead vehicle, or that there is none."""
        self._fcw.receive_lead(lead, self._fresh_speed(now))
        self._judge(Cause.FCW, self._assess_fcw(now), now)

    def receive_warning(
        self, warning: WarningRaised | WarningLevel | WarningOver, now: float
    ) -> None:
        """Take a warning of the LCCA group, or a change of one."""
        key = warning.origin_id, warning.sequence
        match warning:
            case WarningRaised():
                self._warnings[key] = warning
            case WarningLevel() if key in self._warnings:
                self._warnings[key] = replace(
                    self._warnings[key],
                    cause=warning.cause,
                    deceleration_m_s2=warning.deceleration_m_s2,
                )
            case WarningOver():
                self._warnings.pop(key, None)
        self._judge(Cause.LCCA, self._assess_lcca(now), now)

    def receive_bsm(self, bsm: BasicSafetyMessage, now: float) -> None:
        """Take elevation, size and hard braking of a remote vehicle."""
        self._bsm_data.receive_bsm(bsm, now)

    def assess(
        self,
        own: PerceivedObject | None,
        objects: Sequence[PerceivedObject],
        now: float,
        red_light_m: RedLight = no_red_light,
        heading: Heading | None = None,
    ) -> None:
        """Assess every cause; to be called at 10 Hz, also when nothing arrives.

        Args:
            own: the host vehicle; `None` without a position.
            objects: the perceived objects, in the same frame, predicted to `now`.
            now: the time.
            red_light_m: finds the red signal of a vehicle.
            heading: of the host vehicle, kept at rest.
        """
        self._bsm_data.drop_old(now)
        self._judge(Cause.LCCA, self._assess_lcca(now), now)
        others = [] if own is None else [each for each in objects if _is_other(each, own)]
        speed = self._fresh_speed(now)
        self._fcw.receive_objects(own, others, self._bsm_data, self._path, speed)
        self._judge(Cause.FCW, self._assess_fcw(now), now)
        self._ima.follow([*others, own] if own is not None else [], now)
        if own is None or math.hypot(*own.state[2:]) < self._settings.least_speed_m_s:
            self._judge(Cause.EEBL, NOTHING, now)
        else:
            braking = assess_eebl(
                own,
                others,
                self._bsm_data,
                self._path,
                now,
                own_length_m=self._length_m,
                settings=self._fcw_settings,
            )
            self._judge(Cause.EEBL, self._first_permitted(Cause.EEBL, braking, now), now)
        crossing: dict[Cause, list[Assessment]] = {}
        if own is not None:
            crossing, invalid = self._ima.assess(
                own, others, self._bsm_data, now, red_light_m, heading=heading
            )
            self._events.extend(
                Discarded(now, "risk", "covariance", f"{name}: {error}") for name, error in invalid
            )
        crossing = {
            cause: [
                each
                for each in sorted(found, key=urgency, reverse=True)
                if self._is_permitted(cause, each, now)
            ]
            for cause, found in crossing.items()
        }
        for alarms in self._crossing_alarms:
            self._events.extend(alarms.receive(crossing.get(alarms.cause, ()), now))
        self.assessments = {
            key: each for key, each in self.assessments.items() if key[0] not in CROSSING_CAUSES
        } | {(cause, each.vehicle): each for cause, found in crossing.items() for each in found}

    @override
    def next_event(self) -> Alarm | Discarded | None:
        """Return the oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _judge(self, cause: Cause, assessment: Assessment, now: float) -> None:
        self.assessments[cause, ""] = assessment
        alarm = self._alarms[cause].receive(assessment, now)
        if alarm is not None:
            self._events.append(alarm)

    def _assess_lcca(self, now: float) -> Assessment:
        warnings = sorted(self._warnings.values(), key=_severity, reverse=True)
        assessed = (_assess_warning(each, now) for each in warnings)
        return self._first_permitted(Cause.LCCA, assessed, now)

    def _assess_fcw(self, now: float) -> Assessment:
        speed = self._fresh_speed(now)
        if speed is not None and speed.speed_m_s < self._settings.least_speed_m_s:
            return NOTHING
        return self._first_permitted(Cause.FCW, self._fcw.assess(speed, now), now)

    def _first_permitted(
        self, cause: Cause, assessments: Iterable[Assessment], now: float
    ) -> Assessment:
        return next((each for each in assessments if self._is_permitted(cause, each, now)), NOTHING)

    def _is_permitted(self, cause: Cause, assessment: Assessment, now: float) -> bool:
        return assessment.level is Level.NONE or self._permits(cause, assessment, now)

    def _fresh_speed(self, now: float) -> Speed | None:
        speed = self._speed
        is_fresh = speed is not None and abs(now - speed.stamp_s) <= SPEED_TIMEOUT_S
        return speed if is_fresh else None


def _assess_warning(warning: WarningRaised, now: float) -> Assessment:
    age_s = now - warning.stamp_s + warning.age_s
    reason = AlarmReason(warning.kind, warning.origin_id.hex(), age_s)
    return Assessment(Level.WARNING, warning.deceleration_m_s2, (reason,))


def _severity(warning: WarningRaised) -> tuple[bool, float]:
    return warning.cause is not BrakeCause.TEST, warning.deceleration_m_s2


def _is_other(each: PerceivedObject, own: PerceivedObject) -> bool:
    return each.source is not ObjectSource.HOST and each.name != own.name
