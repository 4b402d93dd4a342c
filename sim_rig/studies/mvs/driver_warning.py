"""Warnings of the simulated drivers, and requests to brake: those of their cars' cores."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from onboard.brake_request.brake_requester import BrakeRequest, BrakeRequester
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.observations import Lead, Position, Speed
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.lcca_warning import LCCA
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import PerceivedObject


@dataclass(frozen=True, slots=True)
class DriverWarning:
    """An active warning."""

    cause: Cause
    of: PerceivedObject | Lead | WarningRaised
    """What it warns of: a perceived object in the frame of the warned car, the vehicle ahead of its
    camera, or a vehicle of its warning group."""


class WarningModel:
    """The risk monitor of one car, and its active warnings."""

    def __init__(
        self,
        settings: RiskSettings,
        length_m: float,
        width_m: float,
        brake_request: BrakeRequestSettings | None = None,
    ) -> None:
        """Start without warnings.

        Args:
            settings: of the risk monitor.
            length_m: length of the car.
            width_m: width of the car.
            brake_request: when it requests to brake; never if None.
        """
        self._monitor = RiskMonitor(settings, length_m, width_m)
        self._requester = (
            None if brake_request is None else BrakeRequester(brake_request, self._monitor.host)
        )
        self._active: dict[Cause, DriverWarning] = {}
        self._lead: Lead | None = None
        self._group_warnings: dict[str, WarningRaised] = {}
        self._objects: dict[str, PerceivedObject] = {}

    def receive_speed(self, speed: Speed) -> None:
        """Take a sample of the host vehicle's speed."""
        self._monitor.host.receive_observation(speed)

    def receive_bsm(self, message: BasicSafetyMessage, now: float) -> None:
        """Take the BSM of a remote vehicle."""
        self._monitor.receive_bsm(message, now)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """Take what the camera shows of the vehicle ahead."""
        self._lead = lead
        self._monitor.receive_event(lead, now)

    def receive_group_warning(
        self, warning: WarningRaised | WarningLevel | WarningOver, now: float
    ) -> None:
        """Take what the warning group says of the braking of a vehicle ahead."""
        if isinstance(warning, WarningRaised):
            self._group_warnings[warning.origin_id.hex()] = warning
        self._monitor.receive_event(warning, now)

    def assess(
        self,
        fix: Position | None,
        own: PerceivedObject | None,
        cars: Sequence[PerceivedObject],
        now: float,
    ) -> list[DriverWarning]:
        """Evaluate all perceived objects.

        Args:
            fix: the last one of the host vehicle's receiver.
            own: the host vehicle; None without a position.
            cars: its perceived objects.
            now: time of the evaluation.

        Returns:
            The active warnings, at most one of each cause.
        """
        if fix is not None:
            self._monitor.receive_event(fix, now)
        self._monitor.assess(own, cars, now)
        self._objects |= {car.name: car for car in cars}
        while (event := self._monitor.next_event()) is not None:
            if isinstance(event, Alarm):
                self._active.pop(event.cause, None)
                if event.level is Level.WARNING:
                    self._active[event.cause] = DriverWarning(event.cause, self._of(event))
        self._objects = {car.name: car for car in cars}
        if self._requester is not None:
            self._requester.assess(self._monitor.assessments, now)
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
        while self._requester is not None:
            request = self._requester.next_event()
            if request is None:
                return
            yield request
