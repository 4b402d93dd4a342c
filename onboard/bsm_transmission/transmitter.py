"""What the car says of itself ten times a second: its BSM, put together from what it knows.

A car without GNSS sends one all the same: speed, size and hard braking are known, the position is
said to be unavailable (docs/decisions/0003).
"""

import math

import numpy as np

from onboard.bsm_transmission.path_history import PathHistoryKeeper
from onboard.bsm_transmission.path_prediction import STANDING_M_S, PathPredictor
from onboard.bsm_transmission.schedule import BsmSchedule
from onboard.kinematics.acceleration import AccelerationEstimator
from onboard.kinematics.geodesy import distance_m
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import (
    AccelerationSet,
    BrakeSystemStatus,
    CoreData,
    PositionalAccuracy,
    VehicleSize,
    WheelBrakes,
)
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.observations import BrakePedal, HardBrake, Position, Speed
from onboard.security.pseudonyms import Pseudonym

FRESH_S = 1.0
"""A speed or pedal older than this is said to be unavailable."""

POSITION_FRESH_S = 1.6
"""The same for a position: a receiver with one fix a second is late with it. The BSM says when it
was taken."""

FIX_SPEED_S = 0.25
"""Up to this age the fix's speed is told; then the bus's, which is rounded but of now."""

HARD_BRAKING_S = 1.0
"""How long the event flag stays up after the detector's certainty, which comes once a braking."""

UNKNOWN_SIGMA_M = 5.0
"""Of a position whose sender does not know it: an ordinary receiver in the open."""

ACCELERATION_WINDOW_S = 0.8
"""A line through speeds in whole km/h, twenty a second, is then steep to within 0.1 m/s^2 (rms)."""

ALL_WHEELS = (
    WheelBrakes.LEFT_FRONT | WheelBrakes.LEFT_REAR | WheelBrakes.RIGHT_FRONT
    | WheelBrakes.RIGHT_REAR
)  # fmt: skip

MESSAGE_COUNTS = 128


class BsmTransmitter:
    """Composes BSMs when they are due."""

    def __init__(
        self,
        size: VehicleSize,
        who: Pseudonym,
        rng: np.random.Generator,
        now: float,
    ) -> None:
        self._size = size
        self._schedule = BsmSchedule(rng, now)
        self._speed: Speed | None = None
        self._trend = AccelerationEstimator(ACCELERATION_WINDOW_S)
        self._pedal: BrakePedal | None = None
        self._path = PathHistoryKeeper()
        self._predictor = PathPredictor()
        self._position: Position | None = None
        self._braking_until = -math.inf
        self.change_identity(who)

    def change_identity(self, who: Pseudonym) -> None:
        """Go by another temporary ID, and count from elsewhere: nothing links to the old one."""
        self._temporary_id = who.temporary_id
        self._msg_cnt = who.first_msg_cnt

    def receive_speed(self, speed: Speed) -> None:
        """The own speed."""
        self._speed = speed
        self._trend.receive(speed.stamp_s, speed.speed_m_s)

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """The own brake pedal, where the car tells it."""
        self._pedal = pedal

    def receive_position(self, position: Position) -> None:
        """The own position."""
        self._position = position
        self._path.receive_position(position)
        self._predictor.receive_position(position)

    def receive_hard_brake(self, brake: HardBrake, now: float) -> None:
        """The own car brakes hard: the next BSM says so, and is due at once."""
        self._braking_until = brake.stamp_s + HARD_BRAKING_S
        self._schedule.receive_event_flags(self._is_braking(now), now)

    def receive_remote_vehicle(self, sender: bytes, position: Position | None, now: float) -> None:
        """A BSM of another car came: many of them from near make ours rarer."""
        away_m = None
        if position is not None and self._position is not None:
            own = self._position
            away_m = distance_m(
                own.latitude_deg, own.longitude_deg, position.latitude_deg, position.longitude_deg
            )
        self._schedule.receive_remote_vehicle(sender, away_m, now)

    def receive_longest_interval(self, longest_s: float, now: float) -> None:
        """How far apart BSMs may be at most (`onboard/access`)."""
        self._schedule.receive_longest_interval(longest_s, now)

    def get_timer(self) -> float:
        """When the next BSM is due, or the density is looked at."""
        return self._schedule.get_timer()

    def handle_timer(self, now: float) -> None:
        """Look at the density."""
        self._schedule.receive_event_flags(self._is_braking(now), now)
        self._schedule.handle_timer(now)

    def take_due(self, now: float) -> bool:
        """Whether a BSM is to be sent now; `bsm` then makes it."""
        return self._schedule.take_due(now)

    def bsm(
        self, footer: bytes | None, now: float, utc_s: float, held_heading_rad: float | None = None
    ) -> BasicSafetyMessage:
        """The next BSM.

        Args:
            footer: rides on it.
            now: the same moment as `utc_s`.
            utc_s: in seconds since 1970.
            held_heading_rad: which way the car faces, told while it stands.
        """
        self._msg_cnt = (self._msg_cnt + 1) % MESSAGE_COUNTS
        events = VehicleEventFlags.HARD_BRAKING if self._is_braking(now) else None
        path, prediction = None, None
        if self._fix(now) is not None:
            path, prediction = self._path.history(now), self._predictor.prediction
        safety = None
        if events or path or prediction:
            safety = VehicleSafetyExtensions(events, path, prediction)
        core = self._core(now, utc_s - now, held_heading_rad)
        return BasicSafetyMessage(core, safety, footer=footer)

    def _core(self, now: float, utc_offset_s: float, held_heading_rad: float | None) -> CoreData:
        speed = self._speed if _is_fresh(self._speed, now) else None
        fix = self._fix(now)
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
            heading_rad=held_heading_rad if _stands(fix) else fix.course_rad,
            acceleration=acceleration,
            brakes=self._brakes(now),
            size=self._size,
        )

    def _speed_m_s(self, fix: Position, speed: Speed | None, now: float) -> float | None:
        is_better = fix.speed_m_s is None or now - fix.stamp_s > FIX_SPEED_S
        return speed.speed_m_s if speed is not None and is_better else fix.speed_m_s

    def _fix(self, now: float) -> Position | None:
        return self._position if _is_fresh(self._position, now, POSITION_FRESH_S) else None

    def _brakes(self, now: float) -> BrakeSystemStatus:
        if self._pedal is None or not _is_fresh(self._pedal, now):
            return BrakeSystemStatus()
        return BrakeSystemStatus(ALL_WHEELS if self._pedal.pressed else WheelBrakes(0))

    def _is_braking(self, now: float) -> bool:
        return now < self._braking_until


def position_in(core: CoreData, now: float, utc_offset_s: float) -> Position | None:
    """Where the sender of a BSM says it is, on our own clock; `None` if it does not say.

    A BSM says the second of the minute only; of all minutes, the one nearest to now is meant.
    """
    if core.latitude_deg is None or core.longitude_deg is None or core.sec_mark_s is None:
        return None
    behind_s = (now + utc_offset_s - core.sec_mark_s + 30.0) % 60.0 - 30.0
    sigma_m = core.accuracy.semi_major_m
    return Position(
        stamp_s=now - behind_s,
        latitude_deg=core.latitude_deg,
        longitude_deg=core.longitude_deg,
        altitude_m=core.elevation_m,
        sigma_m=sigma_m if sigma_m is not None else UNKNOWN_SIGMA_M,
        speed_m_s=core.speed_m_s,
        course_rad=core.heading_rad,
    )


def _stands(fix: Position) -> bool:
    return fix.speed_m_s is not None and fix.speed_m_s < STANDING_M_S


def _sec_mark_s(utc_s: float) -> float:
    """Within the minute, in whole ms: 60.000 s and on would be a leap second."""
    return round(utc_s * 1e3) % 60_000 / 1e3


def _is_fresh(
    observation: Speed | BrakePedal | Position | None, now: float, limit_s: float = FRESH_S
) -> bool:
    return observation is not None and now - observation.stamp_s <= limit_s
