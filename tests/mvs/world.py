"""A few cars on a plane, those with a radio each running a real MVS core, in virtual time."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import cpm, sdsm
from onboard.misbehaviour.evidence_check import MAX_MEASUREMENTS_PER_ESTIMATE
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings, SensingSettings, SharedIn
from onboard.observations import Position, VehicleDetection
from onboard.tracking.evidence import measured_ms
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.typed import a

ORIGIN = LocalFrame(48.1, 11.5)
EXACT = MvsSettings(sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.01))
"""The world below ranges to the middle of a car."""


def to_degrees(x_m: float, y_m: float) -> tuple[float, float]:
    """Latitude and longitude of a place in the world's frame, by Newton's method."""
    latitude, longitude = ORIGIN.latitude_deg, ORIGIN.longitude_deg
    for _ in range(4):
        east_m, north_m = ORIGIN.position_m(latitude, longitude)
        latitude += (y_m - north_m) / 111_200
        longitude += (x_m - east_m) / (111_300 * math.cos(math.radians(latitude)))
    return latitude, longitude


@dataclass
class Car:
    """One car that drives straight on."""

    name: str
    x_m: float
    y_m: float
    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    radio: bool = True
    sees: frozenset[str] = frozenset()
    clock_offset_s: float = 0.0
    """UTC less its own clock."""
    heading_rad: float | None = None
    """Taken from its velocity by default."""

    def at(self, t: float) -> np.ndarray:
        """True state (4) at UTC `t`."""
        return np.array(
            [self.x_m + self.vx_m_s * t, self.y_m + self.vy_m_s * t, self.vx_m_s, self.vy_m_s]
        )

    @property
    def id(self) -> bytes:
        """Temporary ID."""
        return self.name.encode().rjust(4, b"-")


@dataclass
class Message:
    """A BSM on its way."""

    sender: Car
    state: Position
    """On UTC; put on the receiver's clock when delivered."""
    footer: bytes | None
    sdsm: bytes | None = None
    cpm: bytes | None = None


Radio = Callable[[Message, Car, float], list[float]]
"""Delays with which a message reaches a receiver: none if it is lost, two if it is doubled."""


def perfect_radio(message: Message, receiver: Car, t: float) -> list[float]:
    """Everything arrives at once, well, after 2 ms."""
    return [0.002]


@dataclass
class World:
    """Cars, what is under way between them, and the time."""

    cars: list[Car]
    radio: Radio = perfect_radio
    settings: MvsSettings = EXACT
    max_measurements: int = MAX_MEASUREMENTS_PER_ESTIMATE
    by_cpm: bool = False
    """Whether CPMs carry what is shared, and neither footers nor SDSMs."""
    seed: int = 1
    position_sigma_m: float = 0.3
    range_sigma_m: float = 0.3
    bearing_sigma_rad: float = 0.01
    t: float = 1000.0
    """UTC."""
    under_way: list[tuple[float, int, Car, Message]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.start = self.t
        self.mvs = {
            car.name: MultiVehicleSensing(
                self.settings,
                car.id,
                np.random.default_rng(2),
                car.clock_offset_s,
                max_measurements=self.max_measurements,
            )
            for car in self.cars
            if car.radio
        }
        self.with_radio = [car for car in self.cars if car.radio]
        self.sent: list[Message] = []
        for car in self.with_radio:
            self.mvs[car.name].receive_position(self.on_clock(self.arrival(car), car))

    def car(self, name: str) -> Car:
        return next(car for car in self.cars if car.name == name)

    def truth(self, name: str) -> np.ndarray:
        return self.car(name).at(self.t - self.start)

    def run(self, seconds: float) -> None:
        """Step the cars one after the other, each at 10 Hz."""
        for _ in range(round(seconds * 10)):
            for car in self.with_radio:
                self.t += 0.1 / len(self.with_radio)
                self.deliver()
                self.step(car)

    def step(self, car: Car) -> None:
        """Fix, picture, broadcast."""
        mvs, now = self.mvs[car.name], self.t - car.clock_offset_s
        state = self.truth(car.name)
        fix = self.fix(car, state)
        mvs.receive_position(self.on_clock(fix, car))
        for number, other in enumerate(self.cars):
            if other.name in car.sees:
                mvs.receive_detection(self.seen(car, state, other, number))
        shared_in, message = self.settings.shared_in, Message(car, fix, None)
        if self.by_cpm:
            perceived = mvs.cpm_to_send(now)
            message.cpm = None if perceived is None else cpm.encode(perceived)
            return self.broadcast(message)
        if shared_in is not SharedIn.SDSM:
            message.footer = mvs.footer_to_send(now)
        if shared_in is not SharedIn.FOOTER and (shared := mvs.sdsm_to_send(now)) is not None:
            message.sdsm = sdsm.encode(shared)
        return self.broadcast(message)

    def arrival(self, car: Car) -> Position:
        """A car that stands when the world begins has a heading from its drive before."""
        heading = car.heading_rad
        if heading is None:
            heading = math.atan2(car.vx_m_s, car.vy_m_s)
        place = to_degrees(car.x_m, car.y_m)
        return Position(self.start - 0.1, *place, None, self.position_sigma_m, 10.0, heading)

    def fix(self, car: Car, state: np.ndarray) -> Position:
        noisy = state[:2] + self.rng.normal(0, self.position_sigma_m, 2)
        heading = car.heading_rad
        if heading is None:
            heading = math.atan2(state[2], state[3])
        return Position(
            self.t,
            *to_degrees(*noisy),
            None,
            self.position_sigma_m,
            math.hypot(*state[2:]),
            heading,
        )

    def seen(self, car: Car, state: np.ndarray, other: Car, number: int) -> VehicleDetection:
        heading = car.heading_rad
        if heading is None:
            heading = math.atan2(state[2], state[3])
        east_m, north_m = self.truth(other.name)[:2] - state[:2]
        return VehicleDetection(
            self.t - car.clock_offset_s,
            number,
            math.hypot(east_m, north_m) + self.rng.normal(0, self.range_sigma_m),
            self.range_sigma_m,
            math.atan2(east_m, north_m) - heading + self.rng.normal(0, self.bearing_sigma_rad),
            self.bearing_sigma_rad,
        )

    def broadcast(self, message: Message) -> None:
        self.sent.append(message)
        for receiver in self.with_radio:
            if receiver is not message.sender:
                for delay in self.radio(message, receiver, self.t):
                    self.under_way.append((self.t + delay, len(self.under_way), receiver, message))

    def deliver(self) -> None:
        arrived = sorted(item for item in self.under_way if item[0] <= self.t)
        self.under_way = [item for item in self.under_way if item[0] > self.t]
        for at, _, receiver, message in arrived:
            self.mvs[receiver.name].receive_bsm(
                message.sender.id,
                self.on_clock(message.state, receiver),
                message.footer,
                at - receiver.clock_offset_s,
            )
            if message.sdsm is not None:
                self.mvs[receiver.name].receive_sdsm(
                    sdsm.decode(message.sdsm), at - receiver.clock_offset_s
                )
            if message.cpm is not None:
                self.mvs[receiver.name].receive_cpm(
                    cpm.decode(message.cpm), at - receiver.clock_offset_s
                )

    @staticmethod
    def on_clock(fix: Position, car: Car) -> Position:
        return Position(
            fix.stamp_s - car.clock_offset_s, fix.latitude_deg, fix.longitude_deg, None,
            fix.sigma_m, fix.speed_m_s, fix.course_rad,
        )  # fmt: skip

    def known(self, name: str) -> list[PerceivedObject]:
        """The kinematic-info of a car, now."""
        car = self.car(name)
        mvs, now = self.mvs[name], self.t - car.clock_offset_s
        mvs.update(now)
        return mvs.kinematic_info(now)

    def without_radio(self, name: str) -> list[PerceivedObject]:
        """What it knows of cars without a radio."""
        return [car for car in self.known(name) if car.source is not ObjectSource.BSM]

    def place_of(self, name: str, known: PerceivedObject) -> np.ndarray:
        """State (4) of a car known to `name`, in the world's frame."""
        frame = a(LocalFrame, self.mvs[name]._host.frame)
        turn, shift = ORIGIN.mapping_from(frame)
        return np.concatenate([turn @ known.state[:2] + shift, turn @ known.state[2:]])

    def discarded(self, name: str) -> list[str]:
        """Reasons since last asked."""
        reasons = []
        while (event := self.mvs[name].next_event()) is not None:
            reasons.append(event.reason)
        return reasons


def assert_lists_each_measurement_once(world: World) -> None:
    """The invariant: whatever is known, its evidence has no measurement in common."""
    for name, mvs in world.mvs.items():
        for track in mvs._tracks:
            used = [identity for piece in track.used for identity in piece.provenance]
            assert len(used) == len(set(used)), name
        for known in world.without_radio(name):
            assert known.provenance
            assert all(measured_ms(each) <= world.t * 1000 + 1 for each in known.provenance)


def only(known: list[PerceivedObject]) -> PerceivedObject:
    (car,) = known
    return car


def ring(n: int, **changes: object) -> World:
    """n cars with radios around one without; each measures it, all receive each other."""
    cars = [
        Car(
            f"c{k}",
            40 * math.cos(2 * math.pi * k / n),
            40 * math.sin(2 * math.pi * k / n),
            clock_offset_s=100.0 * k,
            sees=frozenset({"x"}),
            heading_rad=k * 0.5,
        )
        for k in range(n)
    ]
    return World([*cars, Car("x", -5, 3, 4.0, -2.0, radio=False)], **changes)  # type: ignore[arg-type]
