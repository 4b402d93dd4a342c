"""The core: keeps the intersections around the host vehicle, and finds the signals ahead."""

import math
from collections import Counter, OrderedDict, deque
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from operator import itemgetter
from typing import ClassVar

from typing_extensions import override

from onboard.core import Core
from onboard.errors import DecodeError
from onboard.intersections.approach_lane import MAX_NODES
from onboard.intersections.intersection import GREEN, RED, ApproachedSignal, Intersection
from onboard.intersections.signal_phase import message_age_s
from onboard.kinematics.geodesy import distance_m
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.lanes import IntersectionReferenceId
from onboard.messages.map_data import MapData, ReferencePoint
from onboard.messages.spat import MovementPhaseState, Spat
from onboard.observations import Discarded, Position
from onboard.tracking.perceived_object import PerceivedObject

MAX_DISTANCE_M = 2000.0
"""Distance beyond which an intersection is refused: twice the range of a radio."""
MAX_INTERSECTIONS = 64
"""Intersections that are kept: one more replaces the oldest of the sender who sent most."""


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
        self._ahead: dict[tuple[float, ...], ApproachedSignal | None] = {}
        """By the state of a vehicle, since the last message and the last call of
        `receive_host_vehicle`: several alarms ask for one vehicle."""
        self._shown = SignalAhead(0.0, None)
        self._events: deque[SignalAhead | Discarded] = deque(maxlen=1024)

    def receive_position(self, position: Position) -> None:
        """Take the host vehicle's position, which says what is too far away."""
        self._position = position

    def receive_map(self, message: MapData, signer_id: bytes | None, now: float) -> None:
        """Take the lanes of intersections, from a road-side unit."""
        self._ahead.clear()
        for geometry in message.intersections or ():
            try:
                self._check_distance(geometry.ref_point)
                known = self._intersection(geometry.id, signer_id)
                known.receive_map(geometry, signer_id, now)
            except DecodeError as error:
                self._discard("map", geometry.id, error, now)
        self._forget_farthest(signer_id, now)

    def receive_spat(
        self, message: Spat, signer_id: bytes | None, now: float, utc_s: float
    ) -> None:
        """Take what the signals show, from a road-side unit, at `now`, which is `utc_s`."""
        self._ahead.clear()
        for state in message.intersections:
            age_s = message_age_s(state, message.time_stamp_s, utc_s)
            try:
                known = self._intersection(state.id, signer_id)
                known.receive_spat(state, age_s, signer_id, now, utc_s)
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
        self._ahead.clear()
        shown = _as_event(None if host is None else self.signal_ahead(host), now)
        if shown.place_and_states != self._shown.place_and_states:
            self._shown = shown
            self._events.append(shown)

    def signal_ahead(self, vehicle: PerceivedObject) -> ApproachedSignal | None:
        """Return the nearest stop line on a vehicle's lane; `None` if it is on none."""
        if vehicle.state not in self._ahead:
            self._ahead[vehicle.state] = self._nearest_signal(vehicle.state)
        return self._ahead[vehicle.state]

    def _nearest_signal(self, state: tuple[float, ...]) -> ApproachedSignal | None:
        frame = self._frame
        if frame is None:
            return None
        found = [each.signal_ahead(state, frame, self._now) for each in self._known.values()]
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

    def _check_distance(self, there: ReferencePoint) -> None:
        apart_m = self._apart_m(there)
        if apart_m > MAX_DISTANCE_M:
            raise DecodeError("too_far", f"{apart_m:.0f} m away")

    def _apart_m(self, there: ReferencePoint) -> float:
        """Return the distance from the host vehicle; 0 while one of both places is unknown."""
        here = self._position
        if here is None or there.latitude_deg is None or there.longitude_deg is None:
            return 0.0
        return distance_m(
            here.latitude_deg, here.longitude_deg, there.latitude_deg, there.longitude_deg
        )

    def _intersection(
        self, intersection_id: IntersectionReferenceId, signer_id: bytes | None
    ) -> Intersection:
        known = self._known.setdefault(intersection_id, Intersection(intersection_id, signer_id))
        self._known.move_to_end(intersection_id)
        if len(self._known) > MAX_INTERSECTIONS:
            senders = Counter(each.first_signer_id for each in self._known.values())
            ((most, _),) = senders.most_common(1)
            del self._known[
                next(key for key, each in self._known.items() if each.first_signer_id == most)
            ]
        return known

    def _forget_farthest(self, signer_id: bytes | None, now: float) -> None:
        """Keep of a unit the lanes of the nearest intersections, as far as they are not too many.

        Else one certificate fills the place where the host vehicle drives with lanes.
        """
        of_unit = [
            (self._apart_m(point), key, each)
            for key, each in self._known.items()
            if (point := each.reference_point(signer_id, now)) is not None
        ]
        nodes = 0
        for _, key, each in sorted(of_unit, key=itemgetter(0)):
            nodes += each.nodes
            if nodes > MAX_NODES:
                each.forget_lanes()
                self._discard("map", key, DecodeError("too_many_nodes", f"{nodes} nodes"), now)

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
