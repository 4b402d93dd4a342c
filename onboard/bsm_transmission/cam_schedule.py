"""CAM schedule: when the motion changes, 1 to 10 times a second (EN 302 637-2 V1.4.1, 6.1.3).

Parameter names of the standard stand under the constants. In place of `T_GenCam_DCC`, the interval
that congestion control leaves, `hold_until` waits for its gate: a CAM is new when it is sent.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onboard.bsm_transmission.due_time import DueTime
from onboard.kinematics.geodesy import distance_m

MINIMUM_INTERVAL_S = 0.1
"""T_GenCamMin; also T_CheckCamGen, at which the motion is compared."""
MAXIMUM_INTERVAL_S = 1.0
"""T_GenCamMax."""
REPEATED_CAMS = 3
"""N_GenCam: CAMs at the last interval, after which it is the maximum again."""
HEADING_CHANGE_RAD = math.radians(4.0)
POSITION_CHANGE_M = 4.0
SPEED_CHANGE_M_S = 0.5
"""Since the last CAM, any of which is a reason for the next."""

_ROUNDING_S = 1e-6


@dataclass(frozen=True, slots=True)
class Motion:
    """What the schedule compares; `None` stands for what is not known."""

    latitude_deg: float | None
    longitude_deg: float | None
    heading_rad: float | None
    speed_m_s: float | None

    def differs_from(self, before: "Motion") -> bool:
        """Whether it has changed enough for a CAM."""
        return (
            self._turned_rad(before) > HEADING_CHANGE_RAD
            or self._moved_m(before) > POSITION_CHANGE_M
            or _change(self.speed_m_s, before.speed_m_s) > SPEED_CHANGE_M_S
        )

    def _turned_rad(self, before: "Motion") -> float:
        return abs(math.remainder(_change(self.heading_rad, before.heading_rad), math.tau))

    def _moved_m(self, before: "Motion") -> float:
        if (
            self.latitude_deg is None
            or self.longitude_deg is None
            or before.latitude_deg is None
            or before.longitude_deg is None
        ):
            return 0.0
        return distance_m(
            self.latitude_deg, self.longitude_deg, before.latitude_deg, before.longitude_deg
        )


class CamSchedule(DueTime):
    """Decides when to send CAMs; takes the place of a `BsmSchedule`."""

    def __init__(
        self, rng: np.random.Generator, now: float, motion: Callable[[float], Motion]
    ) -> None:
        """Start, as `DueTime`.

        Args:
            rng: draws the first time.
            now: the present time.
            motion: of the host vehicle, at a `now`.
        """
        super().__init__(rng, now, MINIMUM_INTERVAL_S)
        self._motion = motion
        self._sent: Motion | None = None
        self._sent_at = -math.inf
        self._repeated = 0
        self._interval_s = self._max_interval_s = MAXIMUM_INTERVAL_S

    @property
    def interval_s(self) -> float:
        """Time to the next CAM while the motion does not change: T_GenCam."""
        return min(self._interval_s, self._max_interval_s)

    def receive_max_interval(self, max_s: float, now: float) -> None:  # noqa: ARG002 (BsmSchedule's)
        """Limit the interval to `max_s`."""
        self._max_interval_s = max_s

    def receive_remote_vehicle(self, sender: bytes, distance_m: float | None, now: float) -> None:
        """See `BsmSchedule`; the density of vehicles changes nothing."""

    def take_due(self, now: float) -> bool:
        """Return whether a CAM is to be sent now; it then counts as sent."""
        if not self.is_due(now):
            return False
        self._due_at = now + MINIMUM_INTERVAL_S
        motion, elapsed_s = self._motion(now), now - self._sent_at + _ROUNDING_S
        if self._sent is None or self._is_critical or motion.differs_from(self._sent):
            self._interval_s = min(elapsed_s, MAXIMUM_INTERVAL_S)
            self._repeated = 0
        elif elapsed_s < self.interval_s:
            return False
        else:
            self._repeated += 1
            if self._repeated >= REPEATED_CAMS:
                self._interval_s = MAXIMUM_INTERVAL_S
        self._sent, self._sent_at = motion, now
        return True


def _change(one: float | None, other: float | None) -> float:
    """Return the absolute difference; 0 while either is not known."""
    return 0.0 if one is None or other is None else abs(one - other)
