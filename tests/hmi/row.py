"""Vehicles one behind the other in real time, the last with its page: stacks and a lossless radio.

The test gives the observations of the cameras; everything from there to the browser is real.
"""

import asyncio
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import numpy as np

from onboard.obd.settings import CanSettings
from onboard.observations import (
    HardBrake,
    Lead,
    LeadIdentity,
    PlateCandidate,
    Sensor,
    SensorLost,
    Speed,
    VehicleDetection,
)
from onboard.runtime.driver_page import DriverPage
from onboard.settings import parse_settings
from onboard.step import BrakeButton, Input, ReceivedWsm
from onboard.trace.trace_line import Event
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.vision.settings import CameraSettings
from tests.leads import known_lead

TICK_S = 0.1
SPEED_M_S = 15.0
SENSORS = frozenset({Sensor.SPEED, Sensor.CAMERA})


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Row:
    """Vehicles one behind the other; the page of the last is served in a thread of its own."""

    def __init__(self, *plates: str, gap_m: float = 14.0, **hmi: object) -> None:
        self.port = free_port()
        self.hmi = hmi
        self.plates = plates
        self.gap_m = gap_m
        self.lead_plate: str | None = plates[-2] if len(plates) > 1 else None
        self.detections: tuple[tuple[float, float], ...] = ()
        """Further vehicles in the last camera's image: ahead and right, in m."""
        self.candidates: tuple[str, ...] = ()
        """Texts that the plate of the last vehicle's lead may bear, if it is not certain."""
        self.camera_works = True
        self.sees_lane = True
        self.now = 0.0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def __enter__(self) -> "Row":
        self._thread.start()
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def start(self) -> None:
        """Start all vehicles."""
        self._do(self._start())

    def stop(self) -> None:
        """Stop all vehicles."""
        self._do(self._stop())

    def do(self, action: Callable[[], Any]) -> Any:
        """Call `action` in the loop of the vehicles, and return its result."""

        async def on_loop() -> Any:
            return action()

        return self._do(on_loop())

    def brake(self, car: int = 0, *, is_over: bool = False) -> None:
        """Let a vehicle, counted from the first, brake hard, or end that."""
        self.do(lambda: self._receive(car, HardBrake(self.now, 6.0, "obd:7E8", is_over=is_over)))

    def press_button(self, car: int = 0) -> None:
        """Press the brake button of a vehicle, counted from the first."""
        self.do(lambda: self._receive(car, BrakeButton(self.now)))

    def send_event(self, event: Event) -> None:
        """Give the page an event, as the stack would."""
        self.do(lambda: self.page.receive_event(event))

    def lose_camera(self, reason: str = "frozen") -> None:
        """Report the last vehicle's camera as lost."""
        self.camera_works = False
        lost = SensorLost(self.now, Sensor.CAMERA, None, reason)
        self.do(lambda: self._receive(-1, lost))

    def _do(self, work: Any) -> Any:
        future: Future[Any] = asyncio.run_coroutine_threadsafe(work, self._loop)
        return future.result(timeout=20.0)

    async def _start(self) -> None:
        self.now = time.monotonic()
        configs = [self._config(number) for number in range(len(self.plates))]
        self.stacks = [
            Stack(
                config,
                SENSORS,
                np.random.default_rng(number),
                now=self.now,
                utc_s=1.7e9,
            )
            for number, config in enumerate(configs)
        ]
        self._inputs: list[list[Input]] = [[] for _ in self.stacks]
        """Of each car's next step."""
        last = configs[-1]
        assert last.hmi is not None
        self.page = DriverPage(
            last.hmi,
            last.model_copy(update={"can": CanSettings(), "camera": CameraSettings(source="test")}),
            self.stacks[-1],
            lambda _: self._receive(-1, BrakeButton(self.now)),
        )
        await self.page.start()
        self._running = asyncio.create_task(self._run())

    async def _stop(self) -> None:
        self._running.cancel()
        await self.page.close()

    def _config(self, number: int) -> CarConfig:
        tree: dict[str, object] = {
            "car": {"plate": self.plates[number]},
            "security": {"plate_digest": {"scrypt_log2_n": 1}},
        }
        if number == len(self.plates) - 1:
            tree["hmi"] = {"port": self.port} | self.hmi
        return parse_settings(tree, CarConfig, self.plates[number])

    async def _run(self) -> None:
        observe_at = 0.0
        while True:
            self.now = time.monotonic()
            if self.now >= observe_at:
                observe_at = self.now + TICK_S
                self._observe()
            self._step()
            await asyncio.sleep(0.02)

    def _observe(self) -> None:
        ahead: str | None = None
        for number, plate in enumerate(self.plates):
            is_last = number == len(self.plates) - 1
            self._receive(number, Speed(self.now, SPEED_M_S, 0.28, "obd:7E8"))
            if not is_last or self.camera_works:
                text = self.lead_plate if is_last else ahead
                lead = (
                    Lead(self.now, LeadIdentity.NO_LEAD)
                    if text is None
                    else known_lead(self.now, text, self.gap_m, 0.2)
                )
                if is_last and self.candidates:
                    lead = self._uncertain_lead()
                if is_last and not self.sees_lane:
                    lead = Lead(self.now, LeadIdentity.UNKNOWN)
                self._receive(number, lead)
                if is_last:
                    for track_id, (ahead_m, right_m) in enumerate(self.detections):
                        range_m, bearing_rad = (
                            np.hypot(ahead_m, right_m),
                            np.arctan2(right_m, ahead_m),
                        )
                        detection = VehicleDetection(
                            self.now, track_id, float(range_m), 0.5, float(bearing_rad), 0.01
                        )
                        self._receive(number, detection)
            ahead = plate

    def _uncertain_lead(self) -> Lead:
        probability = 0.99 / len(self.candidates)
        candidates = tuple(PlateCandidate(text, probability) for text in self.candidates)
        track_id = len(self.plates)
        return Lead(
            self.now, LeadIdentity.UNKNOWN, None, self.gap_m, 0.3, 0.2, 0.3, track_id, candidates
        )

    def _receive(self, car: int, received: Input) -> None:
        self._inputs[car].append(received)

    def _step(self) -> None:
        all_inputs, self._inputs = self._inputs, [[] for _ in self.stacks]
        for number, stack in enumerate(self.stacks):
            outputs = stack.step(all_inputs[number], self.now)
            for wsm in outputs.wsms:
                for other in range(len(self.stacks)):
                    if other != number:
                        self._receive(other, ReceivedWsm(self.now, wsm.data))
            if stack is self.stacks[-1]:
                for event in outputs.events:
                    self.page.receive_event(event)
        self.page.show(self.now)
