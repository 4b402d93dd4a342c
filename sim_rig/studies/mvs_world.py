"""Many cars that share what they see: each car with a radio runs the very MVS core of the car.

What the cores are given is made from the true motion: fixes with noise, and cars seen by a ranging
sensor all around, with range, noise, misses, and no view through cars or buildings. What they send
is carried to everybody in reach, or lost.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.mvs.evidence import Measurement, MeasurementId
from onboard.mvs.local_frame import LocalFrame
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.own_car import OwnCar
from onboard.mvs.settings import MvsSettings
from onboard.observations import Position, SensedCar
from onboard.settings import Settings

Array = NDArray[np.float64]
Motion = Callable[[float], Array]
"""True states (N, 4) of all cars at a time in s, NaN for those that are not there: px, py, vx, vy;
x east, y north, of the middle of the car."""
Blocked = Callable[[Array, Array], NDArray[np.bool_]]
"""Whether something that stands between places (..., 2) and (..., 2) hides one from the other."""

ORIGIN = LocalFrame(47.37, 8.54)
TICK_S = 0.1
START_UTC_S = 1_750_000_000.0


class WorldSettings(Settings):
    """What is true of sensors and air."""

    sensing_range_m: float = Field(60.0, gt=0.0)
    detection: float = Field(0.95, ge=0.0, le=1.0)
    """Part of the pictures in which a car in view is found."""
    range_sigma_m: float = Field(0.4, gt=0.0)
    range_sigma_per_m: float = Field(0.01, ge=0.0)
    """On top, of the range."""
    bearing_sigma_rad: float = Field(0.01, gt=0.0)
    position_sigma_m: float = Field(0.4, gt=0.0)
    reach_m: float = Field(300.0, gt=0.0)
    """Of the radio."""
    loss: float = Field(0.0, ge=0.0, le=1.0)
    """Part of the copies of a message that do not arrive."""
    blocker_radius_m: float = Field(0.9, ge=0.0)
    """A car hides what lies behind a disc of this radius."""


@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """Cars that come and go, and what stands between them."""

    motion: Motion
    cars: int
    blocked: Blocked | None = None


@dataclass(frozen=True, slots=True, eq=False)
class TrueMeasurement:
    """A direct measurement and the car that it is truly of."""

    car: int
    measurement: Measurement
    """In the frame of `ORIGIN`."""


class MvsWorld:
    """Steps all cars; a car with a radio acts once in 0.1 s, each at its own phase."""

    def __init__(
        self,
        traffic: Traffic,
        equipped: list[int],
        settings: WorldSettings,
        mvs: MvsSettings,
        seed: int,
    ) -> None:
        self.motion = traffic.motion
        self.equipped = equipped
        self.settings = settings
        self._mvs_settings = mvs
        self._blocked = traffic.blocked
        self._rng = np.random.default_rng(seed)
        phases = self._rng.permutation(len(equipped)) / max(1, len(equipped))
        self._phases = dict(zip(equipped, phases.tolist(), strict=True))
        self.cores: dict[int, MultiVehicleSensing] = {}
        self._shadows: dict[int, OwnCar] = {}
        """Repeat what each core makes of its sensors, to know the measurements it made."""
        self.measurements: list[TrueMeasurement] = []
        self.footers: list[tuple[float, int, bytes]] = []
        """When, whose, what was sent in the last tick."""
        self.now = 0.0

    def own_id(self, car: int) -> bytes:
        """Temporary ID of a car."""
        return car.to_bytes(4)

    def tick(self) -> None:
        """Let every car with a radio that is there act once."""
        self.measurements.clear()
        self.footers.clear()
        began = self.now
        for car in sorted(self.equipped, key=self._phases.__getitem__):
            self.now = began + self._phases[car] * TICK_S
            states = self.motion(self.now)
            if np.isnan(states[car, 0]):
                self.cores.pop(car, None)
                continue
            if car not in self.cores:
                rng = np.random.default_rng([car, 1])
                self.cores[car] = MultiVehicleSensing(
                    self._mvs_settings, self.own_id(car), rng, START_UTC_S
                )
                self._shadows[car] = OwnCar(self._mvs_settings.sensing)
            self._act(car, states)
        self.now = began + TICK_S

    def frame_of(self, car: int) -> LocalFrame:
        """The frame in which a car holds what it knows."""
        frame = self._shadows[car].frame
        assert frame is not None  # noqa: S101 (a core acts with a fix)
        return frame

    def _act(self, car: int, states: Array) -> None:
        core, shadow, settings = self.cores[car], self._shadows[car], self.settings
        heading = math.atan2(states[car, 2], states[car, 3])
        noisy = self._mvs_settings.sensing.heading_sigma_rad * self._rng.normal()
        fix = self._fix(states[car], heading + noisy)
        core.receive_position(fix)
        shadow.receive_position(fix)
        for other in self._in_view(car, states):
            east_m, north_m = states[other, :2] - states[car, :2]
            range_m = math.hypot(east_m, north_m)
            range_sigma_m = settings.range_sigma_m + settings.range_sigma_per_m * range_m
            seen = SensedCar(
                self.now,
                int(other),
                max(range_m + range_sigma_m * self._rng.normal(), 0.0),
                range_sigma_m,
                math.atan2(east_m, north_m)
                - heading
                + settings.bearing_sigma_rad * self._rng.normal(),
                settings.bearing_sigma_rad,
            )
            core.receive_sensed_car(seen)
            self._note(car, int(other), seen)
        self._broadcast(car, fix, core.footer_to_send(self.now), states)

    def _fix(self, state: Array, heading_rad: float) -> Position:
        noisy = state[:2] + self.settings.position_sigma_m * self._rng.normal(size=2)
        return Position(
            self.now,
            *to_degrees(noisy),
            None,
            self.settings.position_sigma_m,
            math.hypot(*state[2:]),
            heading_rad,
        )

    def _note(self, car: int, other: int, seen: SensedCar) -> None:
        placed = self._shadows[car].measure(seen)
        assert not isinstance(placed, str)  # noqa: S101 (a core acts with a fix)
        stamp_ms = round((self.now + START_UTC_S) * 1000)
        measurement = Measurement(MeasurementId(self.own_id(car), stamp_ms), *placed)
        self.measurements.append(
            TrueMeasurement(other, measurement.mapped(*ORIGIN.mapping_from(self.frame_of(car))))
        )

    def _in_view(self, car: int, states: Array) -> NDArray[np.intp]:
        here = states[car, :2]
        ranges = np.hypot(*(states[:, :2] - here).T)
        near = np.flatnonzero((ranges < self.settings.sensing_range_m) & (ranges > 0.0))
        towards = states[near, :2] - here
        lengths = ranges[near]
        # Of every other near car (axis 1): how far along the line of sight, and how far beside it.
        along = towards @ towards.T / lengths[:, None]
        beside = (
            np.abs(
                towards[:, None, 0] * towards[None, :, 1]
                - towards[:, None, 1] * towards[None, :, 0]
            )
            / lengths[:, None]
        )
        radius = self.settings.blocker_radius_m
        hides = (beside < radius) & (along > 0) & (along < lengths[:, None] - 2 * radius)
        visible = ~hides.any(axis=1)
        if self._blocked is not None:
            visible &= ~self._blocked(here, states[near, :2])
        visible &= self._rng.random(len(near)) < self.settings.detection
        in_view: NDArray[np.intp] = near[visible]
        return in_view

    def _broadcast(self, car: int, fix: Position, footer: bytes, states: Array) -> None:
        self.footers.append((self.now, car, footer))
        for receiver, core in self.cores.items():
            apart_m = math.dist(states[car, :2], states[receiver, :2])
            if (
                receiver != car
                and apart_m < self.settings.reach_m
                and self._rng.random() >= self.settings.loss
            ):
                core.receive_bsm(self.own_id(car), fix, footer, self.now)


def to_degrees(position_m: Array) -> tuple[float, float]:
    """Latitude and longitude of a place (2) in the frame of `ORIGIN`."""
    degrees = np.array([ORIGIN.latitude_deg, ORIGIN.longitude_deg])
    for _ in range(3):
        missing_m = position_m - ORIGIN.position_m(*degrees)
        degrees += missing_m[::-1] / _METRES_PER_DEGREE
    return float(degrees[0]), float(degrees[1])


_METRES_PER_DEGREE = np.array(
    [
        ORIGIN.position_m(ORIGIN.latitude_deg + 0.001, ORIGIN.longitude_deg)[1] / 0.001,
        ORIGIN.position_m(ORIGIN.latitude_deg, ORIGIN.longitude_deg + 0.001)[0] / 0.001,
    ]
)
