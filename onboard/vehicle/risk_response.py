"""What one vehicle does about risk: it warns its driver, and requests to brake.

What own sensors alone show is assessed apart, by a monitor that no message reaches.
"""

from collections.abc import Generator, Sequence

from onboard.brake_request.brake_requester import BrakeRequester
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.kinematics.heading import Heading
from onboard.risk.monitor import Admit, RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.risk.signal_intent import NO_SIGNALS, Signals
from onboard.sensors.host_state import HostState
from onboard.step import HostObservation
from onboard.trace.trace_line import Event
from onboard.tracking.perceived_object import PerceivedObject


class RiskResponse:
    """Lets requests follow the alarms at once; the timers of its cores are handled by others."""

    def __init__(
        self,
        settings: RiskSettings,
        size_m: tuple[float, float],
        host: HostState,
        *,
        brake_request: BrakeRequestSettings | None = None,
        admit: Admit = lambda _cause, _assessment, _now: True,
    ) -> None:
        """Start without alarms.

        Args:
            settings: thresholds of the alarms.
            size_m: length and width of the vehicle.
            host: the vehicle by its sensors, filled by the caller.
            brake_request: when to request braking; `None` for never.
            admit: called at each assessment that calls for an alarm.
        """
        self.monitor = RiskMonitor(settings, *size_m, admit, host)
        self.brake_requester: BrakeRequester | None = None
        self._sensed_monitor: RiskMonitor | None = None
        """Of what own sensors alone show, for requests to brake; its alarms are not put out."""
        if brake_request is not None:
            self.brake_requester = BrakeRequester(brake_request, host)
            self._sensed_monitor = RiskMonitor(settings, *size_m, host=host)

    def receive_reaction_time(self, reaction_s: float) -> None:
        """Take the median of the driver's reaction times, which sets how early alarms are."""
        self.monitor.receive_reaction_time(reaction_s)
        if self._sensed_monitor is not None:
            self._sensed_monitor.receive_reaction_time(reaction_s)

    def receive_observation(self, observation: HostObservation, now: float) -> None:
        """Let the alarms, and what requests braking, take what a sensor of the vehicle measures."""
        if self._sensed_monitor is not None:
            self._sensed_monitor.receive_event(observation, now)
        self.receive_event(observation, now)

    def receive_event(self, event: Event, now: float) -> None:
        """Let the alarms take an observation or an event at once, between assessments."""
        if self.monitor.receive_event(event, now):
            self._request_braking(now)

    def assess_in_slices(
        self,
        own: PerceivedObject | None,
        objects: Sequence[PerceivedObject],
        now: float,
        *,
        heading: Heading | None,
        sensed: Sequence[PerceivedObject] = (),
        signals: Signals = NO_SIGNALS,
    ) -> Generator[None, None, None]:
        """Assess every cause, at 10 Hz, in slices; as `RiskMonitor`.

        `sensed` is what own sensors alone measure, for requests to brake.
        """
        yield from self.monitor.assess_in_slices(own, objects, now, signals, heading)
        if self._sensed_monitor is not None:
            yield
            yield from self._sensed_monitor.assess_in_slices(own, sensed, now, signals, heading)
        self._request_braking(now)

    def _request_braking(self, now: float) -> None:
        if self.brake_requester is not None and self._sensed_monitor is not None:
            sensed = self._sensed_monitor.assessments
            self.brake_requester.assess(self.monitor.assessments, sensed, now)
