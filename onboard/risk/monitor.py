"""The risk monitor: lets each application assess the situation, and raises the alarms that follow.

It ranks the assessments of each application, leaves out those that rest on what is not credible,
and holds the alarms. It knows the applications by their shape alone (`alarm_table.py` lists them).
"""

from collections import deque
from collections.abc import Callable, Generator, Sequence
from operator import attrgetter
from typing import NamedTuple

from typing_extensions import override

from onboard.core import Core
from onboard.kinematics.heading import Heading
from onboard.messages.bsm import BasicSafetyMessage
from onboard.observations import Discarded, Position
from onboard.risk import alarm_table
from onboard.risk.alarm import Alarm, AlarmKey, Assessment, Cause, Level
from onboard.risk.application import Application, Assessed
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.path_ahead import PathAhead
from onboard.risk.raised_alarms import OneAlarm, VehicleAlarms
from onboard.risk.settings import RiskSettings
from onboard.risk.signal_intent import NO_SIGNALS, Signals
from onboard.risk.situation import Situation
from onboard.risk.vehicle_motion import TREND_WINDOW_S, VehicleMotion
from onboard.sensors.host_state import HostState
from onboard.trace.trace_line import Event
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from onboard.tracking.slices import result_of

Admit = Callable[[Cause, Assessment, float], bool]
"""Takes an assessment that calls for an alarm of this cause now; returns whether the observations
behind it may raise one."""


class _Kind(NamedTuple):
    """One kind of alarm."""

    cause: Cause
    application: Application
    alarms: OneAlarm | VehicleAlarms


class RiskMonitor(Core):
    """Receives observations and perceived objects, and reports changes of the alarms."""

    def __init__(
        self,
        settings: RiskSettings,
        length_m: float,
        width_m: float,
        admit: Admit = lambda _cause, _assessment, _now: True,
        host: HostState | None = None,
    ) -> None:
        """Start without alarms.

        Args:
            settings: the thresholds.
            length_m: of the host vehicle.
            width_m: of the host vehicle.
            admit: called at each assessment that calls for an alarm.
            host: the host vehicle by its sensors, filled by the caller; one of its own if not
                given.
        """
        self.host = HostState() if host is None else host
        self._admit = admit
        self._reaction_s: float | None = None
        self._bsm_data = BsmDataStore()
        self._path = PathAhead()
        self._motions: dict[str, VehicleMotion] = {}
        self._own_size_m = length_m, width_m
        self._kinds = [
            _Kind(row.cause, row.application(settings), row.alarms()) for row in alarm_table.ALARMS
        ]
        self._assessments: dict[Cause, list[Assessment]] = {}
        self._events: deque[Alarm | Discarded] = deque(maxlen=1024)

    @property
    def assessments(self) -> dict[AlarmKey, Assessment]:
        """The last of each alarm, by its cause and vehicle, before hysteresis."""
        return {
            (cause, each.vehicle): each
            for cause, found in self._assessments.items()
            for each in found
        }

    def receive_reaction_time(self, reaction_s: float) -> None:
        """Take the median of the driver's reaction times, which sets how early alarms are."""
        self._reaction_s = reaction_s

    def receive_bsm(self, bsm: BasicSafetyMessage, now: float) -> None:
        """Take elevation, size and hard braking of a remote vehicle."""
        self._bsm_data.receive_bsm(bsm, now)

    def receive_event(self, event: Event, now: float) -> bool:
        """Take what arrives between assessments: an observation, or an event of another core.

        Returns:
            whether an application has assessed it at once.
        """
        if isinstance(event, Position):  # elevation and course; the state comes to `assess`
            self._bsm_data.receive_own_elevation(event.altitude_m)
            self._path.receive_position(event)
        takers = [each for each in self._kinds if isinstance(event, each.application.takes)]
        for kind in takers:
            self._judge(kind, kind.application.receive_event(event, self._situation(now)), now)
        return bool(takers)

    def assess(
        self,
        own: PerceivedObject | None,
        objects: Sequence[PerceivedObject],
        now: float,
        signals: Signals = NO_SIGNALS,
        heading: Heading | None = None,
    ) -> None:
        """Assess every cause; to be called at 10 Hz, also when nothing arrives.

        Args:
            own: the host vehicle; `None` without a position.
            objects: the perceived objects, in the same frame, predicted to `now`.
            now: the time.
            signals: those of intersections.
            heading: of the host vehicle, kept at rest.
        """
        result_of(self.assess_in_slices(own, objects, now, signals, heading))

    def assess_in_slices(
        self,
        own: PerceivedObject | None,
        objects: Sequence[PerceivedObject],
        now: float,
        signals: Signals = NO_SIGNALS,
        heading: Heading | None = None,
    ) -> Generator[None, None, None]:
        """Do what `assess` does in slices, between which events may be received."""
        self._bsm_data.drop_old(now)
        others = [] if own is None else [each for each in objects if _is_other(each, own)]
        self._follow([] if own is None else [*others, own], now)
        situation = self._situation(now, own, others, heading, signals)
        for kind in self._kinds:
            yield
            self._judge(kind, kind.application.assess(situation), now)

    @override
    def next_event(self) -> Alarm | Discarded | None:
        """Return the oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _situation(
        self,
        now: float,
        own: PerceivedObject | None = None,
        others: Sequence[PerceivedObject] = (),
        heading: Heading | None = None,
        signals: Signals = NO_SIGNALS,
    ) -> Situation:
        """Return the situation; between assessments no positions are known."""
        return Situation(
            now,
            self.host,
            self._own_size_m,
            self._motions,
            self._bsm_data,
            self._path,
            self._reaction_s,
            own,
            others,
            heading,
            signals,
        )

    def _follow(self, objects: Sequence[PerceivedObject], now: float) -> None:
        """Take the velocities of all objects, the host vehicle included."""
        self._motions = {
            each.name: self._motions.get(each.name) or VehicleMotion(TREND_WINDOW_S)
            for each in objects
        }
        for each in objects:
            _, _, east_m_s, north_m_s = each.state
            self._motions[each.name].receive_velocity(now, now - each.age_s, east_m_s, north_m_s)

    def _judge(self, kind: _Kind, found: Assessed, now: float) -> None:
        """Rank the assessments of one cause, and raise its alarms."""
        assessments: list[Assessment] = []
        for each in found:
            if isinstance(each, Discarded):
                self._events.append(each)
            else:
                assessments.append(each)
        assessments.sort(key=attrgetter("urgency"), reverse=True)
        admitted = (
            each
            for each in assessments
            if each.level is Level.NONE or self._admit(kind.cause, each, now)
        )
        kept = kind.alarms.kept(admitted)
        self._assessments[kind.cause] = kept
        self._events.extend(kind.alarms.receive_assessments(kept, now))


def _is_other(each: PerceivedObject, own: PerceivedObject) -> bool:
    return each.source is not ObjectSource.HOST and each.name != own.name
