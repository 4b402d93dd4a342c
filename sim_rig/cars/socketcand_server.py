"""A CAN bus with an ECU, over TCP, in the text protocol of socketcand.

The client sends `< open BUS >` and `< rawmode >`, each answered with `< ok >`, then
`< send ID LENGTH B0 B1 ... >`; it receives `< frame ID SECONDS DATA >`. Identifiers of three hex
digits have 11 bits, those of eight digits 29.
"""

import asyncio
import math
import re
import time
from collections.abc import Callable
from typing import Protocol

from onboard.obd.can_frame import CanFrame

_MESSAGE = re.compile(rb"<\s*([^<>]*?)\s*>")
_LONGEST = 4096
"""A client that sends more bytes than this without a complete message is disconnected."""


class BusNode(Protocol):
    """Whatever is on the bus beside the clients, such as an ECU."""

    def receive_frame(self, frame: CanFrame, now: float) -> None:
        """Receive a frame of a client."""

    def frames_to_send(self, now: float) -> list[CanFrame]:
        """Return the frames that are due."""

    def get_timer(self) -> float:
        """Return when frames are next due; `math.inf` if never."""


class SocketcandServer:
    """Serves one car's bus to its daemon. All clients share the bus."""

    def __init__(
        self,
        ecu: BusNode,
        bus: str,
        on_answer: Callable[[CanFrame], None] = lambda _frame: None,
        on_late: Callable[[float], None] = lambda _late_s: None,
    ) -> None:
        """Serve a bus.

        Args:
            ecu: the node on the bus.
            bus: name of the bus, which clients open.
            on_answer: called with each frame that the ECU sends.
            on_late: called with the lateness of each turn of the ECU, s.
        """
        self._ecu = ecu
        self._bus = bus
        self._on_answer = on_answer
        self._on_late = on_late
        self._clients: set[asyncio.StreamWriter] = set()
        self._timer: asyncio.TimerHandle | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self, port: int = 0, host: str = "127.0.0.1") -> int:
        """Listen, and return the port."""
        self._server = await asyncio.start_server(self._serve, host, port)
        return int(self._server.sockets[0].getsockname()[1])

    @property
    def clients(self) -> int:
        """How many receive the bus now."""
        return len(self._clients)

    def send(self, frame: CanFrame) -> None:
        """Put a frame of another unit on the bus."""
        self._put_on_bus(frame)

    async def close(self) -> None:
        """Stop listening, and close all connections."""
        self._server.close()
        if self._timer is not None:
            self._timer.cancel()
        for client in list(self._clients):
            client.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._server.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 (a stream handler is always a task)
        self._tasks.add(task)
        writer.write(b"< hi >")
        try:
            await self._read(reader, writer)
        except ConnectionError:
            pass
        finally:
            self._clients.discard(writer)
            self._tasks.discard(task)
            writer.close()

    async def _read(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        waiting = b""
        while chunk := await reader.read(_LONGEST):
            waiting += chunk
            end = 0
            for message in _MESSAGE.finditer(waiting):
                self._handle(message[1].decode("ascii", "replace").split(), writer)
                end = message.end()
            waiting = waiting[end:]
            if len(waiting) > _LONGEST:
                return
            await writer.drain()

    def _handle(self, words: list[str], writer: asyncio.StreamWriter) -> None:
        match words:
            case ["open", bus] if bus == self._bus:
                writer.write(b"< ok >")
            case ["rawmode"]:
                self._clients.add(writer)
                writer.write(b"< ok >")
            case ["send", identifier, length, *octets]:
                self._receive(_frame(identifier, length, octets), writer)
            case ["echo"]:
                writer.write(b"< echo >")
            case _:
                writer.write(b"< error unknown command >")

    def _receive(self, frame: CanFrame | None, sender: asyncio.StreamWriter) -> None:
        if frame is None:
            sender.write(b"< error bad frame >")
            return
        self._put_on_bus(frame, but=sender)
        self._ecu.receive_frame(frame, frame.stamp_s)
        self._step()

    def _step(self) -> None:
        now = time.monotonic()
        if self._ecu.get_timer() <= now:
            self._on_late(now - self._ecu.get_timer())
        for frame in self._ecu.frames_to_send(now):
            self._put_on_bus(frame)
            self._on_answer(frame)
        at = self._ecu.get_timer()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if at < math.inf:
            self._timer = asyncio.get_running_loop().call_later(at - now, self._step)

    def _put_on_bus(self, frame: CanFrame, but: asyncio.StreamWriter | None = None) -> None:
        digits = 8 if frame.is_extended_id else 3
        head = f"< frame {frame.arbitration_id:0{digits}X} {time.time():.6f} "
        line = f"{head}{frame.data.hex().upper()} >".encode("ascii")
        for client in self._clients:
            if client is not but:
                client.write(line)


def _frame(identifier: str, length: str, octets: list[str]) -> CanFrame | None:
    """Parse a frame from a client; `None` if it is malformed."""
    try:
        data = bytes(int(octet, 16) for octet in octets)
        frame = CanFrame(time.monotonic(), int(identifier, 16), len(identifier) > 3, data)
        return frame if len(data) == int(length, 16) <= 8 else None
    except ValueError:
        return None
