"""Warnings of the simulated drivers, and requests to brake: those of their cars' cores."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from onboard.brake_request.brake_requester import BrakeRequest, BrakeRequester
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.lcca import CarId
from onboard.mvs.perceived_object import PerceivedObject
from onboard.observations import Position, Speed
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings


@dataclass(frozen=True, slots=True)
class DriverWarning:
    """An active warning of one perceived object."""

    cause: Cause
    target: PerceivedObject
    """In the frame of the warned car."""


class WarningModel:
    """The risk monitor of one car, and the active warnings of it and of the warning group."""

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
        self._requester = None if brake_request is None else BrakeRequester(brake_request)
        self._active: dict[Cause, DriverWarning] = {}
        self._brakings: dict[tuple[CarId, int], CarId] = {}

    def receive_speed(self, speed: Speed) -> None:
        """Take a sample of the host vehicle's speed."""
        self._monitor.receive_speed(speed)
        if self._requester is not None:
            self._requester.receive_speed(speed)

    def receive_bsm(self, message: BasicSafetyMessage, now: float) -> None:
        """Take the BSM of a remote vehicle."""
        self._monitor.receive_bsm(message, now)

    @property
    def braking(self) -> list[CarId]:
        """The vehicles whose hard braking the warning group tells the driver of."""
        return list(self._brakings.values())

    def receive_group_warning(self, warning: WarningRaised | WarningLevel | WarningOver) -> None:
        """Take what the warning group says of the braking of a vehicle ahead."""
        braking = warning.origin_id, warning.sequence
        if isinstance(warning, WarningRaised):
            self._brakings[braking] = warning.origin_id
        elif isinstance(warning, WarningOver):
            self._brakings.pop(braking, None)
        if self._requester is not None:
            self._requester.receive_warning(warning)

    def assess(
        self,
        fix: Position | None,
        own: PerceivedObject | None,
        cars: Sequence[PerceivedObject],
        now: float,
    ) -> DriverWarning | None:
        """Evaluate all perceived objects.

        Args:
            fix: the last one of the host vehicle's receiver.
            own: the host vehicle; None without a position.
            cars: its perceived objects.
            now: time of the evaluation.

        Returns:
            An active warning, or None.
        """
        if fix is not None:
            self._monitor.receive_position(fix)
        self._monitor.assess(own, cars, now)
        by_name = {car.name: car for car in cars}
        while (event := self._monitor.next_event()) is not None:
            if isinstance(event, Alarm):
                self._active.pop(event.cause, None)
                named = [by_name[each.name] for each in event.reasons if each.name in by_name]
                if event.level is Level.WARNING:
                    self._active[event.cause] = DriverWarning(event.cause, named[0])
        if self._requester is not None:
            self._requester.assess(self._monitor.assessments, now)
        return next(iter(self._active.values()), None)

    def take_brake_requests(self) -> Iterator[BrakeRequest]:
        """Yield the requests since the last call, the oldest first."""
        while self._requester is not None:
            request = self._requester.next_event()
            if request is None:
                return
            yield request
