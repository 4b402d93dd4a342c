"""Cars of a live run without processes: the rig steps their stacks itself, in real time.

Each is the car of a virtual run, with a camera model in place of rendered images. It begins with
the scenario: before it, such a car is silent.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from onboard.obd.can_frame import CanFrame
from onboard.security.credentials import Credentials
from onboard.step import SentWsm
from sim_rig.cars.brake_controller import BrakeController
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.roads.road import Road
from sim_rig.run_log.lateness import Lateness
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.run_log.run_log import Record
from sim_rig.runs.virtual_car import VirtualCar
from sim_rig.scenario.schema import Scenario


class VirtualOthers:
    """The cars of a run that are neither boxes nor processes."""

    def __init__(
        self, scenario: Scenario, road: Road, names: Iterable[str], units: RadioUnits
    ) -> None:
        """Give each car a radio unit.

        Args:
            scenario: the scenario of the run.
            road: source of the cars' states.
            names: of the cars.
            units: the radio units of the run.
        """
        self._scenario = scenario
        self._road = road
        self._names = list(names)
        self._units = units
        self._cars: dict[str, VirtualCar] = {}
        self._timers: dict[str, asyncio.TimerHandle] = {}
        for name in self._names:
            units.add_in_process(name, partial(self._receive, name))

    def begin(
        self,
        start_s: float,
        utc_s: float,
        *,
        seed: int,
        credentials: Mapping[str, Credentials],
        recorder: RigRecorder,
        lateness: Lateness,
        brake: Callable[[str, float, float, float], None],
    ) -> None:
        """Make the cars, and step them from `start_s` on.

        Args:
            start_s: start of the scenario on the loop's clock, s; not in the past.
            utc_s: UTC then, s.
            seed: seed of all random numbers.
            credentials: certificates and keys of each car.
            recorder: records the ECUs' answers.
            lateness: collects how late the steps were.
            brake: lets a car brake that obeys requests; arguments as of `BreakpointRoad.brake`.
        """
        self._start_s = start_s
        self._recorder = recorder
        self._lateness = lateness
        sky_seed, *seeds = np.random.SeedSequence(seed).spawn(1 + len(self._names))
        for name, own_seed in zip(self._names, seeds, strict=True):
            obeys = self._scenario.cars[name].obeys_request
            self._cars[name] = VirtualCar(
                self._scenario,
                self._road,
                name,
                own_seed,
                sky_seed,
                recorder=None,
                credentials=credentials[name],
                on_ecu_frame=partial(self._note_answer, name),
                controller=BrakeController(partial(brake, name)) if obeys else None,
                start_utc_s=utc_s,
            )
        loop = asyncio.get_running_loop()
        for name in self._names:
            self._timers[name] = loop.call_at(start_s, self._first_step, name)

    def close(self) -> None:
        """Stop all cars."""
        for timer in self._timers.values():
            timer.cancel()

    def trace(self, name: str) -> Sequence[Record]:
        """Return the trace of a car, on the loop's clock."""
        own = self._cars[name].trace
        return [{**each, "stamp_s": each["stamp_s"] + self._start_s} for each in own]

    def _now(self) -> float:
        """Time since the start of the scenario, s."""
        return asyncio.get_running_loop().time() - self._start_s

    def _first_step(self, name: str) -> None:
        del self._timers[name]
        self._send(name, self._cars[name].step(self._now()))

    def _step(self, name: str) -> None:
        now, car = self._now(), self._cars[name]
        self._lateness.note("other car", now - car.get_timer())
        del self._timers[name]
        self._send(name, car.handle_timer(now))

    def _receive(self, name: str, wsm: bytes) -> None:
        now = self._now() if name in self._cars else -1.0
        if now >= 0.0:
            self._send(name, self._cars[name].receive_wsm(wsm, now))

    def _send(self, name: str, wsms: Sequence[SentWsm]) -> None:
        """Transmit the frames that a car sends, and plan its next step."""
        at = self._start_s + self._cars[name].get_timer()
        planned = self._timers.get(name)
        # One that is due stays: put off with each received frame, it would never run.
        if planned is None or at < planned.when():
            if planned is not None:
                planned.cancel()
            self._timers[name] = asyncio.get_running_loop().call_at(at, self._step, name)
        for wsm in wsms:
            self._units.transmit(name, wsm.data, wsm.user_priority)

    def _note_answer(self, name: str, frame: CanFrame) -> None:
        stamp_s = frame.stamp_s + self._start_s
        self._recorder.note_answer(name, replace(frame, stamp_s=stamp_s))
