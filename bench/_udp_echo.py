"""The reference of latencies on loopback: a datagram to another process and back."""

import asyncio
import contextlib
import multiprocessing
import multiprocessing.connection
import socket
import threading
import time
from collections.abc import AsyncIterator

ECHO_EVERY_S = 0.02
WSM_BYTES = 75


@contextlib.asynccontextmanager
async def udp_echoes() -> AsyncIterator[list[float]]:
    """Measure round trips in a thread; the list that is given has them, in s, at the end."""
    context = multiprocessing.get_context("spawn")
    parent_end, child_end = context.Pipe()
    echo = context.Process(target=_echo, args=(child_end,), daemon=True)
    echo.start()
    port = await asyncio.to_thread(parent_end.recv)
    is_over, delays_s = threading.Event(), list[float]()
    pinging = asyncio.create_task(asyncio.to_thread(_ping, port, is_over, delays_s))
    try:
        yield delays_s
    finally:
        is_over.set()
        await pinging
        echo.terminate()


def _ping(port: int, is_over: threading.Event, delays_s: list[float]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.settimeout(1.0)
        wire.connect(("127.0.0.1", port))
        while not is_over.wait(ECHO_EVERY_S):
            sent_at = time.monotonic()
            wire.send(bytes(WSM_BYTES))
            wire.recv(WSM_BYTES)
            delays_s.append(time.monotonic() - sent_at)


def _echo(parent: multiprocessing.connection.Connection) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        parent.send(wire.getsockname()[1])
        while True:
            data, sender = wire.recvfrom(WSM_BYTES)
            wire.sendto(data, sender)
