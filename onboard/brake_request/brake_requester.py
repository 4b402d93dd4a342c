"""Turns what own sensors show, and what messages tell, into requests to brake.

Braking is requested from the first certain warning on, and repeated at every assessment while that
alarm's danger lasts, at caution level too, as hard as was ever asked for: a vehicle that brakes
enough is warned less, and would otherwise let go and creep on. A request that is not repeated ends
by its validity, so nothing needs to be sent when the program stops.

    state        certain      lasting      none         host_stands  unassessed
    idle         requesting   idle         idle         idle         idle
    requesting   requesting   requesting   idle         idle         idle
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from typing_extensions import override

from onboard.brake_request.certainty import Danger, dangers
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.core import Core
from onboard.observations import Speed
from onboard.risk.alarm import AlarmKey, Assessment, Cause, Level
from onboard.risk.alarm_table import row_of
from onboard.sensors.host_state import BRAKING_SPEED_VALID_S, HostState

VALIDITY_S = 0.3
"""Time for which a request holds: three assessments."""
HOLD_S = 0.5
"""Time for which a request goes on without its danger; shorter than an alarm's release, so that no
request outlasts its alarm."""
OLDEST_S = 0.6
"""Age of its newest observation from which an alarm is no reason to brake."""
STANDS_M_S = 0.3
"""Below this host speed, and so at 1 km/h by OBD, nothing is requested."""
COUNTER_END = 256


class RequestState(StrEnum):
    """Whether braking is requested."""

    IDLE = "idle"
    REQUESTING = "requesting"


class RequestEvent(StrEnum):
    """What an assessment, or its absence, means for a request."""

    CERTAIN = "certain"
    """An alarm is at warning level, and certain enough."""
    LASTING = "lasting"
    """None is, but one that was has been present within `HOLD_S`."""
    NONE = "none"
    """Nothing of that."""
    HOST_STANDS = "host_stands"
    """The host vehicle stands, or its speed is unknown."""
    UNASSESSED = "unassessed"
    """No assessment has come within `VALIDITY_S`."""


TRANSITIONS: Mapping[tuple[RequestState, RequestEvent], RequestState] = {
    (state, event): RequestState.IDLE for state in RequestState for event in RequestEvent
} | {
    (RequestState.IDLE, RequestEvent.CERTAIN): RequestState.REQUESTING,
    (RequestState.REQUESTING, RequestEvent.CERTAIN): RequestState.REQUESTING,
    (RequestState.REQUESTING, RequestEvent.LASTING): RequestState.REQUESTING,
}


@dataclass(frozen=True, slots=True)
class BrakeRequest:
    """Braking that is requested of the vehicle's controller, until it is renewed or too old."""

    kind: ClassVar[str] = "brake_request"
    stamp_s: float
    deceleration_m_s2: float
    """0 ends the request."""
    certainty: float
    """That the danger is real, from 0 to 1."""
    valid_s: float
    """Time from `stamp_s` after which the request is over; 0 if it ends."""
    counter: int
    """Of requests, from 0 to 255 and again."""
    causes: tuple[Cause, ...]
    """Of the alarms behind it, the one that asks for most first; empty if it ends."""


class BrakeRequester(Core):
    """Decides on requests; is given what the alarms rest on, and the time."""

    def __init__(self, settings: BrakeRequestSettings, host: HostState) -> None:
        """Start without a request.

        Args:
            settings: limits, and certainty of the sources.
            host: the host vehicle by its sensors, filled by the caller.
        """
        self._settings = settings
        self.host = host
        self._state = RequestState.IDLE
        self._certain: set[tuple[Cause, str, bool]] = set()
        """Keys of the dangers that were certain in this request."""
        self._hardest_m_s2 = 0.0
        """Braking asked for in this request."""
        self._certainty = 0.0
        self._causes: tuple[Cause, ...] = ()
        self._asked_at_s = -math.inf
        self._valid_until_s = math.inf
        self._counter = 0
        self._events: deque[BrakeRequest] = deque()

    def assess(
        self,
        alarms: Mapping[AlarmKey, Assessment],
        sensed: Mapping[AlarmKey, Assessment],
        now: float,
    ) -> None:
        """Take the last assessments, at 10 Hz or more often.

        Args:
            alarms: those behind the alarms, by all that is known.
            sensed: those of what own sensors alone measure.
            now: the time.
        """
        present = [each for each in dangers(alarms, sensed, self._settings) if _counts(each)]
        certain = {
            each.key
            for each in present
            if each.assessment.level is Level.WARNING
            and each.certainty >= self._settings.least_certainty
        }
        self._certain |= certain
        asking = [each for each in present if each.key in self._certain]
        if asking:
            self._take(asking, now)
        if not self._host_drives(now):
            event = RequestEvent.HOST_STANDS
        elif certain:
            event = RequestEvent.CERTAIN
        else:
            is_held = now - self._asked_at_s <= HOLD_S
            event = RequestEvent.LASTING if is_held else RequestEvent.NONE
        self._receive_event(event, now)

    @override
    def get_timer(self) -> float:
        """Return when the request ends unless it is renewed; `math.inf` without one."""
        return self._valid_until_s

    @override
    def handle_timer(self, now: float) -> None:
        """End a request that is no longer valid."""
        if now >= self._valid_until_s:
            self._receive_event(RequestEvent.UNASSESSED, now)

    @override
    def next_event(self) -> BrakeRequest | None:
        """Return the oldest request not yet taken."""
        return self._events.popleft() if self._events else None

    def _receive_event(self, event: RequestEvent, now: float) -> None:
        before, self._state = self._state, TRANSITIONS[self._state, event]
        if self._state is RequestState.REQUESTING:
            self._valid_until_s = now + VALIDITY_S
            self._put_out(now, self._hardest_m_s2, self._certainty, VALIDITY_S, self._causes)
            return
        self._certain.clear()
        self._hardest_m_s2 = 0.0
        self._valid_until_s = math.inf
        if before is RequestState.REQUESTING:
            self._put_out(now, 0.0, 0.0, 0.0, ())

    def _put_out(
        self,
        now: float,
        deceleration_m_s2: float,
        certainty: float,
        valid_s: float,
        causes: tuple[Cause, ...],
    ) -> None:
        self._events.append(
            BrakeRequest(now, deceleration_m_s2, certainty, valid_s, self._counter, causes)
        )
        self._counter = (self._counter + 1) % COUNTER_END

    def _take(self, asking: Sequence[Danger], now: float) -> None:
        """Take what several dangers ask for together: the hardest braking."""
        asked = sorted(
            ((self._deceleration_m_s2(each), each.cause) for each in asking), reverse=True
        )
        self._hardest_m_s2 = max(self._hardest_m_s2, asked[0][0])
        self._certainty = max(each.certainty for each in asking)
        self._causes = tuple(dict.fromkeys(cause for _, cause in asked))
        self._asked_at_s = now

    def _deceleration_m_s2(self, danger: Danger) -> float:
        asked_m_s2 = danger.assessment.value
        if row_of(danger.cause).is_probability:
            asked_m_s2 = self._settings.crossing_m_s2
        return min(asked_m_s2, self._settings.most_m_s2)

    def _host_drives(self, now: float) -> bool:
        speed = self.host.speed(now, BRAKING_SPEED_VALID_S)
        return speed is not None and speed.speed_m_s >= STANDS_M_S


def _counts(danger: Danger) -> bool:
    """Whether it is one at all, by observations that are not too old."""
    row, assessment = row_of(danger.cause), danger.assessment
    if assessment.level is Level.NONE or assessment.value <= 0.0:
        return False
    if assessment.is_test or not row.may_brake:
        return False
    ages_s = [each.age_s for each in assessment.reasons if each.what != Speed.kind]
    return row.has_known_end or min(ages_s, default=math.inf) <= OLDEST_S
