"""Runs a scenario in virtual time: faster than real time, and equal to the bit for equal seeds.

Each car has the `Stack` of the daemon, the ECU and the radio channel of the rig, and the daemon's
readers for the output of its GNSS receiver and its vehicle detector. Only camera and perception are
a model (`cars/camera_model.py`), without rendering. Processing takes no virtual time, but for the
derivation of IDs (`cars/derivation_delay.py`).
"""

import heapq
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np

from onboard.security.credentials import Credentials
from onboard.security.p256 import key_from
from onboard.step import SentWsm
from onboard.tools.test_ca.authority import make_trial
from sim_rig.cars.background_traffic import BackgroundTraffic, background_names
from sim_rig.cars.brake_controller import BrakeController
from sim_rig.radio.faulty_air import FaultyAir
from sim_rig.road_side.open_channel import open_channel, other_stations
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.car_states import car_state_records
from sim_rig.runs.power_cuts import with_power_cuts
from sim_rig.runs.virtual_car import START_UTC_S, VirtualCar
from sim_rig.runs.virtual_recorder import VirtualRecorder
from sim_rig.scenario.car_config import known_plates, names_by_id
from sim_rig.scenario.schema import Scenario

_MOST_STEPS = 10_000
"""Limit of events at one time: a timer that is always due would stop virtual time."""


def run_virtual(
    scenario: Scenario, seed: int | None = None, recordings_folder: Path | None = None
) -> RunLog:
    """Run a scenario.

    Args:
        scenario: the scenario.
        seed: seed instead of the scenario's own.
        recordings_folder: folder for the recordings, one folder per car; `None` for none.
    """
    chosen = scenario.seed if seed is None else seed
    recorders = (
        {name: VirtualRecorder(recordings_folder / name) for name in scenario.equipped}
        if recordings_folder
        else {}
    )
    with closing(_VirtualRun(scenario, chosen, recorders)) as run:
        run.run()
    for recorder in recorders.values():
        recorder.close(scenario.duration_s)
    return RunLog(
        start_s=0.0,
        traces={
            car.name: with_power_cuts(car.trace, scenario, car.name, 0.0)
            for car in run.cars.values()
        },
        rig=[
            *run.recorder.records,
            *car_state_records(run.road, 0.0, scenario.duration_s),
        ],
        names=names_by_id(scenario, START_UTC_S, START_UTC_S + scenario.duration_s),
    )


class _VirtualRun:
    """Virtual time and the agenda of events of one run."""

    def __init__(
        self, scenario: Scenario, seed: int, recorders: Mapping[str, VirtualRecorder]
    ) -> None:
        self._scenario = scenario
        self.recorder = RigRecorder()
        self.road = road = BreakpointRoad(scenario)
        air_seed, *car_seeds, sky_seed, keys_seed = np.random.SeedSequence(seed).spawn(
            3 + len(scenario.equipped)
        )
        credentials: Mapping[str, Credentials] = {}
        if scenario.signed:
            new_key = key_from(np.random.default_rng(keys_seed))
            cars = [*scenario.equipped, *background_names(scenario)]
            credentials = make_trial(
                cars,
                scenario.psids,
                START_UTC_S,
                new_key,
                others=other_stations(scenario),
                plates=known_plates(scenario),
            )
        air_rng = np.random.default_rng(air_seed)
        air = FaultyAir(
            open_channel(
                scenario,
                road.cars_at,
                lambda now: now,
                air_rng,
                now=0.0,
                utc_s=START_UTC_S,
                credentials=credentials,
            ),
            scenario,
            lambda now: now,
            START_UTC_S,
            credentials,
        )
        self.cars = {
            name: VirtualCar(
                scenario,
                road,
                name,
                car_seed,
                sky_seed,
                recorder=recorders.get(name),
                credentials=credentials.get(name),
                on_ecu_frame=partial(self.recorder.note_answer, name),
                controller=BrakeController(partial(road.brake, name))
                if scenario.cars[name].obeys_request
                else None,
            )
            for name, car_seed in zip(scenario.equipped, car_seeds, strict=True)
        }
        # Last, since an error of what follows would leave SUMO open.
        self._air = BackgroundTraffic(
            air,
            scenario,
            road.cars_at,
            lambda now: now,
            np.random.default_rng(seed),
            now=0.0,
            utc_s=START_UTC_S,
            credentials=credentials,
        )
        self._air_planned_at = math.inf
        self._agenda: list[tuple[float, int, VirtualCar | None]] = []
        self._order = count()

    def run(self) -> None:
        """Handle all events until the end of the scenario."""
        for car in self.cars.values():
            self._carry_away(car, car.step(0.0), 0.0)
        last_s, steps = -1.0, 0
        while self._agenda and self._agenda[0][0] <= self._scenario.duration_s:
            now, _, due = heapq.heappop(self._agenda)
            steps = steps + 1 if now == last_s else 0
            if steps > _MOST_STEPS:
                raise RuntimeError(f"a timer stays due at {now} s")
            last_s = now
            if due is None:
                self._deliver(now)
            elif due.planned_at == now:
                due.planned_at = math.inf
                self._carry_away(due, due.handle_timer(now), now)

    def close(self) -> None:
        """End the background traffic."""
        self._air.close()

    def _deliver(self, now: float) -> None:
        self._air_planned_at = math.inf
        for delivery in self._air.wsms_to_deliver(now):
            self.recorder.note_delivery(
                delivery.receiver, delivery.sender, delivery.user_priority, delivery.wsm, now
            )
            car = self.cars[delivery.receiver]
            self._carry_away(car, car.receive_wsm(delivery.wsm, now), now)
        self._plan_air()

    def _carry_away(self, car: VirtualCar, wsms: Sequence[SentWsm], now: float) -> None:
        """Transmit the frames that a car sends, and plan its next step."""
        for wsm in wsms:
            self.recorder.note_on_air(car.name, wsm.data, wsm.user_priority, now)
            self._air.receive_wsm(car.name, wsm.data, wsm.user_priority, now)
        self._plan_air()
        at = max(car.get_timer(), now)
        if at != car.planned_at:
            # What was planned before stays on the agenda, and is passed over when it comes up.
            car.planned_at = at
            heapq.heappush(self._agenda, (at, next(self._order), car))

    def _plan_air(self) -> None:
        at = self._air.get_timer()
        if at < self._air_planned_at:
            self._air_planned_at = at
            heapq.heappush(self._agenda, (at, next(self._order), None))
