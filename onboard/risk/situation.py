"""All that the applications assess, at one time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from onboard.kinematics.heading import Heading
from onboard.observations import Speed
from onboard.risk.adjacent_lane import AdjacentVehicle, adjacent_vehicles
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.path_ahead import PathAhead
from onboard.risk.signal_intent import NO_SIGNALS, Signals
from onboard.risk.vehicle_motion import VehicleMotion
from onboard.sensors.host_state import HostState
from onboard.tracking.perceived_object import PerceivedObject


@dataclass(frozen=True)
class Situation:
    """The host vehicle, and the vehicles around it."""

    now: float
    host: HostState
    """By the host vehicle's sensors."""
    own_size_m: tuple[float, float]
    """Length and width of the host vehicle."""
    motions: Mapping[str, VehicleMotion]
    """Accelerations of the others and of the host vehicle, by name."""
    bsm_data: BsmDataStore
    """What the others report beside their motion."""
    path: PathAhead
    """The host vehicle's."""
    reaction_s: float | None
    """Median of the driver's reaction times; `None` while few are known."""
    own: PerceivedObject | None = None
    """The host vehicle among the others, by its fixes; `None` without a position, and between
    assessments."""
    others: Sequence[PerceivedObject] = ()
    """The perceived objects, in the same frame, predicted to `now`; none while `own` is `None`."""
    heading: Heading | None = None
    """Of the host vehicle, kept at rest."""
    signals: Signals = NO_SIGNALS
    """Those of intersections."""

    @property
    def speed(self) -> Speed | None:
        """Speed of the host vehicle on its bus; `None` if it is not known."""
        return self.host.speed(self.now)

    @cached_property
    def adjacent_vehicles(self) -> Sequence[AdjacentVehicle]:
        """Those that may be in the lane to which the host vehicle signals.

        Both turn signals at once are the hazard signal, and announce nothing.
        """
        sides = self.host.turn_signals(self.now)
        if self.own is None or len(sides) != 1:
            return ()
        (side,) = sides
        return tuple(
            adjacent_vehicles(
                self.own,
                self.own_size_m[0],
                self.others,
                side,
                path=self.path,
                bsm_data=self.bsm_data,
            )
        )
