"""The main loop: wait for an input or the next timer, then step the cores, send and show."""

import asyncio
import contextlib
import math
import sys
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, TypeVar

import numpy as np
import structlog

from onboard.access.driver_file import load_driver, save_driver
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.request_outputs import RequestOutputs
from onboard.build import present_build
from onboard.detector.detector_socket import open_detector
from onboard.detector.object_list import ObjectListReader
from onboard.errors import UserError
from onboard.gnss.gpsd import Gpsd
from onboard.gnss.gpsd_reader import GpsdReader
from onboard.lcca.events import Identified, IdentityLost
from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_signals
from onboard.observations import Discarded, Lead, Sensor, SensorLost, SensorRecovered
from onboard.recorder.black_box import BlackBox
from onboard.recorder.records import RecorderState
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.runtime.candidate_ids import CandidateIds
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.runtime.output_sinks import OutputSinks
from onboard.runtime.systemd import Systemd
from onboard.security.key_files import read_own_credentials
from onboard.step import BrakeButton, Input, Observation, ReceivedWsm
from onboard.vehicle.config import CarConfig
from onboard.vehicle.wave_link import bsm_sender
from onboard.vision.camera import CameraThread
from onboard.vision.networks import load_perception
from onboard.wave_udp.capture import OTHER_MAC, OWN_MAC
from onboard.wave_udp.endpoint import open_endpoint
from onboard.wave_udp.receive_queue import ReceiveQueue

log = structlog.get_logger()

GIL_INTERVAL_S = 0.000_5
"""Switch interval of the interpreter: the longest time that the camera thread delays a warning.

Python's default is 5 ms.
"""

RADIO_TURN_S = 0.000_7
"""Time in which one step receives BSMs before the wires are polled again: three or four BSMs."""

UNKNOWN_SIGNERS_SHARE = 0.25
"""Share of time for frames of signers that were not verified before: some 1,500 a second. The rest
is for all else, however many arrive."""

RADIO_BACK_S = 4.0
"""Time without errors after which the radio counts as recovered.

An unreachable host causes an error every 3 s (ARP), a closed port every second.
"""

_Item = Input | Callable[[float], Iterable[Input]]
"""An input, or a function that makes inputs with the `now` of the step."""

ReturnT = TypeVar("ReturnT")


@dataclass(frozen=True, slots=True)
class Ready:
    """All wires are open."""

    kind: ClassVar[str] = "ready"
    stamp_s: float


class Daemon:
    """One vehicle: its cores, its wires and the clock."""

    def __init__(self, config: CarConfig, manager: Systemd) -> None:
        """Make the cores; no wire is opened yet. `manager` gets the state of the service.

        Raises:
            UserError: its keys, its driver file or its DBC file cannot be read.
        """
        self.config = config
        self._manager = manager
        credentials = read_own_credentials(config.security, config.psids)
        driver_file = config.access.driver_file
        self._driver = (
            load_driver(driver_file, DEFAULT_POPULATION)
            if driver_file
            else DriverModel(DEFAULT_POPULATION)
        )
        self._black_box = (
            BlackBox(config.recorder, self._on_recorder_state) if config.recorder else None
        )
        self._stack = recorded_stack(
            self._black_box,
            InitialState(
                config=config,
                sensors=config.sensors(),
                seed=np.random.SeedSequence(config.seed),
                now=time.monotonic(),
                utc_s=time.time(),
                credentials=credentials,
                driver=self._driver,
                signals=read_signals(config.obd.broadcast),
            ),
        )
        self._candidate_ids = CandidateIds(self._stack.digest, config.car.plate)
        self._wsms = ReceiveQueue(config.lcca_psid, bsm_sender, self._stack.known_signer)
        self._unknown_at = -math.inf
        """When the next frames of unknown signers may be received."""
        self._unknown_turn: asyncio.TimerHandle | None = None
        self._inbox: deque[_Item] = deque()
        self._next_step: asyncio.Handle | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._radio_back: asyncio.TimerHandle | None = None
        self._is_stopped = False
        self._sinks = OutputSinks()
        self._request_outputs = (
            RequestOutputs(config.brake_request, self._take) if config.brake_request else None
        )
        self._send_can: Callable[[CanFrame], None] = _nowhere
        self._send_wsm: Callable[[bytes, int], None] = _nowhere

    async def run(self, until: Callable[[], Awaitable[ReturnT]]) -> ReturnT:
        """Open the wires, step the cores until `until()` returns, and close the wires.

        Returns:
            the result of `until()`.

        Raises:
            UserError: a wire cannot be opened.
        """
        sys.setswitchinterval(GIL_INTERVAL_S)
        self._loop = asyncio.get_running_loop()
        async with contextlib.AsyncExitStack() as wires:
            wires.callback(self._stop_stepping)
            await self._open(wires)
            freeze_start_up_objects()
            self._sinks.show(Ready(time.monotonic()))
            self._step()
            self._manager.ready(f"driving as {self.config.car.plate}")
            log.info("ready", plate=self.config.car.plate, build=present_build().name)
            result = await until()
        self.save_driver()
        log.info("stopped")
        return result

    def save_driver(self) -> None:
        """Write the driver model, if the configuration names a file.

        A full disk loses the model, and does not end the drive.
        """
        if self.config.access.driver_file is not None:
            try:
                save_driver(self.config.access.driver_file, self._driver)
            except UserError as error:
                log.error("driver model not saved", reason=str(error))  # noqa: TRY400 (no fault of the program)

    async def _open(self, wires: contextlib.AsyncExitStack) -> None:
        config = self.config
        if config.access.driver_file is not None:
            # Before driving, so that a file that cannot be written is reported at once.
            save_driver(config.access.driver_file, self._driver)
        self._sinks.open_files(config.trace, wires)
        if self._black_box is not None:
            self._black_box.start()
            wires.push_async_callback(self._close_black_box, self._black_box)
        if config.can is not None:
            bus = CanBus(config.can, self._take, self._on_bus_state, self._take)
            bus.start(self._loop)
            wires.callback(bus.close)
            self._send_can = bus.send
        if self._request_outputs is not None:
            self._request_outputs.open(self._loop, wires)
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
        self._candidate_ids.start()
        wires.callback(self._candidate_ids.close)
        if config.camera is not None:
            takes_pictures = config.recorder is not None and config.recorder.pictures_hz > 0.0
            on_image = self._black_box.record_image if self._black_box and takes_pictures else None
            camera = CameraThread(
                config.camera,
                load_perception(config.camera, config.vision),
                self._on_seen,
                on_image,
            )
            camera.start()
            wires.callback(camera.close)
        if config.detector is not None:
            detector = await open_detector(config.detector, self._reading(ObjectListReader()))
            wires.callback(detector.close)
        await self._sinks.open_page(config, self._stack, self._on_brake_button, wires)

    def _step(self) -> None:
        """Run one step of the cores: receive, decide, send, show, and arm the next timer."""
        if self._next_step is not None:
            self._next_step.cancel()  # the timer was sooner
            self._next_step = None
        now = time.monotonic()
        outputs = self._stack.step(self._inputs(now), now, time.time())
        for wsm in outputs.wsms:
            self._send_wsm(wsm.data, wsm.user_priority)
            self._sinks.show_frame(wsm.data, OWN_MAC)
        for frame in outputs.can_frames:
            self._send_can(frame)
        if self._request_outputs is not None:
            for event in outputs.events:
                if isinstance(event, BrakeRequest):
                    self._request_outputs.send(event)
        for event in outputs.events:
            if isinstance(event, Identified | IdentityLost):
                self._candidate_ids.receive_identity(event)
            self._sinks.show(event)
        self._sinks.show_view(now)
        if self._timer is not None:
            self._timer.cancel()
        at = outputs.timer_at
        self._timer = None if at == math.inf else self._loop.call_at(at, self._step)
        if self._wsms.has_known and self._next_step is None:
            self._next_step = self._loop.call_soon(self._poll_wires_first)
        self._plan_unknown()
        self._manager.feed(now)

    def _stop_stepping(self) -> None:
        """Cancel all planned steps, and ignore what the camera thread still puts out."""
        self._is_stopped = True
        for handle in (self._timer, self._next_step, self._radio_back, self._unknown_turn):
            if handle is not None:
                handle.cancel()

    def _take(self, item: _Item) -> None:
        """Have `item` received in the next step."""
        self._inbox.append(item)
        self._plan_step()

    def _plan_step(self) -> None:
        """Plan a step as soon as the wires have been polled."""
        if self._next_step is None and not self._is_stopped:
            self._next_step = self._loop.call_soon(self._step)

    def _poll_wires_first(self) -> None:
        """Plan a step after the loop's next poll: it runs planned calls before new input."""
        self._next_step = self._loop.call_soon(self._step)

    def _inputs(self, now: float) -> Iterator[Input]:
        """Yield the inputs of a step, each after the cores have handled the one before."""
        while self._inbox:
            item = self._inbox.popleft()
            if callable(item):
                yield from item(now)
            else:
                yield item
        yield from self._received_wsms(now)

    def _received_wsms(self, now: float) -> Iterator[Input]:
        """Yield all group messages of known signers; without any, other frames for `RADIO_TURN_S`.

        So what follows from a group message is sent and shown before further BSMs are verified.
        Unknown signers have their own share of time.
        """
        dropped = self._wsms.take_dropped()
        if dropped:
            yield Discarded(now, "wsmp", "overload", f"{dropped} frames")
        turn_s = 0.0 if self._wsms.has_urgent else RADIO_TURN_S
        while True:
            wsm = self._wsms.take(only_urgent=time.monotonic() >= now + turn_s)
            if wsm is None:
                break
            yield ReceivedWsm(now, wsm)
            self._sinks.show_frame(wsm, OTHER_MAC)
        yield from self._received_from_unknown(now, turn_s)

    def _received_from_unknown(self, now: float, turn_s: float) -> Iterator[Input]:
        """Yield frames of unknown signers for `turn_s`, at least one, if they are due."""
        began_at = ended_at = time.monotonic()
        if began_at < self._unknown_at:
            return
        while ended_at <= began_at + turn_s and (wsm := self._wsms.take_unknown()) is not None:
            yield ReceivedWsm(now, wsm)
            self._sinks.show_frame(wsm, OTHER_MAC)
            ended_at = time.monotonic()
        self._unknown_at = ended_at + (ended_at - began_at) * (1.0 / UNKNOWN_SIGNERS_SHARE - 1.0)

    def _reading(self, reader: GpsdReader | ObjectListReader) -> Callable[[bytes], None]:
        """Return a function that has bytes read by `reader` in the next step."""

        def read(data: bytes, now: float) -> Iterator[Input]:
            reader.receive_bytes(data, now)
            return iter(reader.next_event, None)

        return lambda data: self._take(partial(read, data))

    def _on_wsm(self, wsm: bytes) -> None:
        self._wsms.put(wsm)
        if self._wsms.has_known:
            self._plan_step()
        self._plan_unknown()

    def _plan_unknown(self) -> None:
        """Plan a step for the frames of unknown signers that wait, as soon as they may be taken."""
        if self._wsms.has_unknown and self._unknown_turn is None and not self._is_stopped:
            self._unknown_turn = self._loop.call_at(self._unknown_at, self._take_unknown_turn)

    def _take_unknown_turn(self) -> None:
        self._unknown_turn = None
        self._plan_step()

    def _on_bus_state(self, up: bool, why: str) -> None:
        if not up:  # recovered by the next speed, not by the bus
            self._lose(Sensor.SPEED, why)

    def _on_gpsd_state(self, up: bool, why: str) -> None:
        if not up:
            self._lose(Sensor.POSITION, why)

    def _on_radio_trouble(self, why: str) -> None:
        """Report the radio lost; it is recovered when no more errors come, one per frame sent."""
        if self._radio_back is None:
            self._lose(Sensor.RADIO, why)
        else:
            self._radio_back.cancel()
        self._radio_back = self._loop.call_later(RADIO_BACK_S, self._on_radio_back)

    def _on_radio_back(self) -> None:
        self._radio_back = None
        self._take(SensorRecovered(self._loop.time(), Sensor.RADIO))

    def _lose(self, sensor: Sensor, why: str) -> None:
        self._take(SensorLost(self._loop.time(), sensor, silent_s=None, reason=why))

    def _on_seen(self, observations: Sequence[Observation]) -> None:
        """Take observations in the camera thread: of a lead, the candidates with derived IDs."""
        for observation in observations:
            seen = observation
            if isinstance(observation, Lead):
                seen = self._candidate_ids.derived(observation, time.time())
            self._loop.call_soon_threadsafe(self._take, seen)

    def _on_brake_button(self, _: None) -> None:
        self._take(lambda now: [BrakeButton(now)])

    async def _close_black_box(self, black_box: BlackBox) -> None:
        black_box.close()
        await asyncio.sleep(0)  # its last state is traced before the trace is closed

    def _on_recorder_state(self, state: RecorderState) -> None:
        """Show the recorder's state; called in the black box's thread."""
        self._loop.call_soon_threadsafe(self._sinks.show, state)


def _nowhere(*_: object) -> None:
    """Discard a frame of a wire that the vehicle does not have."""
