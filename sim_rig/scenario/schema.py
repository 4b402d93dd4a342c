"""Schema of a scenario: cars, roads, radio, sensors, faults, and expected results.

The YAML files in `scenarios/` are data. The schema is strict: an unknown key, a wrong type, an
unknown car or a time out of order is an error that names file, field and value.
"""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from itertools import combinations, pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    StringConstraints,
    field_validator,
    model_validator,
)

from onboard.access.settings import AccessSettings
from onboard.lcca.settings import LccaSettings
from onboard.mvs.settings import SharedIn
from onboard.obd.settings import BroadcastSettings
from onboard.observations import Side
from onboard.settings import Settings, SettingsError, load_settings
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile
from sim_rig.scenario.background_settings import BackgroundSettings
from sim_rig.scenario.catalogue import SCENARIOS, scenario_names
from sim_rig.scenario.expectations import Expectation
from sim_rig.scenario.faults import Attack, Fault, PlateMisread, PowerCut, SlowCpu
from sim_rig.scenario.field_types import CarName, PlateText, RoadName, Seconds
from sim_rig.scenario.radio_settings import AirSettings, ReachSettings
from sim_rig.scenario.scenario_clock import RUN_UP_S
from sim_rig.scenario.sensor_settings import (
    DetectorProfile,
    EcuSettings,
    LensSettings,
    ReceiverSettings,
)
from sim_rig.scenario.signal_settings import Metres, SignalSettings


def _points(value: object) -> object:
    """Convert a constant, or YAML's lists of points, to a tuple of breakpoints."""
    if isinstance(value, int | float):
        return ((0.0, value),)
    if isinstance(value, list):
        return tuple(tuple(point) if isinstance(point, list) else point for point in value)
    return value


def _in_order(
    breakpoints: tuple[tuple[Seconds, float], ...],
) -> tuple[tuple[Seconds, float], ...]:
    for (sooner, _), (later, _) in pairwise(breakpoints):
        if later <= sooner:
            raise ValueError(f"breakpoints must grow in time, and {later:g} s follows {sooner:g} s")
    return breakpoints


SpeedCourse = Annotated[
    tuple[tuple[Seconds, Annotated[float, Field(ge=0.0, le=70.0)]], ...],
    Field(min_length=1),
    BeforeValidator(_points),
    AfterValidator(_in_order),
]
"""Speed at breakpoints, linear in between: `20.0`, or `[[0, 20.0], [10, 20.0], [12, 8.0]]`."""
LaneCourse = Annotated[
    tuple[tuple[Seconds, Annotated[float, Field(ge=0.0, le=9.0)]], ...],
    Field(min_length=1),
    BeforeValidator(_points),
    AfterValidator(_in_order),
]
"""Lane at breakpoints, 1 the rightmost; the lateral position is linear in between."""
Sentence = Annotated[str, StringConstraints(pattern=r"^[A-Z].{10,}[.]$")]


class RoadBend(Settings):
    """A bend of a road, between two distances along it."""

    from_m: float = Field(ge=0.0)
    until_m: float
    radius_m: float = Field(ge=-10_000.0, le=10_000.0)
    """Positive to the right, as in SAE J2735."""

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if abs(self.radius_m) < _LEAST_RADIUS_M:
            raise ValueError(f"radius_m must be {_LEAST_RADIUS_M:g} or more on either side")
        if self.until_m <= self.from_m:
            raise ValueError("until_m must be after from_m")
        return self


_LEAST_RADIUS_M = 10.0
EASTWARDS_M = ((0.0, 0.0), (1.0, 0.0))


class RoadSettings(Settings):
    """Course of lane 1 of a road."""

    points_m: tuple[tuple[Metres, Metres], ...] = Field(default=EASTWARDS_M, min_length=2)
    """East and north of the scenario's origin; straight in between and beyond both ends."""
    bends: tuple[RoadBend, ...] = ()
    """Instead of points: from the origin eastwards, and straight where it does not bend."""
    marked: bool = False
    """Whether cameras of virtual runs find the lines of its lanes; pictures always show them."""
    elevation_m: float = Field(default=0.0, ge=-100.0, le=100.0)
    """Height of the road; roads at different heights do not conflict."""

    @model_validator(mode="after")
    def _has_a_direction(self) -> Self:
        if any(one == other for one, other in pairwise(self.points_m)):
            raise ValueError("two points of a road that follow each other must differ")
        return self

    @model_validator(mode="after")
    def _has_one_course(self) -> Self:
        if self.bends and self.points_m != EASTWARDS_M:
            raise ValueError("bends exclude points_m")
        if any(after.from_m < before.until_m for before, after in pairwise(self.bends)):
            raise ValueError("bends must follow each other")
        return self


EASTWARDS = {"road": RoadSettings()}


class TurnSignalOn(Settings):
    """A time in which a turn signal of a car is on."""

    side: Side
    from_s: Seconds
    until_s: Seconds


class ScenarioCar(Settings):
    """One car."""

    plate: PlateText | None = None
    """Text of its rear plate."""
    tag_id: int | None = Field(default=None, ge=0, le=49)
    """AR tag instead of a plate, as on the model cars of the LCCA paper."""
    equipped: bool = True
    """Whether it runs `onboard`; other cars have no radio."""
    road: RoadName = "road"
    start_m: float = 0.0
    """Position of its front bumper along its road at the start of the scenario."""
    lane: LaneCourse = ((0.0, 1.0),)
    speed_m_s: SpeedCourse = ((0.0, 0.0),)
    trajectory: Path | None = None
    """Trace file with a car of this name, instead of `start_m`, `lane` and `speed_m_s`: it drives
    as recorded. A relative path is relative to the folder in which the rig is started."""
    length_m: float = Field(default=4.5, gt=1.0, le=20.0)
    width_m: float = Field(default=1.8, gt=0.5, le=3.0)
    height_m: float = Field(default=1.5, gt=0.5, le=4.0)
    colour: Literal["green", "red", "blue", "yellow", "white", "grey"] = "grey"
    obeys_request: bool = False
    """Whether it brakes as its daemon requests; from the first request on it gains no speed."""
    shared_in: SharedIn = SharedIn.FOOTER
    """What carries its measurements to the others."""
    access: AccessSettings = AccessSettings()
    """Driver-based channel access."""
    turn_signals: tuple[TurnSignalOn, ...] = ()
    """When its driver signals; its daemon reads that from `broadcast`."""
    broadcast: BroadcastSettings | None = None
    """Signals that its bus carries and its daemon reads, as `obd.broadcast` of `onboard`: speeds,
    turning, pedal and turn signals are those of the car, other signals 0. A `dbc` that is not found
    from the folder in which the rig is started is one of `sim_rig/scenarios`."""

    @field_validator("broadcast")
    @classmethod
    def _finds_the_dbc_file(cls, signals: BroadcastSettings | None) -> BroadcastSettings | None:
        if signals is None or signals.dbc.is_file():
            return signals
        return signals.model_copy(update={"dbc": SCENARIOS / signals.dbc})

    @model_validator(mode="after")
    def _has_one_motion(self) -> Self:
        given = self.model_fields_set & {"start_m", "lane", "speed_m_s"}
        if self.trajectory is not None and given:
            raise ValueError(f"trajectory excludes {', '.join(sorted(given))}")
        if self.trajectory is None and not {"start_m", "speed_m_s"} <= given:
            raise ValueError("either start_m and speed_m_s, or a trajectory")
        if self.obeys_request and not (self.equipped and self.trajectory is None):
            raise ValueError("obeys_request needs a daemon, and no trajectory")
        return self

    @property
    def identity(self) -> str:
        """The text from which its communication IDs are derived: its plate, or `TAG<n>`."""
        return self.plate if self.plate is not None else f"TAG{self.tag_id}"


class ScenarioPedestrian(Settings):
    """A pedestrian with a radio, whom cameras and detectors do not see."""

    road: RoadName
    """The way, which may cross others."""
    start_m: float = 0.0
    lane: LaneCourse = ((0.0, 1.0),)
    speed_m_s: SpeedCourse
    """As of a car."""
    length_m: ClassVar[float] = 0.6
    width_m: ClassVar[float] = 0.6
    height_m: ClassVar[float] = 1.7


class Scenario(Settings):
    """One scenario."""

    elsewhere: ClassVar[Mapping[str, str]] = {
        "car": "is the configuration of a car, not a scenario: onboard run"
    }

    title: Sentence
    seed: int = Field(ge=0)
    duration_s: float = Field(gt=0.0, le=600.0)
    cars: Mapping[CarName, ScenarioCar] = Field(min_length=1)
    roads: Mapping[RoadName, RoadSettings] = EASTWARDS
    """Default: one road that leads east."""
    lane_width_m: float = Field(default=3.5, gt=2.0, le=6.0)
    radio: AirSettings
    profile: RadioProfile = RadioProfile.WAVE
    """Messages and headers of all cars."""
    signal: SignalSettings | None = None
    """Signals of a crossing, whose road-side unit sends MAP and SPAT messages."""
    pedestrians: Mapping[CarName, ScenarioPedestrian] = {}
    """Who sends PSMs or VAMs."""
    lens: LensSettings = LensSettings()
    ecu: EcuSettings = EcuSettings()
    gnss: ReceiverSettings | None = None
    """GNSS receiver of every equipped car; without it, no car has a position."""
    detector: DetectorProfile | None = None
    """Vehicle detector of every equipped car, beside its plate camera: a profile's name, or its
    settings."""
    beacons: bool = True
    """Whether the cars send BSMs."""
    signed: bool = False
    """Whether messages are signed in virtual runs; in live runs they always are."""
    lcca: LccaSettings = LccaSettings()
    """Warning-group settings of every car."""
    background_traffic: int = Field(default=0, ge=0, le=200)
    """Number of invisible cars that only send BSMs, received by all."""
    traffic: BackgroundSettings | None = None
    """Who drives them: the nearest cars of a source at the start. Without it, they have no
    position."""
    faults: tuple[Fault, ...] = ()
    expect: tuple[Expectation, ...]

    @property
    def equipped(self) -> list[str]:
        """Names of the cars that run `onboard`."""
        return [name for name, car in self.cars.items() if car.equipped]

    @property
    def run_up_s(self) -> float:
        """Time before the start of a live run in which the cars drive, where places are measured.

        Else a car that waits for its start, and tells its speed, would near all that it perceives.
        """
        return 0.0 if self.gnss is None else RUN_UP_S

    @property
    def psids(self) -> frozenset[int]:
        """Services in which its vehicles send."""
        is_its = self.profile is RadioProfile.ITS_G5
        return psid.OF_ITS_VEHICLES if is_its else psid.OF_VEHICLES

    @property
    def unit_psids(self) -> frozenset[int]:
        """Services in which its road-side units send."""
        is_its = self.profile is RadioProfile.ITS_G5
        return psid.OF_ITS_ROAD_SIDE_UNITS if is_its else psid.OF_ROAD_SIDE_UNITS

    @property
    def pedestrian_psids(self) -> frozenset[int]:
        """Services in which its pedestrians send."""
        return frozenset({psid.VAM if self.profile is RadioProfile.ITS_G5 else psid.PSM})

    def has_fault(self, what: str, car: str, at_s: float) -> bool:
        """Whether a fault is active; one that begins with the scenario is so before it, too.

        Args:
            what: kind of the fault.
            car: name of the car.
            at_s: time since the start of the scenario, s.
        """
        return any(fault.what == what and fault.holds(car, max(0.0, at_s)) for fault in self.faults)

    def slowed_cars(self) -> frozenset[str]:
        """Return the cars whose daemon is late by a fault, which excuses nothing."""
        return frozenset(
            fault.car for fault in self.faults if isinstance(fault, PowerCut | SlowCpu)
        )

    def power_cuts(self) -> list[PowerCut]:
        """Return the power cuts of all cars."""
        return [fault for fault in self.faults if isinstance(fault, PowerCut)]


def load_scenario(name: str, profile: RadioProfile | None = None) -> Scenario:
    """Read a scenario that comes with the rig, by its name, or a file, by its path.

    Args:
        name: of the scenario, or of the file.
        profile: messages and headers of all cars, instead of the scenario's own.

    Raises:
        SettingsError: it does not exist or violates the schema; one line per mistake.
    """
    path = SCENARIOS / f"{name}.yaml"
    if not path.is_file():
        path = Path(name)
        if not path.is_file():
            near = get_close_matches(name, scenario_names(), 1)
            remedy = (
                f"did you mean {near[0]}?" if near else f"scenarios: {', '.join(scenario_names())}"
            )
            raise SettingsError(f"{name}: no such scenario or file; {remedy}")
    scenario = load_settings(path, Scenario)
    if profile is not None:
        scenario = scenario.model_copy(update={"profile": profile})
    mistakes = [f"{path}: {mistake}" for mistake in _mistakes(scenario)]
    if mistakes:
        raise SettingsError("\n".join(mistakes))
    return scenario


def _mistakes(scenario: Scenario) -> Iterator[str]:
    """Yield mistakes across fields: unknown cars, repeated identities, times out of order."""
    for field, name in _names_used(scenario):
        if name not in scenario.cars:
            yield f"{field}: no such car (given {name!r}); cars: {', '.join(scenario.cars)}"
    yield from _mistakes_of_cars(scenario)
    for index, entry in enumerate(scenario.expect):
        untraced = [name for name in entry.cars_traced() if name not in scenario.equipped]
        for name in untraced:
            if name in scenario.cars:
                yield f"expect.{index}: {name!r} is not equipped and has no trace"
    approaches = scenario.signal.approaches if scenario.signal is not None else {}
    for road in approaches:
        if road not in scenario.roads:
            yield f"signal.approaches.{road}: no such road; roads: {', '.join(scenario.roads)}"
    yield from _mistakes_of_pedestrians(scenario)
    has_others = approaches or scenario.pedestrians
    if has_others and isinstance(scenario.radio, ReachSettings) and scenario.radio.reach_m is None:
        yield "radio.neighbours: signal and pedestrians need reach_m instead"
    if scenario.traffic is not None and not scenario.background_traffic:
        yield "traffic: drives background_traffic (given 0); allowed: 1 to 200"
    yield from _mistakes_of_expectations(scenario)
    yield from _mistakes_of_faults(scenario)
    has_attack = any(isinstance(fault, Attack) for fault in scenario.faults)
    if scenario.profile is RadioProfile.ITS_G5 and has_attack:
        yield "faults: attackers send WSMs (given profile its-g5); allowed: wave"


def _mistakes_of_expectations(scenario: Scenario) -> Iterator[str]:
    """Yield intervals in which nothing can happen: what must not happen there never fails."""
    for index, entry in enumerate(scenario.expect):
        given = entry.model_dump(include={"from_s", "by_s", "until_s"}, exclude_none=True)
        times = sorted(given.items(), key=lambda item: _ORDER.index(item[0]))
        for (first, first_s), (second, second_s) in pairwise(times):
            if second_s <= first_s:
                yield f"expect.{index}.{second}: must be after {first} (given {second_s:g})"
        if times and times[0][1] >= scenario.duration_s:
            yield (
                f"expect.{index}.{times[0][0]}: must be before the end of the scenario, duration_s"
                f" = {scenario.duration_s:g} (given {times[0][1]:g})"
            )


_ORDER = ("from_s", "by_s", "until_s")
"""Of the times of an expectation."""


def _mistakes_of_faults(scenario: Scenario) -> Iterator[str]:
    for index, fault in enumerate(scenario.faults):
        if fault.until_s <= fault.from_s:
            yield f"faults.{index}.until_s: must be after from_s (given {fault.until_s:g})"
        if isinstance(fault, PowerCut) and fault.car not in scenario.equipped:
            yield f"faults.{index}.car: has no computer whose power can be cut (given {fault.car})"
    for one, other in combinations(scenario.power_cuts(), 2):
        if one.car == other.car and one.from_s <= other.until_s and other.from_s <= one.until_s:
            yield (
                f"faults: the second power_cut of {one.car} must begin after the first has ended"
                f" (given {other.from_s:g} to {other.until_s:g} s)"
            )


def _mistakes_of_cars(scenario: Scenario) -> Iterator[str]:
    seen: dict[str, str] = {}
    for name, car in scenario.cars.items():
        if (car.plate is None) == (car.tag_id is None):
            yield f"cars.{name}: exactly one of plate and tag_id"
        elif car.identity in seen:
            yield f"cars.{name}: has the identity of {seen[car.identity]} (given {car.identity!r})"
        seen[car.identity] = name
        if car.road not in scenario.roads:
            roads = ", ".join(scenario.roads)
            yield f"cars.{name}.road: no such road (given {car.road!r}); roads: {roads}"


def _mistakes_of_pedestrians(scenario: Scenario) -> Iterator[str]:
    for name, pedestrian in scenario.pedestrians.items():
        if name in scenario.cars:
            yield f"pedestrians.{name}: is the name of a car"
        if pedestrian.road not in scenario.roads:
            roads = ", ".join(scenario.roads)
            given = f"(given {pedestrian.road!r})"
            yield f"pedestrians.{name}.road: no such road {given}; roads: {roads}"


def _names_used(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield every field that refers to a car, with the name of the car."""
    for index, fault in enumerate(scenario.faults):
        yield f"faults.{index}.car", fault.car
        if isinstance(fault, PlateMisread):
            yield f"faults.{index}.of", fault.of
    for index, entry in enumerate(scenario.expect):
        for name in entry.cars_used():
            yield f"expect.{index}", name
    if isinstance(scenario.radio, ReachSettings):
        for name, neighbours in (scenario.radio.neighbours or {}).items():
            for other in (name, *neighbours):
                yield f"radio.neighbours.{name}", other
