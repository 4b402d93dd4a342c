"""The core: keeps the intersections around the host vehicle, and finds the signals ahead."""

import math
from collections import OrderedDict, deque
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import ClassVar

from typing_extensions import override

from onboard.core import Core
from onboard.errors import DecodeError
from onboard.intersections.intersection import GREEN, RED, ApproachedSignal, Intersection
from onboard.intersections.signal_phase import message_age_s
from onboard.kinematics.geodesy import distance_m
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.lanes import IntersectionReferenceId
from onboard.messages.map_data import IntersectionGeometry, MapData
from onboard.messages.spat import MovementPhaseState, Spat
from onboard.observations import Discarded, Position
from onboard.tracking.perceived_object import PerceivedObject

MAX_DISTANCE_M = 2000.0
"""Distance beyond which an intersection is refused: twice the range of a radio."""
MAX_INTERSECTIONS = 64
"""Intersections that are kept, those heard last."""


@dataclass(frozen=True, slots=True)
class SignalAhead:
    """The signals that the host vehicle's lane leads to show something else, or are others."""

    kind: ClassVar[str] = "signal_ahead"
    stamp_s: float
    intersection: int | None
    """Its number; `None`: no lane leads the host vehicle to a signal any more."""
    lane_id: int | None = None
    distance_m: float | None = None
    """From the host vehicle's position to the stop line."""
    states: tuple[str, ...] = ()
    """Of all ways on; none while one is unknown."""
    min_left_s: float | None = None
    """Time until the earliest end of these; `None` if it is unknown."""

    @property
    def place_and_states(self) -> tuple[object, ...]:
        """What makes it another one."""
        return self.intersection, self.lane_id, self.states


class Intersections(Core):
    """All intersections that are heard."""

    def __init__(self) -> None:
        """Start without any."""
        self._known: OrderedDict[IntersectionReferenceId, Intersection] = OrderedDict()
        """The one heard last at the end."""
        self._position: Position | None = None
        self._frame: LocalFrame | None = None
        self._now = -math.inf
        self._shown = SignalAhead(0.0, None)
        self._events: deque[SignalAhead | Discarded] = deque(maxlen=1024)

    def receive_position(self, position: Position) -> None:
        """Take the host vehicle's position, which says what is too far away."""
        self._position = position

    def receive_map(self, message: MapData, signer_id: bytes | None, now: float) -> None:
        """Take the lanes of intersections, from a road-side unit."""
        for geometry in message.intersections or ():
            try:
                self._check_distance(geometry)
                self._intersection(geometry.id).receive_map(geometry, signer_id, now)
            except DecodeError as error:
                self._discard("map", geometry.id, error, now)

    def receive_spat(
        self, message: Spat, signer_id: bytes | None, now: float, utc_s: float
    ) -> None:
        """Take what the signals show, from a road-side unit, at `now`, which is `utc_s`."""
        for state in message.intersections:
            age_s = message_age_s(state, message.time_stamp_s, utc_s)
            try:
                self._intersection(state.id).receive_spat(state, age_s, signer_id, now, utc_s)
            except DecodeError as error:
                self._discard("spat", state.id, error, now)

    def receive_host_vehicle(
        self, host: PerceivedObject | None, frame: LocalFrame | None, now: float
    ) -> None:
        """Take the host vehicle's state, and put out a `SignalAhead` if another one is ahead.

        Args:
            host: the host vehicle; `None` without a position.
            frame: of its state and of those that are asked for until the next call.
            now: the time.
        """
        self._frame, self._now = frame, now
        shown = _as_event(None if host is None else self.signal_ahead(host), now)
        if shown.place_and_states != self._shown.place_and_states:
            self._shown = shown
            self._events.append(shown)

    def signal_ahead(self, vehicle: PerceivedObject) -> ApproachedSignal | None:
        """Return the nearest stop line on a vehicle's lane; `None` if it is on none."""
        frame = self._frame
        if frame is None:
            return None
        found = [
            each.signal_ahead(vehicle.state, frame, self._now) for each in self._known.values()
        ]
        return min(
            (each for each in found if each is not None),
            key=lambda each: each.distance_m,
            default=None,
        )

    def red_light_m(self, vehicle: PerceivedObject) -> float | None:
        """Return a vehicle's distance to its stop line in m if it has red until it is there."""
        return self._light_m(vehicle, RED)

    def green_light_m(self, vehicle: PerceivedObject) -> float | None:
        """Return the same if it has green until it is there."""
        return self._light_m(vehicle, GREEN)

    def _light_m(
        self, vehicle: PerceivedObject, colour: AbstractSet[MovementPhaseState]
    ) -> float | None:
        signal = self.signal_ahead(vehicle)
        shown_s = None if signal is None else signal.shown_for_s(colour)
        if signal is None or shown_s is None:
            return None
        is_shown_there = shown_s * math.hypot(*vehicle.state[2:]) >= signal.distance_m
        return signal.distance_m if is_shown_there else None

    @override
    def next_event(self) -> SignalAhead | Discarded | None:
        """Return the oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _check_distance(self, geometry: IntersectionGeometry) -> None:
        here, there = self._position, geometry.ref_point
        if here is None or there.latitude_deg is None or there.longitude_deg is None:
            return
        apart_m = distance_m(
            here.latitude_deg, here.longitude_deg, there.latitude_deg, there.longitude_deg
        )
        if apart_m > MAX_DISTANCE_M:
            raise DecodeError("too_far", f"{apart_m:.0f} m away")

    def _intersection(self, intersection_id: IntersectionReferenceId) -> Intersection:
        known = self._known.setdefault(intersection_id, Intersection(intersection_id))
        self._known.move_to_end(intersection_id)
        if len(self._known) > MAX_INTERSECTIONS:
            self._known.popitem(last=False)
        return known

    def _discard(
        self, component: str, intersection: IntersectionReferenceId, error: DecodeError, now: float
    ) -> None:
        detail = f"intersection {intersection.id}: {error.detail}"
        self._events.append(Discarded(now, component, error.reason, detail))


def _as_event(signal: ApproachedSignal | None, now: float) -> SignalAhead:
    if signal is None:
        return SignalAhead(now, None)
    phases = signal.phases or ()
    ends_s = [each.min_left_s for each in phases if each.min_left_s is not None]
    return SignalAhead(
        now,
        signal.id.id,
        signal.lane_id,
        round(signal.distance_m, 1),
        tuple(each.state.name.lower() for each in phases),
        round(float(min(ends_s)), 1) if len(ends_s) == len(phases) > 0 else None,
    )
