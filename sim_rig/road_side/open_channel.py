"""The radio channel of a scenario's cars, and of the stations beside them."""

from collections.abc import Callable, Mapping

import numpy as np

from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from sim_rig.radio.air import Air, CarsAt
from sim_rig.radio.models import open_air
from sim_rig.road_side.personal_device import PersonalDevice
from sim_rig.road_side.road_side_unit import NAME, RoadSideUnit, mast
from sim_rig.roads.breakpoints import BreakpointDrive
from sim_rig.roads.road import CarState
from sim_rig.scenario.schema import Scenario


def other_stations(scenario: Scenario) -> dict[str, frozenset[int]]:
    """Return the services in which the stations beside the cars send, by name."""
    unit = {} if scenario.signal is None else {NAME: scenario.unit_psids}
    return unit | dict.fromkeys(scenario.pedestrians, scenario.pedestrian_psids)


def open_channel(
    scenario: Scenario,
    cars_at: CarsAt,
    at_s: Callable[[float], float],
    rng: np.random.Generator,
    *,
    now: float,
    utc_s: float,
    credentials: Mapping[str, Credentials],
) -> Air:
    """Return the radio channel of a scenario's cars, its road-side unit and its pedestrians.

    Args:
        scenario: the scenario of the run.
        cars_at: states of all cars at a `now`.
        at_s: time since the start of the scenario at a `now`, s.
        rng: source of all random effects.
        now: monotonic time, s.
        utc_s: UTC at `now`, s.
        credentials: by name of the station; one without any sends unsigned messages.
    """
    others = other_stations(scenario)
    if not others:
        return open_air(scenario.radio, cars_at, scenario.equipped, rng)
    signal = scenario.signal
    walks = {
        name: BreakpointDrive(person, scenario.roads[person.road], scenario.lane_width_m)
        for name, person in scenario.pedestrians.items()
    }

    def stations_at(at: float) -> Mapping[str, CarState]:
        unit = {} if signal is None else {NAME: mast(signal)}
        return {**cars_at(at), **unit, **{name: walks[name].state(at_s(at)) for name in walks}}

    air = open_air(scenario.radio, stations_at, [*scenario.equipped, *others], rng)
    security = {name: SecurityServices(utc_s - now, credentials.get(name)) for name in others}
    if signal is not None:
        air = RoadSideUnit(air, scenario, signal, at_s, security[NAME], now=now)
    for name, walk in walks.items():
        air = PersonalDevice(air, name, scenario.profile, at_s, security[name], now=now, walk=walk)
    return air
