"""What is known of one intersection: its lanes by MAP, its signals by SPAT messages."""

import math
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

from onboard.errors import DecodeError
from onboard.intersections.approach_lane import BEYOND_M, ApproachLane, Point, approach_lanes
from onboard.intersections.signal_phase import SignalPhase, signal_phases
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages.lanes import IntersectionReferenceId
from onboard.messages.map_data import IntersectionGeometry, ReferencePoint
from onboard.messages.spat import IntersectionState, MovementPhaseState

MAP_LIFETIME_S = 60.0
"""Time for which a MAP message is used; they come every second."""
SPAT_LIFETIME_S = 1.0
"""Time for which a SPAT message is used; they come ten times a second."""
CLOCK_TOLERANCE_S = 2.0
"""Age by the sender's clock, in either direction, beyond which a SPAT message is refused."""
_ROUNDING_S = 1e-3
MIN_SPEED_M_S = 1.0
"""A slower vehicle has no course."""
ASIDE_M = 1.5
"""Error of a position, within which a vehicle may be on a lane beside it."""


RED = frozenset({MovementPhaseState.STOP_AND_REMAIN})
GREEN = frozenset(
    {
        MovementPhaseState.PERMISSIVE_MOVEMENT_ALLOWED,
        MovementPhaseState.PROTECTED_MOVEMENT_ALLOWED,
    }
)


@dataclass(frozen=True, slots=True)
class ApproachedSignal:
    """The stop line ahead of a vehicle, and what the signals there show."""

    id: IntersectionReferenceId
    lane_id: int
    """Of the nearest lane."""
    distance_m: float
    """From the vehicle's position to the stop line."""
    phases: tuple[SignalPhase, ...] | None
    """Of all ways on from all lanes that the vehicle may be on; `None` if one is unknown."""

    def shown_for_s(self, colour: AbstractSet[MovementPhaseState]) -> float | None:
        """Time for which all ways on keep a colour at least; `None` if one is not so or unknown."""
        if not self.phases or any(each.state not in colour for each in self.phases):
            return None
        return min(each.min_left_s or 0.0 for each in self.phases)


class _Box(NamedTuple):
    """Rectangle around all lanes, outside of which no vehicle is on one of them."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float

    def contains(self, position_m: Point) -> bool:
        east_m, north_m = position_m
        return self.west_m <= east_m <= self.east_m and self.south_m <= north_m <= self.north_m


@dataclass(frozen=True, slots=True)
class _Map:
    geometry: IntersectionGeometry
    frame: LocalFrame
    lanes: tuple[ApproachLane, ...]
    box: _Box | None
    """`None` without lanes."""
    nodes: int
    """Of all lanes together."""
    signer_id: bytes | None
    received_at: float


@dataclass(frozen=True, slots=True)
class _Spat:
    phases: Mapping[int, SignalPhase]
    revision: int
    sent_utc_s: float
    signer_id: bytes | None
    received_at: float
    sent_at: float
    """By the sender's clock, but not after `received_at`."""


class Intersection:
    """One intersection."""

    def __init__(self, intersection_id: IntersectionReferenceId, signer_id: bytes | None) -> None:
        """Start without messages.

        Args:
            intersection_id: its number.
            signer_id: HashedId8 of the certificate of who sends the first one, if it was verified.
        """
        self.first_signer_id = signer_id
        self._id = intersection_id
        self._map: _Map | None = None
        self._spat: _Spat | None = None
        self._is_disputed_until = -math.inf

    @property
    def nodes(self) -> int:
        """Number of nodes of its lanes."""
        return 0 if self._map is None else self._map.nodes

    def reference_point(self, signer_id: bytes | None, now: float) -> ReferencePoint | None:
        """Return that of its lanes; `None` where no MAP message of this sender is in use."""
        known = self._map_in_use(now)
        return None if known is None or known.signer_id != signer_id else known.geometry.ref_point

    def forget_lanes(self) -> None:
        """Drop the MAP message."""
        self._map = None

    def receive_map(
        self, geometry: IntersectionGeometry, signer_id: bytes | None, now: float
    ) -> None:
        """Take its part of a MAP message.

        Raises:
            DecodeError: `no_position`, `too_many_nodes`, or `contradictory` where the lanes differ
                from those of the same revision, or another sender's.
        """
        point, known = geometry.ref_point, self._map_in_use(now)
        if point.latitude_deg is None or point.longitude_deg is None:
            raise DecodeError("no_position", "no reference point")
        if known is not None:
            if known.geometry == geometry:
                self._map = replace(known, signer_id=signer_id, received_at=now)
                return
            if known.geometry.revision == geometry.revision or known.signer_id != signer_id:
                raise DecodeError("contradictory", f"other lanes of revision {geometry.revision}")
        frame = LocalFrame(point.latitude_deg, point.longitude_deg)
        lanes = approach_lanes(geometry, frame)
        nodes = sum(len(lane.points_m) for lane in lanes)
        self._map = _Map(geometry, frame, lanes, _box(lanes), nodes, signer_id, now)

    def receive_spat(
        self,
        state: IntersectionState,
        age_s: float | None,
        signer_id: bytes | None,
        now: float,
        utc_s: float,
    ) -> None:
        """Take its part of a SPAT message.

        Args:
            state: the part.
            age_s: by the sender's clock; `None` if the message states no time.
            signer_id: HashedId8 of the sender's certificate, if it was verified.
            now: the time.
            utc_s: the same instant in seconds since 1970.

        Raises:
            DecodeError: `stale`, `from_the_future`, `older`, `dark`, `ends_in_past`, or
                `contradictory` in itself or to another sender, after which neither is used.
        """
        if age_s is not None and age_s > CLOCK_TOLERANCE_S:
            raise DecodeError("stale", f"{age_s:.1f} s old")
        if age_s is not None and age_s < -CLOCK_TOLERANCE_S:
            raise DecodeError("from_the_future", f"{-age_s:.1f} s ahead")
        sent_utc_s = utc_s - (age_s or 0.0)
        known = self._spat
        if known is not None and now - known.received_at > SPAT_LIFETIME_S:
            known = None
        is_same_sender = known is not None and known.signer_id == signer_id
        if known is not None and is_same_sender and known.sent_utc_s - sent_utc_s > _ROUNDING_S:
            raise DecodeError("older", f"{known.sent_utc_s - sent_utc_s:.1f} s")
        try:
            phases = signal_phases(state, sent_utc_s)
        except DecodeError:
            if is_same_sender:
                self._spat = None
            raise
        if known is not None and not is_same_sender and _differ(known.phases, phases):
            self._is_disputed_until = now + SPAT_LIFETIME_S
            raise DecodeError("contradictory", "two senders show different phases")
        sent_at = now - max(age_s or 0.0, 0.0)
        self._spat = _Spat(phases, state.revision, sent_utc_s, signer_id, now, sent_at)

    def signal_ahead(
        self, state: tuple[float, ...], frame: LocalFrame, now: float
    ) -> ApproachedSignal | None:
        """Return the stop line on a vehicle's lane; `None` if it is on none.

        Args:
            state: px, py in m, vx, vy in m/s; east and north in `frame`.
            frame: of the state.
            now: the time.
        """
        known = self._map_in_use(now)
        speed_m_s = math.hypot(*state[2:])
        if known is None or known.box is None or speed_m_s < MIN_SPEED_M_S:
            return None
        east_m, north_m, east_m_s, north_m_s = state
        cos, sin, shift_east_m, shift_north_m = _mapping(known.frame, frame)
        position_m = (
            cos * east_m - sin * north_m + shift_east_m,
            sin * east_m + cos * north_m + shift_north_m,
        )
        if not known.box.contains(position_m):
            return None
        course = (
            (cos * east_m_s - sin * north_m_s) / speed_m_s,
            (sin * east_m_s + cos * north_m_s) / speed_m_s,
        )
        places = [
            (*place, lane)
            for lane in known.lanes
            if (place := lane.place(position_m, course)) is not None
            and place[1] <= _most_aside_m(lane)
        ]
        if not places:
            return None
        distance_m, _, nearest = min(places, key=lambda place: place[1])
        groups = sorted(frozenset[int]().union(*(lane.signal_groups for *_, lane in places)))
        phases = [phase for group in groups if (phase := self._phase(group, now)) is not None]
        return ApproachedSignal(
            self._id,
            nearest.lane_id,
            distance_m,
            tuple(phases) if len(phases) == len(groups) else None,
        )

    def _map_in_use(self, now: float) -> _Map | None:
        known = self._map
        return None if known is None or now - known.received_at > MAP_LIFETIME_S else known

    def _phase(self, signal_group: int, now: float) -> SignalPhase | None:
        """Return what a signal shows; `None` if that is not known, or not any more."""
        spat, lanes = self._spat, self._map
        if spat is None or lanes is None or now < self._is_disputed_until:
            return None
        is_silent = now - spat.received_at > SPAT_LIFETIME_S
        if is_silent or spat.revision != lanes.geometry.revision:
            return None
        phase = spat.phases.get(signal_group)
        return None if phase is None else phase.after(now - spat.sent_at)


def _most_aside_m(lane: ApproachLane) -> float:
    """Distance from a lane's centre line up to which a vehicle may be on it."""
    return lane.width_m / 2.0 + ASIDE_M


def _box(lanes: Sequence[ApproachLane]) -> _Box | None:
    if not lanes:
        return None
    beside_m = BEYOND_M + max(map(_most_aside_m, lanes))
    easts_m, norths_m = zip(*(point for lane in lanes for point in lane.points_m), strict=True)
    return _Box(
        min(easts_m) - beside_m,
        min(norths_m) - beside_m,
        max(easts_m) + beside_m,
        max(norths_m) + beside_m,
    )


@lru_cache(maxsize=64)
def _mapping(into: LocalFrame, frame: LocalFrame) -> tuple[float, float, float, float]:
    """Return cosine and sine of the turn, and the shift in m, from one frame into another."""
    turn, shift = into.mapping_from(frame)
    return float(turn[0, 0]), float(turn[1, 0]), float(shift[0]), float(shift[1])


def _differ(one: Mapping[int, SignalPhase], other: Mapping[int, SignalPhase]) -> bool:
    return any(one[group].state is not other[group].state for group in one.keys() & other.keys())
