"""Connections without data, and too many of them, on real sockets with short limits."""

import asyncio

import pytest
from typing_extensions import override

from onboard.hmi import connection_limiter
from onboard.hmi.connection_limiter import ConnectionLimiter


class Echo(asyncio.Protocol):
    """A server that returns what it receives."""

    lost = 0

    @override
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    @override
    def data_received(self, data: bytes) -> None:
        self.transport.write(data)

    @override
    def connection_lost(self, exc: Exception | None) -> None:
        Echo.lost += 1


class Download(asyncio.Protocol):
    """A server that sends, without a request, as fast as its client takes it."""

    def __init__(self, size: int) -> None:
        self.left = size

    @override
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self.is_paused = False
        self.resume_writing()

    @override
    def pause_writing(self) -> None:
        self.is_paused = True

    @override
    def resume_writing(self) -> None:
        self.is_paused = False
        while self.left and not self.is_paused:
            chunk = bytes(min(self.left, 1 << 18))
            self.left -= len(chunk)
            self.transport.write(chunk)


async def end_of(reader: asyncio.StreamReader) -> bytes:
    try:
        return await reader.read()
    except ConnectionResetError:
        return b""


async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bytes:
    writer.write(b"hello")
    return await reader.readexactly(5)


def test_a_connection_without_data_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_limiter, "SILENT_S", 0.05)
    monkeypatch.setattr(Echo, "lost", 0)

    async def connect() -> None:
        limiter = ConnectionLimiter(Echo)
        server = await asyncio.get_running_loop().create_server(limiter, "127.0.0.1", 0)
        async with server:
            address = server.sockets[0].getsockname()
            for _ in range(3):  # also after all connections were closed
                reader, writer = await asyncio.open_connection(*address)
                assert await end_of(reader) == b""
                writer.close()
            assert len(limiter) == 0
            assert Echo.lost == 3
            limiter.close()

    asyncio.run(asyncio.wait_for(connect(), 20.0))


def test_a_download_that_is_slow_is_not_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_limiter, "SILENT_S", 0.3)
    size = 32 << 20  # more than the sockets buffer

    async def connect() -> None:
        limiter = ConnectionLimiter(lambda: Download(size))
        server = await asyncio.get_running_loop().create_server(limiter, "127.0.0.1", 0)
        async with server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            received = 0
            while data := await reader.read(1 << 19):
                received += len(data)
                await asyncio.sleep(0.01)
            assert received == size
            writer.close()
            limiter.close()

    asyncio.run(asyncio.wait_for(connect(), 30.0))


def test_above_the_limit_the_oldest_connection_without_an_accepted_request_is_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(connection_limiter, "MOST_CONNECTIONS", 3)

    async def connect() -> None:
        made: list[Echo] = []

        def echo() -> Echo:
            made.append(Echo())
            return made[-1]

        limiter = ConnectionLimiter(echo)
        server = await asyncio.get_running_loop().create_server(limiter, "127.0.0.1", 0)
        async with server:
            address = server.sockets[0].getsockname()
            page = await asyncio.open_connection(*address)
            assert await answer(*page) == b"hello"
            limiter.accept(made[0].transport)
            silent = [await asyncio.open_connection(*address) for _ in range(2)]
            another = await asyncio.open_connection(*address)

            assert await end_of(silent[0][0]) == b""
            for each in (page, another, silent[1]):
                assert await answer(*each) == b"hello"
            assert len(limiter) == 3
            for _, writer in (page, another, *silent):
                writer.close()
            limiter.close()

    asyncio.run(asyncio.wait_for(connect(), 20.0))


def test_a_closed_connection_is_not_counted() -> None:
    async def connect() -> None:
        limiter = ConnectionLimiter(Echo)
        server = await asyncio.get_running_loop().create_server(limiter, "127.0.0.1", 0)
        async with server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            assert await answer(reader, writer) == b"hello"
            writer.close()
            while len(limiter):
                await asyncio.sleep(0)
            limiter.close()

    asyncio.run(asyncio.wait_for(connect(), 20.0))
