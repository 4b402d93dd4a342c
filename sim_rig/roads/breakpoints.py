"""Motion of a scenario's cars: speed and lane at breakpoints, or a recorded trajectory."""

from collections.abc import Mapping, Sequence

from typing_extensions import override

from sim_rig.roads.path import Path, Point, bent_m, heading_rad
from sim_rig.roads.piecewise_linear import Breakpoints, PiecewiseLinear
from sim_rig.roads.road import CarState, Road
from sim_rig.roads.trace_files import read_trace
from sim_rig.roads.trajectory_drive import TrajectoryDrive
from sim_rig.scenario.schema import RoadSettings, Scenario, ScenarioCar, ScenarioPedestrian


class BreakpointRoad(Road):
    """Evaluates the breakpoints exactly, at any times in any order."""

    def __init__(self, scenario: Scenario) -> None:
        files = {car.trajectory for car in scenario.cars.values() if car.trajectory is not None}
        traces = {file: read_trace(file) for file in files}
        self._cars = {
            name: BreakpointDrive(car, scenario.roads[car.road], scenario.lane_width_m)
            if car.trajectory is None
            else TrajectoryDrive(traces[car.trajectory].drive(name), car.height_m)
            for name, car in scenario.cars.items()
        }
        self._at_s = -1.0
        self._states: Mapping[str, CarState] = {}

    @override
    def cars_at(self, at_s: float) -> Mapping[str, CarState]:
        if at_s != self._at_s:
            self._states = {name: drive.state(at_s) for name, drive in self._cars.items()}
            self._at_s = at_s
        return self._states

    def brake(self, car: str, begin_s: float, until_s: float, deceleration_m_s2: float) -> None:
        """Let a car brake, instead of how it was to brake from `begin_s` on.

        Args:
            car: name of the car, which has breakpoints.
            begin_s: start of the braking since the start of the scenario, s; not in the past.
            until_s: end of the braking.
            deceleration_m_s2: 0 ends the braking.
        """
        drive = self._cars[car]
        assert isinstance(drive, BreakpointDrive)  # noqa: S101 (by the schema)
        drive.brake(begin_s, until_s, deceleration_m_s2)
        self._at_s = -1.0

    @override
    def lane_ahead(self, car: str, at_s: float, ahead_m: Sequence[float]) -> Sequence[Point]:
        drive = self._cars[car]
        return drive.lane_ahead(at_s, ahead_m) if isinstance(drive, BreakpointDrive) else []

    @override
    def car_at(self, car: str, at_s: float) -> CarState:
        return self._cars[car].state(at_s)


class BreakpointDrive:
    """Motion of one car, or of one pedestrian, by breakpoints."""

    def __init__(
        self, car: ScenarioCar | ScenarioPedestrian, road: RoadSettings, lane_width_m: float
    ) -> None:
        self._car = car
        bends = [(bend.from_m, bend.until_m, bend.radius_m) for bend in road.bends]
        self._path = Path(bent_m(bends) if bends else road.points_m)
        self._elevation_m = road.elevation_m
        self._lane = PiecewiseLinear(car.lane)
        self._lane_width_m = lane_width_m
        self._set_course(car.speed_m_s)

    def brake(self, begin_s: float, until_s: float, deceleration_m_s2: float) -> None:
        """See `BreakpointRoad.brake`."""
        self._set_course(
            braked(self._course, self._car.speed_m_s, begin_s, until_s, deceleration_m_s2)
        )

    def _set_course(self, course: Breakpoints) -> None:
        self._course = course
        self._speed_m_s = PiecewiseLinear(course)
        *_, driven_m = self._speed_m_s.sample(0.0)
        self._zero_m = self._car.start_m - driven_m

    def lane_ahead(self, at_s: float, ahead_m: Sequence[float]) -> Sequence[Point]:
        """See `Road.lane_ahead`."""
        *_, driven_m = self._speed_m_s.sample(at_s)
        left_m = round(self._lane.value(at_s) - 1) * self._lane_width_m
        return [self._path.place(self._zero_m + driven_m + each, left_m) for each in ahead_m]

    def state(self, at_s: float) -> CarState:
        """Return the state at a time since the start of the scenario, s."""
        speed_m_s, acceleration_m_s2, driven_m = self._speed_m_s.sample(at_s)
        front_m = self._zero_m + driven_m
        left_m = (self._lane.value(at_s) - 1) * self._lane_width_m
        # The heading is that of the line from rear to front bumper, so that cars turn in bends.
        front = self._path.place(front_m, left_m)
        rear = self._path.place(front_m - self._car.length_m, left_m)
        return CarState(
            x_m=(front[0] + rear[0]) / 2,
            y_m=(front[1] + rear[1]) / 2,
            heading_rad=heading_rad(rear, front),
            elevation_m=self._elevation_m,
            front_m=front_m,
            speed_m_s=speed_m_s,
            acceleration_m_s2=acceleration_m_s2,
            length_m=self._car.length_m,
            width_m=self._car.width_m,
            height_m=self._car.height_m,
        )


def braked(
    course: Breakpoints,
    planned: Breakpoints,
    begin_s: float,
    until_s: float,
    deceleration_m_s2: float,
) -> Breakpoints:
    """Return a course of speed with other braking from `begin_s` on.

    The car brakes as planned if that is harder, and gains no speed any more.

    Args:
        course: the present one.
        planned: without any braking but the driver's.
        begin_s: start of the braking.
        until_s: its end.
        deceleration_m_s2: of the braking.
    """
    speed_m_s, at_s = PiecewiseLinear(course).value(begin_s), begin_s
    plan = PiecewiseLinear(planned)
    points = [point for point in course if point[0] < begin_s] + [(begin_s, speed_m_s)]
    ends_s = {until_s, *(at_s for at_s, _ in planned)}
    for end_s in sorted(each for each in ends_s if each > begin_s):
        _, slope_m_s2, _ = plan.sample(at_s)
        braking_m_s2 = max(-slope_m_s2, deceleration_m_s2 if at_s < until_s else 0.0, 0.0)
        if braking_m_s2 * (end_s - at_s) > speed_m_s:
            stops_s = at_s + speed_m_s / braking_m_s2
            return [*points, (stops_s, 0.0)] if stops_s > at_s else points
        speed_m_s -= braking_m_s2 * (end_s - at_s)
        at_s = end_s
        points.append((at_s, speed_m_s))
    return points
