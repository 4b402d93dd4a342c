"""Composes the host vehicle's BSM from its sensors.

Without GNSS a BSM is sent as well: with speed, size and hard braking, and with its position as
unavailable (docs/design/messages.md, "BSM without a position").
"""

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet

import numpy as np
from typing_extensions import override

from onboard.bsm_transmission.cam_schedule import CamSchedule, Motion
from onboard.bsm_transmission.path_history import PathHistoryKeeper
from onboard.bsm_transmission.path_prediction import PathPredictor
from onboard.bsm_transmission.schedule import BsmSchedule
from onboard.core import Core
from onboard.kinematics.acceleration import AccelerationEstimator
from onboard.kinematics.course_rate import STANDSTILL_M_S
from onboard.kinematics.geodesy import distance_m
from onboard.kinematics.units import STANDARD_GRAVITY_M_S2
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import (
    ALL_WHEELS,
    AccelerationSet,
    BrakeSystemStatus,
    CoreData,
    PositionalAccuracy,
    VehicleSize,
    WheelBrakes,
)
from onboard.messages.bsm_safety import (
    ExteriorLights,
    VehicleEventFlags,
    VehicleSafetyExtensions,
)
from onboard.messages.message_frame import MESSAGE_COUNTS
from onboard.observations import (
    BrakeCause,
    HardBrake,
    Position,
    Side,
    Speed,
)
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState

MAX_FIX_SPEED_AGE_S = 0.25
"""Age up to which the speed of the fix is sent; then the bus speed, rounded but newer."""

HARD_BRAKING_M_S2 = 0.4 * STANDARD_GRAVITY_M_S2
"""Deceleration from which the flag of hard braking is set (SAE J2945/1)."""

STANDSTILL_S = 1.5
"""Time at standstill after which it is not: receivers compare it with the speeds of the last 2 s,
and what caused it may last."""

EVENT_FLAGS: Mapping[BrakeCause, VehicleEventFlags] = {
    BrakeCause.HAZARD_LIGHTS: VehicleEventFlags.HAZARD_LIGHTS,
    BrakeCause.STABILITY_CONTROL: VehicleEventFlags.STABILITY_CONTROL_ACTIVATED,
    BrakeCause.ABS: VehicleEventFlags.ABS_ACTIVATED,
    BrakeCause.AIRBAG: VehicleEventFlags.AIR_BAG_DEPLOYMENT,
}
"""Flags of causes, beside that of hard braking; set while the event lasts (SAE J2735)."""

DEFAULT_SIGMA_M = 5.0
"""Sigma of a position without accuracy: an ordinary receiver under open sky."""

ACCELERATION_WINDOW_S = 0.8
"""Window of the slope of speed: 0.1 m/s^2 rms error for whole km/h at 20 Hz."""


class BsmTransmitter(Core):
    """Decides when a BSM is due, and composes it."""

    def __init__(
        self,
        size: VehicleSize,
        pseudonym: Pseudonym,
        rng: np.random.Generator,
        now: float,
        host: HostState,
        *,
        triggered: bool = False,
    ) -> None:
        """Start the schedule.

        Args:
            size: of the host vehicle.
            pseudonym: gives temporary ID and first message count.
            rng: for the schedule's jitter.
            now: the present time.
            host: the host vehicle by its sensors, filled by the caller. What is too old there is
                sent as unavailable.
            triggered: send when the motion changes, as CAMs are, and not at a rate.
        """
        self._size = size
        self._host = host
        self._schedule: BsmSchedule | CamSchedule = (
            CamSchedule(rng, now, self._motion) if triggered else BsmSchedule(rng, now)
        )
        self._trend = AccelerationEstimator(ACCELERATION_WINDOW_S)
        self._predictor = PathPredictor()
        self._brake: HardBrake | None = None
        self._stopped_at: float | None = None
        self._take_identity(pseudonym)

    def change_identity(self, pseudonym: Pseudonym, now: float) -> None:
        """Change temporary ID and message count, and begin path history and schedule anew.

        Nothing links to the old pseudonym: where it drove, least of all.
        """
        self._take_identity(pseudonym)
        self._schedule.begin_anew(now)

    def _take_identity(self, pseudonym: Pseudonym) -> None:
        self._temporary_id = pseudonym.temporary_id
        self._msg_cnt = pseudonym.first_msg_cnt
        self._path = PathHistoryKeeper()

    def receive_speed(self, speed: Speed) -> None:
        """Take a sample of the host vehicle's speed, for the acceleration."""
        self._trend.receive_speed(speed.stamp_s, speed.speed_m_s)
        if speed.speed_m_s >= STANDSTILL_M_S:
            self._stopped_at = None
        elif self._stopped_at is None:
            self._stopped_at = speed.stamp_s

    def receive_position(self, position: Position) -> None:
        """Take a fix of the host vehicle, for its path."""
        self._path.receive_position(position)
        self._predictor.receive_position(position)

    def receive_hard_brake(self, brake: HardBrake, now: float) -> None:
        """Take a change of hard braking: a BSM with the first flag is due at once.

        The driver's button is no event: it sets no flag, and ends none.
        """
        if brake.cause is BrakeCause.TEST:
            return
        self._brake = None if brake.is_over else brake
        self._schedule.receive_event_flags(bool(self._event_flags(now)), now)

    def receive_remote_vehicle(self, sender: bytes, position: Position | None, now: float) -> None:
        """Count a received BSM for the vehicle density.

        Args:
            sender: temporary ID.
            position: of the sender; `None` if unknown.
            now: the present time.
        """
        range_m = None
        own = self._host.position(now, math.inf)  # what has been near remains so for a while
        if position is not None and own is not None:
            range_m = distance_m(
                own.latitude_deg, own.longitude_deg, position.latitude_deg, position.longitude_deg
            )
        self._schedule.receive_remote_vehicle(sender, range_m, now)

    def hold_until(self, at: float) -> None:
        """Send no earlier than at `at`, unless there is a critical event."""
        self._schedule.hold_until(at)

    def receive_max_interval(self, max_s: float, now: float) -> None:
        """Limit the interval of BSMs (`onboard/access`)."""
        self._schedule.receive_max_interval(max_s, now)

    @override
    def get_timer(self) -> float:
        """Return the time of the next BSM or density measurement."""
        return self._schedule.get_timer()

    @override
    def handle_timer(self, now: float) -> None:
        """Measure the density if that is due."""
        self._schedule.receive_event_flags(bool(self._event_flags(now)), now)
        self._schedule.handle_timer(now)

    def is_due(self, now: float) -> bool:
        """Whether `take_due` is to be asked."""
        return self._schedule.is_due(now)

    def take_due(self, now: float) -> bool:
        """Return whether a BSM is to be sent now; `bsm` composes it."""
        return self._schedule.take_due(now)

    def _motion(self, now: float) -> Motion:
        speed, fix = self._host.speed(now), self._host.position(now)
        if fix is None:
            return Motion(None, None, None, speed.speed_m_s if speed else None)
        heading_rad = None if _is_at_standstill(fix) else fix.course_rad
        return Motion(
            fix.latitude_deg, fix.longitude_deg, heading_rad, self._speed_m_s(fix, speed, now)
        )

    def bsm(
        self, footer: bytes | None, now: float, utc_s: float, held_heading_rad: float | None = None
    ) -> BasicSafetyMessage:
        """Compose the next BSM.

        Args:
            footer: the MVS footer.
            now: the present time, the same as `utc_s`.
            utc_s: the present time in seconds since 1970.
            held_heading_rad: heading to send at standstill, clockwise from true north.
        """
        self._msg_cnt = (self._msg_cnt + 1) % MESSAGE_COUNTS
        events = self._event_flags(now) or None
        path, prediction = None, None
        if self._host.position(now) is not None:
            path, prediction = self._path.history(now), self._predictor.prediction
        lights = _lights(self._host.turn_signals(now))
        safety = None
        if events or path or prediction or lights:
            safety = VehicleSafetyExtensions(events, path, prediction, lights)
        core = self._core(now, utc_s - now, held_heading_rad)
        return BasicSafetyMessage(core, safety, footer=footer)

    def _core(self, now: float, utc_offset_s: float, held_heading_rad: float | None) -> CoreData:
        speed, fix = self._host.speed(now), self._host.position(now)
        acceleration = AccelerationSet(
            longitudinal_m_s2=self._trend.acceleration_m_s2 if speed else None,
            yaw_rate_rad_s=(self._predictor.yaw_rate_rad_s if fix else None) or 0.0,
        )
        if fix is None:
            return CoreData(
                self._msg_cnt,
                self._temporary_id,
                sec_mark_s=_sec_mark_s(now + utc_offset_s),
                speed_m_s=speed.speed_m_s if speed else None,
                acceleration=acceleration,
                brakes=self._brakes(now),
                size=self._size,
            )
        return CoreData(
            self._msg_cnt,
            self._temporary_id,
            sec_mark_s=_sec_mark_s(fix.stamp_s + utc_offset_s),
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            elevation_m=fix.altitude_m,
            accuracy=PositionalAccuracy(fix.sigma_m, fix.sigma_m, 0.0),
            speed_m_s=self._speed_m_s(fix, speed, now),
            heading_rad=held_heading_rad if _is_at_standstill(fix) else fix.course_rad,
            acceleration=acceleration,
            brakes=self._brakes(now),
            size=self._size,
        )

    def _speed_m_s(self, fix: Position, speed: Speed | None, now: float) -> float | None:
        is_better = fix.speed_m_s is None or now - fix.stamp_s > MAX_FIX_SPEED_AGE_S
        return speed.speed_m_s if speed is not None and is_better else fix.speed_m_s

    def _brakes(self, now: float) -> BrakeSystemStatus:
        pedal = self._host.pedal(now)
        if pedal is None:
            return BrakeSystemStatus()
        return BrakeSystemStatus(ALL_WHEELS if pedal.pressed else WheelBrakes(0))

    def _event_flags(self, now: float) -> VehicleEventFlags:
        brake = self._brake
        if brake is None:
            return VehicleEventFlags(0)
        flags = EVENT_FLAGS.get(brake.cause, VehicleEventFlags(0))
        is_stopped = self._stopped_at is not None and now > self._stopped_at + STANDSTILL_S
        if brake.deceleration_m_s2 >= HARD_BRAKING_M_S2 and not is_stopped:
            flags |= VehicleEventFlags.HARD_BRAKING
        return flags


def position_in(core: CoreData, now: float, utc_offset_s: float) -> Position | None:
    """Return the position in a BSM on the monotonic clock; `None` if it has none.

    `sec_mark` is within a minute; the minute nearest to now is assumed.

    Args:
        core: Part I of the BSM.
        now: the present time.
        utc_offset_s: UTC less the monotonic clock.
    """
    if core.latitude_deg is None or core.longitude_deg is None or core.sec_mark_s is None:
        return None
    age_s = (now + utc_offset_s - core.sec_mark_s + 30.0) % 60.0 - 30.0
    sigma_m = core.accuracy.semi_major_m
    return Position(
        stamp_s=now - age_s,
        latitude_deg=core.latitude_deg,
        longitude_deg=core.longitude_deg,
        altitude_m=core.elevation_m,
        sigma_m=sigma_m if sigma_m is not None else DEFAULT_SIGMA_M,
        speed_m_s=core.speed_m_s,
        course_rad=core.heading_rad,
    )


def _is_at_standstill(fix: Position) -> bool:
    return fix.speed_m_s is not None and fix.speed_m_s < STANDSTILL_M_S


def _lights(on: AbstractSet[Side]) -> ExteriorLights | None:
    """Return the turn signals, both as the hazard signal; of other lights nothing is known."""
    if len(on) == 2:
        return ExteriorLights.HAZARD_SIGNAL
    if "left" in on:
        return ExteriorLights.LEFT_TURN_SIGNAL
    return ExteriorLights.RIGHT_TURN_SIGNAL if on else None


def _sec_mark_s(utc_s: float) -> float:
    """Return the time within the minute in whole ms; 60.000 s and above would be a leap second."""
    return round(utc_s * 1e3) % 60_000 / 1e3
