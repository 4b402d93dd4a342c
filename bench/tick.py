"""One tick (100 ms) of one car's MVS with 100 perceived objects: 40 with a radio, 60 without.

Each of the 40 has an MVS core and sends its footer. The inputs of the first car in 2 s are
recorded, and then given to new cores. A tick includes the host vehicle's fix, its detections, 40
BSMs with footers, its own footer, and the kinematic-info. As in the daemon, the tracks are updated
and the footer is composed in slices; the longest one of each is measured as well, and the alarms,
which assess all objects after the tick. Garbage is collected as in the daemon. Times are processor
times, since the machine is shared.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from bench import Figure
from onboard.kinematics.units import KM_H
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import Speed
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.tracking.perceived_object import PerceivedObject
from onboard.tracking.tracks import TrackingParameters
from sim_rig.studies.mvs.roads import SPEED_M_S, SixLaneRoad
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.mvs.world import START_UTC_S, MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings

TICKS, WARM, ROUNDS = 20, 10, 10
RADIOS, SPACING_M = 41, 22.0
CARS_PER_LANE = 17
OWN = 40
"""Number of the measured car, in the middle of the road."""

Call = tuple[str, tuple[Any, ...]]


class _InputRecorder:
    """An MVS core whose inputs are recorded."""

    def __init__(self, core: MultiVehicleSensing, world: MvsWorld) -> None:
        self._core = core
        self._world = world
        self.calls: list[Call] = []

    def __getattr__(self, name: str) -> Callable[..., object]:
        def call(*arguments: object) -> object:
            # In a car footers are received as bytes.
            wire = tuple(self._footer() if isinstance(a, SharedEntries) else a for a in arguments)
            self.calls.append((name, wire))
            return getattr(self._core, name)(*arguments)

        return call

    def _footer(self) -> bytes:
        return self._world.sent[-1].footer


def measure() -> Iterator[Figure]:
    """Yield median and 99th percentile of a tick and of its longest slice, and other medians."""
    settings = MvsSettings(
        sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0),
    )
    tracking = TrackingParameters(acceleration_density=1.0)
    ticks = _inputs(settings, tracking)
    times_s, slices_s, footers_s, alarms_s = [], [], [], []
    objects: list[PerceivedObject] = []
    now = slice_s = footer_s = 0.0
    freeze_start_up_objects()
    for _ in range(ROUNDS):
        core = MultiVehicleSensing(
            settings, OWN.to_bytes(4), np.random.default_rng(1), START_UTC_S, tracking=tracking
        )
        monitor = RiskMonitor(RiskSettings(), 4.5, 1.8)
        for number, calls in enumerate(ticks):
            began = time.process_time()
            for name, arguments in calls:
                if name == "footer_to_send":
                    (now,) = arguments
                    slice_s = _longest_slice_s(core.update_slice, now)
                    composing_s = _longest_slice_s(core.footer_slice, now)
                    composed = time.process_time()
                    core.footer_to_send(now)
                    footer_s = max(composing_s, time.process_time() - composed)
                    objects = core.kinematic_info(now)
                else:
                    getattr(core, name)(*arguments)
            ended = time.process_time()
            monitor.host.receive_observation(Speed(now, SPEED_M_S, KM_H, "obd:7E8"))
            monitor.assess(core.host_vehicle(now), objects, now)
            if number >= WARM:
                times_s.append(ended - began)
                slices_s.append(slice_s)
                footers_s.append(footer_s)
                alarms_s.append(time.process_time() - ended)
    of_objects = f"tick.{len(objects)}_objects"
    interval = ("the BSM's interval", TICK_S * 1000)
    tick = ("the tick without alarms", float(np.median(times_s)) * 1000)
    for name, each_s, reference in (
        (of_objects, times_s, interval),
        (f"{of_objects}.longest_slice", slices_s, tick),
        (f"{of_objects}.footer.longest_slice", footers_s, tick),
        (f"{of_objects}.alarms", alarms_s, tick),
    ):
        for quantity, quantile in (("median", 0.5), ("p99", 0.99)):
            value = float(np.quantile(each_s, quantile)) * 1000
            yield Figure(f"{name}.{quantity}", value, "ms", len(each_s), *reference)


def _longest_slice_s(do_slice: Callable[[float], bool], now: float) -> float:
    """Do all slices, and return how long the longest one took."""
    longest_s, is_complete = 0.0, False
    while not is_complete:
        began = time.process_time()
        is_complete = do_slice(now)
        longest_s = max(longest_s, time.process_time() - began)
    return longest_s


def _inputs(settings: MvsSettings, tracking: TrackingParameters) -> list[list[Call]]:
    """Inputs of one car in each of `TICKS` ticks."""
    rng = np.random.default_rng(0)
    traffic = SixLaneRoad(CARS_PER_LANE, SPACING_M, TICKS * TICK_S + 1.0, 1.0, rng)
    own = traffic.names[OWN]
    others = [car for car in traffic.names if car != own]
    equipped = {own, *(others[i] for i in rng.permutation(len(others))[: RADIOS - 1])}
    reach = WorldSettings(reach_m=1000.0)
    world = MvsWorld(traffic, equipped, reach, settings, seed=1, tracking=tracking)
    world.tick()
    sharing = world.cars[own].sharing
    recorder = _InputRecorder(sharing.mvs, world)
    sharing.mvs = recorder  # type: ignore[assignment]
    inputs = []
    for _ in range(TICKS):
        world.tick()
        inputs.append(recorder.calls.copy())
        recorder.calls.clear()
    return inputs
