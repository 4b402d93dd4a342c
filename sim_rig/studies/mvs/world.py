"""Many cars that share evidence: each car with a radio has the `SharedSensing` of a vehicle.

Its inputs are made from the true motion: fixes with noise, and detections of a ranging
sensor all around, with a limited range, noise, misses, and occlusion by cars and buildings. Their
messages reach every car in range, unless lost, or go over the 802.11p channel. Each footer is
decoded once for all receivers.
"""

import math
from collections.abc import Iterable, Set
from dataclasses import dataclass, field, replace
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from onboard.kinematics.local_frame import LocalFrame
from onboard.kinematics.units import KM_H
from onboard.messages import bsm, sdsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.mvs.footer_coding import read
from onboard.mvs.host_vehicle import HostVehicle
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings
from onboard.observations import HardBrake, Position, Speed, VehicleDetection
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState
from onboard.settings import Settings
from onboard.tracking.evidence import Measurement, MeasurementId
from onboard.tracking.tracks import DEFAULTS, TrackingParameters
from onboard.vehicle.shared_sensing import SharedSensing
from sim_rig.cars.vehicle_camera import REAR_VIEW_RAD
from sim_rig.roads.cars import Array, Cars, Traffic
from sim_rig.roads.line_of_sight import Blocked
from sim_rig.scenario.radio_settings import CsmaSettings, SidelinkSettings
from sim_rig.scenario.sensor_settings import LensSettings
from sim_rig.studies.mvs.sampled_bus import TICK_S, SampledBus
from sim_rig.studies.radio.lossy_reach import LossyReach
from sim_rig.studies.radio.study_channel import BSM_BYTES, StudyChannel

ORIGIN = LocalFrame(47.37, 8.54)
START_UTC_S = 1_750_000_000.0
_BSM_PRIORITY = 5
_ARRIVAL_M_S = 10.0
"""Speed of the first fix of a car, which gives it a heading even if it stands."""


FooterSize = Annotated[int, Field(ge=0, le=64)]
"""M, as `MvsSettings.max_entries` bounds it."""


class WorldSettings(Settings):
    """True properties of sensors and radio."""

    senses: bool = True
    """Whether cars with a radio have sensors."""
    sensing_range_m: float = Field(60.0, gt=0.0)
    """Range of the sensors."""
    view_deg: float = Field(360.0, gt=0.0, le=360.0)
    """Field of view, centred straight ahead."""
    rear_only: bool = False
    """Whether only cars that show their rear, up to 60 degrees aslant, are detected."""
    detection: float = Field(0.95, ge=0.0, le=1.0)
    """Probability that a car in view is detected in one tick."""
    range_sigma_m: float = Field(0.4, ge=0.0)
    """Standard deviation of a range at 0 m."""
    range_sigma_per_m: float = Field(0.01, ge=0.0)
    """Added to it, for each metre of range; one of both is above 0."""
    bearing_sigma_rad: float = Field(0.01, gt=0.0)
    """Standard deviation of a bearing."""
    range_rate_sigma_m_s: float | None = Field(None, gt=0.0)
    """Error of the range rate; without it none is measured."""
    plate_lens: LensSettings | None = None
    """Lens of a camera that reads plates, with which cars run LCCA (`mvs/lcca.py`)."""
    position_sigma_m: float = Field(0.4, gt=0.0)
    """Standard deviation of a fix, on each horizontal axis."""
    speed_sigma_m_s: float = Field(0.1, ge=0.0)
    """Of each component of the velocity; the error of the course follows from it."""
    bus_speed_step_m_s: float = Field(KM_H, gt=0.0)
    """Resolution of the speed on the car's bus; by default that of OBD, polled in each tick."""
    reach_m: float = Field(300.0, gt=0.0)
    """Range of the radio."""
    loss: float = Field(0.0, ge=0.0, le=1.0)
    """Probability that one receiver in range loses a message."""
    csma: CsmaSettings | None = None
    """The 802.11p channel; replaces `reach_m` and `loss`."""
    sidelink: SidelinkSettings | None = None
    """C-V2X, where `csma` is not given."""
    blocker_radius_m: float = Field(0.9, ge=0.0)
    """A car occludes what lies behind a disc of this radius."""

    @model_validator(mode="after")
    def _has_a_range_error(self) -> Self:
        if not self.range_sigma_m + self.range_sigma_per_m > 0.0:
            raise ValueError("range_sigma_m and range_sigma_per_m are both 0; one must be above")
        return self


@dataclass(frozen=True, slots=True, eq=False)
class TrueMeasurement:
    """A direct measurement and the car that it is truly about."""

    car: str
    measurement: Measurement
    """In the frame of `ORIGIN`."""


@dataclass(slots=True, eq=False)
class WorldCar:
    """A car with a radio."""

    host: HostState
    sharing: SharedSensing
    bus: SampledBus
    phase_s: float
    """Time into each tick at which it acts."""
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
        self._blocked = blocked
        self._seed = seed
        self._rng = np.random.default_rng(seed)
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
        return self._numbers.setdefault(car, len(self._numbers)).to_bytes(4)

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
        self.cars[name] = car = WorldCar(host, sharing, bus, phase_s)
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
        car, settings = self.cars[name], self.settings
        own = cars.names.index(name)
        course_rad = math.pi / 2.0 - float(cars.heading_rad[own])
        speed_m_s = float(cars.speed_m_s[own])
        for sample in car.bus.sample(speed_m_s, self.now):
            car.receive_observation(sample, self.now)
        self._receive_fix(name, self._fix(cars, own, speed_m_s))
        for other in self._in_view(own, cars).tolist() if settings.senses else ():
            apart_m = cars.middle_m[other] - cars.middle_m[own]
            east_m, north_m = apart_m.tolist()
            range_m = math.hypot(east_m, north_m)
            range_sigma_m = settings.range_sigma_m + settings.range_sigma_per_m * range_m
            bearing_rad = math.atan2(east_m, north_m) - course_rad
            detection = VehicleDetection(
                self.now,
                int.from_bytes(self.own_id(cars.names[other])),
                max(range_m + range_sigma_m * self._rng.normal(), 0.0),
                range_sigma_m,
                bearing_rad + settings.bearing_sigma_rad * self._rng.normal(),
                settings.bearing_sigma_rad,
            )
            rate_sigma_m_s = settings.range_rate_sigma_m_s
            if rate_sigma_m_s is not None:
                closing = cars.velocity_m_s[other] - cars.velocity_m_s[own]
                rate_m_s = float(closing @ apart_m) / range_m + rate_sigma_m_s * self._rng.normal()
                detection = replace(
                    detection, range_rate_m_s=rate_m_s, range_rate_sigma_m_s=rate_sigma_m_s
                )
            car.sharing.receive_observation(detection, self.now)
            if self._records_measurements:
                self._record_measurement(name, cars.names[other], detection)
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
        velocity_m_s = speed_m_s * cars.ahead[own]
        east_m_s, north_m_s = velocity_m_s + settings.speed_sigma_m_s * self._rng.normal(size=2)
        return Position(
            self.now,
            *to_degrees(noisy_m),
            None,
            settings.position_sigma_m,
            math.hypot(east_m_s, north_m_s),
            math.atan2(east_m_s, north_m_s) % math.tau,
        )

    def _record_measurement(self, car: str, other: str, detection: VehicleDetection) -> None:
        measured = self._reference_hosts[car].measure(detection)
        assert not isinstance(measured, str)  # noqa: S101 (a core acts with a fix)
        stamp_ms = round((self.now + START_UTC_S) * 1000)
        measurement = Measurement(MeasurementId(self.own_id(car), stamp_ms), *measured)
        self.measurements.append(
            TrueMeasurement(other, measurement.mapped(*ORIGIN.mapping_from(self.frame_of(car))))
        )

    def _in_view(self, own: int, cars: Cars) -> NDArray[np.intp]:
        here = cars.middle_m[own]
        ranges = np.hypot(*(cars.middle_m - here).T)
        near = np.flatnonzero((ranges < self.settings.sensing_range_m) & (ranges > 0.0))
        towards = cars.middle_m[near] - here
        lengths = ranges[near]
        # Of every other near car (axis 1): distance along the line of sight, and beside it.
        along = towards @ towards.T / lengths[:, None]
        beside = (
            np.abs(
                towards[:, None, 0] * towards[None, :, 1]
                - towards[:, None, 1] * towards[None, :, 0]
            )
            / lengths[:, None]
        )
        radius = self.settings.blocker_radius_m
        occluded = (beside < radius) & (along > 0) & (along < lengths[:, None] - 2 * radius)
        visible = ~occluded.any(axis=1)
        if self._blocked is not None:
            visible &= ~self._blocked(here, cars.middle_m[near])
        visible &= self._rng.random(len(near)) < self.settings.detection
        sight_rad = np.arctan2(towards[:, 1], towards[:, 0])
        half_rad = math.radians(self.settings.view_deg) / 2.0
        visible &= _between(sight_rad, cars.heading_rad[own]) <= half_rad
        if self.settings.rear_only:
            visible &= _between(sight_rad, cars.heading_rad[near]) <= REAR_VIEW_RAD
        in_view: NDArray[np.intp] = near[visible]
        return in_view

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


def _between(angles_rad: Array, others_rad: Array) -> Array:
    """Angles (n,) between directions, from 0 to pi."""
    between_rad: Array = np.abs((angles_rad - others_rad + np.pi) % (2.0 * np.pi) - np.pi)
    return between_rad


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
