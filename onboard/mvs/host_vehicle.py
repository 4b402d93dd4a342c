"""Position and heading of the host vehicle, and the positions of the vehicles that it detects."""

import math
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.acceleration import AccelerationEstimator
from onboard.kinematics.arrays import Array
from onboard.kinematics.heading import Heading, HeadingFilter
from onboard.kinematics.local_frame import LocalFrame
from onboard.mvs.settings import SensingSettings
from onboard.observations import Position, VehicleDetection, YawRate
from onboard.sensors.host_state import PREDICTED_POSITION_VALID_S

MAX_ORIGIN_DISTANCE_M = 5000.0
"""Farther from its origin, the frame is moved: `LocalFrame` is right to 1 cm up to here."""
REPORTED_SPEED_SIGMA_M_S = 0.5
"""Error of the reported velocity of a vehicle, on either axis."""
UNREPORTED_SPEED_SIGMA_M_S = 30.0
"""The same of a vehicle that reports none."""
ACCELERATION_M_S2 = 3.0
"""Acceleration of the host vehicle between two fixes; hard braking is twice this."""
FIXES_WINDOW_S = 0.8
"""Window of the host vehicle's acceleration, by its fixes."""
ACCELERATION_CHANGE_M_S2 = 1.0
"""Change of that acceleration since the middle of the window."""
MAX_HEADING_SIGMA_RAD = 0.35
"""With a less certain heading detections are not used: the error is not linear any more."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportedState:
    """State that a vehicle reports of itself: x as in `kalman.py`, in the host vehicle's frame."""

    stamp_s: float
    state: Array
    """(4)"""
    covariance: Array
    """(4, 4)"""


class HostVehicle:
    """The last fix, the frame around it, and the heading."""

    def __init__(self, settings: SensingSettings) -> None:
        self._settings = settings
        self._fix: Position | None = None
        self._heading = HeadingFilter(settings.velocity_sigma_m_s, settings.heading_sigma_rad)
        self._acceleration = AccelerationEstimator(FIXES_WINDOW_S)
        self._state: ReportedState | None = None
        self.frame: LocalFrame | None = None

    def receive_position(self, fix: Position) -> tuple[Array, Array] | None:
        """Take a fix; one older than the last is ignored.

        Returns:
            turn and shift for everything stored in the old frame, if the frame was moved.
        """
        if self._fix is not None and fix.stamp_s < self._fix.stamp_s:
            return None
        self._fix = fix
        self._heading.receive_position(fix)
        if fix.speed_m_s is not None:
            self._acceleration.receive_speed(fix.stamp_s, fix.speed_m_s)
        here = LocalFrame(fix.latitude_deg, fix.longitude_deg)
        moved = None
        if self.frame is None:
            self.frame = here
        elif self.leaves_frame(fix):
            moved = here.mapping_from(self.frame)
            self.frame = here
        self._state = self.reported_state(fix)
        return moved

    def receive_yaw_rate(self, sample: YawRate) -> None:
        """Take how fast the vehicle turns."""
        self._heading.receive_yaw_rate(sample)

    def leaves_frame(self, fix: Position) -> bool:
        """Whether the frame is moved with this fix."""
        if self.frame is None:
            return False
        place_m = self.frame.position_m(fix.latitude_deg, fix.longitude_deg)
        return math.hypot(*place_m) > MAX_ORIGIN_DISTANCE_M

    @property
    def anchor(self) -> tuple[float, float]:
        """Latitude and longitude of the last fix, in degrees; only with a frame."""
        assert self._fix is not None  # noqa: S101 (a frame comes with a fix)
        return self._fix.latitude_deg, self._fix.longitude_deg

    def has_position(self, at_s: float) -> bool:
        """Whether the last fix is recent enough at `at_s`."""
        fix = self._fix
        return fix is not None and abs(at_s - fix.stamp_s) <= PREDICTED_POSITION_VALID_S

    def heading(self, at_s: float) -> Heading | None:
        """Return the heading; `None` before the first course, or where it is too uncertain."""
        heading = self._heading.at(at_s)
        return None if heading is None or heading.sigma_rad > MAX_HEADING_SIGMA_RAD else heading

    def reported_state(self, fix: Position) -> ReportedState:
        """Return a fix, the host's or a BSM's, as a state in the host vehicle's frame."""
        assert self.frame is not None  # noqa: S101 (callers ask `has_position` first)
        state, covariance = np.zeros(4), np.zeros((4, 4))
        state[:2] = self.frame.position_m(fix.latitude_deg, fix.longitude_deg)
        covariance[0, 0] = covariance[1, 1] = fix.sigma_m**2
        if fix.speed_m_s is None or (fix.course_rad is None and fix.speed_m_s > 1.0):
            covariance[2, 2] = covariance[3, 3] = UNREPORTED_SPEED_SIGMA_M_S**2
        else:
            course_rad = fix.course_rad or 0.0
            state[2:] = (
                fix.speed_m_s * math.sin(course_rad),
                fix.speed_m_s * math.cos(course_rad),
            )
            covariance[2, 2] = covariance[3, 3] = REPORTED_SPEED_SIGMA_M_S**2
        return ReportedState(fix.stamp_s, state, covariance)

    def standing_at(self, place: LocalFrame, now: float) -> ReportedState:
        """Return a sender that does not move, in the host vehicle's frame."""
        assert self.frame is not None  # noqa: S101 (callers ask `has_position` first)
        state = np.zeros(4)
        state[:2] = self.frame.position_m(place.latitude_deg, place.longitude_deg)
        return ReportedState(now, state, np.eye(4))

    def state(self) -> ReportedState | None:
        """Return the host vehicle's state by its last fix."""
        return self._state

    def measure(self, detection: VehicleDetection) -> tuple[Array, Array] | str:
        """Return the position of a detected vehicle's centre.

        Returns:
            position (2) and covariance (2, 2) in the frame, or the reason why there is none:
            `no_position`, `no_heading`.
        """
        if self._fix is None or self._state is None or not self.has_position(detection.stamp_s):
            return "no_position"
        facing = self.heading(detection.stamp_s)
        if facing is None:
            return "no_heading"
        settings = self._settings
        since_fix_s = detection.stamp_s - self._fix.stamp_s
        # Numbers: a dozen of them cost less than one array.
        east_m, north_m, east_m_s, north_m_s = self._state.state.tolist()
        if self._fix.speed_m_s is not None:
            east_m += since_fix_s * east_m_s
            north_m += since_fix_s * north_m_s
        east_m += settings.camera_ahead_m * math.sin(facing.heading_rad)
        north_m += settings.camera_ahead_m * math.cos(facing.heading_rad)

        direction = facing.heading_rad + detection.bearing_rad
        east, north = math.sin(direction), math.cos(direction)
        range_m = detection.range_m + settings.face_to_centre_m
        along_m2 = detection.range_sigma_m**2 + settings.face_to_centre_sigma_m**2
        across_m2 = range_m**2 * (detection.bearing_sigma_rad**2 + facing.sigma_rad**2)
        own_m2 = self._fix.sigma_m**2 + (ACCELERATION_M_S2 * since_fix_s**2 / 2) ** 2
        both_m2 = along_m2 * (east * north) - across_m2 * (north * east)
        covariance = [
            [own_m2 + along_m2 * (east * east) + across_m2 * (north * north), both_m2],
            [both_m2, own_m2 + along_m2 * (north * north) + across_m2 * (east * east)],
        ]
        position_m = east_m + range_m * east, north_m + range_m * north
        return np.array(position_m), np.array(covariance)

    def velocity(self, detection: VehicleDetection) -> tuple[Array, Array] | None:
        """Return the velocity of a detected vehicle by its range rate, for one that is measured.

        Along the line of sight it is the range rate and the host vehicle's velocity; across, it is
        unknown.

        Returns:
            velocity (2) and covariance (2, 2) in the frame; `None` without range rate or velocity.
        """
        fix, facing = self._fix, self.heading(detection.stamp_s)
        if (
            detection.range_rate_m_s is None
            or detection.range_rate_sigma_m_s is None
            or fix is None
            or fix.speed_m_s is None
            or facing is None
            or self._state is None
        ):
            return None
        direction = facing.heading_rad + detection.bearing_rad
        along = np.array([math.sin(direction), math.cos(direction)])
        own = float(along @ self._state.state[2:])
        since_fix_s = detection.stamp_s - fix.stamp_s
        changed_m_s = (self._acceleration.acceleration_m_s2 or 0.0) * since_fix_s
        own += changed_m_s * math.cos(detection.bearing_rad)
        own_variance = self._settings.velocity_sigma_m_s**2
        own_variance += (ACCELERATION_CHANGE_M_S2 * since_fix_s) ** 2
        variance = detection.range_rate_sigma_m_s**2 + own_variance
        across = np.eye(2) - np.outer(along, along)
        covariance = variance * np.outer(along, along) + UNREPORTED_SPEED_SIGMA_M_S**2 * across
        return (detection.range_rate_m_s + own) * along, covariance
