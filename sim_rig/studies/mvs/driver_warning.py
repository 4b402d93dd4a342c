"""Warnings of the simulated drivers, and requests to brake: those of their cars' cores."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.kinematics.heading import Heading
from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.observations import Lead
from onboard.risk.alarm import Alarm, AlarmKey, Cause, Level
from onboard.risk.lcca_warning import LCCA
from onboard.risk.settings import RiskSettings
from onboard.sensors.host_state import HostState
from onboard.step import Observation
from onboard.tracking.perceived_object import PerceivedObject
from onboard.tracking.slices import result_of
from onboard.vehicle.risk_response import RiskResponse


@dataclass(frozen=True, slots=True)
class DriverWarning:
    """An active warning."""

    cause: Cause
    of: PerceivedObject | Lead | WarningRaised
    """What it warns of: a perceived object in the frame of the warned car, the lead of its camera,
    or a vehicle of its warning group."""


class WarningModel:
    """The response of one car to risk, and its active warnings."""

    def __init__(
        self,
        settings: RiskSettings,
        length_m: float,
        width_m: float,
        brake_request: BrakeRequestSettings | None = None,
    ) -> None:
        """Start without warnings.

        Args:
            settings: thresholds of the alarms.
            length_m: length of the car.
            width_m: width of the car.
            brake_request: when it requests to brake; never if None.
        """
        self._host = HostState()
        self._response = RiskResponse(
            settings, (length_m, width_m), self._host, brake_request=brake_request
        )
        self._active: dict[AlarmKey, DriverWarning] = {}
        self._lead: Lead | None = None
        self._group_warnings: dict[str, WarningRaised] = {}
        self._objects: dict[str, PerceivedObject] = {}

    def receive_observation(self, observation: Observation, now: float) -> None:
        """Take what a sensor of the host vehicle has measured."""
        if isinstance(observation, Lead):
            self._lead = observation
        self._host.receive_observation(observation)
        self._response.receive_observation(observation, now)

    def receive_bsm(self, message: BasicSafetyMessage, now: float) -> None:
        """Take the BSM of a remote vehicle."""
        self._response.monitor.receive_bsm(message, now)

    def receive_group_warning(
        self, warning: WarningRaised | WarningLevel | WarningOver, now: float
    ) -> None:
        """Take what the warning group says of the braking of a member ahead."""
        if isinstance(warning, WarningRaised):
            self._group_warnings[warning.origin_id.hex()] = warning
        self._response.receive_event(warning, now)

    def assess(
        self,
        own: PerceivedObject | None,
        cars: Sequence[PerceivedObject],
        now: float,
        heading: Heading | None = None,
        sensed: Sequence[PerceivedObject] = (),
    ) -> list[DriverWarning]:
        """Evaluate all perceived objects.

        Args:
            own: the host vehicle; None without a position.
            cars: its perceived objects.
            now: time of the evaluation.
            heading: of the host vehicle, kept at rest.
            sensed: what its own sensors alone measure, for requests to brake.

        Returns:
            The active warnings, at most one of each cause and vehicle.
        """
        result_of(self._response.assess_in_slices(own, cars, now, heading=heading, sensed=sensed))
        self._objects |= {car.name: car for car in cars}
        while (event := self._response.monitor.next_event()) is not None:
            if isinstance(event, Alarm):
                self._active.pop(event.key, None)
                if event.level is Level.WARNING:
                    self._active[event.key] = DriverWarning(event.cause, self._of(event))
        self._objects = {car.name: car for car in cars}
        return list(self._active.values())

    def _of(self, alarm: Alarm) -> PerceivedObject | Lead | WarningRaised:
        """What an alarm is about, by the first of its reasons that says so."""
        known: dict[str, PerceivedObject | WarningRaised] = {}
        known |= self._group_warnings if alarm.cause == LCCA else self._objects
        named = [known[reason.name] for reason in alarm.reasons if reason.name in known]
        if named:
            return named[0]
        assert self._lead is not None  # noqa: S101 (no other reason is left)
        return self._lead

    def take_brake_requests(self) -> Iterator[BrakeRequest]:
        """Yield the requests since the last call, the oldest first."""
        requester = self._response.brake_requester
        if requester is not None:
            yield from iter(requester.next_event, None)
