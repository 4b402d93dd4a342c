"""Whether cars could drive as a trace says: how hard they brake, gain speed and jerk, and overlap.

The limits are those of cars, not of drivers: what exceeds them is an error of the trace.
"""

from dataclasses import astuple, dataclass

import numpy as np

from sim_rig.roads.cars import Array
from sim_rig.roads.crashes import boxes_overlap
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory

HARDEST_BRAKING_M_S2 = 10.0
"""Dry asphalt holds a tyre with about its weight."""
HARDEST_GAINING_M_S2 = 6.0
"""From 0 to 100 km/h in less than 5 s."""
HARDEST_JERK_M_S3 = 80.0
"""Brakes build up 8 m/s^2 within 0.1 s at best."""
_OVERLAPS_EVERY_S = 0.5


@dataclass(frozen=True, slots=True)
class Drivability:
    """How many cars of a recording exceed each limit."""

    brake_too_hard: int
    gain_speed_too_fast: int
    jerk: int
    overlap: int
    """Cars that are in the place of another one at some time."""
    cars: int

    @property
    def can_be_driven(self) -> bool:
        """Whether no car exceeds a limit."""
        return not any(astuple(self)[:-1])

    def line(self, origin: str) -> str:
        """Say how many cars fail, and in what; `origin` is where the recording comes from."""
        return (
            f"{origin}: of {self.cars} cars, {self.brake_too_hard} brake harder than"
            f" {HARDEST_BRAKING_M_S2:g} m/s^2, {self.gain_speed_too_fast} gain speed faster than"
            f" {HARDEST_GAINING_M_S2:g} m/s^2, {self.jerk} jerk by more than"
            f" {HARDEST_JERK_M_S3:g} m/s^3, {self.overlap} overlap"
        )


def drivability(recording: RecordedTraffic) -> Drivability:
    """Check every car of a recording."""
    gains = [_gains_m_s2(drive) for drive in recording.drives]
    return Drivability(
        sum(bool((gain < -HARDEST_BRAKING_M_S2).any()) for gain in gains),
        sum(bool((gain > HARDEST_GAINING_M_S2).any()) for gain in gains),
        sum(bool((np.abs(np.diff(gain)) > HARDEST_JERK_M_S3 * STEP_S).any()) for gain in gains),
        len(_overlapping(recording)),
        len(recording.drives),
    )


def _gains_m_s2(drive: Trajectory) -> Array:
    gains_m_s2: Array = np.diff(drive.speed_m_s) / STEP_S
    return gains_m_s2


def _overlapping(recording: RecordedTraffic) -> set[str]:
    times_s = np.arange(0.0, recording.end_s, _OVERLAPS_EVERY_S).tolist()
    return {
        cars.names[at]
        for cars in map(recording.cars_at, times_s)
        for pair in boxes_overlap(cars)
        for at in pair
    }
