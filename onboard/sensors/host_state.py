"""What the host vehicle's sensors tell of it: the last sample of each, as old as a reader allows.

It is filled in one place, and whoever asks says how old the answer may be. How long a speed is
valid stands here, each time with its reason. Cores that need every sample (detectors of braking,
path history) are given the samples themselves.
"""

from collections.abc import Set as AbstractSet
from typing import TypeVar

from onboard.observations import (
    BrakePedal,
    Curvature,
    Position,
    Side,
    Speed,
    Steering,
    TurnSignal,
    YawRate,
)
from onboard.sensors.host_braking import HostBraking
from onboard.sensors.path_curvature import PathCurvature
from onboard.sensors.turn_signals import TurnSignals
from onboard.trace.trace_line import Event

SPEED_VALID_S = 1.0
"""Of a speed that is warned by, sent or followed at: the slowest ECUs answer twice a second, and
one answer may be lost."""
BRAKING_SPEED_VALID_S = 0.5
"""Of a speed that braking is requested by: at 8 m/s^2 it is wrong by 4 m/s by then."""
PEDAL_VALID_S = 1.0
"""Of a brake pedal that is sent: as of the speed beside it."""
YAW_RATE_VALID_S = 0.5
"""Of a yaw rate that shows a turn."""
POSITION_VALID_S = 1.6
"""Of a position that is sent: receivers at 1 Hz deliver late. `sec_mark` is the time of the fix."""
PLACE_VALID_S = 10.0
"""Of a fix by which messages for elsewhere are refused: a car drives some 500 m in it. A tunnel may
lead into another area."""
PREDICTED_POSITION_VALID_S = 1.5
"""Of a fix that a position is predicted from, or that the speed on the bus is compared with."""
HOST_WINDOW_S = 0.5
"""Window of the acceleration that alarms use: steps of 1 km/h are 0.2 m/s^2 over it."""
BRAKING_WINDOW_S = 0.6
"""Window of the driver's braking, the same as that of the vehicle ahead: both lag alike."""


ObservationT = TypeVar("ObservationT", Speed, BrakePedal, Position, YawRate)


class HostState:
    """The last samples, and the acceleration by the speeds."""

    def __init__(self) -> None:
        """Start without samples."""
        self._speed: Speed | None = None
        self._pedal: BrakePedal | None = None
        self._position: Position | None = None
        self._yaw_rate: YawRate | None = None
        self._turn_signals = TurnSignals()
        self._acceleration = HostBraking(HOST_WINDOW_S)
        self._braking = HostBraking(BRAKING_WINDOW_S)
        self._curvature = PathCurvature()

    def receive_observation(self, observation: Event) -> None:
        """Take an observation of the host vehicle's sensors; most kinds change nothing."""
        if isinstance(observation, Speed | YawRate | Steering | Position):
            self._curvature.receive_observation(observation)
        match observation:
            case Speed():
                self._speed = observation
                self._acceleration.receive_speed(observation)
                self._braking.receive_speed(observation)
            case BrakePedal():
                self._pedal = observation
                self._braking.receive_pedal(observation)
            case TurnSignal():
                self._turn_signals.receive_turn_signal(observation)
            case Position():
                self._position = observation
            case YawRate():
                self._yaw_rate = observation

    def speed(self, now: float, valid_s: float = SPEED_VALID_S) -> Speed | None:
        """Return the last speed; `None` if it is older than `valid_s`, or dated ahead by more."""
        return _valid(self._speed, now, valid_s)

    def pedal(self, now: float, valid_s: float = PEDAL_VALID_S) -> BrakePedal | None:
        """Return the last state of the brake pedal, as `speed` does."""
        return _valid(self._pedal, now, valid_s)

    def position(self, now: float, valid_s: float = POSITION_VALID_S) -> Position | None:
        """Return the last fix, as `speed` does."""
        return _valid(self._position, now, valid_s)

    def turn_signals(self, now: float) -> AbstractSet[Side]:
        """Return the sides whose turn signals are on; both are the hazard signal."""
        return self._turn_signals.on(now)

    def curvature(self, now: float) -> Curvature | None:
        """Return the curvature of the path; `None` while nothing measures it."""
        return self._curvature.at(now)

    def yaw_rate(self, now: float, valid_s: float = YAW_RATE_VALID_S) -> YawRate | None:
        """Return the last yaw rate on the bus, as `speed` does."""
        return _valid(self._yaw_rate, now, valid_s)

    def acceleration_m_s2(self, now: float) -> float | None:
        """Return the slope of the speed over `HOST_WINDOW_S`; `None` while unknown."""
        return self._acceleration.acceleration_m_s2(now)

    def braking_m_s2(self, now: float) -> float | None:
        """Return how hard the driver brakes at least, as `HostBraking` does."""
        return self._braking.at_least_m_s2(now)


def _valid(last: ObservationT | None, now: float, valid_s: float) -> ObservationT | None:
    return last if last is not None and abs(now - last.stamp_s) <= valid_s else None
