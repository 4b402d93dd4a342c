"""Events of vehicles by DENMs: reported, updated and cancelled; received as what a BSM would say.

Two events are known: hard braking (EN 302 637-3; cause 99, subcause 1) and a vehicle that stands
with its hazard signal on (cause 94). Others are read and not used.
"""

import math
from collections import OrderedDict
from dataclasses import dataclass
from typing import NamedTuple

from onboard.errors import DecodeError
from onboard.its_g5.awareness import ELLIPSE_SIGMAS, path_history_of, path_of
from onboard.its_g5.its_timestamp import timestamp_ms, utc_of
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import (
    ALL_WHEELS,
    BrakeSystemStatus,
    CoreData,
    PositionalAccuracy,
    WheelBrakes,
)
from onboard.messages.bsm_safety import (
    ExteriorLights,
    VehicleEventFlags,
    VehicleSafetyExtensions,
)
from onboard.messages.denm import (
    DANGEROUS_SITUATION,
    DEFAULT_VALIDITY_S,
    EMERGENCY_BRAKE_LIGHTS,
    STATIONARY_VEHICLE,
    ActionId,
    Denm,
    EventLocation,
    Management,
    Notification,
    ReportedEvent,
    Termination,
)
from onboard.messages.its_common import (
    Altitude,
    CauseCode,
    ConfidenceEllipse,
    PathPoint,
    ReferencePosition,
    ReportedHeading,
    ReportedSpeed,
)

STATIONARY_S = 30.0
"""Time at rest with the hazard signal after which a vehicle reports that it stands. Ours."""
AT_REST_M_S = 0.5
CLOCK_TOLERANCE_S = 2.0
"""How far the clock of who reports an event may be ahead; as of signed messages."""
MAX_EVENTS = 1024
"""Events whose last report is known, those received last."""
BRAKING_LASTS_S = 10.0
"""Longest hard braking: to rest from 200 km/h at 5.6 m/s². One detected before is over. Ours."""
_PROBABLE = 4
"""Information quality. Ours."""


class _Kind(NamedTuple):
    """One kind of event."""

    cause: CauseCode
    validity_s: float
    interval_s: float
    """Between two reports."""


BRAKING = _Kind(CauseCode(DANGEROUS_SITUATION, EMERGENCY_BRAKE_LIGHTS), 2.0, 0.1)
STATIONARY = _Kind(CauseCode(STATIONARY_VEHICLE), 5.0, 1.0)


@dataclass(slots=True)
class _Open:
    """An event of the host vehicle that lasts."""

    action: ActionId
    sent_at: float


class EventReports:
    """The host vehicle's own events, by its BSMs."""

    def __init__(self) -> None:
        self._open: dict[_Kind, _Open] = {}
        self._station_id = b""
        self._sequence = 0
        self._rests_since: float | None = None

    def messages(self, bsm: BasicSafetyMessage, now: float, utc_s: float) -> list[Denm]:
        """Return what is to be reported with a BSM at `now`, which is `utc_s` since 1970.

        Without a position there is nothing to report.
        """
        station_id = bsm.core.temporary_id
        if station_id != self._station_id:  # nothing links the events to the pseudonym before
            self._open.clear()
            self._station_id, self._sequence = station_id, int.from_bytes(station_id[:2])
        self._receive_rest(bsm, now)
        stands = self._rests_since is not None and now - self._rests_since >= STATIONARY_S
        found = [
            self._report(kind, bsm, now, utc_s, is_on=is_on)
            for kind, is_on in (
                (BRAKING, _brakes_hard(bsm)),
                (STATIONARY, stands),
            )
        ]
        return [each for each in found if each is not None]

    def _receive_rest(self, bsm: BasicSafetyMessage, now: float) -> None:
        """Keep since when the vehicle has been at rest with its hazard signal on."""
        speed_m_s, lights = bsm.core.speed_m_s, bsm.safety.lights if bsm.safety else None
        if speed_m_s is None or speed_m_s > AT_REST_M_S or lights != ExteriorLights.HAZARD_SIGNAL:
            self._rests_since = None
        elif self._rests_since is None:
            self._rests_since = now

    def _report(
        self, kind: _Kind, bsm: BasicSafetyMessage, now: float, utc_s: float, *, is_on: bool
    ) -> Denm | None:
        if bsm.core.latitude_deg is None or bsm.core.longitude_deg is None:
            return None
        known = self._open.get(kind)
        if not is_on:
            if known is None:
                return None
            del self._open[kind]
            return _denm(kind, known.action, bsm, utc_s, Termination.CANCELLATION)
        if known is None:
            self._sequence = (self._sequence + 1) & 0xFFFF
            known = _Open(ActionId(bsm.core.temporary_id, self._sequence), -math.inf)
            self._open[kind] = known
        elif now - known.sent_at < kind.interval_s - 1e-3:
            return None
        known.sent_at = now
        return _denm(kind, known.action, bsm, utc_s)


class ReceivedEvents:
    """The events of others: each braking once a report, however often that is repeated.

    A repetition of a vehicle that stands says that it still does.
    """

    def __init__(self) -> None:
        """Start with no report."""
        self._reports: OrderedDict[tuple[ActionId, bytes | None], tuple[float, bool]] = (
            OrderedDict()
        )
        """Time of the last report and whether it was the end, by event and signer."""

    def bsm_of(
        self, message: Denm, signer_id: bytes | None, utc_s: float
    ) -> BasicSafetyMessage | None:
        """Return the BSM that says what a DENM says of its sender.

        Args:
            message: as received.
            signer_id: who signed it; `None` if nobody did.
            utc_s: the present time, seconds since 1970.

        Returns:
            `None` for the end of an event and what is older, a braking that was reported before or
            must be over, and other events.

        Raises:
            DecodeError: `another_origin` of an event of somebody else, `contradictory_times`, or
                `expired`.
        """
        management = message.notification.management
        action, now_s = management.action, timestamp_ms(utc_s) / 1e3
        if action.station_id != message.station_id:
            raise DecodeError("another_origin", f"event of {action.station_id.hex()}")
        if not management.detected_s <= management.reference_s <= now_s + CLOCK_TOLERANCE_S:
            ahead_s = management.reference_s - now_s
            raise DecodeError("contradictory_times", f"reported {ahead_s:.3f} s ahead")
        validity_s = management.validity_s
        ends_s = management.detected_s + (DEFAULT_VALIDITY_S if validity_s is None else validity_s)
        if now_s > ends_s:
            raise DecodeError("expired", f"{now_s - ends_s:.3f} s ago")
        report = management.reference_s, management.termination is not None
        last = self._reports.get((action, signer_id), (-math.inf, False))
        if report < last:
            return None
        self._keep((action, signer_id), report)
        situation = message.notification.situation
        if management.termination is not None or situation is None:
            return None
        if situation.event.cause == STATIONARY_VEHICLE:
            return _bsm(message, VehicleEventFlags.HAZARD_LIGHTS, utc_s, speed_m_s=0.0)
        is_new = report != last and now_s - management.detected_s <= BRAKING_LASTS_S
        if situation.event == BRAKING.cause and is_new:
            return _bsm(message, VehicleEventFlags.HARD_BRAKING, utc_of(management.detected_s))
        return None

    def _keep(self, key: tuple[ActionId, bytes | None], report: tuple[float, bool]) -> None:
        self._reports[key] = report
        self._reports.move_to_end(key)
        if len(self._reports) > MAX_EVENTS:
            self._reports.popitem(last=False)


def _brakes_hard(bsm: BasicSafetyMessage) -> bool:
    events = bsm.safety.events if bsm.safety is not None else None
    return events is not None and VehicleEventFlags.HARD_BRAKING in events


def _denm(
    kind: _Kind,
    action: ActionId,
    bsm: BasicSafetyMessage,
    utc_s: float,
    termination: Termination | None = None,
) -> Denm:
    core, now_s = bsm.core, timestamp_ms(utc_s) / 1e3
    semi_major_m, semi_minor_m = core.accuracy.semi_major_m, core.accuracy.semi_minor_m
    ellipse = ConfidenceEllipse(
        None if semi_major_m is None else semi_major_m * ELLIPSE_SIGMAS,
        None if semi_minor_m is None else semi_minor_m * ELLIPSE_SIGMAS,
        core.accuracy.orientation_rad,
    )
    position = ReferencePosition(
        core.latitude_deg, core.longitude_deg, ellipse, Altitude(core.elevation_m)
    )
    management = Management(
        action,
        detected_s=now_s,
        reference_s=now_s,
        termination=termination,
        position=position,
        validity_s=kind.validity_s,
        interval_s=kind.interval_s,
    )
    if termination is not None:
        return Denm(action.station_id, Notification(management))
    location = EventLocation(
        ReportedSpeed(core.speed_m_s),
        ReportedHeading(core.heading_rad),
        (tuple(path_of(bsm)),),
    )
    situation = ReportedEvent(_PROBABLE, kind.cause)
    return Denm(action.station_id, Notification(management, situation, location))


def _bsm(
    message: Denm, event: VehicleEventFlags, there_utc_s: float, speed_m_s: float | None = None
) -> BasicSafetyMessage:
    """Return the BSM of a vehicle where its event is.

    Args:
        message: about the event.
        event: what the BSM says of it.
        there_utc_s: when the vehicle is there.
        speed_m_s: of the vehicle; `None`: what the message says.
    """
    management, location = message.notification.management, message.notification.location
    position, heading_rad = management.position, None
    path: tuple[PathPoint, ...] = ()
    if location is not None:
        if speed_m_s is None and location.speed is not None:
            speed_m_s = location.speed.speed_m_s
        heading_rad = None if location.heading is None else location.heading.heading_rad
        path = location.traces[0]
    ellipse = position.ellipse
    major_m, minor_m = ellipse.semi_major_m, ellipse.semi_minor_m
    is_braking = event is VehicleEventFlags.HARD_BRAKING
    core = CoreData(
        msg_cnt=0,
        temporary_id=message.station_id,
        sec_mark_s=round(there_utc_s * 1e3) % 60_000 / 1e3,
        latitude_deg=position.latitude_deg,
        longitude_deg=position.longitude_deg,
        elevation_m=position.altitude.altitude_m,
        accuracy=PositionalAccuracy(
            None if major_m is None else major_m / ELLIPSE_SIGMAS,
            None if minor_m is None else minor_m / ELLIPSE_SIGMAS,
            ellipse.orientation_rad,
        ),
        speed_m_s=speed_m_s,
        heading_rad=heading_rad,
        brakes=BrakeSystemStatus(ALL_WHEELS if is_braking else WheelBrakes.UNAVAILABLE),
    )
    lights = None if is_braking else ExteriorLights.HAZARD_SIGNAL
    history = None
    if position.latitude_deg is not None and position.longitude_deg is not None:
        history = path_history_of(path, (0.0, 0.0))
    return BasicSafetyMessage(core, VehicleSafetyExtensions(event, history, None, lights))
