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
from onboard.obd.settings import CanSettings
from onboard.observations import Discarded

DEFAULT_CHANNEL = "can0"

CONNECT_TIMEOUT_S = 3.0

RECONNECT_PERIOD_S = 0.5
"""A bus that comes back is read again within this and the time to connect."""

DRAIN_FRAMES = 256
"""At most so many frames in one go, then the loop looks after the rest of the car."""

NO_SOCKETCAN = "the kernel has no SocketCAN (modprobe can_raw)"

MAX_QUEUED_S = 1.0
"""A kernel stamp older than this is a clock that was set, not a frame that waited."""


# Its words are for those who set up logging, not for stderr beside ours.
logging.getLogger("can").addHandler(logging.NullHandler())


class CanBusError(UserError):
    """The bus cannot be opened; one line for the user."""


def _ignore(_: Discarded) -> None:
    """For callers that do not count."""


class CanBus:
    """Hands over every data frame as soon as the wire has it, and reconnects by itself.

    The loop waits for the wire's file descriptor: no thread, no polling.
    """

    def __init__(
        self,
        settings: CanSettings,
        on_frame: Callable[[CanFrame], None],
        on_state: Callable[[bool, str], None],
        on_discarded: Callable[[Discarded], None] = _ignore,
    ) -> None:
        """Take the callbacks; all are called from the loop.

        `on_state` gets whether the bus is there, and why it is not, on each change after `start`.
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
        """
        self._loop = loop
        if self._settings.file is None:
            self._attach(self._open())
            return
        frames = read_can_log(self._settings.file, self._settings.channel, self._on_discarded)
        first = next(frames, None)  # opens the file
        if first is not None:
            self._task = loop.create_task(self._play(first, frames))

    def send(self, frame: CanFrame) -> None:
        """Put `frame` on the bus; without a bus, or where its queue is full, it is lost."""
        if self._bus is None:
            return
        message = can.Message(
            arbitration_id=frame.arbitration_id,
            is_extended_id=frame.is_extended_id,
            data=frame.data,
        )
        # What is wrong with the wire shows when reading; a full queue empties again.
        with contextlib.suppress(can.CanOperationError):
            self._bus.send(message)

    def close(self) -> None:
        """Leave the bus. No callback comes any more."""
        if self._task is not None:
            self._task.cancel()
        self._detach()

    def _open(self) -> can.BusABC:
        """Blocks for a few `CONNECT_TIMEOUT_S` at most."""
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
            if self._bus is None:  # closed by who got the last frame
                return
            try:
                message = self._bus.recv(0)
            except can.CanError as error:
                self._lose(str(error))
                return
            if message is None:
                return
            if not (message.is_error_frame or message.is_remote_frame):
                self._on_frame(_frame(message, self._stamp_s(message)))
        # What the bus object has buffered does not show on its file descriptor.
        if self._rest is None:
            self._rest = self._loop.call_soon(self._drain_rest)

    def _drain_rest(self) -> None:
        self._rest = None
        self._drain()

    def _stamp_s(self, message: can.Message) -> float:
        """On the loop's clock. Only the kernel's stamps are of this machine."""
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

    async def _play(self, first: CanFrame, others: Iterator[CanFrame]) -> None:
        """Play a recording at its own pace, its first frame now."""
        offset_s = self._loop.time() - first.stamp_s
        why = "end of the recording"
        frame: CanFrame | None = first
        while frame is not None:
            at = frame.stamp_s + offset_s
            await asyncio.sleep(at - self._loop.time())
            self._on_frame(replace(frame, stamp_s=at))
            try:
                frame = next(others, None)
            except CanBusError as error:
                frame, why = None, str(error)
        self._on_state(False, why)

    def _on_malformed(self, detail: str) -> None:
        self._on_discarded(Discarded(self._loop.time(), "obd", "socketcand_element", detail))


def read_can_log(
    path: Path,
    channel: str | None = None,
    on_discarded: Callable[[Discarded], None] = _ignore,
) -> Iterator[CanFrame]:
    """The data frames of a recording, with its own stamps; of all channels, or of one.

    The suffix names the format (`.log` of candump -L, `.asc`, `.blf`, `.trc`, `.mf4`, ...). A line
    of candump's that cannot be read is discarded with reason `log_line`, and reading goes on.

    Raises:
        CanBusError: there is no such file, or its format is unknown or broken.
    """
    if not path.is_file():  # before python-can judges the name
        raise CanBusError(f"{path}: no such file")
    try:
        for message in _messages(path, on_discarded):
            is_data = not (message.is_error_frame or message.is_remote_frame)
            if is_data and channel in {None, str(message.channel)}:
                yield _frame(message, message.timestamp)
    except OSError as error:
        raise CanBusError(f"{path}: cannot be read: {error.strerror}") from error
    except CanBusError:
        raise
    except Exception as error:  # each format's reader has its own kinds
        raise CanBusError(f"{path}: no readable CAN log: {error}") from error


def _messages(path: Path, on_discarded: Callable[[Discarded], None]) -> Iterator[can.Message]:
    if path.suffix.lower() != ".log":
        with can.LogReader(path) as reader:
            yield from reader
        return
    stamp_s: float | None = None
    bad_lines = 0
    with path.open(encoding="ascii", errors="replace") as file:
        while not file.closed:
            try:
                # Reading ends at a bad line, and the next reader goes on behind it.
                for message in can.CanutilsLogReader(file):
                    stamp_s = message.timestamp
                    yield message
            except (ValueError, IndexError) as error:
                bad_lines += 1
                on_discarded(Discarded(stamp_s or 0.0, "obd", "log_line", str(error)))
    if bad_lines and stamp_s is None:
        raise CanBusError(f"{path}: no line is as `candump -L` writes it")


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
    # An interface that is down binds without complaint, and says so on the socket.
    if bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
        bus.shutdown()
        raise CanBusError(f"CAN bus {channel} cannot be opened: it is down (ip link set up)")
    return bus


def _shut_down(opening: asyncio.Future[can.BusABC]) -> None:
    if opening.exception() is None:
        opening.result().shutdown()


def _frame(message: can.Message, stamp_s: float) -> CanFrame:
    return CanFrame(stamp_s, message.arbitration_id, message.is_extended_id, bytes(message.data))
