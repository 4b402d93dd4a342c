"""The public test procedures as motions of two cars, of which neither reacts to a warning.

Speeds, gaps and decelerations are those of Euro NCAP (car-to-car rear, crossing, turning and
head-on), of NHTSA (confirmation test of FCW, crossings of IMA) and of FMVSS 127. What is asked is
the time from the warning to the contact. Where a procedure asks for no time, it is that which a
driver needs who brakes with `BRAKING_M_S2` after `REACTION_S`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from itertools import pairwise, product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from onboard.kinematics.units import KM_H
from sim_rig.roads.crashes import first_crash
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory
from sim_rig.studies.alarms.wired_vehicle import LENGTH_M, WIDTH_M

Array = NDArray[np.float64]

MEETS_S = 8.0
"""The cars are where they are to meet."""
END_S = 14.0
EURO_NCAP_S = 1.7
"""Euro NCAP counts a warning that comes this long before the contact."""
REACTION_S = 1.0
BRAKING_M_S2 = 8.0
LANE_M = 3.5
"""From the middle of one lane to the middle of the oncoming one."""
MPH = 1609.344 / 3600.0
G = 9.81
HOST, OTHER = "host", "other"

_CLOTHOID_RAD = 0.364
"""By which a car turns while its curvature grows."""
_TURN_RADIUS_M = {10.0: 9.0, 15.0: 11.75, 20.0: 14.75}
"""Of the left turn, by the speed in km/h."""
_FINE_M = 0.05
_MOST_LEAD_S = 6.0


class ProcedureName(StrEnum):
    """The groups of cases."""

    CCRS = "CCRs"
    """A standing car ahead (Euro NCAP)."""
    CCRM = "CCRm"
    """A slower car ahead."""
    CCRB = "CCRb"
    """A car ahead that brakes."""
    CCCSCP = "CCCscp"
    """Both go straight on and cross."""
    CCFTAP = "CCFtap"
    """The host turns left across the path of an oncoming car."""
    CCFHOS = "CCFhos"
    """Head-on in one lane."""
    CCFHOL = "CCFhol"
    """Head-on, while the host changes into the oncoming lane."""
    NHTSA_FCW = "NHTSA-FCW"
    """Confirmation test: a standing, a slower and a braking car ahead."""
    NHTSA_IMA = "NHTSA-IMA"
    """Straight crossing paths."""
    FMVSS_127 = "FMVSS-127"
    """A standing, a slower and a braking car ahead."""


class DrivenLine(Protocol):
    """A line that a car drives."""

    def at(self, way_m: Array) -> tuple[Array, Array]:
        """Return the positions, (k, 2), and the courses, (k) counterclockwise from east."""


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight line."""

    origin_m: tuple[float, float]
    course_rad: float

    def at(self, way_m: Array) -> tuple[Array, Array]:
        """See `DrivenLine`."""
        ahead = np.array([math.cos(self.course_rad), math.sin(self.course_rad)])
        return np.array(self.origin_m) + way_m[:, None] * ahead, np.full(
            len(way_m), self.course_rad
        )


@dataclass(frozen=True)
class Bent:
    """A line north that bends from the origin on, and goes on straight after the last bend."""

    bends: tuple[tuple[float, float, float], ...]
    """Length in m, and the curvatures in 1/m at begin and end."""

    @cached_property
    def _fine(self) -> tuple[Array, Array, Array]:
        """Ways, positions and courses at small distances."""
        ends_m = np.cumsum([0.0, *(length_m for length_m, _, _ in self.bends)])
        way_m = np.arange(0.0, ends_m[-1] + _FINE_M, _FINE_M)
        curvature = np.zeros(len(way_m))
        for (begin_m, end_m), (_, first, last) in zip(pairwise(ends_m), self.bends, strict=True):
            inside = (way_m >= begin_m) & (way_m < end_m)
            curvature[inside] = np.interp(way_m[inside], [begin_m, end_m], [first, last])
        course_rad = math.pi / 2.0 + np.cumsum(curvature) * _FINE_M
        steps_m = _FINE_M * np.stack([np.cos(course_rad), np.sin(course_rad)], axis=1)
        return way_m, np.cumsum(steps_m, axis=0) - steps_m[0], course_rad

    def at(self, way_m: Array) -> tuple[Array, Array]:
        """See `DrivenLine`."""
        fine_m, position_m, course_rad = self._fine
        courses_rad = np.interp(way_m, fine_m, course_rad, left=math.pi / 2.0)
        inside = np.stack([np.interp(way_m, fine_m, each) for each in position_m.T], axis=1)
        outside_m = way_m - np.clip(way_m, fine_m[0], fine_m[-1])
        ahead = np.stack([np.cos(courses_rad), np.sin(courses_rad)], axis=1)
        return inside + outside_m[:, None] * ahead, courses_rad


@dataclass(frozen=True, slots=True)
class Drive:
    """Motion of one car along its path."""

    path: DrivenLine
    meets_at_m: float
    """Where its middle is at `MEETS_S`, along the path."""
    times_s: tuple[float, ...]
    speeds_m_s: tuple[float, ...]
    """At these times, linear between them."""

    def trajectory(self, name: str, brakes_at_s: float = math.inf) -> Trajectory:
        """Return the motion, of a driver who brakes to a standstill from a time on."""
        at_s = np.arange(0.0, END_S + STEP_S / 2.0, STEP_S)
        planned = np.interp(at_s, self.times_s, self.speeds_m_s)
        begin_m = self.meets_at_m - float(np.interp(MEETS_S, at_s, _way_m(planned)))
        braked_s = np.maximum(at_s - brakes_at_s, 0.0)
        then_m_s = np.interp(brakes_at_s, at_s, planned) - BRAKING_M_S2 * braked_s
        speed_m_s = np.where(
            at_s > brakes_at_s, np.minimum(planned, np.maximum(then_m_s, 0.0)), planned
        )
        middle_m, course_rad = self.path.at(begin_m + _way_m(speed_m_s))
        return Trajectory(name, 0, middle_m, course_rad, speed_m_s, LENGTH_M, WIDTH_M)


def _way_m(speed_m_s: Array) -> Array:
    steps_m = (speed_m_s[1:] + speed_m_s[:-1]) / 2.0 * STEP_S
    return np.concatenate([[0.0], np.cumsum(steps_m)])


@dataclass(frozen=True, slots=True)
class Procedure:
    """One case of a procedure: two cars that touch if nobody is warned."""

    group: ProcedureName
    case: str
    host: Drive
    other: Drive
    stated_s: float | None = EURO_NCAP_S
    """The time that is asked by the procedure."""

    @property
    def signals_left(self) -> bool:
        """Whether the host signals that it turns left."""
        return self.group is ProcedureName.CCFTAP

    @property
    def contact_s(self) -> float:
        """Time of the contact; infinite without one."""
        return _contact_s(self.host.trajectory(HOST), self.other.trajectory(OTHER))

    @property
    def asked_s(self) -> float:
        """From the latest warning that is in time to the contact."""
        if self.stated_s is not None:
            return self.stated_s
        contact_s, other = self.contact_s, self.other.trajectory(OTHER)
        late_s, early_s = 0.0, _MOST_LEAD_S
        while early_s - late_s > STEP_S / 4.0:
            lead_s = (late_s + early_s) / 2.0
            braking = self.host.trajectory(HOST, contact_s - lead_s + REACTION_S)
            if math.isinf(_contact_s(braking, other)):
                early_s = lead_s
            else:
                late_s = lead_s
        return early_s


def _contact_s(host: Trajectory, other: Trajectory) -> float:
    traffic = RecordedTraffic([host, other])
    steps = (traffic.cars_at(step * STEP_S) for step in range(len(host)))
    crashes = (first_crash(before, after) for before, after in pairwise(steps))
    return next((crash.at_s for crash in crashes if crash is not None), math.inf)


_NORTH = Straight((0.0, 0.0), math.pi / 2.0)


def _steady(path: DrivenLine, meets_at_m: float, speed_m_s: float) -> Drive:
    return Drive(path, meets_at_m, (0.0,), (speed_m_s,))


def _behind(
    group: ProcedureName, speeds_m_s: tuple[float, float], case: str, asked_s: float | None
) -> Procedure:
    """A car ahead of constant speed; the contact is at `MEETS_S`."""
    host, lead = speeds_m_s
    return Procedure(
        group, case, _steady(_NORTH, 0.0, host), _steady(_NORTH, LENGTH_M, lead), asked_s
    )


def _braking(
    group: ProcedureName,
    speed_m_s: float,
    gap_m: float,
    braking_m_s2: float,
    asked_s: float | None,
) -> Procedure:
    """A car ahead brakes at `MEETS_S` less some seconds."""
    begin_s = MEETS_S - 3.0
    stands_s = begin_s + speed_m_s / braking_m_s2
    braked_m = np.interp(
        MEETS_S,
        np.arange(0.0, END_S, 0.01),
        np.cumsum(
            np.interp(np.arange(0.0, END_S, 0.01), [begin_s, stands_s], [speed_m_s, 0.0]) * 0.01
        ),
    )
    lead_at_m = gap_m + LENGTH_M + float(braked_m) - speed_m_s * MEETS_S
    return Procedure(
        group,
        f"{speed_m_s / KM_H:.0f} km/h, {gap_m:.0f} m, {braking_m_s2:.1f} m/s2",
        _steady(_NORTH, 0.0, speed_m_s),
        Drive(_NORTH, lead_at_m, (begin_s, stands_s), (speed_m_s, 0.0)),
        asked_s,
    )


def _crossing(
    group: ProcedureName, host_m_s: float, other_m_s: float, case: str, asked_s: float | None
) -> Procedure:
    """The host's front meets the middle of the other's side."""
    return Procedure(
        group,
        case,
        _steady(_NORTH, -(LENGTH_M + WIDTH_M) / 2.0, host_m_s),
        _steady(Straight((0.0, 0.0), 0.0), 0.0, other_m_s),
        asked_s,
    )


def _left_turn(host_km_h: float, other_km_h: float) -> Procedure:
    """The front of the host meets that of the oncoming car in the middle of its lane."""
    curvature = 1.0 / _TURN_RADIUS_M[host_km_h]
    clothoid_m = 2.0 * _CLOTHOID_RAD / curvature
    arc_m = (math.pi / 2.0 - 2.0 * _CLOTHOID_RAD) / curvature
    path = Bent(
        (
            (clothoid_m, 0.0, curvature),
            (arc_m, curvature, curvature),
            (clothoid_m, curvature, 0.0),
        )
    )
    way_m = np.arange(0.0, 40.0, _FINE_M)
    middle_m, course_rad = path.at(way_m)
    front_m = middle_m + LENGTH_M / 2.0 * np.stack([np.cos(course_rad), np.sin(course_rad)], axis=1)
    meets = int(np.argmax(front_m[:, 0] <= -LANE_M))
    oncoming = Straight((-LANE_M, float(front_m[meets, 1])), -math.pi / 2.0)
    return Procedure(
        ProcedureName.CCFTAP,
        f"{host_km_h:.0f}/{other_km_h:.0f} km/h",
        _steady(path, float(way_m[meets]), host_km_h * KM_H),
        _steady(oncoming, -LENGTH_M / 2.0, other_km_h * KM_H),
    )


def _head_on(km_h: float, *, changes_lane: bool) -> Procedure:
    """Both at the same speed; the lane change takes 3 s and ends in the contact."""
    speed_m_s, name = km_h * KM_H, ProcedureName.CCFHOS
    path: DrivenLine = _NORTH
    at_m = aside_m = 0.0
    if changes_lane:
        name, at_m, aside_m = ProcedureName.CCFHOL, 3.0 * speed_m_s, -LANE_M
        bend = LANE_M * (2.0 / at_m) ** 2
        path = Bent(((at_m / 2.0, bend, bend), (at_m / 2.0, -bend, -bend)))
    oncoming = Straight((aside_m, at_m), -math.pi / 2.0)
    return Procedure(
        name,
        f"{km_h:.0f}/{km_h:.0f} km/h",
        _steady(path, at_m - LENGTH_M / 2.0, speed_m_s),
        _steady(oncoming, -LENGTH_M / 2.0, speed_m_s),
    )


def _euro_ncap() -> Iterator[Procedure]:
    for km_h in (30, 50, 80):
        yield _behind(ProcedureName.CCRS, (km_h * KM_H, 0.0), f"{km_h} km/h", EURO_NCAP_S)
    for km_h in (30, 50, 80):
        speeds_m_s = km_h * KM_H, 20 * KM_H
        yield _behind(ProcedureName.CCRM, speeds_m_s, f"{km_h}/20 km/h", EURO_NCAP_S)
    for gap_m, braking_m_s2 in product((12.0, 40.0), (2.0, 6.0)):
        yield _braking(ProcedureName.CCRB, 50 * KM_H, gap_m, braking_m_s2, EURO_NCAP_S)
    for host, other in product((20, 30, 40, 50, 60), (20, 30, 40, 50, 60)):
        yield _crossing(
            ProcedureName.CCCSCP, host * KM_H, other * KM_H, f"{host}/{other} km/h", EURO_NCAP_S
        )
    for turning, oncoming in product((10.0, 15.0, 20.0), (30.0, 45.0, 60.0)):
        yield _left_turn(turning, oncoming)
    for speed_km_h, changes_lane in product((50.0, 70.0), (False, True)):
        yield _head_on(speed_km_h, changes_lane=changes_lane)


def _nhtsa() -> Iterator[Procedure]:
    name = ProcedureName.NHTSA_FCW
    yield _behind(name, (45 * MPH, 0.0), "45/0 mph", 2.1)
    yield _behind(name, (45 * MPH, 20 * MPH), "45/20 mph", 2.0)
    yield _braking(name, 45 * MPH, 30.0, 0.3 * G, 2.4)
    for mph in (25, 35, 45):
        yield _crossing(ProcedureName.NHTSA_IMA, mph * MPH, mph * MPH, f"{mph}/{mph} mph", None)


def _fmvss_127() -> Iterator[Procedure]:
    name = ProcedureName.FMVSS_127
    for km_h in (20, 40, 60, 80):
        yield _behind(name, (km_h * KM_H, 0.0), f"{km_h}/0 km/h", None)
    for km_h in (40, 60, 80):
        yield _behind(name, (km_h * KM_H, 20 * KM_H), f"{km_h}/20 km/h", None)
    for km_h, gap_m, share in product((50, 80), (12.0, 40.0), (0.3, 0.5)):
        yield _braking(name, km_h * KM_H, gap_m, share * G, None)


def _pack() -> Mapping[ProcedureName, Sequence[Procedure]]:
    cases = [*_euro_ncap(), *_nhtsa(), *_fmvss_127()]
    return {name: [case for case in cases if case.group is name] for name in ProcedureName}


PROCEDURES = _pack()
"""All cases, by their group."""
