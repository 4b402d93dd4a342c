"""Recorded traffic in which each car keeps its gap to the one ahead on its path.

Cars that were recorded or retimed one by one can drive through each other. Here each follows its
recording in time, unless the intelligent driver model behind a car that drives its way, or in front
of a place where it gives way, asks for less: then it drives the same path later. What is lost in
time is won back where the recording stands.
"""

import numpy as np

from sim_rig.roads.car_following import COMFORTABLE_M_S2, CarFollowing, idm_acceleration
from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crashes import boxes_overlap
from sim_rig.roads.giving_way import stops_m
from sim_rig.roads.paced_drive import PacedDrive
from sim_rig.roads.paths import blocked_at_m
from sim_rig.roads.recording import STEP_S, RecordedTraffic
from sim_rig.roads.retimed import BRAKING_M_S2, GAINING_M_S2

_SEEN_M = 60.0
"""Cars within this distance are followed."""
_SAME_WAY = 0.5
"""Cosine of the greatest angle between cars of one way, 60 degrees: those of a bend, too."""
_MOST_LATE_S = 120.0
"""Time after the last recorded step at which the traffic ends."""
_LEAST_GAP_M = 0.1
"""Gaps count as this at least, so that they can divide."""


def following(recording: RecordedTraffic, model: CarFollowing | None = None) -> RecordedTraffic:
    """Return the same cars on the same paths, none driving into another one of its way.

    Args:
        recording: cars that may have been recorded one by one.
        model: of their drivers; by default, they gain speed as retimed cars do.
    """
    model = model or CarFollowing(acceleration_m_s2=GAINING_M_S2)
    drivers = [PacedDrive(drive) for drive in recording.drives]
    last = max((each.drive.last for each in drivers), default=-1) + round(_MOST_LATE_S / STEP_S)
    for step in range(last + 1):
        on_road = [each for each in drivers if each.is_on_road]
        for driver in drivers:
            if driver.is_due(step) and _has_room([*on_road, driver], step, model):
                driver.enter(step)
                on_road.append(driver)
        bounds_m_s2 = _bounds_m_s2(on_road, step, model)
        for driver, bound_m_s2 in zip(on_road, bounds_m_s2, strict=True):
            driver.go_on(step, bound_m_s2)
    return RecordedTraffic(each.driven() for each in drivers if each.ways_m)


def _cars(drivers: list[PacedDrive], step: int) -> Cars:
    places = [driver.place for driver in drivers]
    return Cars(
        step * STEP_S,
        tuple(driver.drive.name for driver in drivers),
        np.array([middle_m for middle_m, _ in places]),
        np.array([heading_rad for _, heading_rad in places]),
        np.array([driver.speed_m_s for driver in drivers]),
        np.zeros(len(drivers)),
        np.array([driver.drive.length_m for driver in drivers]),
        np.array([driver.drive.width_m for driver in drivers]),
    )


def _has_room(drivers: list[PacedDrive], step: int, model: CarFollowing) -> bool:
    """Whether the last of them can enter: neither it nor a car behind it has to brake hard."""
    cars = _cars(drivers, step)
    own = len(drivers) - 1
    if any(own in pair for pair in boxes_overlap(cars)):
        return False
    are_there = np.arange(len(drivers)) < own
    gaps_m = np.where(are_there[:, None] & are_there, np.inf, _gaps_m(drivers, cars))
    return bool((_idm_m_s2(cars, gaps_m, model) >= -BRAKING_M_S2).all())


def _bounds_m_s2(drivers: list[PacedDrive], step: int, model: CarFollowing) -> Array:
    """The most that each driver (n,) accelerates because of others; infinite without."""
    if not drivers:
        return np.zeros(0)
    cars = _cars(drivers, step)
    follows_m_s2 = _idm_m_s2(cars, _gaps_m(drivers, cars), model)
    may_drive_m = stops_m(drivers, _SAME_WAY)
    stops_m_s2 = _behind_m_s2(cars.speed_m_s, may_drive_m, cars.speed_m_s, model)
    return np.minimum(follows_m_s2, stops_m_s2)


def _gaps_m(drivers: list[PacedDrive], cars: Cars) -> Array:
    """The gap (n, n) of each to each other one on its path and of its way, else infinite."""
    gaps_m = np.full((len(cars), len(cars)), np.inf)
    distances_m = np.hypot(*(cars.middle_m[None] - cars.middle_m[:, None]).transpose(2, 0, 1))
    turns_rad = cars.heading_rad[None] - cars.heading_rad[:, None]
    may_follow = (distances_m < _SEEN_M) & (np.cos(turns_rad) > _SAME_WAY)
    np.fill_diagonal(may_follow, val=False)
    for at in np.flatnonzero(may_follow.any(axis=1)).tolist():
        path, way_m, others = drivers[at].path, drivers[at].way_m, np.flatnonzero(may_follow[at])
        gaps_m[at, others] = blocked_at_m(path, way_m, cars, at, others)
    # Of two that are in each other's way, where roads join, the farther one waits.
    rows = np.arange(len(cars))
    goes_first = (gaps_m < gaps_m.T) | ((gaps_m == gaps_m.T) & (rows[:, None] < rows))
    gaps_m[goes_first & np.isfinite(gaps_m.T)] = np.inf
    return gaps_m


def _idm_m_s2(cars: Cars, gaps_m: Array, model: CarFollowing) -> Array:
    nearest = gaps_m.argmin(axis=1)
    gap_m = gaps_m[np.arange(len(cars)), nearest]
    along = np.cos(cars.heading_rad[nearest] - cars.heading_rad)
    closing_m_s = cars.speed_m_s - cars.speed_m_s[nearest] * along
    return _behind_m_s2(cars.speed_m_s, gap_m, closing_m_s, model)


def _behind_m_s2(speed_m_s: Array, gaps_m: Array, closing_m_s: Array, model: CarFollowing) -> Array:
    """The acceleration (n,) behind what is this far ahead; infinite behind nothing."""
    bound_m_s2 = idm_acceleration(
        speed_m_s,
        np.full(len(speed_m_s), np.inf),
        np.maximum(gaps_m, _LEAST_GAP_M),
        closing_m_s,
        COMFORTABLE_M_S2,
        model,
    )
    return np.where(np.isfinite(gaps_m), bound_m_s2, np.inf)
