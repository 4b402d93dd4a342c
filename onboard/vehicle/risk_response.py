"""What one vehicle does about risk: it warns its driver, and requests to brake."""

from collections.abc import Sequence

from onboard.brake_request.brake_requester import BrakeRequester
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.kinematics.heading import Heading
from onboard.risk.expected_stop import RedLight, no_red_light
from onboard.risk.monitor import Permits, RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.sensors.host_state import HostState
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
        permits: Permits = lambda _cause, _assessment, _now: True,
    ) -> None:
        """Start without alarms.

        Args:
            settings: thresholds of the alarms.
            size_m: length and width of the vehicle.
            host: the vehicle by its sensors, filled by the caller.
            brake_request: when to request braking; `None` for never.
            permits: asked at each assessment that calls for an alarm.
        """
        self.monitor = RiskMonitor(settings, *size_m, permits, host)
        self.brake_requester = (
            None if brake_request is None else BrakeRequester(brake_request, host)
        )

    def receive_event(self, event: Event, now: float) -> None:
        """Let the alarms take an observation or an event at once, between assessments."""
        if self.monitor.receive_event(event, now):
            self._request_braking(now)

    def assess(
        self,
        own: PerceivedObject | None,
        objects: Sequence[PerceivedObject],
        now: float,
        *,
        heading: Heading | None,
        red_light_m: RedLight = no_red_light,
    ) -> None:
        """Assess every cause, at 10 Hz; as `RiskMonitor`."""
        self.monitor.assess(own, objects, now, red_light_m, heading)
        self._request_braking(now)

    def _request_braking(self, now: float) -> None:
        if self.brake_requester is not None:
            self.brake_requester.assess(self.monitor.assessments, now)
