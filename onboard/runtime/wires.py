"""The wires of one vehicle: opened in a fixed order, they deliver inputs and send outputs."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.request_outputs import RequestOutputs
from onboard.detector.detector_socket import open_detector
from onboard.detector.object_list import ObjectListReader
from onboard.gnss.gpsd import Gpsd
from onboard.gnss.gpsd_reader import GpsdReader
from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.observations import Curvature, Lead, Sensor, SensorLost
from onboard.recorder.black_box import BlackBox
from onboard.recorder.records import RecorderState
from onboard.runtime.candidate_ids import CandidateIds
from onboard.runtime.radio_loss import RadioLoss
from onboard.step import Input, SentWsm, StepOutputs
from onboard.vehicle.config import CarConfig
from onboard.vision.camera_process import CameraProcess, CameraWork, CameraWorker
from onboard.vision.seen import PictureRate, Seen
from onboard.wave_udp.endpoint import open_endpoint

if TYPE_CHECKING:
    from onboard.vision.recorded_camera import RecordedCamera

Item = Input | Callable[[float], Iterable[Input]]
"""An input, or a function that makes inputs with the `now` of the step."""


class Wires:
    """The recorder, the sensors, the radio and the ways out of requests to brake, as configured."""

    def __init__(
        self,
        config: CarConfig,
        take: Callable[[Item], None],
        take_wsm: Callable[[bytes], None],
        show: Callable[[RecorderState], None],
        camera_worker: CameraWorker | None = None,
    ) -> None:
        """Open nothing yet. The callbacks are called from the loop.

        Args:
            config: which wires there are.
            take: gets what the wires deliver, and which of them are lost.
            take_wsm: gets each frame of the radio.
            show: gets the recorder's state when it changes.
            camera_worker: a process for a live camera.

        Raises:
            UserError: the DBC file of the requests to brake cannot be read.
        """
        self._config = config
        self._take = take
        self._take_wsm = take_wsm
        self._show = show
        self._camera_worker = camera_worker
        self.black_box = (
            BlackBox(config.recorder, self._on_recorder_state) if config.recorder else None
        )
        self._request_outputs = (
            RequestOutputs(config.brake_request, take) if config.brake_request else None
        )
        self.tell_camera: Callable[[Curvature | None], None] = _nowhere
        """Tells the camera the curvature of the vehicle's path."""
        self._camera: CameraProcess | RecordedCamera | None = None
        self.take_object_list = self._reading(ObjectListReader())
        """Takes what the detector detects."""
        self._send_can: Callable[[CanFrame], None] = _nowhere
        self._send_wsm: Callable[[bytes, int], None] = _nowhere

    async def open(self, candidate_ids: CandidateIds, exits: contextlib.AsyncExitStack) -> None:
        """Open them in the running loop, until `exits` are closed, the last one first.

        The camera is not awaited: see `open_camera`.

        Args:
            candidate_ids: derives the IDs of what the camera reads.
            exits: close the wires.

        Raises:
            UserError: one of them cannot be opened.
        """
        self._loop = asyncio.get_running_loop()
        self._open_recorder(exits)
        self._camera = self._new_camera(candidate_ids)
        if self._camera is not None:
            exits.callback(self._camera.close)
            self.tell_camera = self._camera.receive_curvature
        self._open_can(exits)
        self._open_gnss(exits)
        self._open_radio(exits)
        candidate_ids.start()
        exits.callback(candidate_ids.close)
        await self._open_detector(exits)

    async def open_camera(self) -> None:
        """Wait until the camera is open; meanwhile the others deliver and send.

        Raises:
            UserError: it cannot be opened.
        """
        if self._camera is not None:
            await asyncio.to_thread(self._camera.start)

    def send_wsm(self, wsm: SentWsm) -> None:
        """Send a WSM; it is lost without a radio."""
        self._send_wsm(wsm.data, wsm.user_priority)

    def send_to_vehicle(self, outputs: StepOutputs) -> None:
        """Send CAN frames and requests of a step; they are lost on a wire that there is not."""
        for frame in outputs.can_frames:
            self._send_can(frame)
        if self._request_outputs is not None:
            for event in outputs.events:
                if isinstance(event, BrakeRequest):
                    self._request_outputs.send(event)

    def _open_recorder(self, exits: contextlib.AsyncExitStack) -> None:
        if self.black_box is not None:
            self.black_box.start()
            exits.push_async_callback(_close_recorder, self.black_box)

    def _open_can(self, exits: contextlib.AsyncExitStack) -> None:
        if self._config.can is not None:
            on_state = partial(self._on_state, Sensor.SPEED)
            bus = CanBus(self._config.can, self._take, on_state, self._take)
            bus.start(self._loop)
            exits.callback(bus.close)
            self._send_can = bus.send
        if self._request_outputs is not None:
            self._request_outputs.open(self._loop, exits)

    def _open_gnss(self, exits: contextlib.AsyncExitStack) -> None:
        if self._config.gnss is not None:
            take_data = self._reading(GpsdReader(self._config.gnss))
            gpsd = Gpsd(self._config.gnss, take_data, partial(self._on_state, Sensor.POSITION))
            gpsd.start(self._loop)
            exits.callback(gpsd.close)

    def _open_radio(self, exits: contextlib.AsyncExitStack) -> None:
        if self._config.radio is not None:
            loss = RadioLoss(self._take)
            exits.callback(loss.close)
            radio = open_endpoint(self._config.radio, self._take_wsm, loss.receive_error)
            exits.callback(radio.close)
            radio.start(self._loop)
            self._send_wsm = radio.send

    def _new_camera(self, candidate_ids: CandidateIds) -> "CameraProcess | RecordedCamera | None":
        """Make the camera; a live one opens in its process while other wires are opened."""
        config, recorder = self._config, self._config.recorder
        if config.camera is None:
            return None
        pictures = None
        if recorder is not None and recorder.pictures_hz > 0.0:
            pictures = PictureRate(recorder.pictures_hz, recorder.picture_quality)
        work = CameraWork(config.camera, config.vision, pictures)
        on_seen = partial(self._on_seen, candidate_ids)
        if not config.camera.is_live:
            # Importing OpenCV and ONNX Runtime takes a third of the start-up time.
            from onboard.vision.recorded_camera import recorded_camera  # noqa: PLC0415 (see above)

            return recorded_camera(work, on_seen)
        camera = CameraProcess(work, on_seen, self._camera_worker)
        camera.spawn()
        return camera

    async def _open_detector(self, exits: contextlib.AsyncExitStack) -> None:
        if self._config.detector is not None:
            detector = await open_detector(self._config.detector, self.take_object_list)
            exits.callback(detector.close)

    def _reading(self, reader: GpsdReader | ObjectListReader) -> Callable[[bytes], None]:
        """Return a function that has bytes read by `reader` in the next step."""

        def read(data: bytes, now: float) -> Iterator[Input]:
            reader.receive_bytes(data, now)
            return iter(reader.next_event, None)

        return lambda data: self._take(partial(read, data))

    def _on_state(self, sensor: Sensor, up: bool, why: str) -> None:
        if not up:  # recovered by the next observation, not by the wire
            self._take(SensorLost(self._loop.time(), sensor, silent_s=None, reason=why))

    def _on_seen(self, candidate_ids: CandidateIds, seen: Seen) -> None:
        """Take observations in the camera's thread: of a lead, the candidates with derived IDs."""
        for event in seen.events:
            if isinstance(event, Lead):
                event = candidate_ids.derived(event, time.time())  # noqa: PLW2901
            self._loop.call_soon_threadsafe(self._take, event)
        if seen.picture is not None and self.black_box is not None:
            self.black_box.record_picture(seen.picture.stamp_s, seen.picture.jpeg)

    def _on_recorder_state(self, state: RecorderState) -> None:
        """Show the recorder's state; called in the black box's thread."""
        self._loop.call_soon_threadsafe(self._show, state)


async def _close_recorder(black_box: BlackBox) -> None:
    black_box.close()
    await asyncio.sleep(0)  # its last state is traced before the trace is closed


def _nowhere(*_: object) -> None:
    """Discard a frame of a wire that the vehicle does not have."""
