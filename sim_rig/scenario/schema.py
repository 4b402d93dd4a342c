"""A scenario: who drives how, what the radio is like, what breaks, and what must come of it.

The YAML files in `scenarios/` are data. The schema is strict: an unknown key, a wrong type, a car
that is not there or a time out of order is an error that names file, field and value.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, StringConstraints, model_validator

from onboard.access.settings import AccessSettings
from onboard.lcca.settings import LccaSettings
from onboard.settings import Settings, SettingsError, load_settings
from sim_rig.scenario.expectations import Expectation
from sim_rig.scenario.faults import Fault, PlateMisread
from sim_rig.scenario.field_types import CarName, PlateText, RoadName, Seconds
from sim_rig.scenario.radio_settings import AirSettings, ReachSettings
from sim_rig.scenario.sensor_settings import ReceiverSettings, VehicleCameraSettings

SCENARIOS = Path(__file__).parents[1] / "scenarios"
"""The scenarios that come with the rig."""


def _points(value: object) -> object:
    """One number stands for a quantity that never changes; YAML's lists are tuples here."""
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
"""Lane at breakpoints, 1 the rightmost; in between the car drifts from one to the other."""
Sentence = Annotated[str, StringConstraints(pattern=r"^[A-Z].{10,}[.]$")]


Metres = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]


class RoadSettings(Settings):
    """The line that lane 1 of a road follows."""

    points_m: tuple[tuple[Metres, Metres], ...] = Field(min_length=2)
    """East and north of the scenario's origin; straight in between, and on beyond both ends."""
    elevation_m: float = Field(default=0.0, ge=-100.0, le=100.0)
    """A bridge is higher than the road under it."""

    @model_validator(mode="after")
    def _leads_somewhere(self) -> Self:
        if any(one == other for one, other in pairwise(self.points_m)):
            raise ValueError("two points of a road that follow each other must differ")
        return self


EASTWARDS = {"road": RoadSettings(points_m=((0.0, 0.0), (1.0, 0.0)))}


class ScenarioCar(Settings):
    """One car on the road."""

    plate: PlateText | None = None
    """What the cars behind can read."""
    tag_id: int | None = Field(default=None, ge=0, le=49)
    """An AR tag in the place of the plate, as on the paper's model cars."""
    equipped: bool = True
    """Whether it runs `onboard`; otherwise it is only seen."""
    road: RoadName = "road"
    start_m: float
    """Its front bumper when the scenario begins, along its road."""
    lane: LaneCourse = ((0.0, 1.0),)
    speed_m_s: SpeedCourse
    length_m: float = Field(default=4.5, gt=1.0, le=20.0)
    width_m: float = Field(default=1.8, gt=0.5, le=3.0)
    height_m: float = Field(default=1.5, gt=0.5, le=4.0)
    colour: Literal["green", "red", "blue", "yellow", "white", "grey"] = "grey"

    access: AccessSettings = AccessSettings()
    """Whether its driver's danger decides how often it talks."""

    @property
    def identity(self) -> str:
        """The text that this car is known by: its plate, or `TAG<n>`."""
        return self.plate if self.plate is not None else f"TAG{self.tag_id}"


class Scenario(Settings):
    """One story, from the first second to what must have come of it."""

    title: Sentence
    seed: int = Field(ge=0)
    duration_s: float = Field(gt=0.0, le=600.0)
    cars: Mapping[CarName, ScenarioCar] = Field(min_length=1)
    roads: Mapping[RoadName, RoadSettings] = EASTWARDS
    """One that leads east, if left out."""
    lane_width_m: float = Field(default=3.5, gt=2.0, le=6.0)
    radio: AirSettings
    gnss: ReceiverSettings | None = None
    """Of every car that is equipped; without it no car knows where it is."""
    detector: VehicleCameraSettings | None = None
    """Of every car that is equipped, beside its plate camera: it knows cars from every side."""
    beacons: bool = True
    """Whether the cars also send BSMs, ten a second; no warning group needs them."""
    signed: bool = False
    """Whether messages are signed in virtual time, too; live they always are."""
    lcca: LccaSettings = LccaSettings()
    """Of every car."""
    background_traffic: int = Field(default=0, ge=0, le=200)
    """Cars around that nobody sees, and everybody hears sending BSMs."""
    faults: tuple[Fault, ...] = ()
    expect: tuple[Expectation, ...]

    @property
    def equipped(self) -> list[str]:
        """The cars that run `onboard`."""
        return [name for name, car in self.cars.items() if car.equipped]

    def has_fault(self, what: str, car: str, at_s: float) -> bool:
        """Whether a sensor of `car` has the fault `what` at `at_s`."""
        return any(fault.what == what and fault.holds(car, at_s) for fault in self.faults)


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the rig."""
    return sorted(path.stem for path in SCENARIOS.glob("*.yaml"))


def load_scenario(name: str) -> Scenario:
    """Read a scenario by its name, or by the path of a file.

    Raises:
        SettingsError: there is none, or it does not fit the schema; one line per mistake.
    """
    path = SCENARIOS / f"{name}.yaml"
    if not path.is_file():
        path = Path(name)
        if not path.is_file():
            known = ", ".join(scenario_names())
            raise SettingsError(f"{name}: no such scenario or file; scenarios: {known}")
    scenario = load_settings(path, Scenario)
    mistakes = [f"{path}: {mistake}" for mistake in _mistakes(scenario)]
    if mistakes:
        raise SettingsError("\n".join(mistakes))
    return scenario


def _mistakes(scenario: Scenario) -> Iterator[str]:
    """What no field shows by itself: who is spoken of must be there, and known apart."""
    for field, name in _names_used(scenario):
        if name not in scenario.cars:
            yield f"{field}: no such car (given {name!r}); cars: {', '.join(scenario.cars)}"
    yield from _mistakes_of_cars(scenario)
    for index, entry in enumerate(scenario.expect):
        silent = [name for name in entry.cars_telling() if name not in scenario.equipped]
        for name in silent:
            if name in scenario.cars:
                yield f"expect.{index}: {name!r} is not equipped and tells nothing"
    for index, fault in enumerate(scenario.faults):
        if fault.until_s <= fault.from_s:
            yield f"faults.{index}.until_s: must be after from_s (given {fault.until_s:g})"


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


def _names_used(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Every place that names a car, and the name."""
    for index, fault in enumerate(scenario.faults):
        yield f"faults.{index}.car", fault.car
        if isinstance(fault, PlateMisread):
            yield f"faults.{index}.of", fault.of
    for index, entry in enumerate(scenario.expect):
        for name in entry.cars_named():
            yield f"expect.{index}", name
    if isinstance(scenario.radio, ReachSettings):
        for name, neighbours in (scenario.radio.neighbours or {}).items():
            for other in (name, *neighbours):
                yield f"radio.neighbours.{name}", other
