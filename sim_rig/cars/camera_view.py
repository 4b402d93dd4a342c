"""The scene in front of a car's camera, for the renderer and for the camera model.

The camera is at the middle of the front bumper and looks straight ahead. The scene has cars of any
heading; plates are visible only from behind.
"""

import math
from collections.abc import Sequence

import numpy as np

from onboard.vision.lane import LaneShape
from onboard.vision.settings import Calibration
from sim_rig.rendering.scene import Scene, SceneCar
from sim_rig.roads.road import Road
from sim_rig.scenario.faults import PlateMisread
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import LensSettings

FPS = LensSettings().rate_hz
"""Frame rate of the rig's cameras where a scenario names none."""


def calibration(lens: LensSettings) -> Calibration:
    """Calibration of a camera of the rig with this lens."""
    height_px = lens.width_px * 9 // 16
    return Calibration(
        width_px=lens.width_px,
        height_px=height_px,
        focal_x_px=lens.focal_px,
        focal_y_px=lens.focal_px,
        principal_x_px=lens.width_px / 2,
        principal_y_px=height_px / 2,
        mounting_height_m=1.3,
        pitch_rad=0.04,
        yaw_rad=0.0,
    )


LENS = calibration(LensSettings())
"""Calibration of the rig's cameras where a scenario names no lens."""

SMALL_LENS = calibration(LensSettings(width_px=320, focal_px=800.0))
"""The same at half the resolution, for machines with other load."""

SIGHT_M = 120.0
"""Range of the camera."""
MARKINGS_AHEAD_M = tuple(np.linspace(5.0, 35.0, 13).tolist())
"""Distances at which lines are seen: those of `LaneMarkingDetector`."""
DRAWN_AHEAD_M = tuple(np.linspace(0.0, 200.0, 101).tolist())
"""Points of a bend that pictures show."""
OTHER_LEVEL_M = 2.0
"""Cars on a road that is higher or lower by this are hidden by the bridge."""
COLOURS_BGR = {
    "green": (60, 120, 40),
    "red": (40, 40, 170),
    "blue": (150, 80, 30),
    "yellow": (50, 190, 210),
    "white": (225, 225, 225),
    "grey": (120, 115, 110),
}
_BRAKE_LIGHTS_M_S2 = -0.5
_STRAIGHT = 2
"""Points of a road without a bend."""


class CameraView:
    """The view from one car, over time."""

    def __init__(self, scenario: Scenario, road: Road, car: str, rng: np.random.Generator) -> None:
        """Mount the camera.

        Args:
            scenario: the scenario of the run.
            road: source of the cars' states.
            car: name of the host.
            rng: selects the frames with a misread plate.
        """
        self._scenario = scenario
        self._road = road
        self._car = car
        self._rng = rng
        self._road_settings = scenario.roads[scenario.cars[car].road]
        self._misread = [
            fault
            for fault in scenario.faults
            if isinstance(fault, PlateMisread) and fault.car == car
        ]

    def scene(self, at_s: float) -> Scene:
        """Scene ahead of the car at `at_s`; call it once per frame."""
        return Scene(
            cars=tuple(car for _, car in self.cars(at_s)),
            lane_width_m=self._scenario.lane_width_m,
            travelled_m=self._road.car_at(self._car, at_s).front_m,
            middle_m=self._drawn_lane(at_s),
        )

    def cars(self, at_s: float) -> list[tuple[str, SceneCar]]:
        """Cars ahead with their names, the nearest first; call it once per frame."""
        states = self._road.cars_at(at_s)
        own = states[self._car]
        cars = []
        for name, car in self._scenario.cars.items():
            other = states[name]
            ahead_m, right_m = own.seen_from_front(*other.point(-car.length_m / 2, 0.0))
            if (
                name == self._car
                or not 0.5 < ahead_m < SIGHT_M
                or abs(other.elevation_m - own.elevation_m) > OTHER_LEVEL_M
            ):
                continue
            seen = SceneCar(
                ahead_m=ahead_m,
                lateral_m=right_m,
                heading_rad=math.remainder(other.heading_rad - own.heading_rad, math.tau),
                width_m=car.width_m,
                height_m=car.height_m,
                length_m=car.length_m,
                plate=self._plate(name, at_s),
                tag_id=car.tag_id,
                colour_bgr=COLOURS_BGR[car.colour],
                braking=other.acceleration_m_s2 < _BRAKE_LIGHTS_M_S2,
            )
            cars.append((name, seen))
        return sorted(cars, key=lambda each: each[1].ahead_m)

    def marked_lane(self, at_s: float) -> LaneShape | None:
        """The host's lane by its lines, as the shipped camera fits them; `None` without lines."""
        points = self._lane_ahead(at_s, MARKINGS_AHEAD_M) if self._road_settings.marked else ()
        if not points:
            return None
        ahead_m, right_m = zip(*points, strict=True)
        bend, heading, offset_m = np.polyfit(ahead_m, right_m, 2)
        lane_width_m = self._scenario.lane_width_m
        return LaneShape(lane_width_m, float(offset_m), float(heading), 2.0 * float(bend))

    def _drawn_lane(self, at_s: float) -> tuple[tuple[float, float], ...]:
        """Middle of the lane where it bends; none where it is straight, or turns off a road."""
        settings = self._road_settings
        if not settings.bends and len(settings.points_m) == _STRAIGHT:
            return ()
        points = self._lane_ahead(at_s, DRAWN_AHEAD_M)
        ahead_m, right_m = np.diff(points, axis=0).T
        return points if settings.bends or (ahead_m > np.abs(right_m)).all() else ()

    def _lane_ahead(self, at_s: float, ahead_m: Sequence[float]) -> tuple[tuple[float, float], ...]:
        own = self._road.car_at(self._car, at_s)
        points = self._road.lane_ahead(self._car, at_s, ahead_m)
        return tuple(own.seen_from_front(*point) for point in points)

    def is_dark(self, at_s: float) -> bool:
        """Whether the images are black."""
        return self._scenario.has_fault("camera_dark", self._car, at_s)

    def is_frozen(self, at_s: float) -> bool:
        """Whether the camera repeats its last image."""
        return self._scenario.has_fault("camera_frozen", self._car, at_s)

    def _plate(self, name: str, at_s: float) -> str | None:
        """Text on the plate of `name` as this camera shows it in this frame."""
        for fault in self._misread:
            if fault.of == name and fault.holds(self._car, at_s):
                return fault.reads if self._rng.random() < fault.rate else self._true_plate(name)
        return self._true_plate(name)

    def _true_plate(self, name: str) -> str | None:
        return self._scenario.cars[name].plate
