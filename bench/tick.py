"""What one vehicle does in each tick (100 ms) with 100 others around: 40 with a radio, 60 without.

Each of the 40 has an MVS core and sends its footer. The inputs of one car in 2 s are recorded, and
then given to a new `Vehicle`, which is driven as in the daemon: a step receives one input and
handles the timer if it is due. Between two steps a daemon looks at its receive queue. The longest
step of each tick is measured, and by name those that are the longest at the 99th percentile. A
name is what the step does, or where in the code it takes up the work that the step before left.
Signatures, and the decoding of what is around a footer, are not in it (`receive_path`,
`send_path`). Garbage is collected as in the daemon. Times are processor times, since the machine
is shared.
"""

import math
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import GeneratorType
from typing import Any, NamedTuple

import numpy as np

from bench import Figure
from onboard.messages.bsm import BasicSafetyMessage
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import Sensor
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.settings import PlateDigestSettings
from onboard.step import HostObservation
from onboard.vehicle.config import CarConfig, CarSettings
from onboard.vehicle.shared_sensing import SharedSensing
from onboard.vehicle.vehicle import Vehicle
from sim_rig.studies.mvs.roads import SixLaneRoad
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.mvs.world import START_UTC_S, MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings

TICKS, WARM, ROUNDS = 20, 10, 10
RADIOS, SPACING_M = 41, 22.0
CARS_PER_LANE = 17
OWN = 40
"""Number of the measured car, in the middle of the road."""
NAMED = 8
"""Steps that are named, those with the largest 99th percentiles."""


class _Input(NamedTuple):
    now: float
    what: HostObservation | BasicSafetyMessage


class _InputRecorder:
    """The shared sensing of a car, whose inputs are recorded."""

    def __init__(self, sharing: SharedSensing) -> None:
        self._sharing = sharing
        self.inputs: list[_Input] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sharing, name)

    def receive_observation(self, observation: HostObservation, now: float) -> None:
        self.inputs.append(_Input(now, observation))
        self._sharing.receive_observation(observation, now)

    def receive_bsm(
        self, message: BasicSafetyMessage, sender: bytes, now: float, *, entries: SharedEntries
    ) -> bool:
        self.inputs.append(_Input(now, message))
        return self._sharing.receive_bsm(message, sender, now, entries=entries)


class _SteppedVehicle:
    """A vehicle that is stepped as by `Stack.step`."""

    def __init__(self, config: CarConfig) -> None:
        self.vehicle = Vehicle(
            config,
            {Sensor.SPEED, Sensor.POSITION, Sensor.CAMERA},
            np.random.default_rng(1),
            now=0.0,
            utc_offset_s=START_UTC_S,
            pseudonym=Pseudonym(bytes(8), OWN.to_bytes(4), 0, None, math.inf),
            digest=PlateDigest(PlateDigestSettings(scrypt_log2_n=1)),
            is_road_side_unit=lambda _: False,
        )
        self.took_s: list[tuple[str, float]] = []
        """Name and time of each step."""

    def receive(self, each: _Input) -> None:
        """Receive an input in a step, and take as many more as have something to do."""
        self._step(each.now, each.what)
        while self.vehicle.get_timer() <= each.now:
            self._step(each.now)

    def _step(
        self, now: float, received: HostObservation | BasicSafetyMessage | None = None
    ) -> None:
        vehicle, name = self.vehicle, "" if received is None else received.kind
        work_left = self._work_left()
        began = time.process_time()
        if isinstance(received, BasicSafetyMessage):
            vehicle.receive_message(received, bytes(4) + received.core.temporary_id, now, now)
        elif received is not None:
            vehicle.receive_observation(received, now)
        if vehicle.get_timer() <= now:
            name += f" {work_left}"
            for _ in vehicle.group_messages_to_send(now):
                pass
            vehicle.handle_timer(now)
        for message in vehicle.messages_to_send(now):
            name += f" send {message.kind}"
        for _ in iter(vehicle.next_event, None):
            pass
        self.took_s.append((name.strip(), time.process_time() - began))

    def _work_left(self) -> str:
        """Return where the work goes on that the last step left; `timer` if it left none."""
        surroundings, mvs = self.vehicle._surroundings, self.vehicle._sharing.mvs  # noqa: SLF001
        for work in (surroundings._slices, mvs._slices, mvs._composing):  # noqa: SLF001
            if isinstance(work, GeneratorType):
                return _place(work)
        return "timer"


def _place(work: "GeneratorType[None, None, object]") -> str:
    while isinstance(work.gi_yieldfrom, GeneratorType):
        work = work.gi_yieldfrom
    code, frame = work.gi_code, work.gi_frame
    assert frame is not None  # noqa: S101 (it has not ended)
    return f"{Path(code.co_filename).stem}.{code.co_name}:{frame.f_lineno}"


def measure() -> Iterator[Figure]:
    """Yield median and 99th percentile of a tick, of its longest step, and of the steps by name."""
    sensing = SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0)
    config = CarConfig(car=CarSettings(plate="TICK1"), mvs=MvsSettings(sensing=sensing))
    ticks = _inputs(config.mvs)
    sums_s: list[float] = []
    longest_s: list[float] = []
    of_name_s: defaultdict[str, list[float]] = defaultdict(list)
    objects = 0
    for _ in range(ROUNDS):
        stepped = _SteppedVehicle(config)
        freeze_start_up_objects()
        for number, inputs in enumerate(ticks):
            stepped.took_s.clear()
            for each in inputs:
                stepped.receive(each)
            if number >= WARM:
                sums_s.append(sum(took_s for _, took_s in stepped.took_s))
                longest_s.append(max(took_s for _, took_s in stepped.took_s))
                for name, took_s in stepped.took_s:
                    of_name_s[name].append(took_s)
        objects = len(stepped.vehicle.surroundings[1])
    name = f"tick.{objects}_objects"
    yield from _figures(name, sums_s, "the BSM's interval", TICK_S)
    tick = "the tick", float(np.median(sums_s))
    yield from _figures(f"{name}.longest_step", longest_s, *tick)
    by_p99 = sorted(of_name_s, key=lambda each: -float(np.quantile(of_name_s[each], 0.99)))
    for step in by_p99[:NAMED]:
        yield from _figures(f"{name}.step {step}", of_name_s[step], *tick)


def _figures(
    name: str, each_s: list[float], reference: str, reference_s: float
) -> Iterator[Figure]:
    for quantity, quantile in (("median", 0.5), ("p99", 0.99)):
        value = float(np.quantile(each_s, quantile)) * 1000
        yield Figure(f"{name}.{quantity}", value, "ms", len(each_s), reference, reference_s * 1000)


def _inputs(settings: MvsSettings) -> list[list[_Input]]:
    """Inputs of one car in each of `TICKS` ticks."""
    rng = np.random.default_rng(0)
    traffic = SixLaneRoad(CARS_PER_LANE, SPACING_M, TICKS * TICK_S + 1.0, 1.0, rng)
    own = traffic.names[OWN]
    others = [car for car in traffic.names if car != own]
    equipped = {own, *(others[i] for i in rng.permutation(len(others))[: RADIOS - 1])}
    world = MvsWorld(traffic, equipped, WorldSettings(reach_m=1000.0), settings, seed=1)
    world.tick()
    car = world.cars[own]
    recorder = _InputRecorder(car.sharing)
    car.sharing = recorder  # type: ignore[assignment]
    inputs = []
    for _ in range(TICKS):
        world.tick()
        inputs.append(recorder.inputs.copy())
        recorder.inputs.clear()
    return inputs
