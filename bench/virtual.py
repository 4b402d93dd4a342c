"""Car-seconds that one processor core simulates in a second, with and without MVS; memory.

25 to 400 cars on a six-lane road, 22 m apart, four in ten with a radio. Without MVS a car with a
radio sends and receives plain BSMs and runs its risk monitor; with MVS it also senses, shares and
fuses evidence. The reference is real time: one car-second a second for each car.
"""

import time
from collections.abc import Iterator

import numpy as np

from bench import Figure
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.risk.settings import RiskSettings
from sim_rig.studies.mvs.driver_warning import WarningModel
from sim_rig.studies.mvs.roads import LANES_M, SixLaneRoad
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.mvs.world import MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings
from sim_rig.studies.soak.fleet import resident_bytes

SHARE = 0.4
WARM_TICKS, TICKS = 5, 2


def measure() -> Iterator[Figure]:
    """Yield a figure for each number of cars, with and without MVS, and the largest memory."""
    before = largest = resident_bytes()
    for cars in (25, 50, 100, 200, 400):
        for with_mvs in (False, True):
            rate, used = _car_seconds_per_s(cars, with_mvs=with_mvs)
            largest = max(largest, used)
            name = f"virtual.{cars}_cars.{'mvs' if with_mvs else 'plain'}"
            real = ("real time of as many cars", float(cars))
            yield Figure(name, rate, "car-s/s", TICKS, *real)
    reference = "the same process before the first car"
    yield Figure("virtual.memory", largest / 2**20, "MiB", 1, reference, before / 2**20)


def _car_seconds_per_s(cars: int, *, with_mvs: bool) -> tuple[float, int]:
    """Car-seconds simulated in a second, and the memory of this process at the end."""
    rng = np.random.default_rng(cars)
    per_lane = round(cars / len(LANES_M)) or 1
    road = SixLaneRoad(per_lane, 22.0, (WARM_TICKS + TICKS) * TICK_S + 1.0, 1.0, rng)
    names = road.names
    equipped = {names[i] for i in rng.permutation(len(names))[: round(SHARE * len(names))]}
    settings = MvsSettings(
        max_entries=10 if with_mvs else 0,
        sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0),
    )
    world = MvsWorld(road, equipped, WorldSettings(senses=with_mvs), settings, seed=1)
    models = {name: WarningModel(RiskSettings(), 4.5, 1.8) for name in equipped}
    for _ in range(WARM_TICKS):
        world.tick()
    began = time.process_time()
    for _ in range(TICKS):
        world.tick()
        for name, car in world.cars.items():
            core, model = car.sharing.mvs, models[name]
            core.update(world.now)
            objects = core.kinematic_info(world.now)
            for observation in car.observations:
                model.receive_observation(observation, world.now)
            for message in car.received:
                model.receive_bsm(message, world.now)
            own, heading = core.host_vehicle(world.now), core.heading(world.now)
            model.assess(own, objects, world.now, heading)
    took_s = time.process_time() - began
    return len(names) * TICKS * TICK_S / took_s, resident_bytes()
