"""Runs a scenario with real daemons, one process per car, on localhost; some cars may be boxes.

The rig is the other end of each interface: a bus with an ECU, an MJPEG server for the cameras (a
process of its own), and a UDP radio unit for each car with the channel between them. A daemon's
configuration has its own plate and ports, and nothing of other cars. For a car that is a box, the
rig opens the same ends at the addresses of its file, and starts no daemon.
"""

import asyncio
import json
import shutil
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import AsyncExitStack
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from onboard.security.key_files import write_credentials
from sim_rig.boxes.box_computer import BoxComputer
from sim_rig.boxes.box_configuration import differences
from sim_rig.boxes.box_log import FLUSHED_AFTER_S, BoxLog, FramesOfRun, box_log, other_identity
from sim_rig.boxes.contact import BoxNotReadyError, Contact
from sim_rig.boxes.sent_messages import sent_messages
from sim_rig.boxes.settings import BoxSettings
from sim_rig.boxes.trial_keys import run_credentials
from sim_rig.cars.background_traffic import BackgroundTraffic
from sim_rig.engineer.page_process import ENGINEER, EngineerPage
from sim_rig.processes.processes import ProcessError, Processes
from sim_rig.processes.slow_cpu import slow_down
from sim_rig.processes.wrong_clock import START_FILE
from sim_rig.radio.air import Air
from sim_rig.radio.faulty_air import FaultyAir
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.road_side.open_channel import open_channel
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.run_log.daemon_lateness import daemon_lateness
from sim_rig.run_log.lateness import Lateness
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.runs.car_states import car_state_records
from sim_rig.runs.daemons import DaemonPower, Daemons
from sim_rig.runs.power_cuts import PowerSwitch, cut_power, with_power_cuts
from sim_rig.runs.rig_ends import RigEnds
from sim_rig.runs.virtual_others import VirtualOthers
from sim_rig.scenario.car_config import names_by_id
from sim_rig.scenario.scenario_clock import ScenarioClock
from sim_rig.scenario.schema import Scenario

_READY_WITHIN_S = 120.0
"""Eight daemons with cameras are not ready after 40 s on two cores with other work."""
_EXTRA_S = 0.5
"""Time after the scenario's end, for messages and records in transit."""
_BEGUN_WITHIN_S = 1.0
"""Time to make the stacks of the cars that the rig steps."""
_NO_BOXES: Mapping[str, BoxSettings] = MappingProxyType({})


class LiveTestbench:
    """The cars of a scenario, and the rig's ends of their interfaces.

    An asynchronous context. Configurations, logs, traces and recordings are written to `folder`.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        folder: Path,
        boxes: Mapping[str, BoxSettings] = _NO_BOXES,
        *,
        virtual_others: bool = False,
        daemons: Collection[str] = (),
    ) -> None:
        """Prepare `folder`.

        Args:
            scenario: the scenario to run.
            seed: seed of all random errors.
            folder: folder for all files of the run.
            boxes: the cars that are boxes.
            virtual_others: no other car is a process: the rig steps them itself.
            daemons: cars that are processes also with `virtual_others`.
        """
        folder.mkdir(parents=True, exist_ok=True)
        (folder / START_FILE).unlink(missing_ok=True)
        self.recorder = RigRecorder(boxes)
        self.processes = Processes(folder)
        self._clock = ScenarioClock(scenario.run_up_s)
        self.pages: dict[str, str] = {}
        """Address of each daemon's page by its car, and of the engineer's page."""
        self.start_utc_s = time.time()
        self._scenario = scenario
        self._seed = seed
        self._folder = folder
        self._keys = folder / "keys"
        self._boxes = boxes
        others = [car for car in scenario.equipped if car not in boxes]
        self._virtual = [car for car in others if virtual_others and car not in daemons]
        self._processed = [car for car in others if car not in self._virtual]
        self._computers = {car: BoxComputer(car, box, folder) for car, box in boxes.items()}
        self._why_not_copied: dict[str, str | None] = {}
        """For each box; `None` where there is a recording."""
        self._contacts = {car: Contact() for car in boxes}
        self._daemons = Daemons(scenario, seed, folder, self.processes)
        self._lateness = Lateness()
        self._road = BreakpointRoad(scenario)
        self._open = AsyncExitStack()

    async def __aenter__(self) -> "LiveTestbench":
        try:
            await self._set_up()
        except BaseException:
            await self._open.aclose()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._open.aclose()

    @property
    def start_s(self) -> float:
        """Start of the scenario; infinite until all is ready for it."""
        return self._clock.start_s

    async def run(self) -> None:
        """Start the scenario when all daemons are ready, and return at its end.

        Raises:
            ProcessError: a daemon did not get ready, or ended unexpectedly.
            BoxNotReadyError: a box did not get ready.
            UserError: a command of a box's file has failed.
        """
        await self._until_ready()
        self._lateness.clear()
        begun_within_s = _BEGUN_WITHIN_S if self._virtual else 0.0
        self._clock.start_s = time.monotonic() + max(begun_within_s, self._clock.run_up_s)
        self._others.begin(
            self.start_s,
            self.start_s + time.time() - time.monotonic(),
            seed=self._seed,
            credentials=self._trial,
            recorder=self.recorder,
            lateness=self._lateness,
            brake=self._brake,
        )
        (self._folder / START_FILE).write_text(repr(self.start_s), encoding="utf-8")
        assert self._cameras.stdin is not None  # noqa: S101 (started with pipes)
        self._cameras.stdin.write(f"{self.start_s}\n".encode())
        self._engineer.begin(self.start_s)
        await self._drive(self.start_s + self._scenario.duration_s + _EXTRA_S)
        self._lines = tuple(self._lateness.lines())
        await self.processes.stop(*self._processed)
        await asyncio.sleep(FLUSHED_AFTER_S if self._boxes else 0.0)
        for car, computer in self._computers.items():
            self._why_not_copied[car] = await computer.finish()

    async def _drive(self, end_s: float) -> None:
        """Let the daemons run until `end_s`, with the faults of their computers."""
        power_cuts = [
            cut_power(fault, self._power(fault.car), self.start_s, end_s)
            for fault in self._scenario.power_cuts()
            if fault.car not in self._virtual
        ]
        slowing, *tasks = (
            asyncio.create_task(each)
            for each in (
                slow_down(self._scenario, self.start_s, self.processes, self._processed),
                self.processes.sleep_until(end_s),
                *power_cuts,
            )
        )
        try:
            await asyncio.gather(*tasks)
        finally:
            for task in (slowing, *tasks):
                task.cancel()
            await asyncio.gather(slowing, *tasks, return_exceptions=True)

    def _power(self, car: str) -> PowerSwitch:
        return self._computers.get(car) or DaemonPower(self._daemons, car)

    def log(self) -> RunLog:
        """Return the run log; call it after the end of the context."""
        boxes = {car: self._box_log(car, box) for car, box in self._boxes.items()}
        names = names_by_id(self._scenario, self.start_utc_s, time.time())
        why_not_judged = {
            car: box.why_not_judged
            or other_identity(
                box.records, [each for each in names if names[each] == car], self.start_s
            )
            for car, box in boxes.items()
        }
        log = RunLog(
            start_s=self.start_s,
            traces={
                car: with_power_cuts(
                    self._trace(car) if car not in boxes else boxes[car].records,
                    self._scenario,
                    car,
                    self.start_s,
                )
                for car in self._scenario.equipped
            },
            rig=[
                *self.recorder.records,
                *car_state_records(self._road, self.start_s, self._scenario.duration_s),
            ],
            names=names,
            clocks={car: box.clocks for car, box in boxes.items() if box.clocks},
            unjudged={car: why for car, why in why_not_judged.items() if why is not None},
            by_messages=frozenset(car for car, box in self._boxes.items() if not box.recording),
            notes={car: box.notes for car, box in boxes.items() if box.notes},
            builds={car: box.build for car, box in boxes.items() if box.build is not None},
            lateness=self._lines,
        )
        slowed = self._scenario.slowed_cars()
        daemons = [car for car in self._processed if car not in slowed]
        lines = daemon_lateness(log, daemons, 1.0 / self._scenario.lens.rate_hz)
        return replace(log, daemon_lateness=tuple(lines))

    def _box_log(self, car: str, box: BoxSettings) -> BoxLog:
        if box.recording is None:
            return BoxLog(sent_messages(self.recorder.from_box[car]), (), None)
        if (why := self._why_not_copied[car]) is not None:
            return BoxLog((), (), why)
        return box_log(
            box.recording,
            FramesOfRun(
                self.recorder.from_box[car],
                self.recorder.to_box[car],
                self.start_s,
                self.start_s + self._scenario.duration_s,
                time.time() - time.monotonic(),
                self._computers[car].power_cuts,
            ),
            self._folder / "box" / car,
            lambda header: differences(header, self._scenario, car),
        )

    def _trace(self, car: str) -> Sequence[Record]:
        source = self._others if car in self._virtual else self._daemons
        return source.trace(car)

    async def _set_up(self) -> None:
        self._make_keys()
        camera_port = await self._start_cameras()
        units = RadioUnits(
            self._air(),
            self.recorder,
            self._has_mute_radio,
            lambda late_s: self._lateness.note("WSM", late_s),
        )
        self._open.callback(units.close)
        ends = RigEnds(
            self._scenario,
            self._road,
            self._clock.at_s,
            seed=self._seed,
            recorder=self.recorder,
            lateness=self._lateness,
            brake=self._brake,
        )
        self._others = VirtualOthers(self._scenario, self._road, self._virtual, units)
        self._open.callback(self._others.close)
        for car in (*self._boxes, *self._processed):
            box = self._boxes.get(car)
            wires = self._daemons.wires(camera_port) if box is None else box
            await ends.open(car, wires, units, self._open)
            if box is None:
                self.pages[car] = await self._daemons.start(car, wires)
            else:
                self._open.push_async_callback(self._computers[car].stop)
                await self._computers[car].start()
        self._engineer = await EngineerPage.open(
            self.processes, self._scenario_file, self._folder, camera_port
        )
        self._engineer.link(self.pages)
        self.pages = {ENGINEER: self._engineer.address} | self.pages
        self._open.callback(asyncio.create_task(self._engineer.follow(self.recorder)).cancel)

    def _make_keys(self) -> None:
        """Write certificates of one authority for every car: live messages are always signed."""
        shutil.rmtree(self._keys, ignore_errors=True)
        self._keys.mkdir(mode=0o700)
        self._trial = run_credentials(self._scenario, self._boxes, self.start_utc_s)
        for car in self._processed:
            write_credentials(self._keys / car, self._trial[car])

    async def _start_cameras(self) -> int:
        """Start the process of the cameras, and return its port."""
        await self._open.enter_async_context(self.processes)
        self._scenario_file = self._folder / "scenario.json"
        self._scenario_file.write_text(self._scenario.model_dump_json(), encoding="utf-8")
        at = [f"{box.camera.host}:{box.camera.port}" for box in self._boxes.values()]
        self._cameras = await self.processes.start(
            "cameras",
            *("-m", "sim_rig.cars.camera_server", str(self._scenario_file), str(self._seed), *at),
            with_pipes=True,
        )
        assert self._cameras.stdout is not None  # noqa: S101 (started with pipes)
        line = await self._cameras.stdout.readline()
        if not line:
            reason = self.processes.last_log_line("cameras")
            raise ProcessError(f"the cameras do not start: {reason}")
        self._open.callback(asyncio.create_task(self._follow(self._cameras.stdout)).cancel)
        return int(line)

    async def _follow(self, images: asyncio.StreamReader) -> None:
        """Note each image that a camera has sent, until the cameras end."""
        while line := await images.readline():
            car, late_s = line.decode().split()
            self._lateness.note("picture", float(late_s))
            if car in self._contacts:
                self._contacts[car].pictures += 1

    def _brake(self, car: str, begin_s: float, until_s: float, deceleration_m_s2: float) -> None:
        """Let a car brake, also in the pictures of the cameras."""
        self._road.brake(car, begin_s, until_s, deceleration_m_s2)
        assert self._cameras.stdin is not None  # noqa: S101 (started with pipes)
        braking = [car, begin_s, until_s, deceleration_m_s2]
        self._cameras.stdin.write(f"{json.dumps(braking)}\n".encode())

    def _has_mute_radio(self, car: str, now: float) -> bool:
        return self._scenario.has_fault("radio_mute", car, self._clock.at_s(now))

    def _air(self) -> Air:
        utc_offset_s = time.time() - time.monotonic()
        air = open_channel(
            self._scenario,
            lambda now: self._road.cars_at(self._clock.at_s(now)),
            self._clock.at_s,
            np.random.default_rng(self._seed),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=self._trial,
        )
        background = BackgroundTraffic(
            FaultyAir(air, self._scenario, self._clock.at_s, utc_offset_s, self._trial),
            self._scenario,
            self._road.cars_at,
            self._clock.at_s,
            np.random.default_rng(self._seed),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=self._trial,
        )
        self._open.callback(background.close)
        return background

    async def _until_ready(self) -> None:
        """Wait until every daemon is ready and receives its sensors, and every box, too."""
        began_at = time.monotonic()
        waiting = self._processed
        while waiting := [car for car in waiting if not self._daemons.check_ready(car)]:
            if time.monotonic() > began_at + _READY_WITHIN_S:
                raise ProcessError(
                    f"not ready after {_READY_WITHIN_S:g} s: {', '.join(waiting)};"
                    f" see {self._folder}"
                )
            await self.processes.sleep_until(time.monotonic() + 0.1)
        for car, box in self._boxes.items():
            while missing := self.contact(car).missing(car, box, self._scenario):
                if time.monotonic() > began_at + box.ready_within_s:
                    raise BoxNotReadyError(
                        f"{car}: the box is not ready after {box.ready_within_s:g} s:"
                        f" {'; '.join(f'{each.subject}: {each.detail}' for each in missing)}"
                    )
                self._computers[car].check()
                await self.processes.sleep_until(time.monotonic() + 0.1)

    def contact(self, car: str) -> Contact:
        """Return what a box has used of its wires up to now."""
        contact = self._contacts[car]
        frames = list(self.recorder.from_box[car])
        for wsm in frames[contact.frames.total() :]:
            contact.receive_wsm(wsm)
        contact.answers = self.recorder.answers[car]
        return contact
