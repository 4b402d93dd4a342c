"""Data of BSMs beside the motion of the sender: elevation, size, hard braking, path history."""

import math
from collections.abc import ItemsView
from dataclasses import dataclass

from onboard.kinematics.heading import Heading
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_safety import ExteriorLights, VehicleEventFlags
from onboard.tracking.perceived_object import PerceivedObject

DEFAULT_LENGTH_M, DEFAULT_WIDTH_M = 5.0, 1.75
"""Size of a vehicle that does not report it: a large car."""
HEADING_SIGMA_RAD = 0.1
"""Of the heading that a slow vehicle reports."""
BRIDGE_M = 3.5
"""A crossing vehicle whose elevation differs by more is on a bridge over the host's road, or under
it: bridges have a clearance above 4 m, receivers a sigma of about 0.7 m."""
DECK_M = 6.0
"""A vehicle that drives the host's way is on another deck if its elevation differs by more: roads
above roads are rarer than receivers whose heights are metres apart."""
SLOPE = 0.015
"""Added to both for each metre that both have to go: roads slope. With 0.02, receivers whose
heights err by metres took a bridge 7 m up for a crossing (scenario `bridge`)."""

_TIMEOUT_S = 5.0
"""Time for which elevation and size of a vehicle are kept after its last BSM."""
_NEW_ELEVATION_WEIGHT = 0.1
"""Weight of a new elevation in the running mean: at 10 Hz, a mean of about a second."""


@dataclass(frozen=True, slots=True)
class BsmData:
    """Data of one vehicle's BSMs."""

    received_s: float
    elevation_m: float | None
    """Running mean."""
    length_m: float | None
    width_m: float | None
    braked_hard_s: float
    """Time of the last BSM with the hard braking flag; `-math.inf` if there was none."""
    last: BasicSafetyMessage


class BsmDataStore:
    """The data of all remote vehicles, and the host vehicle's elevation to compare with."""

    def __init__(self) -> None:
        self._of: dict[str, BsmData] = {}
        self._own_elevation_m: float | None = None

    def receive_own_elevation(self, elevation_m: float | None) -> None:
        """Take the elevation of a fix."""
        self._own_elevation_m = _running_mean_m(self._own_elevation_m, elevation_m)

    def receive_bsm(self, bsm: BasicSafetyMessage, now: float) -> None:
        """Take the BSM of a remote vehicle."""
        core, name = bsm.core, bsm.core.temporary_id.hex()
        events = bsm.safety.events if bsm.safety is not None else None
        before = self._of.get(name)
        braked_hard_s = before.braked_hard_s if before is not None else -math.inf
        if events is not None and VehicleEventFlags.HARD_BRAKING in events:
            braked_hard_s = now
        elevation_m = _running_mean_m(before.elevation_m if before else None, core.elevation_m)
        self._of[name] = BsmData(
            now, elevation_m, core.size.length_m, core.size.width_m, braked_hard_s, bsm
        )

    def drop_old(self, now: float) -> None:
        """Drop the vehicles that have been silent."""
        self._of = {
            name: data for name, data in self._of.items() if now - data.received_s <= _TIMEOUT_S
        }

    def items(self) -> ItemsView[str, BsmData]:
        """Return all vehicles' data, by name."""
        return self._of.items()

    def get(self, name: str) -> BsmData | None:
        """Return the data of the vehicle with this name, if there is any."""
        return self._of.get(name)

    def size_m(self, name: str) -> tuple[float, float]:
        """Return length and width, by default where they are not reported."""
        data = self._of.get(name)
        return (
            (data.length_m if data else None) or DEFAULT_LENGTH_M,
            (data.width_m if data else None) or DEFAULT_WIDTH_M,
        )

    def heading(self, name: str) -> Heading | None:
        """Return the heading of a vehicle's last BSM."""
        data = self._of.get(name)
        if data is None or data.last.core.heading_rad is None:
            return None
        return Heading(data.last.core.heading_rad, HEADING_SIGMA_RAD)

    def signals_left(self, name: str) -> bool:
        """Return whether a vehicle's left turn signal is on."""
        data = self._of.get(name)
        safety = data.last.safety if data is not None else None
        return safety is not None and safety.lights == ExteriorLights.LEFT_TURN_SIGNAL

    def path_history_m(self, name: str) -> list[tuple[float, float]]:
        """Return a vehicle's past positions, metres east and north of its last one, newest first.

        Empty if it has not reported any.
        """
        data = self._of.get(name)
        return [] if data is None else _path_history_m(data.last)

    def crosses_on_a_bridge(self, other: PerceivedObject, distance_m: float) -> bool:
        """Whether a vehicle crosses over or under the host's road; not one that is sensed.

        Args:
            other: the vehicle.
            distance_m: what both have to go until they would meet.
        """
        return self._apart_m(other) > BRIDGE_M + SLOPE * distance_m

    def is_on_another_deck(self, other: PerceivedObject, distance_m: float) -> bool:
        """Whether the road of a vehicle lies above the host's or below; not of one that is sensed.

        Args:
            other: the vehicle, which drives the host's way.
            distance_m: between both.
        """
        return self._apart_m(other) > DECK_M + SLOPE * distance_m

    def _apart_m(self, other: PerceivedObject) -> float:
        """By how much the elevations differ; 0 if one is unknown, or the vehicle is sensed."""
        data = self._of.get(other.name)
        if data is None or data.elevation_m is None or self._own_elevation_m is None:
            return 0.0
        return 0.0 if other.is_sensed else abs(data.elevation_m - self._own_elevation_m)


def _running_mean_m(mean_m: float | None, elevation_m: float | None) -> float | None:
    """Update a mean: elevations scatter, and a single one could put a vehicle on a bridge."""
    if mean_m is None or elevation_m is None:
        return elevation_m
    return mean_m + _NEW_ELEVATION_WEIGHT * (elevation_m - mean_m)


def _path_history_m(bsm: BasicSafetyMessage) -> list[tuple[float, float]]:
    core, history = bsm.core, bsm.safety.path_history if bsm.safety is not None else None
    if history is None or core.latitude_deg is None or core.longitude_deg is None:
        return []
    begin = history.initial_position or core
    if begin.latitude_deg is None or begin.longitude_deg is None:
        return []
    here, points_m = LocalFrame(core.latitude_deg, core.longitude_deg), []
    for point in history.crumb_data:
        if point.latitude_offset_deg is None or point.longitude_offset_deg is None:
            break
        east_m, north_m = here.position_m(
            begin.latitude_deg + point.latitude_offset_deg,
            begin.longitude_deg + point.longitude_offset_deg,
        )
        points_m.append((float(east_m), float(north_m)))
    return points_m
