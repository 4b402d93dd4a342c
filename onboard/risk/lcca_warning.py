"""LCCA warning: a member ahead in the warning group brakes hard, until that is over.

Who stands or crawls is not warned: there is nothing to brake. A test of the button is shown anyway.
"""

from dataclasses import replace
from typing import ClassVar

from typing_extensions import override

from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.messages.lcca import CarId
from onboard.observations import BrakeCause
from onboard.risk.alarm import AlarmReason, Assessment, Cause, Level
from onboard.risk.application import Application, Assessed
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation
from onboard.trace.trace_line import Event

LCCA = Cause("lcca")
CRAWLING_M_S = 2.0
"""Below this host speed there is no warning: in a jam others brake all the time."""


class LccaWarning(Application):
    """Warns of each braking that is not over; needs no position."""

    cause = LCCA
    takes: ClassVar = (WarningRaised, WarningLevel, WarningOver)

    def __init__(self, _settings: RiskSettings) -> None:
        """Start without a warning; no setting has a part in it."""
        self._warnings: dict[tuple[CarId, int], WarningRaised] = {}
        """Of brakings that are not over, by vehicle and sequence number."""

    @override
    def assess(self, situation: Situation) -> Assessed:
        """Assess the brakings that are not over."""
        speed = situation.speed
        is_slow = speed is not None and speed.speed_m_s < CRAWLING_M_S
        return [
            _assess(each, situation.now)
            for each in self._warnings.values()
            if not is_slow or each.cause is BrakeCause.TEST
        ]

    @override
    def receive_event(self, event: Event, situation: Situation) -> Assessed:
        """Take a warning of the group, or a change of one."""
        match event:
            case WarningRaised():
                self._warnings[event.origin_id, event.sequence] = event
            case WarningLevel(origin_id=origin_id, sequence=sequence):
                before = self._warnings.get((origin_id, sequence))
                if before is not None:
                    self._warnings[origin_id, sequence] = replace(
                        before,
                        cause=event.cause,
                        deceleration_m_s2=event.deceleration_m_s2,
                    )
            case WarningOver():
                self._warnings.pop((event.origin_id, event.sequence), None)
        return self.assess(situation)


def _assess(warning: WarningRaised, now: float) -> Assessment:
    age_s = now - warning.stamp_s + warning.age_s
    reason = AlarmReason(warning.kind, warning.origin_id.hex(), age_s)
    return Assessment(
        Level.WARNING,
        warning.deceleration_m_s2,
        (reason,),
        is_test=warning.cause is BrakeCause.TEST,
    )
