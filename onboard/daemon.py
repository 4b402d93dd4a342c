"""The loop of the car: wait for input or the least timer, then receive, decide, send, show."""

import asyncio
import contextlib
import math
import sys
import time
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np
import structlog

from onboard import psid
from onboard.access.driver_file import load_driver, save_driver
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.config import CarConfig
from onboard.detector.detector_socket import open_detector
from onboard.detector.object_list import ObjectListReader
from onboard.errors import UserError
from onboard.gnss.gpsd import Gpsd
from onboard.gnss.gpsd_reader import GpsdReader
from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.observations import Discarded, Lead, Sensor, SensorLost, SensorRecovered
from onboard.recorder.black_box import BlackBox
from onboard.recorder.initial_state import InitialState
from onboard.recorder.recorded_stack import recorded_stack
from onboard.recorder.records import RecorderState
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.runtime.output_sinks import OutputSinks
from onboard.runtime.systemd import Systemd
from onboard.security.key_files import read_credentials
from onboard.stack import Observation
from onboard.vision.camera import CameraThread
from onboard.wave_link import bsm_sender
from onboard.wave_udp.capture import OTHER_MAC, OWN_MAC
from onboard.wave_udp.endpoint import open_endpoint
from onboard.wave_udp.receive_queue import ReceiveQueue

log = structlog.get_logger()

GIL_INTERVAL_S = 0.000_5
"""How long the camera's thread may keep the interpreter while a warning waits; 5 ms by default."""

EPOCH_AHEAD_S = 10.0
"""How long before an epoch begins the IDs that will hold in it are derived."""

RADIO_TURN_S = 0.000_7
"""How long a round may hear a crowd, before the wires are looked at again: three or four BSMs."""

RADIO_BACK_S = 4.0
"""A radio without errors for this long is back: a host that is gone makes one every third second
(ARP), a closed port every second."""

InputT = TypeVar("InputT")
ReturnT = TypeVar("ReturnT")


@dataclass(frozen=True, slots=True)
class Ready:
    """All wires are open."""

    kind: ClassVar[str] = "ready"
    stamp_s: float


class Daemon:
    """One car: its cores, its wires and the clock."""

    def __init__(self, config: CarConfig, manager: Systemd) -> None:
        """Put the car together; no wire is opened yet. `manager` is told how it goes.

        Raises:
            UserError: its keys cannot be read.
        """
        self.config = config
        self._manager = manager
        folder = config.security.keys_folder
        psids = (config.lcca_psid, psid.BSM)
        credentials = read_credentials(folder, psids) if folder is not None else None
        remembered = config.access.driver_file
        self._driver = (
            load_driver(remembered, DEFAULT_POPULATION)
            if remembered
            else DriverModel(DEFAULT_POPULATION)
        )
        self._box = BlackBox(config.recorder, self._on_box_state) if config.recorder else None
        self._stack = recorded_stack(
            self._box,
            InitialState(
                config=config,
                sensors=config.sensors(),
                seed=np.random.SeedSequence(config.seed),
                now=time.monotonic(),
                utc_s=time.time(),
                credentials=credentials,
                driver=self._driver,
            ),
        )
        self._wsms = ReceiveQueue(config.lcca_psid, bsm_sender)
        self._inbox: deque[tuple[Callable[[Any, float], None], object]] = deque()
        self._next_step: asyncio.Handle | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._radio_back: asyncio.TimerHandle | None = None
        self._is_resting = False
        self._onlookers = OutputSinks()
        self._send_can: Callable[[CanFrame], None] = _nowhere
        self._send_wsm: Callable[[bytes, int], None] = _nowhere

    async def run(self, until: Callable[[], Awaitable[ReturnT]]) -> ReturnT:
        """Open the wires, drive the cores `until` something comes, close the wires, return it.

        Raises:
            UserError: a wire cannot be opened.
        """
        sys.setswitchinterval(GIL_INTERVAL_S)
        self._loop = asyncio.get_running_loop()
        async with contextlib.AsyncExitStack() as wires:
            wires.callback(self._rest)
            await self._open(wires)
            freeze_start_up_objects()
            self._onlookers.show(Ready(time.monotonic()))
            self._step()
            self._manager.ready(f"driving as {self.config.car.plate}")
            log.info("ready", plate=self.config.car.plate)
            came = await until()
        self.save_driver()
        log.info("stopped")
        return came

    def save_driver(self) -> None:
        """Remember what was learnt of the driver, where the configuration says where.

        A disk that is full by now costs what was learnt, and not the drive.
        """
        if self.config.access.driver_file is not None:
            try:
                save_driver(self.config.access.driver_file, self._driver)
            except UserError as error:
                log.error("driver not remembered", reason=str(error))  # noqa: TRY400 (no fault of the program)

    async def _open(self, wires: contextlib.AsyncExitStack) -> None:
        config, stack = self.config, self._stack
        if config.access.driver_file is not None:
            save_driver(config.access.driver_file, self._driver)  # whether it can be, is said now
        self._onlookers.open_files(config.trace, wires)
        if self._box is not None:
            self._box.start()
            wires.push_async_callback(self._close_box, self._box)
        if config.can is not None:
            take_discarded = self._taker(stack.receive_observation)
            take_frame = self._taker(stack.receive_can)
            bus = CanBus(config.can, take_frame, self._on_bus_state, take_discarded)
            bus.start(self._loop)
            wires.callback(bus.close)
            self._send_can = bus.send
        if config.gnss is not None:
            take_data = self._reading(GpsdReader(config.gnss))
            gpsd = Gpsd(config.gnss, take_data, self._on_gpsd_state)
            gpsd.start(self._loop)
            wires.callback(gpsd.close)
        if config.radio is not None:
            radio = open_endpoint(config.radio, self._on_wsm, self._on_radio_trouble)
            wires.callback(radio.close)
            radio.start(self._loop)
            self._send_wsm = radio.send
        if config.camera is not None:
            takes_pictures = config.recorder is not None and config.recorder.pictures_hz > 0.0
            on_picture = self._box.note_picture if self._box and takes_pictures else None
            camera = CameraThread(config.camera, config.vision, self._on_seen, on_picture)
            camera.start()
            wires.callback(camera.close)
        if config.detector is not None:
            detector = await open_detector(config.detector, self._reading(ObjectListReader()))
            wires.callback(detector.close)
        on_brake = self._taker(self._press_brake_button)
        await self._onlookers.open_page(config, stack, on_brake, wires)

    def _step(self) -> None:
        """One round, in a fixed order: receive, decide, send, show, arm the next timer."""
        if self._next_step is not None:
            self._next_step.cancel()  # planned, and the timer was sooner
            self._next_step = None
        now = time.monotonic()
        self._stack.set_utc(time.time(), now)
        while self._inbox:
            receive, item = self._inbox.popleft()
            receive(item, now)
        self._receive_wsms(now)
        if self._stack.get_timer() <= now:
            self._stack.handle_timer(now)
        for user_priority, wsm in self._stack.wsms_to_send(now):
            self._send_wsm(wsm, user_priority)
            self._onlookers.show_frame(wsm, OWN_MAC)
        for frame in self._stack.can_to_send(now):
            self._send_can(frame)
        while (event := self._stack.next_event()) is not None:
            self._onlookers.show(event)
        self._onlookers.show_view(now)
        if self._timer is not None:
            self._timer.cancel()
        at = self._stack.get_timer()
        self._timer = None if at == math.inf else self._loop.call_at(at, self._step)
        if self._wsms and self._next_step is None:
            self._next_step = self._loop.call_soon(self._look_first)
        self._manager.feed(now)

    def _rest(self) -> None:
        """No step any more, whatever the camera's thread still brings."""
        self._is_resting = True
        for handle in (self._timer, self._next_step, self._radio_back):
            if handle is not None:
                handle.cancel()

    def _take(self, receive: Callable[[InputT, float], None], item: InputT) -> None:
        """Have `item` received in the next round."""
        self._inbox.append((receive, item))
        self._plan_step()

    def _plan_step(self) -> None:
        """Have a round as soon as the wires have been looked at."""
        if self._next_step is None and not self._is_resting:
            self._next_step = self._loop.call_soon(self._step)

    def _look_first(self) -> None:
        """At the wires: a loop calls what was planned before what they bring in the same round."""
        self._next_step = self._loop.call_soon(self._step)

    def _taker(self, receive: Callable[[InputT, float], None]) -> Callable[[InputT], None]:
        return lambda item: self._take(receive, item)

    def _reading(self, reader: GpsdReader | ObjectListReader) -> Callable[[bytes], None]:
        """Have what comes read by `reader` in the next round, and what it says received."""

        def receive(data: bytes, now: float) -> None:
            reader.receive_bytes(data, now)
            while (observation := reader.next_event()) is not None:
                self._stack.receive_observation(observation, now)

        return self._taker(receive)

    def _on_wsm(self, wsm: bytes) -> None:
        self._wsms.put(wsm)
        self._plan_step()

    def _receive_wsms(self, now: float) -> None:
        """All of the warning group; without any, as many others as there is time for.

        So what a group message leads to is sent and shown before the crowd is heard.
        """
        shed = self._wsms.take_dropped()
        if shed:
            overload = Discarded(now, "wsmp", "overload", f"{shed} frames")
            self._stack.receive_observation(overload, now)
        turn_ends_at = now if self._wsms.has_urgent else now + RADIO_TURN_S
        while True:
            wsm = self._wsms.take(only_urgent=time.monotonic() >= turn_ends_at)
            if wsm is None:
                return
            self._stack.receive_wsm(wsm, now)
            self._onlookers.show_frame(wsm, OTHER_MAC)

    def _on_bus_state(self, up: bool, why: str) -> None:
        if not up:  # it is back when a speed comes, not when the bus does
            self._lose(Sensor.SPEED, why)

    def _on_gpsd_state(self, up: bool, why: str) -> None:
        if not up:
            self._lose(Sensor.POSITION, why)

    def _on_radio_trouble(self, why: str) -> None:
        """It comes as often as something is sent, so when it no longer does, the radio is back."""
        if self._radio_back is None:
            self._lose(Sensor.RADIO, why)
        else:
            self._radio_back.cancel()
        self._radio_back = self._loop.call_later(RADIO_BACK_S, self._on_radio_back)

    def _on_radio_back(self) -> None:
        self._radio_back = None
        back = SensorRecovered(self._loop.time(), Sensor.RADIO)
        self._take(self._stack.receive_observation, back)

    def _lose(self, sensor: Sensor, why: str) -> None:
        lost = SensorLost(self._loop.time(), sensor, silent_s=None, reason=why)
        self._take(self._stack.receive_observation, lost)

    def _on_seen(self, observations: Sequence[Observation]) -> None:
        """Called from the camera's thread, where there is time for the slow derivation of IDs."""
        leads = {each.text for each in observations if isinstance(each, Lead) and each.text}
        for plate_text in leads | {self.config.car.plate}:
            for utc_s in (time.time(), time.time() + EPOCH_AHEAD_S):
                self._stack.digest.car_id(plate_text, utc_s)
        for observation in observations:
            self._loop.call_soon_threadsafe(
                self._take, self._stack.receive_observation, observation
            )

    def _press_brake_button(self, _: None, now: float) -> None:
        self._stack.press_brake_button(now)

    async def _close_box(self, box: BlackBox) -> None:
        box.close()
        await asyncio.sleep(0)  # what it told is shown before the trace is closed

    def _on_box_state(self, state: RecorderState) -> None:
        """Called from the black box's thread."""
        self._loop.call_soon_threadsafe(self._onlookers.show, state)


def _nowhere(*_: object) -> None:
    """Where a car without that wire sends."""
