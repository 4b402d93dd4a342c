"""The live interface over TCP: all readers get all lines in order, and none slows the daemon."""

import asyncio
import contextlib
import json
import re
import socket
import sys
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from onboard.errors import UserError
from onboard.interface import event_server
from onboard.interface.event_server import MOST_CLIENTS, VERSION, EventServer
from onboard.interface.event_stream import MOST_WAITING_BYTES, EventStream
from onboard.interface.requests import MessageRequest
from onboard.interface.settings import InterfaceSettings, SentService
from tests.architecture.syntax import ROOT

HOST = "127.0.0.1"
Client = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class Vehicle:
    """A served interface, and what came in by it."""

    def __init__(self, port: int, *accepts: Any) -> None:
        self.brakes = 0
        self.lists: list[bytes] = []
        self.messages: list[MessageRequest] = []
        sends = (SentService(psid=0x83),)
        settings = InterfaceSettings(port=port, accepts=accepts, sends=sends)
        self.port = port
        self.server = EventServer(
            settings, "0.0.0", self._brake, self.lists.append, self.messages.append
        )
        self._writers: list[asyncio.StreamWriter] = []

    def _brake(self) -> None:
        self.brakes += 1

    async def connect(self) -> Client:
        client = await asyncio.open_connection(HOST, self.port)
        self._writers.append(client[1])
        return client

    async def close(self) -> None:
        await self.server.close()
        for each in self._writers:
            each.close()
        await asyncio.gather(
            *(each.wait_closed() for each in self._writers), return_exceptions=True
        )

    async def client(self) -> Client:
        client = await self.connect()
        assert await record(client) == {"kind": "interface", "version": VERSION, "build": "0.0.0"}
        return client

    def publish(self, kind: str, **fields: object) -> None:
        self.server.publish(kind, json.dumps({"kind": kind, **fields}).encode() + b"\n")


async def record(client: Client) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(await client[0].readline())
    return found


def send(client: Client, **fields: object) -> None:
    client[1].write(json.dumps(fields).encode() + b"\n")


async def until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(10.0):
        while not holds():
            await asyncio.sleep(0.001)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port


def serve(run: Callable[[Vehicle], Awaitable[None]], *accepts: str) -> Vehicle:
    vehicle = Vehicle(free_port(), *accepts)

    async def served() -> None:
        await vehicle.server.start()
        try:
            async with asyncio.timeout(20.0):
                await run(vehicle)
        finally:
            await vehicle.close()

    asyncio.run(served())
    return vehicle


def test_twenty_readers_get_every_line_in_order() -> None:
    async def run(vehicle: Vehicle) -> None:
        clients = [await vehicle.client() for _ in range(20)]
        for number in range(100):
            vehicle.publish("speed", number=number)
        for client in clients:
            assert [(await record(client))["number"] for _ in range(100)] == list(range(100))

    serve(run)


def test_who_subscribes_gets_these_kinds_only_and_no_other_is_asked_for() -> None:
    async def run(vehicle: Vehicle) -> None:
        client = await vehicle.client()
        assert vehicle.server.wants("speed")
        send(client, kind="subscribe", kinds=["alarm"])
        await until(lambda: not vehicle.server.wants("speed"))
        vehicle.publish("speed")
        vehicle.publish("alarm")
        assert (await record(client))["kind"] == "alarm"

    assert not serve(run).server.wants("alarm")


def test_a_reader_that_stops_reading_loses_lines_and_is_given_their_number() -> None:
    async def run() -> tuple[list[dict[str, Any]], int]:
        stream = EventStream()
        reader = stream.open()
        line = b'{"kind":"speed"}'.ljust(1023) + b"\n"
        published = 3 * MOST_WAITING_BYTES // len(line)
        for _ in range(published):
            stream.publish("speed", line)
        return [json.loads(each) for each in (await reader.next()).splitlines()], published

    records, published = asyncio.run(run())
    assert records[0] == {"kind": "lines_dropped", "lines": published - len(records) + 1}
    assert 1 < len(records) <= MOST_WAITING_BYTES // 1024 + 1


def test_the_others_read_on_beside_one_that_has_stopped_and_one_that_has_gone() -> None:
    async def run(vehicle: Vehicle) -> None:
        await vehicle.client()  # reads nothing
        gone, reads = await vehicle.client(), await vehicle.client()
        gone[1].transport.abort()
        for number in range(2000):
            vehicle.publish("speed", number=number, padding="." * 1000)
            assert (await record(reads))["number"] == number

    serve(run)


def test_what_is_permitted_arrives_and_else_the_reason_comes_back() -> None:
    async def run(vehicle: Vehicle) -> None:
        client = await vehicle.client()
        send(client, kind="brake_button")
        await until(lambda: vehicle.brakes == 1)
        send(client, kind="object_list", cars=[])
        assert (await record(client))["reason"] == "not_permitted"
        client = await vehicle.client()
        client[1].write(b"garbage\n")
        assert (await record(client))["reason"] == "malformed"

    assert serve(run, "brake_button").lists == []


def test_a_web_page_does_not_press_the_brake_button() -> None:
    async def run(vehicle: Vehicle) -> None:
        browser = await vehicle.client()
        browser[1].write(b'POST / HTTP/1.1\r\nHost: x\r\n\r\n{"kind": "brake_button"}\n')
        with contextlib.suppress(ConnectionError):
            await browser[0].read()

    assert serve(run, "brake_button").brakes == 0


def test_who_is_disconnected_while_it_does_not_read_keeps_no_socket() -> None:
    async def run(vehicle: Vehicle) -> None:
        with socket.create_connection((HOST, vehicle.port)) as client:
            await until(lambda: vehicle.server.wants("speed"))
            for _ in range(200):
                vehicle.publish("speed", padding="." * 100_000)
                await asyncio.sleep(0)
            client.sendall(b"garbage\n")
            await until(lambda: not vehicle.server.wants("speed"))
            client.settimeout(1.0)
            with pytest.raises(ConnectionError):
                await until(lambda: not client.send(b"more\n"))

    serve(run)


def test_lists_of_detections_are_handed_on_as_they_are() -> None:
    async def run(vehicle: Vehicle) -> None:
        client = await vehicle.client()
        send(client, kind="object_list", sent_s=1.0, age_s=0.0, cars=[])
        await until(lambda: bool(vehicle.lists))

    (data,) = serve(run, "object_list").lists
    assert json.loads(data)["sent_s"] == 1.0


def test_messages_to_send_are_handed_on() -> None:
    async def run(vehicle: Vehicle) -> None:
        client = await vehicle.client()
        send(client, kind="message", psid=0x83, data="00ff")
        await until(lambda: bool(vehicle.messages))

    (message,) = serve(run).messages
    assert (message.psid, message.data) == (0x83, "00ff")


def test_messages_of_all_programs_together_have_the_least_interval(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each is signed in the loop that warnings wait for."""
    monkeypatch.setattr(event_server, "MESSAGE_INTERVAL_S", 3600.0)

    async def run(vehicle: Vehicle) -> None:
        clients = [await vehicle.client() for _ in range(3)]
        for client in clients:
            send(client, kind="message", psid=0x83, data="00ff")
        await until(lambda: bool(vehicle.messages))
        other = await vehicle.client()
        send(other, kind="brake_button")
        await until(lambda: vehicle.brakes == 1)

    assert len(serve(run, "brake_button").messages) == 1


def test_one_program_at_a_time_sends_lists() -> None:
    async def run(vehicle: Vehicle) -> None:
        first, second = await vehicle.client(), await vehicle.client()
        send(first, kind="object_list", sent_s=1.0)
        await until(lambda: len(vehicle.lists) == 1)
        send(second, kind="object_list", sent_s=9.0)
        assert (await record(second))["reason"] == "in_use"
        first[1].transport.abort()
        third = await vehicle.client()
        await until(lambda: len(vehicle.server._clients) == 1)
        send(third, kind="object_list", sent_s=2.0)
        await until(lambda: len(vehicle.lists) == 2)

    serve(run, "object_list")


def test_who_sends_a_line_without_an_end_is_disconnected() -> None:
    async def run(vehicle: Vehicle) -> None:
        client = await vehicle.client()
        client[1].write(b"x" * 100_000)
        assert await client[0].read() == b""

    serve(run)


def test_who_has_gone_makes_room_without_an_event() -> None:
    """Who waited for alarms and was started again 32 times was refused until there was one."""

    async def run(vehicle: Vehicle) -> None:
        for _ in range(MOST_CLIENTS):
            client = await vehicle.client()
            client[1].close()
            await client[1].wait_closed()
        await until(lambda: not vehicle.server._clients)
        await vehicle.client()

    serve(run)


def test_more_clients_than_allowed_are_disconnected() -> None:
    async def run(vehicle: Vehicle) -> None:
        clients = [await vehicle.client() for _ in range(MOST_CLIENTS)]
        one_more = await vehicle.connect()
        assert await one_more[0].read() == b""
        vehicle.publish("alarm")
        assert (await record(clients[0]))["kind"] == "alarm"

    serve(run)


def test_a_port_in_use_is_named() -> None:
    async def run(vehicle: Vehicle) -> None:
        with pytest.raises(UserError, match=f"interface: {HOST}:{vehicle.port}: "):
            await Vehicle(vehicle.port).server.start()

    serve(run)


def test_the_client_of_the_pages_prints_the_alarms() -> None:
    page = (ROOT / "docs/pages.md").read_text("utf-8")
    (program,) = re.findall(r"(?s)```python\n(import json.*?)```", page)

    async def run(vehicle: Vehicle) -> None:
        client = await asyncio.create_subprocess_exec(
            sys.executable, "-u", "-c", program.replace("8470", str(vehicle.port)),
            stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        assert client.stdout is not None
        await until(lambda: vehicle.server.wants("alarm") and not vehicle.server.wants("speed"))
        vehicle.publish("speed")
        vehicle.publish("alarm", cause="fcw", level="warning")
        assert await client.stdout.readline() == b"fcw warning\n"
        await vehicle.server.close()
        assert await client.wait() == 0

    serve(run)
