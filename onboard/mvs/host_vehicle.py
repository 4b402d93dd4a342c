"""Where the own car is, and from there where the cars are that its camera sees."""

import math
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.kinematics.heading import Heading, HeadingFilter
from onboard.kinematics.local_frame import LocalFrame
from onboard.mvs.settings import SensingSettings
from onboard.observations import Position, VehicleDetection

NEW_ORIGIN_M = 5000.0
"""So far from its origin, the frame is moved along."""
SPEED_SIGMA_M_S = 0.5
"""Of a speed over ground that a car reports of itself, with its course, per axis."""
UNKNOWN_SPEED_SIGMA_M_S = 30.0
ACCELERATION_M_S2 = 3.0
"""What a car may do between two fixes; twice this is hard braking."""
VAGUEST_HEADING_RAD = 0.35
"""With a heading that is less certain, nothing is placed: its error is no small, linear one."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportedState:
    """The state that a car reports of itself: x as in `kalman.py`, in the own car's frame."""

    stamp_s: float
    state: Array
    """(4)"""
    covariance: Array
    """(4, 4)"""


class HostVehicle:
    """The last fix, the frame around it and the heading."""

    def __init__(self, settings: SensingSettings) -> None:
        self._settings = settings
        self._fix: Position | None = None
        self._heading = HeadingFilter(settings)
        self._state: ReportedState | None = None
        self.frame: LocalFrame | None = None

    def receive_position(self, fix: Position) -> tuple[Array, Array] | None:
        """Take a fix; older ones than the last are ignored.

        Returns:
            turn and shift for everything held in the old frame, if the frame has moved.
        """
        if self._fix is not None and fix.stamp_s < self._fix.stamp_s:
            return None
        self._fix = fix
        self._heading.receive_position(fix)
        here = LocalFrame(fix.latitude_deg, fix.longitude_deg)
        moved = None
        if self.frame is None:
            self.frame = here
        elif math.hypot(*self.frame.position_m(*self.anchor)) > NEW_ORIGIN_M:
            moved = here.mapping_from(self.frame)
            self.frame = here
        self._state = self.place(fix)
        return moved

    @property
    def anchor(self) -> tuple[float, float]:
        """Latitude and longitude of the last fix, in degrees; only with a frame."""
        assert self._fix is not None  # noqa: S101 (a frame comes with a fix)
        return self._fix.latitude_deg, self._fix.longitude_deg

    def has_position(self, at_s: float) -> bool:
        """Whether there is a fix that still holds at `at_s`."""
        return self._fix is not None and (
            abs(at_s - self._fix.stamp_s) <= self._settings.position_held_s
        )

    def heading(self, at_s: float) -> Heading | None:
        """Which way it faces; `None` until it has driven, or where that is long ago."""
        heading = self._heading.at(at_s)
        return None if heading is None or heading.sigma_rad > VAGUEST_HEADING_RAD else heading

    def place(self, fix: Position) -> ReportedState:
        """Put a fix, the own or one from a BSM, into the own car's frame."""
        assert self.frame is not None  # noqa: S101 (callers ask `has_position` first)
        state, covariance = np.zeros(4), np.zeros((4, 4))
        state[:2] = self.frame.position_m(fix.latitude_deg, fix.longitude_deg)
        covariance[0, 0] = covariance[1, 1] = fix.sigma_m**2
        if fix.speed_m_s is None or (fix.course_rad is None and fix.speed_m_s > 1.0):
            covariance[2, 2] = covariance[3, 3] = UNKNOWN_SPEED_SIGMA_M_S**2
        else:
            course_rad = fix.course_rad or 0.0
            state[2:] = (
                fix.speed_m_s * math.sin(course_rad),
                fix.speed_m_s * math.cos(course_rad),
            )
            covariance[2, 2] = covariance[3, 3] = SPEED_SIGMA_M_S**2
        return ReportedState(fix.stamp_s, state, covariance)

    def state(self) -> ReportedState | None:
        """The own car at its last fix."""
        return self._state

    def measure(self, seen: VehicleDetection) -> tuple[Array, Array] | str:
        """Place the middle of a car that the camera sees.

        Returns:
            position (2) and covariance (2, 2) in the frame, or the reason why it has none:
            `no_position`, `no_heading`.
        """
        if self._fix is None or self._state is None or not self.has_position(seen.stamp_s):
            return "no_position"
        facing = self.heading(seen.stamp_s)
        if facing is None:
            return "no_heading"
        settings = self._settings
        own = self._state
        since_fix_s = seen.stamp_s - self._fix.stamp_s
        speed = own.state[2:] if self._fix.speed_m_s is not None else np.zeros(2)
        heading = np.array([math.sin(facing.heading_rad), math.cos(facing.heading_rad)])
        camera = own.state[:2] + since_fix_s * speed + settings.camera_ahead_m * heading

        direction = facing.heading_rad + seen.bearing_rad
        along = np.array([math.sin(direction), math.cos(direction)])
        across = np.array([along[1], -along[0]])
        range_m = seen.range_m + settings.face_to_centre_m
        range_variance = seen.range_sigma_m**2 + settings.face_to_centre_sigma_m**2
        bearing_variance = seen.bearing_sigma_rad**2 + facing.sigma_rad**2
        own_variance = self._fix.sigma_m**2 + (ACCELERATION_M_S2 * since_fix_s**2 / 2) ** 2
        covariance = (
            own_variance * np.eye(2)
            + range_variance * np.outer(along, along)
            + range_m**2 * bearing_variance * np.outer(across, across)
        )
        return camera + range_m * along, covariance
