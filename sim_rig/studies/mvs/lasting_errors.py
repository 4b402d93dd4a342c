"""Consistency of what MVS reports where the errors of the observers' receivers last.

A few vehicles with sensors share what they measure of others with one that has none, which is far
from all of them. The vehicles move as the filter assumes; the errors of the receivers are
Gauss-Markov processes, of which the filter is given nothing but the accuracy that BSMs state. One
run is one draw of these errors, judged once, since they last longer than a run.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from onboard.kinematics.arrays import map_state
from onboard.tracking.evidence import Measurement
from onboard.tracking.perceived_object import ObjectSource
from sim_rig.studies.mvs.accuracy import MODELLED, TRACKING, Errors, Q
from sim_rig.studies.mvs.methods import use_all
from sim_rig.studies.mvs.roads import FreeCars, states_of
from sim_rig.studies.mvs.world import ORIGIN, START_UTC_S, MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings

TICKS = 25
"""Of 0.1 s, until the reported vehicles are judged: longer than the memory of the tracks."""
GHOST_M = 4.0
"""What is reported farther than this from every vehicle is a ghost."""
_SAME_M = 12.0
"""Less than from one lane to the next."""


class ObservedRoad(FreeCars):
    """One vehicle in each of six lanes, and the one that observes nothing far beside them."""

    lanes_m = (-5.0, -20.0, -35.0, -50.0, -65.0, -80.0, -240.0)


@dataclass(slots=True)
class Consistency:
    """What is reported in all runs, and the errors of a central filter for the same vehicles."""

    reported: Errors = field(default_factory=Errors)
    central: Errors = field(default_factory=Errors)
    objects: int = 0
    """Reported vehicles without a radio."""
    missed: int = 0
    """Vehicles without a radio that the central filter knows, and the host vehicle does not."""
    ghosts: int = 0
    """Objects farther than `GHOST_M` from every vehicle."""
    doubles: int = 0
    """Objects that are a vehicle with a radio, or a second object of one without."""


def consistency(
    observers: int, world: WorldSettings, runs: int, seed: int, *, is_alone: bool = False
) -> Consistency:
    """Judge what is reported once in each run.

    Args:
        observers: number of vehicles that measure, 1 to 5.
        world: errors of sensors and receivers.
        runs: each with other errors and motions.
        seed: of the first run.
        is_alone: whether the first observer, which receives nothing, is judged; its errors are then
            those relative to itself, as it is placed by its receiver.
    """
    found = Consistency()
    for number in range(seed, seed + runs):
        _run(observers, world, number, found, is_alone=is_alone)
    return found


def _run(
    observers: int, settings: WorldSettings, seed: int, found: Consistency, *, is_alone: bool
) -> None:
    rng = np.random.default_rng((seed, 1))
    road = ObservedRoad(1, 25.0, TICKS / 10.0 + 1.0, Q, rng)
    *near, far = road.names
    sharing = [near[at] for at in rng.permutation(len(near))[:observers]]
    host = sharing[0] if is_alone else far
    loss = 1.0 if is_alone else settings.loss
    world = MvsWorld(
        road,
        {host, *sharing},
        settings.model_copy(update={"loss": loss}),
        MODELLED,
        seed,
        tracking=TRACKING,
        records_measurements=True,
    )
    measured: dict[str, list[Measurement]] = defaultdict(list)
    for _ in range(TICKS):
        world.tick()
        for made in world.measurements:
            measured[made.car].append(made.measurement)
    _judge(world, host, measured, found, is_alone=is_alone)


def _judge(
    world: MvsWorld,
    host: str,
    measured: dict[str, list[Measurement]],
    found: Consistency,
    *,
    is_alone: bool,
) -> None:
    core, cars = world.cars[host].sharing.mvs, world.traffic.cars_at(world.now)
    core.update(world.now)
    objects = [
        map_state(
            np.array(each.state),
            np.array(each.covariance),
            *ORIGIN.mapping_from(world.frame_of(host)),
        )
        for each in core.kinematic_info(world.now)
        if each.source is not ObjectSource.BSM
    ]
    truth = states_of(cars)
    if is_alone:
        truth[:, :2] += world.cars[host].bias.error_m
    known = [
        at for at, name in enumerate(cars.names) if name in measured and name not in world.cars
    ]
    places_m = np.array([state[:2] for state, _ in objects]).reshape(-1, 2)
    apart_m = np.hypot(*(places_m[:, None] - truth[:, :2]).T).T
    found.objects += len(objects)
    found.ghosts += int((apart_m > GHOST_M).all(axis=1).sum())
    pairs = [
        (row, known[column])
        for row, column in zip(*linear_sum_assignment(apart_m[:, known]), strict=True)
        if apart_m[row, known[column]] < _SAME_M
    ]
    found.doubles += len(objects) - len(pairs)
    found.missed += len(known) - len(pairs)
    now_ms = round((world.now + START_UTC_S) * 1000)
    for row, at in pairs:
        state, covariance = objects[row]
        found.reported.add(state - truth[at], covariance)
        central, central_covariance = use_all(measured[cars.names[at]], now_ms, Q)
        found.central.add(central - truth[at], central_covariance)
