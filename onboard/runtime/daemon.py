"""The main loop: wait for an input or the next timer, then step the cores, send and show."""

import asyncio
import contextlib
import math
import sys
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
import structlog

from onboard.access.driver_file import DriverFile
from onboard.access.driver_model import DEFAULT_POPULATION
from onboard.errors import UserError
from onboard.interface.requests import MessageRequest
from onboard.lcca.events import Identified, IdentityLost
from onboard.obd.dbc_file import read_signals
from onboard.observations import Discarded
from onboard.recorder.build import present_build
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.runtime.candidate_ids import CandidateIds
from onboard.runtime.entropy_source import entropy_source
from onboard.runtime.gc_tuning import freeze_start_up_objects
from onboard.runtime.output_sinks import OutputSinks
from onboard.runtime.polled_loop import PolledLoop
from onboard.runtime.systemd import Systemd
from onboard.runtime.wires import Item, Wires
from onboard.security.key_files import read_own_credentials
from onboard.step import BrakeButton, Input, ProgramMessage, ReceivedWsm, SentWsm
from onboard.trace.file_failure import FileUse
from onboard.vehicle.config import CarConfig
from onboard.vision.camera_process import CameraWorker
from onboard.wave_udp.capture import OTHER_MAC, OWN_MAC
from onboard.wave_udp.receive_queue import ReceiveQueue
from onboard.wave_udp.receive_turns import ReceiveTurns

log = structlog.get_logger()

GIL_INTERVAL_S = 0.000_5
"""Switch interval of the interpreter: the longest time that another thread delays a warning.

Python's default is 5 ms.
"""

CURVATURE_S = 0.05
"""Time between two curvatures for the camera, which takes one for each picture: no step needs
another."""

ReturnT = TypeVar("ReturnT")


@dataclass(frozen=True, slots=True)
class Ready:
    """All wires are open."""

    kind: ClassVar[str] = "ready"
    stamp_s: float


class Daemon:
    """One vehicle: its cores, its wires and the clock."""

    def __init__(
        self, config: CarConfig, manager: Systemd, camera_worker: CameraWorker | None = None
    ) -> None:
        """Make the cores; no wire is opened yet.

        Args:
            config: of the vehicle.
            manager: gets the state of the service.
            camera_worker: a process for a live camera, if one has been started.

        Raises:
            UserError: its keys or its DBC file cannot be read.
        """
        self.config = config
        self._manager = manager
        credentials = read_own_credentials(config.security, config.car.plate, config.psids)
        self._end_part()
        self._sinks = OutputSinks()
        self._driver_file = DriverFile(config.access.driver_file, DEFAULT_POPULATION)
        self._driver = self._driver_file.driver
        self._wires = Wires(config, self._take, self._take_wsm, self._sinks.show, camera_worker)
        self._stack = recorded_stack(
            self._wires.black_box,
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
            entropy_source(config.seed),
        )
        self._end_part()
        self._candidate_ids = CandidateIds(self._stack.digest, config.car.plate)
        self._wsms = ReceiveQueue(
            config.lcca_psid,
            self._stack.framing.sender_of,
            self._stack.known_signer,
            self._stack.certificate_in,
            self._stack.framing.read,
            may_wait=self._stack.framing.may_wait,
        )
        self._turns = ReceiveTurns(self._wsms, time.monotonic, self._has_input)
        self._inbox: deque[Item] = deque()
        self._handled: list[bytes] = []
        """Received frames of the present step."""
        self._next_step: asyncio.Handle | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._is_stopped = False
        self._curvature_at = 0.0

    async def run(self, until: Callable[[], Awaitable[ReturnT]]) -> ReturnT:
        """Open the wires, step the cores until `until()` returns, and close the wires.

        Returns:
            the result of `until()`.

        Raises:
            UserError: a wire cannot be opened.
        """
        sys.setswitchinterval(GIL_INTERVAL_S)
        self._loop = asyncio.get_running_loop()
        async with contextlib.AsyncExitStack() as exits:
            exits.callback(self._stop_stepping)
            self._sinks.open_files(self.config.trace, exits)
            self.save_driver()  # before driving, so that a file that cannot be written is reported
            self._end_part()
            await self._wires.open(self._candidate_ids, exits)
            self._end_part()
            await self._sinks.open_interface(
                self.config.interface,
                self._take_brake_button,
                self._wires.take_object_list,
                self._take_message,
                exits,
            )
            self._end_part()
            await self._sinks.open_page(self.config, self._stack, self._take_brake_button, exits)
            self._plan_step()  # the vehicle is not deaf while the camera opens
            await self._wires.open_camera()
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
        try:
            self._driver_file.save()
        except UserError as error:
            self._sinks.report_failure(FileUse.DRIVER, str(error))

    def _end_part(self) -> None:
        """Feed the watchdog after a part of a start: a reload has many, and takes no steps."""
        self._manager.feed(time.monotonic())

    def _step(self) -> None:
        """Run one step of the cores: receive, decide, send, show, and arm the next timer."""
        if self._next_step is not None:
            self._next_step.cancel()  # the timer was sooner
            self._next_step = None
        now = time.monotonic()
        outputs = self._stack.step(self._inputs(now), now, time.time(), self._wires.send_wsm)
        self._wires.send_to_vehicle(outputs)
        if now >= self._curvature_at:
            self._curvature_at = now + CURVATURE_S
            self._wires.tell_camera(self._stack.curvature(now))
        for event in outputs.events:
            if isinstance(event, Identified | IdentityLost):
                self._candidate_ids.receive_identity(event)
        self._sinks.show_step(outputs.events, now)
        self._capture_frames(outputs.wsms)
        # Frames that are left are due at once, after a poll: the loop polls before it runs timers.
        self._arm(min(outputs.timer_at, self._turns.get_timer()))
        self._manager.feed(now)

    def _inputs(self, now: float) -> Iterator[Input]:
        """Yield the inputs of a step, each after the cores have handled the one before."""
        while self._inbox:
            item = self._inbox.popleft()
            if callable(item):
                yield from item(now)
            else:
                yield item
        dropped = self._wsms.take_dropped()
        if dropped:
            yield Discarded(now, self._stack.framing.component, "overload", f"{dropped} frames")
        for wsm in self._turns.take(now):
            yield ReceivedWsm(now, wsm)
            self._handled.append(wsm)

    def _capture_frames(self, sent: Sequence[SentWsm]) -> None:
        """Write the frames of a step to the capture, after all that they led to."""
        for handled in self._handled:
            self._sinks.show_frame(handled, OTHER_MAC)
        self._handled.clear()
        for wsm in sent:
            self._sinks.show_frame(wsm.data, OWN_MAC)

    def _take(self, item: Item) -> None:
        """Have `item` received in the next step."""
        self._inbox.append(item)
        self._plan_step()

    def _take_wsm(self, wsm: bytes) -> None:
        """Have a frame received in its turn."""
        self._turns.put(wsm, at_once=self._stack.awaits_speeds)
        if self._wsms.is_pressing:
            self._plan_step()
        due_at = self._turns.get_timer()
        if due_at < (math.inf if self._timer is None else self._timer.when()):
            self._arm(due_at)

    def _has_input(self) -> bool:
        """Whether a wire has input, as far as this loop can tell."""
        return not isinstance(self._loop, PolledLoop) or self._loop.has_input()

    def _take_brake_button(self, _: None) -> None:
        self._take(lambda now: [BrakeButton(now)])

    def _take_message(self, message: MessageRequest) -> None:
        data = bytes.fromhex(message.data)
        self._take(lambda now: [ProgramMessage(now, message.psid, message.user_priority, data)])

    def _plan_step(self) -> None:
        """Plan a step as soon as the wires have been polled."""
        if self._next_step is None and not self._is_stopped:
            self._next_step = self._loop.call_soon(self._step)

    def _arm(self, at: float) -> None:
        """Set the timer to `at`, whatever it was set to."""
        if self._timer is not None:
            if self._timer.when() == at:
                return
            self._timer.cancel()
        self._timer = None if at == math.inf else self._loop.call_at(at, self._on_timer)

    def _on_timer(self) -> None:
        self._timer = None
        self._step()

    def _stop_stepping(self) -> None:
        """Cancel all planned steps, and ignore what the camera still puts out."""
        self._is_stopped = True
        for handle in (self._timer, self._next_step):
            if handle is not None:
                handle.cancel()
