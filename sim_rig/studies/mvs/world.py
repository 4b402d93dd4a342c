"""Many cars that share evidence: each car with a radio has the `SharedSensing` of a vehicle.

Its inputs are made from the true motion: fixes with noise, and detections of a ranging
sensor all around, with a limited range, noise, misses, and occlusion by cars and buildings. Their
messages reach every car in range, unless lost, or go over the 802.11p channel. Each footer is
decoded once for all receivers.
"""

import math
from collections.abc import Iterable, Set
from dataclasses import dataclass, field

import numpy as np

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import bsm, sdsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.mvs.footer_reading import read
from onboard.mvs.host_vehicle import HostVehicle
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings
from onboard.observations import HardBrake, Position, Speed, VehicleDetection
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState
from onboard.tracking.evidence import Measurement, measurement_id
from onboard.tracking.tracks import DEFAULTS, TrackingParameters
from onboard.vehicle.shared_sensing import SharedSensing
from sim_rig.cars.gauss_markov import wandered
from sim_rig.roads.cars import Array, Cars, Traffic
from sim_rig.roads.line_of_sight import Blocked
from sim_rig.studies.mvs.ranging_sensor import RangingSensor
from sim_rig.studies.mvs.sampled_bus import TICK_S, SampledBus
from sim_rig.studies.mvs.world_settings import WorldSettings
from sim_rig.studies.radio.lossy_reach import LossyReach
from sim_rig.studies.radio.study_channel import BSM_BYTES, StudyChannel

ORIGIN = LocalFrame(47.37, 8.54)
START_UTC_S = 1_750_000_000.0
_BSM_PRIORITY = 5
_ARRIVAL_M_S = 10.0
"""Speed of the first fix of a car, which gives it a heading even if it stands."""


@dataclass(frozen=True, slots=True, eq=False)
class TrueMeasurement:
    """A direct measurement and the car that it is truly about."""

    car: str
    measurement: Measurement
    """In the frame of `ORIGIN`."""


class SlowError:
    """The error of a receiver that varies slowly, by a generator of its own."""

    def __init__(self, settings: WorldSettings, rng: np.random.Generator) -> None:
        """Draw the first one."""
        self._sigma_m, self._times = settings.bias_sigma_m, TICK_S / settings.bias_time_s
        self._rng = rng
        self.error_m: Array = self._sigma_m * rng.standard_normal(2)
        """(2,) of the last fix."""

    def go_on(self) -> Array:
        """Let a tick pass; returns `error_m`."""
        draws = self._rng.standard_normal(2)
        self.error_m = wandered(self.error_m, self._sigma_m, self._times, draws)
        return self.error_m


@dataclass(slots=True, eq=False)
class WorldCar:
    """A car with a radio."""

    host: HostState
    sharing: SharedSensing
    bus: SampledBus
    phase_s: float
    """Time into each tick at which it acts."""
    bias: SlowError
    """Of its receiver."""
    observations: list[Speed | HardBrake | Position] = field(default_factory=list)
    """Of its bus and receiver in the last tick; when it joins, also those of the time before."""
    received: list[BasicSafetyMessage] = field(default_factory=list)
    """The BSMs that it has received and used in the last tick."""

    def receive_observation(self, observation: Speed | HardBrake | Position, now: float) -> None:
        """Take what bus or receiver have measured."""
        self.host.receive_observation(observation)
        self.sharing.receive_observation(observation, now)
        self.observations.append(observation)


@dataclass(frozen=True, slots=True, eq=False)
class _Sent:
    """What a car sends in one tick, as it is decoded."""

    sender: str
    bsm: BasicSafetyMessage
    sdsm: SensorDataSharingMessage | None
    octets: int
    """Of both together."""


@dataclass(frozen=True, slots=True, eq=False)
class SentFooter:
    """One footer that was sent."""

    at_s: float
    sender: str
    footer: bytes
    entries: SharedEntries
    """The decoded footer."""
    receivers: tuple[str, ...]


class MvsWorld:
    """Steps all cars; a car with a radio senses and sends every 0.1 s, each at its own phase."""

    def __init__(
        self,
        traffic: Traffic,
        equipped: Set[str],
        settings: WorldSettings,
        mvs: MvsSettings,
        seed: int,
        *,
        blocked: Blocked | None = None,
        tracking: TrackingParameters = DEFAULTS,
        records_measurements: bool = False,
        tracks_sensed: bool = False,
    ) -> None:
        """Start at time 0.

        Args:
            traffic: motion of all cars.
            equipped: names of the cars with a radio.
            settings: of sensors and radio.
            mvs: settings of every core.
            seed: of noise, phases and losses.
            blocked: occlusion by buildings; None for none.
            tracking: parameters of every tracker.
            records_measurements: whether `measurements` is filled.
            tracks_sensed: whether every car tracks apart, too, what its own sensors measure.
        """
        self.traffic = traffic
        self.equipped = equipped
        self.settings = settings
        self._mvs_settings = mvs
        self._tracking = tracking
        self._tracks_sensed = tracks_sensed
        self._seed = seed
        self._rng = np.random.default_rng(seed)
        self._sensor = RangingSensor(settings, blocked, self._rng)
        self._numbers: dict[str, int] = {}
        self.cars: dict[str, WorldCar] = {}
        """Those with a radio that are present."""
        self._reference_hosts: dict[str, HostVehicle] = {}
        """Process the same inputs as each car, to compute the measurements that it makes; empty if
        these are not recorded."""
        self._records_measurements = records_measurements
        self.measurements: list[TrueMeasurement] = []
        """Of all cars in the last tick."""
        self.sent: list[SentFooter] = []
        """Footers of the last tick."""
        self.now = 0.0
        self._reach = LossyReach(settings.reach_m, settings.loss, self._rng)
        self._channel: StudyChannel[_Sent] | None = None
        channel = settings.csma or settings.sidelink
        if channel is not None:
            rng = np.random.default_rng([seed, 2])
            self._channel = StudyChannel(channel, sorted(equipped), rng)

    def own_id(self, car: str) -> bytes:
        """Temporary ID of a car."""
        return self._number(car).to_bytes(4)

    def _number(self, car: str) -> int:
        return self._numbers.setdefault(car, len(self._numbers))

    def tick(self) -> None:
        """Let every present car with a radio sense and send once."""
        self.measurements.clear()
        self.sent.clear()
        for car in self.cars.values():
            car.observations.clear()
            car.received.clear()
        began = self.now
        cars = self.traffic.cars_at(began)
        if self._channel is not None:
            self._channel.place(cars)
        with_radio = [name for name in cars.names if name in self.equipped]
        for gone in self.cars.keys() - set(with_radio):
            del self.cars[gone]
        for name in with_radio:
            if name not in self.cars:
                self._join(name, cars)
        for name in sorted(with_radio, key=lambda name: self.cars[name].phase_s):
            self.now = began + self.cars[name].phase_s
            self._receive()
            self._step_car(name, cars.moved_on(self.now - began))
        self.now = began + TICK_S
        self._receive()

    def world_position_m(self, car: str, state: tuple[float, ...]) -> Array:
        """Position (2,) in the frame of `ORIGIN` of a state in the local frame of `car`."""
        turn, shift = ORIGIN.mapping_from(self.frame_of(car))
        position_m: Array = turn @ np.array(state[:2]) + shift
        return position_m

    def frame_of(self, car: str) -> LocalFrame:
        """The local frame of a car's core."""
        frame = self.cars[car].sharing.mvs.frame
        assert frame is not None  # noqa: S101 (a core acts with a fix)
        return frame

    def _join(self, name: str, cars: Cars) -> None:
        """Create a car; its first fix has a speed, so that its heading is defined."""
        own_id = self.own_id(name)
        rng = np.random.default_rng([self._seed, *own_id])
        phase_s = float(rng.random()) * TICK_S
        own = cars.names.index(name)
        host = HostState()
        sharing = SharedSensing(
            self._mvs_settings,
            VehicleSize(length_m=float(cars.length_m[own]), width_m=float(cars.width_m[own])),
            Pseudonym(b"", own_id, 0, None, math.inf),
            rng,
            host,
            now=0.0,
            utc_offset_s=START_UTC_S,
            tracking=self._tracking,
            tracks_sensed=self._tracks_sensed,
        )
        bus = SampledBus(self.settings.bus_speed_step_m_s)
        bias = SlowError(self.settings, np.random.default_rng([self._seed, *own_id, 3]))
        self.cars[name] = car = WorldCar(host, sharing, bus, phase_s, bias)
        motion = float(cars.speed_m_s[own]), float(cars.acceleration_m_s2[own])
        for earlier in bus.earlier_samples(*motion, self.now + phase_s):
            car.receive_observation(earlier, earlier.stamp_s)
        if self._records_measurements:
            self._reference_hosts[name] = HostVehicle(self._mvs_settings.sensing)
        self._receive_fix(name, self._fix(cars, own, speed_m_s=_ARRIVAL_M_S))

    def _receive_fix(self, name: str, fix: Position) -> None:
        self.cars[name].receive_observation(fix, self.now)
        if name in self._reference_hosts:
            self._reference_hosts[name].receive_position(fix)

    def _step_car(self, name: str, cars: Cars) -> None:
        car, own = self.cars[name], cars.names.index(name)
        speed_m_s = float(cars.speed_m_s[own])
        for sample in car.bus.sample(speed_m_s, self.now):
            car.receive_observation(sample, self.now)
        self._receive_fix(name, self._fix(cars, own, speed_m_s))
        for other, detection in self._sensor.detections(own, cars, self._number, self.now):
            car.sharing.receive_observation(detection, self.now)
            if self._records_measurements:
                self._record_measurement(name, other, detection)
        self._broadcast(own, self._sent(name), cars)

    def _sent(self, name: str) -> _Sent:
        """Return what a car sends now; BSM and SDSM pass their codecs."""
        sharing = self.cars[name].sharing
        message, shared = sharing.bsm(self.now), sharing.sdsm(self.now)
        data = b"" if shared is None else sdsm.encode(shared)
        octets = BSM_BYTES + len(message.footer or b"") + len(data)
        return _Sent(
            name, bsm.decode(bsm.encode(message)), sdsm.decode(data) if data else None, octets
        )

    def _fix(self, cars: Cars, own: int, speed_m_s: float) -> Position:
        settings = self.settings
        noisy_m = cars.middle_m[own] + settings.position_sigma_m * self._rng.normal(size=2)
        noisy_m += self.cars[cars.names[own]].bias.go_on()
        velocity_m_s = speed_m_s * cars.ahead[own]
        east_m_s, north_m_s = velocity_m_s + settings.speed_sigma_m_s * self._rng.normal(size=2)
        return Position(
            self.now,
            *to_degrees(noisy_m),
            None,
            math.hypot(settings.position_sigma_m, settings.bias_sigma_m),
            math.hypot(east_m_s, north_m_s),
            math.atan2(east_m_s, north_m_s) % math.tau,
        )

    def _record_measurement(self, car: str, other: str, detection: VehicleDetection) -> None:
        measured = self._reference_hosts[car].measure(detection)
        assert not isinstance(measured, str)  # noqa: S101 (a core acts with a fix)
        stamp_ms = round((self.now + START_UTC_S) * 1000)
        measurement = Measurement(measurement_id(self.own_id(car), stamp_ms), *measured)
        self.measurements.append(
            TrueMeasurement(other, measurement.mapped(*ORIGIN.mapping_from(self.frame_of(car))))
        )

    def _broadcast(self, own: int, sent: _Sent, cars: Cars) -> None:
        if self._channel is not None:
            self._channel.send(sent.sender, sent, sent.octets, _BSM_PRIORITY, self.now)
            return
        apart_m = np.hypot(*(cars.middle_m - cars.middle_m[own]).T)
        apart_m[own] = math.inf
        reached = np.flatnonzero(self._reach.received(apart_m))
        self._deliver(sent, [cars.names[i] for i in reached])

    def _receive(self) -> None:
        channel = self._channel
        for sent, receivers in channel.received(self.now) if channel is not None else ():
            self._deliver(sent, receivers)

    def _deliver(self, sent: _Sent, reached: Iterable[str]) -> None:
        receivers = tuple(name for name in reached if name in self.cars)
        message, entries = sent.bsm, None
        if message.footer is not None:
            entries = read(message.footer)
            self.sent.append(SentFooter(self.now, sent.sender, message.footer, entries, receivers))
        for receiver in receivers:
            car, sender = self.cars[receiver], message.core.temporary_id
            if car.sharing.receive_bsm(message, sender, self.now, entries=entries):
                car.received.append(message)
            if sent.sdsm is not None:
                car.sharing.mvs.receive_sdsm(sent.sdsm, self.now)


def to_degrees(position_m: Array) -> tuple[float, float]:
    """Latitude and longitude of a position (2,) in the frame of `ORIGIN`."""
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
