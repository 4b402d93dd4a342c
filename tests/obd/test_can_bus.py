"""The wire: a socketcand server on 127.0.0.1, recordings in every format, and their faults."""

import asyncio
import contextlib
import socket
from collections.abc import Awaitable, Callable, Coroutine
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from pydantic import ValidationError

from onboard.obd.can_bus import REPEAT_S, CanBus, CanBusError
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import CanSettings, ObdSettings
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import Discarded, Speed
from sim_rig.cars.ecu import ENGINE_11_BIT, ENGINE_29_BIT, Addresses, Ecu
from sim_rig.cars.socketcand_server import SocketcandServer
from tests.tcp import is_kept_alive
from tests.typed import a

ANSWER = CanFrame(0.0, 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D3200000000"))


class Server:
    """The server's side of socketcand; the test writes the frames of the bus."""

    def __init__(
        self, greeting: bytes = b"< hi >", answers: tuple[bytes, ...] = (b"< ok >", b"< ok >")
    ) -> None:
        self.greeting, self.answers = greeting, answers
        self.received: asyncio.Queue[bytes] = asyncio.Queue()
        self.clients: asyncio.Queue[asyncio.StreamWriter] = asyncio.Queue()

    async def __aenter__(self) -> "Server":
        self.server = await asyncio.start_server(self.serve, "127.0.0.1", 0)
        self.port = self.server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: None) -> None:
        self.server.close()
        while not self.clients.empty():
            self.clients.get_nowait().close()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(self.greeting)
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            for answer in self.answers:
                await self.received.put(await reader.readuntil(b">"))
                writer.write(answer)
            await self.clients.put(writer)
            while True:
                await self.received.put(await reader.readuntil(b">"))
        writer.close()


class Callbacks:
    """Collects the callbacks of a bus."""

    def __init__(self) -> None:
        self.frames: asyncio.Queue[CanFrame] = asyncio.Queue()
        self.states: asyncio.Queue[tuple[bool, str]] = asyncio.Queue()
        self.discarded: list[Discarded] = []

    def bus(self, port: int, **more: Any) -> CanBus:
        settings = CanSettings(interface="socketcand", channel="can0", port=port, **more)
        return CanBus(
            settings,
            self.frames.put_nowait,
            lambda there, why: self.states.put_nowait((there, why)),
            self.discarded.append,
        )


async def open_in_thread(bus: CanBus) -> None:
    """Open in a thread: opening blocks, and the server runs on the same loop."""
    opened = await asyncio.to_thread(bus._open)
    bus._loop = asyncio.get_running_loop()
    bus._attach(opened)


T = TypeVar("T")


def soon(awaitable: Awaitable[T]) -> Coroutine[Any, Any, T]:
    return asyncio.wait_for(awaitable, timeout=10)


def on_a_loop(scenario: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), timeout=30))


def test_frames_are_received_unchanged_and_requests_are_sent() -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            before = asyncio.get_running_loop().time()
            client.write(b"< frame 7E8 1.5 03410D3200000000 >< frame 18DAF110 1.6 00 >")
            first, second = await soon(callbacks.frames.get()), await soon(callbacks.frames.get())
            assert (first.arbitration_id, first.is_extended_id) == (0x7E8, False)
            assert first.data == ANSWER.data
            assert before <= first.stamp_s <= asyncio.get_running_loop().time()
            assert (second.arbitration_id, second.is_extended_id) == (0x18DAF110, True)
            bus.send(CanFrame(0.0, 0x7DF, is_extended_id=False, data=bytes.fromhex("02010D")))
            opened = [await soon(server.received.get()) for _ in range(3)]
            assert opened == [b"< open can0 >", b"< rawmode >", b"< send 7DF 3 02 01 0D >"]
            bus.close()

    on_a_loop(scenario)


def test_a_server_whose_computer_has_lost_power_is_found_out_without_a_request() -> None:
    async def scenario() -> None:
        async with Server() as server:
            bus = Callbacks().bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            assert is_kept_alive(client.get_extra_info("peername")[1])
            bus.close()

    on_a_loop(scenario)


def test_a_frame_split_by_tcp_is_reassembled() -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            for part in (b"< fra", b"me 7E8 1.5 0341", b"0D32 >< frame 7E8 1.5 03410D33 >"):
                client.write(part)
                await client.drain()
            assert (await soon(callbacks.frames.get())).data[-1] == 0x32
            assert (await soon(callbacks.frames.get())).data[-1] == 0x33
            bus.close()

    on_a_loop(scenario)


def test_garbage_is_counted_and_reading_continues() -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            client.write(b"\x00\xff>< frame 7E8 nonsense >" + b"x" * 1000)
            await client.drain()
            client.write(b"< error 004 1.5 >< frame 7E8 1.5 03410D32 >")
            assert (await soon(callbacks.frames.get())).data[-1] == 0x32
            assert len(callbacks.discarded) >= 3
            assert {d.reason for d in callbacks.discarded} == {"socketcand_element"}
            bus.close()

    on_a_loop(scenario)


def test_many_frames_are_delivered_completely_and_in_order() -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            client.write(b"".join(b"< frame 100 1.5 %04X >" % n for n in range(5000)))
            numbers = [
                int.from_bytes((await soon(callbacks.frames.get())).data) for _ in range(5000)
            ]
            assert numbers == list(range(5000))
            bus.close()

    on_a_loop(scenario)


def test_a_lost_server_is_reported_at_once_and_reconnected() -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            client.close()
            assert await soon(callbacks.states.get()) == (False, "the server closed the connection")
            bus.send(ANSWER)  # lost, and no error
            assert await soon(callbacks.states.get()) == (True, "")
            again = await soon(server.clients.get())
            again.write(b"< frame 7E8 1.5 03410D32 >")
            assert (await soon(callbacks.frames.get())).data[-1] == 0x32
            bus.close()

    on_a_loop(scenario)


def test_a_bus_that_is_closed_while_it_reconnects_stays_closed() -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            (await soon(server.clients.get())).close()
            await soon(callbacks.states.get())
            bus.close()
        assert callbacks.states.empty()

    on_a_loop(scenario)


def test_a_connection_opened_after_close_is_closed(caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        callbacks = Callbacks()
        async with Server() as server:
            bus = callbacks.bus(server.port)
            await open_in_thread(bus)
            client = await soon(server.clients.get())
            server.greeting, server.answers = b"", ()
            client.close()
            again = await soon(server.clients.get())
            bus.close()
            again.write(b"< hi >< ok >< ok >")
            await soon(again.wait_closed())

    on_a_loop(scenario)
    assert "not properly shut down" not in caplog.text


@pytest.mark.parametrize(
    ("greeting", "answers", "why"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n>", (), "the server answered 'HTTP/1.1 400"),
        (b"< hi >", (b"< error could not open bus >",), "answered 'error could not open bus'"),
        (b"x" * 1000, (), "not socketcand: expected < hi >"),
        (b"", (), "timed out"),
    ],
)
def test_a_server_of_another_protocol_is_an_error_of_one_line(
    greeting: bytes, answers: tuple[bytes, ...], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("onboard.obd.can_bus.CONNECT_TIMEOUT_S", 0.3)

    async def scenario() -> None:
        async with Server(greeting, answers) as server:
            with pytest.raises(CanBusError) as raised:
                await open_in_thread(Callbacks().bus(server.port))
            assert why in str(raised.value)
            where = f"CAN bus can0 of the socketcand server 127.0.0.1:{server.port} cannot be"
            assert str(raised.value).startswith(where)

    on_a_loop(scenario)


def test_a_missing_server_is_an_error_of_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]

    async def scenario() -> None:
        with pytest.raises(CanBusError, match=r"cannot be opened: Connection refused$"):
            Callbacks().bus(port).start(asyncio.get_running_loop())

    on_a_loop(scenario)


def test_a_missing_interface_is_an_error_of_one_line() -> None:
    async def scenario() -> None:
        bus = CanBus(CanSettings(interface="socketcan", channel="can77"), print, print)
        with pytest.raises(CanBusError, match=r"^CAN bus can77 cannot be opened: .+$"):
            bus.start(asyncio.get_running_loop())

    on_a_loop(scenario)


@pytest.mark.parametrize("addresses", [ENGINE_11_BIT, ENGINE_29_BIT])
def test_the_speed_comes_from_the_ecu_at_the_other_end(addresses: Addresses) -> None:
    """The daemon's loop in small: the bus, the core and a clock."""

    async def scenario() -> None:
        ecu = Ecu(lambda now: 50 / 3.6, addresses=addresses)
        server = SocketcandServer(ecu, "can0", lambda frame: None)
        port = await server.start()
        loop = asyncio.get_running_loop()
        callbacks, core = Callbacks(), VehicleBus(ObdSettings())
        bus = callbacks.bus(port)
        await open_in_thread(bus)
        speeds: list[Speed] = []
        while len(speeds) < 5:
            for frame in core.frames_to_send(loop.time()):
                bus.send(frame)
            until = max(0.0, core.get_timer() - loop.time())
            with contextlib.suppress(TimeoutError):
                frame = await asyncio.wait_for(callbacks.frames.get(), until)
                core.receive_frame(frame, loop.time())
            while (event := core.next_event()) is not None:
                speeds.append(a(Speed, event))
        assert {round(speed.speed_m_s * 3.6) for speed in speeds} == {50}
        bus.close()
        await server.close()

    on_a_loop(scenario)


def test_a_recording_plays_at_its_own_pace_on_the_loops_clock(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("(10.0) can0 100#\n(10.05) can0 101#\n(10.1) can0 102#\n", encoding="ascii")

    async def scenario() -> None:
        callbacks = Callbacks()
        settings = CanSettings(interface="log", file=path)
        bus = CanBus(
            settings, callbacks.frames.put_nowait, lambda *state: callbacks.states.put_nowait(state)
        )
        started = asyncio.get_running_loop().time()
        bus.start(asyncio.get_running_loop())
        frames = [await soon(callbacks.frames.get()) for _ in range(3)]
        assert [f.stamp_s - frames[0].stamp_s for f in frames] == pytest.approx([0, 0.05, 0.1])
        assert frames[0].stamp_s >= started
        assert asyncio.get_running_loop().time() >= frames[-1].stamp_s
        assert await soon(callbacks.states.get()) == (False, "end of the recording")
        bus.close()

    on_a_loop(scenario)


def test_a_recording_that_is_to_be_repeated_begins_anew_at_its_end(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("(10.0) can0 100#\n(10.05) can0 101#\n", encoding="ascii")

    async def scenario() -> None:
        callbacks = Callbacks()
        settings = CanSettings(interface="log", file=path, repeat=True)
        bus = CanBus(
            settings, callbacks.frames.put_nowait, lambda *state: callbacks.states.put_nowait(state)
        )
        bus.start(asyncio.get_running_loop())
        frames = [await soon(callbacks.frames.get()) for _ in range(5)]
        assert [f.arbitration_id for f in frames] == [0x100, 0x101, 0x100, 0x101, 0x100]
        assert np.diff([f.stamp_s for f in frames]) == pytest.approx([0.05, REPEAT_S] * 2)
        assert callbacks.states.empty()
        bus.close()

    on_a_loop(scenario)


@pytest.mark.parametrize(
    "wrong",
    [
        {"repeat": True},
        {"interface": "log"},
        {"interface": "socketcan", "file": "a.log"},
        {"port": 0},
    ],
)
def test_impossible_settings_are_refused(wrong: dict[str, int | str]) -> None:
    with pytest.raises(ValidationError):
        CanSettings.model_validate(wrong, strict=False)
