"""The CAN wire: a kernel interface, a socketcand server or a recording, on an asyncio loop."""

import asyncio
import contextlib
import errno
import logging
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import can
from can.interfaces.socketcan import SocketcanBus

from onboard.errors import UserError
from onboard.obd import socketcand
from onboard.obd.can_frame import CanFrame
from onboard.obd.can_log import CanLogError, frame_of, ignore, read_can_log
from onboard.obd.settings import DEFAULT_CHANNEL, CanSettings
from onboard.observations import Discarded

CONNECT_TIMEOUT_S = 3.0

RECONNECT_PERIOD_S = 0.5
"""Pause between attempts to reconnect."""

DRAIN_FRAMES = 256
"""Frames that are read before other tasks of the loop run."""

REPEAT_S = 0.05
"""From the last frame of a recording to its first, where it begins anew."""

NO_SOCKETCAN = "the kernel has no SocketCAN (modprobe can_raw)"

MAX_QUEUED_S = 1.0
"""Age above which a kernel stamp is a change of the system's clock, and not a queued frame."""


# python-can's log output would duplicate the daemon's own messages on stderr.
logging.getLogger("can").addHandler(logging.NullHandler())


class CanBusError(UserError):
    """The bus cannot be opened; the text is one line for the user."""


class CanBus:
    """Delivers every data frame as soon as the wire has it, and reconnects after a loss.

    It waits for the wire's file descriptor: no thread, no polling.
    """

    def __init__(
        self,
        settings: CanSettings,
        on_frame: Callable[[CanFrame], None],
        on_state: Callable[[bool, str], None],
        on_discarded: Callable[[Discarded], None] = ignore,
    ) -> None:
        """Take the callbacks; all are called from the loop.

        Args:
            settings: of the wire.
            on_frame: gets each data frame.
            on_state: gets whether the bus is open, or why it is not, on changes after `start`.
            on_discarded: gets malformed input.
        """
        self._settings = settings
        self._on_frame = on_frame
        self._on_state = on_state
        self._on_discarded = on_discarded
        self._bus: can.BusABC | None = None
        self._task: asyncio.Task[None] | None = None
        self._rest: asyncio.Handle | None = None

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open the bus and read it from `loop`.

        Raises:
            CanBusError: it cannot be opened.
            CanLogError: a recording cannot be read.
        """
        self._loop = loop
        if self._settings.file is None:
            self._attach(self._open())
            return
        frames = self._read(self._settings.file)
        try:
            first = next(frames, None)  # opens the file
        except CanLogError as error:
            raise CanLogError(f"can.file: {error}") from error
        if first is not None:
            self._task = loop.create_task(self._play(self._settings.file, first, frames))

    def send(self, frame: CanFrame) -> None:
        """Send `frame`; it is lost without a bus, or if the bus's queue is full."""
        if self._bus is None:
            return
        message = can.Message(
            arbitration_id=frame.arbitration_id,
            is_extended_id=frame.is_extended_id,
            data=frame.data,
        )
        # A fault of the wire is detected when reading; a full queue empties again.
        with contextlib.suppress(can.CanOperationError):
            self._bus.send(message)

    def close(self) -> None:
        """Close the bus. No callback is called afterwards."""
        if self._task is not None:
            self._task.cancel()
        self._detach()

    def _open(self) -> can.BusABC:
        """Open the bus; blocks for a few `CONNECT_TIMEOUT_S` at most."""
        channel = self._settings.channel or DEFAULT_CHANNEL
        if self._settings.interface == "socketcan":
            return _open_socketcan(channel)
        return _open_socketcand(
            channel, self._settings.host, self._settings.port, self._on_malformed
        )

    def _attach(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._loop.add_reader(bus.fileno(), self._drain)

    def _detach(self) -> None:
        if self._rest is not None:
            self._rest.cancel()
            self._rest = None
        if self._bus is not None:
            self._loop.remove_reader(self._bus.fileno())
            self._bus.shutdown()
            self._bus = None

    def _drain(self) -> None:
        for _ in range(DRAIN_FRAMES):
            if self._bus is None:  # the last callback closed the bus
                return
            try:
                message = self._bus.recv(0)
            except can.CanError as error:
                self._lose(str(error))
                return
            if message is None:
                return
            if not (message.is_error_frame or message.is_remote_frame):
                self._on_frame(frame_of(message, self._stamp_s(message)))
        # Frames that the bus object has buffered do not show on its file descriptor.
        if self._rest is None:
            self._rest = self._loop.call_soon(self._drain_rest)

    def _drain_rest(self) -> None:
        self._rest = None
        self._drain()

    def _stamp_s(self, message: can.Message) -> float:
        """Time of reception on the loop's clock; only the kernel's stamps are of this computer."""
        now = self._loop.time()
        if self._settings.interface != "socketcan":
            return now
        queued_s = time.time() - message.timestamp
        return now - queued_s if 0.0 <= queued_s <= MAX_QUEUED_S else now

    def _lose(self, why: str) -> None:
        self._detach()
        self._on_state(False, why)
        self._task = self._loop.create_task(self._reopen())

    async def _reopen(self) -> None:
        while self._bus is None:
            await asyncio.sleep(RECONNECT_PERIOD_S)
            opening = self._loop.run_in_executor(None, self._open)
            try:
                self._attach(await asyncio.shield(opening))
            except CanBusError:
                continue
            except asyncio.CancelledError:
                opening.add_done_callback(_shut_down)  # its thread cannot be cancelled
                raise
        self._on_state(True, "")

    def _read(self, recording: Path) -> Iterator[CanFrame]:
        return read_can_log(recording, self._settings.channel, self._on_discarded)

    async def _play(self, recording: Path, first: CanFrame, others: Iterator[CanFrame]) -> None:
        """Play a recording at its own pace, the first frame now."""
        offset_s = self._loop.time() - first.stamp_s
        why = "end of the recording"
        frame: CanFrame | None = first
        while frame is not None:
            at = frame.stamp_s + offset_s
            await asyncio.sleep(at - self._loop.time())
            self._on_frame(replace(frame, stamp_s=at))
            try:
                frame = next(others, None)
                if frame is None and self._settings.repeat:
                    others = self._read(recording)
                    frame = next(others, first)
                    offset_s = at + REPEAT_S - frame.stamp_s
            except CanLogError as error:
                frame, why = None, str(error)
        self._on_state(False, why)

    def _on_malformed(self, detail: str) -> None:
        self._on_discarded(Discarded(self._loop.time(), "obd", "socketcand_element", detail))


def _open_socketcand(
    channel: str, host: str, port: int, on_malformed: Callable[[str], None]
) -> can.BusABC:
    try:
        connection = socketcand.connect(channel, host, port, CONNECT_TIMEOUT_S)
    except (OSError, socketcand.ProtocolError) as error:
        raise CanBusError(
            f"CAN bus {channel} of the socketcand server {host}:{port} cannot be opened: "
            f"{getattr(error, 'strerror', None) or error}"
        ) from error
    return socketcand.SocketcandBus(connection, channel, on_malformed)


def _open_socketcan(channel: str) -> can.BusABC:
    try:
        bus = SocketcanBus(channel=channel)
    except OSError as error:
        why = NO_SOCKETCAN if error.errno == errno.EAFNOSUPPORT else error.strerror
        raise CanBusError(f"CAN bus {channel} cannot be opened: {why}") from error
    # Binding to an interface that is down succeeds; the error is on the socket.
    if bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
        bus.shutdown()
        raise CanBusError(f"CAN bus {channel} cannot be opened: it is down (ip link set up)")
    return bus


def _shut_down(opening: asyncio.Future[can.BusABC]) -> None:
    if opening.exception() is None:
        opening.result().shutdown()
