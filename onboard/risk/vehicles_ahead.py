"""The vehicles ahead that FCW assesses, each once, by all that is known of it.

The camera's lead vehicle is known without a position. Perceived objects (radio, own sensors, shared
by others) count if they are ahead on the host vehicle's path. The object that is the camera's lead
is recognised by gap and closing speed: both are weighed by their variances.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

from onboard.observations import Lead, Speed
from onboard.risk.alarm import AlarmReason
from onboard.risk.lead_motion import LeadMotion
from onboard.risk.situation import Situation
from onboard.risk.vehicle_motion import SETTLED_SIGMA_M_S
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

OBJECT_WINDOW_S = 0.35
"""Window of the decelerations of perceived objects, whose speeds are filtered: four speeds, ten a
second."""
YOUNG_S = 1.0
"""A vehicle that others have told of for less time is not assessed: on busy computers, measurements
with late stamps make a second track of a vehicle, whose speed is wrong by many sigmas."""
LEAD_TIMEOUT_S = 0.5
"""Time for which an observation of a vehicle is valid."""
IN_THE_WAY_M = 1.6
"""Farther from the path the middle of a vehicle is in another lane, or beside the road. A wider
limit (2.0 m) for who was ahead would warn one of 244 drives more by BSMs, and 4 of 100 that pass a
standing car one lane aside."""
SAME_SIGMAS = 3.0
"""Gaps and closing speeds that differ by less may be of one vehicle."""

_CAMERA = "camera"
_LEAST_SIGMA = 0.1
"""In m and m/s: no measurement is better."""


@dataclass(frozen=True, slots=True)
class VehicleAhead:
    """A vehicle ahead, by its last measurements."""

    key: str
    """Distinguishes it from the other vehicles ahead."""
    stamp_s: float
    """Of the last measurement."""
    gap_m: float
    gap_sigma_m: float
    closing_speed_m_s: float
    closing_speed_sigma_m_s: float
    deceleration_m_s2: float
    """Its own, as far as it is certain; 0 or more."""
    measured: tuple[tuple[str, str, float], ...]
    """Kind, name and time of each observation."""
    is_filtered: bool = False
    """Whether its state is filtered from several measurements, outliers left out by gates."""
    is_new: bool = False
    """Whether it was not ahead at the last assessment: one odd course of the host vehicle moves its
    path by a lane."""

    @property
    def place_sigmas(self) -> tuple[float, float]:
        """Sigmas of gap and closing speed, if these follow from places: a camera measures gaps."""
        return (
            (0.0, 0.0) if self.key == _CAMERA else (self.gap_sigma_m, self.closing_speed_sigma_m_s)
        )

    def reasons(self, now: float) -> tuple[AlarmReason, ...]:
        """Return the observations as reasons of an alarm at `now`."""
        return tuple(AlarmReason(what, name, now - at_s) for what, name, at_s in self.measured)

    def may_be(self, other: "VehicleAhead") -> bool:
        """Whether gap and closing speed are those of another observed vehicle."""
        apart_m = abs(self.gap_m - other.gap_m)
        apart_m_s = abs(self.closing_speed_m_s - other.closing_speed_m_s)
        return apart_m <= SAME_SIGMAS * math.hypot(
            self.gap_sigma_m, other.gap_sigma_m
        ) and apart_m_s <= SAME_SIGMAS * math.hypot(
            self.closing_speed_sigma_m_s, other.closing_speed_sigma_m_s
        )

    def joined(self, other: "VehicleAhead") -> "VehicleAhead":
        """Return the vehicle by both observations, under the key of this one."""
        gap_m, gap_sigma_m = _weighed(
            (self.gap_m, self.gap_sigma_m), (other.gap_m, other.gap_sigma_m)
        )
        closing_m_s, closing_sigma_m_s = _weighed(
            (self.closing_speed_m_s, self.closing_speed_sigma_m_s),
            (other.closing_speed_m_s, other.closing_speed_sigma_m_s),
        )
        return replace(
            self,
            gap_m=gap_m,
            gap_sigma_m=gap_sigma_m,
            closing_speed_m_s=closing_m_s,
            closing_speed_sigma_m_s=closing_sigma_m_s,
            deceleration_m_s2=max(self.deceleration_m_s2, other.deceleration_m_s2),
            measured=(*self.measured, *other.measured),
        )


class CameraLead:
    """The lead vehicle that the camera observes."""

    def __init__(self) -> None:
        self._lead: Lead | None = None
        self._motion = LeadMotion()

    def receive_lead(self, lead: Lead, speed: Speed | None) -> None:
        """Take an observation, or that there is none, at the host vehicle's speed if known."""
        self._lead = lead
        if speed is not None and lead.gap_m is not None and lead.closing_speed_m_s is not None:
            if (lead.closing_speed_sigma_m_s or 0.0) > SETTLED_SIGMA_M_S:
                self._motion.clear()
            lead_speed_m_s = speed.speed_m_s - lead.closing_speed_m_s
            self._motion.receive_speed(lead.stamp_s, lead.gap_m, lead_speed_m_s)

    def vehicle(self, now: float) -> VehicleAhead | None:
        """Return the lead vehicle; `None` if there is none, or its observation is too old."""
        lead = self._lead
        if (
            lead is None
            or lead.gap_m is None
            or lead.closing_speed_m_s is None
            or abs(now - lead.stamp_s) > LEAD_TIMEOUT_S
        ):
            return None
        return VehicleAhead(
            _CAMERA,
            lead.stamp_s,
            lead.gap_m,
            max(lead.gap_sigma_m or 0.0, _LEAST_SIGMA),
            lead.closing_speed_m_s,
            max(lead.closing_speed_sigma_m_s or 0.0, _LEAST_SIGMA),
            self._motion.deceleration_m_s2(),
            ((lead.kind, lead.identity.value, lead.stamp_s),),
        )


class ObjectsAhead:
    """The perceived objects ahead on the host vehicle's path."""

    def __init__(self) -> None:
        self._motions: dict[str, LeadMotion] = {}
        self._vehicles: list[VehicleAhead] = []

    def receive_situation(self, situation: Situation) -> None:
        """Take all perceived objects."""
        own, data = situation.own, situation.bsm_data
        motions = {}
        self._vehicles = []
        for other in situation.others:
            is_young = other.source is ObjectSource.SHARED and other.tracked_for_s < YOUNG_S
            if own is None or is_young or other.age_s > LEAD_TIMEOUT_S:
                continue
            place = situation.path.place(own, other, partial(data.path_history_m, other.name))
            if place is None or abs(place.left_m) > IN_THE_WAY_M:
                continue
            if data.is_on_another_deck(other, place.ahead_m):
                continue
            length_m, _ = data.size_m(other.name)
            gap_m = place.ahead_m - (situation.own_size_m[0] + length_m) / 2.0
            motion = self._motions.get(other.name) or LeadMotion(OBJECT_WINDOW_S)
            motions[other.name] = motion
            ahead = _vehicle(own, other, gap_m, place.course_rad, motion, speed=situation.speed)
            self._vehicles.append(replace(ahead, is_new=other.name not in self._motions))
        self._motions = motions

    def with_lead(self, lead: VehicleAhead | None) -> list[VehicleAhead]:
        """Return all vehicles ahead: these, and the camera's lead, joined with its object."""
        if lead is None:
            return self._vehicles
        same = min(
            (vehicle for vehicle in self._vehicles if vehicle.may_be(lead)),
            key=lambda vehicle: abs(vehicle.gap_m - lead.gap_m),
            default=None,
        )
        if same is None:
            return [lead, *self._vehicles]
        others = [vehicle for vehicle in self._vehicles if vehicle is not same]
        return [lead.joined(same), *others]


def _vehicle(
    own: PerceivedObject,
    other: PerceivedObject,
    gap_m: float,
    course_rad: float,
    motion: LeadMotion,
    *,
    speed: Speed | None,
) -> VehicleAhead:
    """Return an object `gap_m` ahead, where the path leads to `course_rad`."""
    cos, sin = math.cos(course_rad), math.sin(course_rad)
    east, north = other.state[2:]
    along_m_s = max(east * cos + north * sin, 0.0)
    speed_sigma_m_s = math.sqrt(_variance(other, 2, cos, sin))
    gap_variance = _variance(other, 0, cos, sin)
    own_m_s = math.hypot(*own.state[2:])
    is_measured = other.source is not ObjectSource.BSM
    if not is_measured:  # what is measured has the uncertainty of the own position
        gap_variance += _variance(own, 0, cos, sin)
    elif speed is not None:  # a BSM is as old as the own fix: braking of both cancels
        own_m_s = speed.speed_m_s
    stamp_s = other.stamp_s - other.age_s
    if speed_sigma_m_s > SETTLED_SIGMA_M_S:
        motion.clear()
    motion.receive_speed(stamp_s, gap_m, along_m_s)
    return VehicleAhead(
        other.name,
        stamp_s,
        gap_m,
        max(math.sqrt(gap_variance), _LEAST_SIGMA),
        own_m_s - along_m_s,
        max(speed_sigma_m_s, _LEAST_SIGMA),
        max(motion.deceleration_m_s2(speed_sigma_m_s), -(other.acceleration_m_s2 or 0.0), 0.0),
        ((f"{other.kind}:{other.source.value}", other.name, stamp_s),),
        is_filtered=is_measured,
    )


def _variance(of: PerceivedObject, axis: int, cos: float, sin: float) -> float:
    """Variance of position (`axis` 0) or velocity (2) along a direction."""
    rows = of.covariance
    a, b, c = rows[axis][axis], rows[axis][axis + 1], rows[axis + 1][axis + 1]
    return max(cos * cos * a + 2.0 * cos * sin * b + sin * sin * c, 0.0)


def _weighed(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Mean of two values weighed by their variances, and its sigma; each is (value, sigma)."""
    (value, sigma), (other_value, other_sigma) = one, other
    weight = sigma**2 / (sigma**2 + other_sigma**2)
    return value + weight * (other_value - value), sigma * math.sqrt(1.0 - weight)
