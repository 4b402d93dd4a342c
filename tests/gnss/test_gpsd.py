"""The wire to gpsd: a faulty replacement, and the real one fed with NMEA over UDP."""

import asyncio
import contextlib
import shutil
import socket
from collections.abc import Awaitable, Callable, Coroutine
from socket import SocketKind
from typing import Any, TypeVar

import pytest

from onboard.gnss.gpsd import Gpsd
from onboard.gnss.gpsd_reader import WATCH, GpsdReader
from onboard.gnss.settings import GnssSettings
from onboard.observations import Discarded, Position
from tests.gnss.test_nmea import GGA, RMC, at, sentence
from tests.tcp import is_kept_alive
from tests.typed import a


class Callbacks:
    """Collects the data and events of the wire and the reader."""

    def __init__(self, port: int) -> None:
        self.reader = GpsdReader(GnssSettings())
        self.states = asyncio.Queue[tuple[bool, str]]()
        self.positions = asyncio.Queue[Position | Discarded]()
        self.gpsd = Gpsd(
            GnssSettings(port=port),
            self.hear,
            lambda there, why: self.states.put_nowait((there, why)),
        )
        self.gpsd.start(asyncio.get_running_loop())

    def hear(self, data: bytes) -> None:
        self.reader.receive_bytes(data, asyncio.get_running_loop().time())
        while (event := self.reader.next_event()) is not None:
            self.positions.put_nowait(event)


T = TypeVar("T")


def soon(awaitable: Awaitable[T]) -> Coroutine[Any, Any, T]:
    return asyncio.wait_for(awaitable, timeout=10)


def on_a_loop(scenario: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), timeout=30))


def free_port(kind: SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as unused:
        unused.bind(("127.0.0.1", 0))
        return int(unused.getsockname()[1])


REPORT = (
    b'{"class":"TPV","mode":3,"time":"2021-07-26T04:50:00.340Z",'
    b'"lat":56.1,"lon":10.1,"eph":4.9}\r\n'
)


def test_gpsd_is_subscribed_lost_and_reconnected() -> None:
    async def scenario() -> None:
        asked, clients = asyncio.Queue[bytes](), asyncio.Queue[asyncio.StreamWriter]()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            asked.put_nowait(await reader.readline())
            clients.put_nowait(writer)

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        callbacks = Callbacks(server.sockets[0].getsockname()[1])
        assert await soon(callbacks.states.get()) == (True, "")
        assert await soon(asked.get()) == WATCH
        client = await soon(clients.get())
        client.write(REPORT[:20])
        await client.drain()
        client.write(REPORT[20:])
        assert a(Position, await soon(callbacks.positions.get())).latitude_deg == 56.1
        client.close()
        assert await soon(callbacks.states.get()) == (False, "gpsd closed the connection")
        assert await soon(callbacks.states.get()) == (True, "")
        (await soon(clients.get())).close()
        callbacks.gpsd.close()
        server.close()

    on_a_loop(scenario)


def test_a_gpsd_whose_computer_has_lost_power_is_found_out() -> None:
    """A client that only listens would wait for it for ever."""

    async def scenario() -> None:
        clients = asyncio.Queue[asyncio.StreamWriter]()
        server = await asyncio.start_server(
            lambda _, writer: clients.put_nowait(writer), "127.0.0.1", 0
        )
        callbacks = Callbacks(server.sockets[0].getsockname()[1])
        client = await soon(clients.get())
        assert await soon(callbacks.states.get()) == (True, "")
        assert is_kept_alive(client.get_extra_info("peername")[1])
        callbacks.gpsd.close()
        client.close()
        server.close()

    on_a_loop(scenario)


def test_a_missing_gpsd_is_a_state_reported_once() -> None:
    async def scenario() -> None:
        port = free_port()
        callbacks = Callbacks(port)
        there, why = await soon(callbacks.states.get())
        assert (there, why) == (False, f"gpsd at 127.0.0.1:{port}: Connection refused")
        callbacks.gpsd.close()
        assert callbacks.states.empty()

    on_a_loop(scenario)


@pytest.mark.live
def test_positions_from_the_real_gpsd_fed_by_udp() -> None:
    program = shutil.which("gpsd", path="/usr/sbin:/usr/bin:/usr/local/sbin")
    if program is None:
        pytest.skip("gpsd is not installed")

    async def scenario() -> None:
        port, nmea_port = free_port(), free_port(socket.SOCK_DGRAM)
        gpsd = await asyncio.create_subprocess_exec(
            program, "-N", "-n", "-S", str(port), f"udp://127.0.0.1:{nmea_port}"
        )
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            callbacks = Callbacks(port)
            while await soon(callbacks.states.get()) != (True, ""):
                pass
            positions = []
            for second in range(50):
                for text in (RMC, GGA):
                    nmea = sentence(at(text, f"0450{second:02d}.00"))
                    receiver.sendto(nmea, ("127.0.0.1", nmea_port))
                with contextlib.suppress(TimeoutError):
                    positions.append(await asyncio.wait_for(callbacks.positions.get(), 0.2))
                if len(positions) == 5:
                    break
            now = asyncio.get_running_loop().time()
            callbacks.gpsd.close()
        finally:
            receiver.close()
            gpsd.terminate()
            await gpsd.wait()
        assert len(positions) == 5
        for position in positions:
            assert isinstance(position, Position)
            assert position.latitude_deg == pytest.approx(56 + 6.25716 / 60, abs=1e-7)
            assert position.longitude_deg == pytest.approx(10 + 8.71506 / 60, abs=1e-7)
            assert position.speed_m_s == pytest.approx(15.725, abs=1e-3)
            assert 1.0 < position.sigma_m < 20.0
            assert position.stamp_s < now

    on_a_loop(scenario)
