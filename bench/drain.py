"""Datagrams from the radio unit: cost of receiving one, and the highest rate without loss.

A separate process sends at a constant rate; the reference is a bare blocking `recv` loop on an
equal socket. Each step sends for one second at most, on 127.0.0.1 only.
"""

import asyncio
import multiprocessing
import socket
import time
from collections.abc import Callable, Iterator
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event

from bench import Figure
from onboard.wave_udp.drained_socket import (
    MAX_DATAGRAM_BYTES,
    RECEIVE_BUFFER_BYTES,
    DrainedSocket,
    udp_socket,
)

WSM_BYTES = 300
RATES_HZ = (5_000, 10_000, 20_000, 40_000, 80_000, 160_000)
QUIET_S = 0.5
"""Time after the last datagram after which the missing ones count as lost."""

BATCH = 1_000
"""Datagrams that fit the receive buffer of this socket with any default kernel."""

REPEATS = 20


def measure() -> Iterator[Figure]:
    """Yield the cost of a datagram, and the highest rate without loss."""
    context = multiprocessing.get_context("spawn")
    yield Figure(
        "drain.cost",
        _cost_us(_drain_batch),
        "us/datagram",
        REPEATS,
        "bare recv loop",
        _cost_us(_receive_batch),
    )
    yield Figure(
        "drain.without_loss",
        _highest_rate_hz(context, _drain_until_quiet),
        "datagrams/s",
        1,
        "bare recv loop",
        _highest_rate_hz(context, _receive_until_quiet),
    )


def _open() -> socket.socket:
    wire = udp_socket("127.0.0.1", 0)
    wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return wire


def _cost_us(receive_batch: Callable[[socket.socket], int]) -> float:
    """Median over batches that are queued already, so that the sender's time is not included."""
    costs = []
    for _ in range(REPEATS):
        with _open() as wire, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
            for _ in range(BATCH):
                unit.sendto(bytes(WSM_BYTES), wire.getsockname())
            start = time.perf_counter()
            if receive_batch(wire) != BATCH:
                raise RuntimeError(f"{BATCH} datagrams do not fit the receive buffer")
            costs.append((time.perf_counter() - start) / BATCH * 1e6)
    return sorted(costs)[REPEATS // 2]


def _receive_batch(wire: socket.socket) -> int:
    wire.setblocking(False)
    count = 0
    try:
        while True:
            wire.recv(MAX_DATAGRAM_BYTES)
            count += 1
    except BlockingIOError:
        return count


def _drain_batch(wire: socket.socket) -> int:
    async def drain() -> int:
        return await _count(wire, until=BATCH, quiet_s=QUIET_S)

    return asyncio.run(drain())


async def _count(wire: socket.socket, until: int, quiet_s: float) -> int:
    """Count the datagrams of a `DrainedSocket`, until `until` of them or none for `quiet_s`."""
    loop = asyncio.get_running_loop()
    done = asyncio.Event()
    count = 0

    def on_datagram(_: bytes) -> None:
        nonlocal count
        count += 1
        if count == until:
            done.set()

    drained = DrainedSocket(wire, on_datagram, print)
    drained.start(loop)
    previous_count = -1
    while previous_count != count and not done.is_set():
        previous_count = count
        try:
            await asyncio.wait_for(done.wait(), quiet_s)
        except TimeoutError:
            continue
    drained.close()
    return count


def _drain_until_quiet(wire: socket.socket, until: int, go: Event) -> int:
    async def drain() -> int:
        go.set()
        return await _count(wire, until, QUIET_S)

    return asyncio.run(drain())


def _receive_until_quiet(wire: socket.socket, until: int, go: Event) -> int:
    wire.settimeout(QUIET_S)
    count = 0
    go.set()
    try:
        while count < until:
            wire.recv(MAX_DATAGRAM_BYTES)
            count += 1
    except TimeoutError:
        pass
    return count


def _highest_rate_hz(
    context: multiprocessing.context.SpawnContext,
    receive: Callable[[socket.socket, int, Event], int],
) -> float:
    """The highest rate at which all datagrams of 1 s were received, as measured by the sender."""
    best = 0.0
    for rate in RATES_HZ:
        with _open() as wire:
            go, achieved = context.Event(), context.Value("d", 0.0)
            sender = context.Process(target=_send, args=(wire.getsockname(), rate, go, achieved))
            sender.start()
            received = receive(wire, rate, go)
            sender.join()
        if received < rate:
            break
        best = max(best, achieved.value)
    return best


def _send(
    address: tuple[str, int], rate_hz: int, go: Event, achieved: "Synchronized[float]"
) -> None:
    """Send the datagrams of one second in steps of a millisecond; reports the rate achieved."""
    wsm = bytes(WSM_BYTES)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
        go.wait()
        start = time.perf_counter()
        for sent in range(rate_hz):
            if sent % (rate_hz // 1000) == 0:
                while (ahead_s := start + sent / rate_hz - time.perf_counter()) > 0:
                    time.sleep(ahead_s)
            unit.sendto(wsm, address)
        achieved.value = rate_hz / (time.perf_counter() - start)
