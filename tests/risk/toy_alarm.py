"""A toy alarm: all that a new one needs, its file and its row of the table."""

from typing import ClassVar

from typing_extensions import override

from onboard.observations import Lead
from onboard.risk.alarm import AlarmReason, Assessment, Cause, Level
from onboard.risk.alarm_table import AlarmRow, Headline
from onboard.risk.application import Application, Assessed
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation
from onboard.trace.trace_line import Event

TOY = Cause("toy")
FAST_M_S = 25.0


class ToyAlarm(Application):
    """Whoever drives fast behind a lead vehicle shall brake."""

    cause = TOY
    takes: ClassVar = (Lead,)

    def __init__(self, _settings: RiskSettings) -> None:
        self._lead: Lead | None = None

    @override
    def assess(self, situation: Situation) -> Assessed:
        lead, speed = self._lead, situation.speed
        if lead is None or speed is None or speed.speed_m_s < FAST_M_S:
            return ()
        reason = AlarmReason(lead.kind, lead.identity.value, situation.now - lead.stamp_s)
        return [Assessment(Level.WARNING, 4.0, (reason,))]

    @override
    def receive_event(self, event: Event, situation: Situation) -> Assessed:
        assert isinstance(event, Lead)
        self._lead = event
        return self.assess(situation)


ROW = AlarmRow(ToyAlarm, "You drive fast behind a car", Headline.BRAKE)
