"""The rig's bus, as python-can's own socketcand client meets it."""

import asyncio
from collections.abc import Awaitable, Callable

import can
import pytest

from onboard.kinematics.units import KM_H
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer


def with_server(dialogue: Callable[[int], Awaitable[None]]) -> list[bytes]:
    """Run `dialogue` against a served ECU at 50 km/h; return the frames of the ECU."""
    answers: list[bytes] = []

    async def run() -> None:
        ecu = Ecu(lambda _now: 50 * KM_H, answer_after_s=0.0)
        server = SocketcandServer(ecu, "can0", lambda frame: answers.append(frame.data))
        port = await server.start()
        try:
            await dialogue(port)
        finally:
            await server.close()

    asyncio.run(run())
    return answers


def open_bus(port: int) -> can.BusABC:
    return can.Bus(
        interface="socketcand", host="127.0.0.1", port=port, channel="can0", tcp_tune=True
    )


def test_a_request_on_one_client_is_answered_to_all_of_them() -> None:
    def talk(port: int) -> list[can.Message | None]:
        with open_bus(port) as asking, open_bus(port) as listening:
            asking.send(can.Message(arbitration_id=0x7DF, is_extended_id=False, data=[2, 1, 13]))
            return [asking.recv(2.0), listening.recv(2.0), listening.recv(2.0)]

    async def dialogue(port: int) -> None:
        answer, overheard_request, overheard_answer = await asyncio.to_thread(talk, port)
        assert answer is not None
        assert (answer.arbitration_id, bytes(answer.data[:4])) == (0x7E8, bytes([3, 0x41, 13, 50]))
        assert overheard_request is not None
        assert overheard_request.arbitration_id == 0x7DF
        assert overheard_answer is not None
        assert overheard_answer.data == answer.data

    assert len(with_server(dialogue)) == 1


@pytest.mark.parametrize("identifier", [0x18DB33F1, 0x7FF])
def test_identifiers_of_29_bits_keep_their_length(identifier: int) -> None:
    def talk(port: int) -> can.Message | None:
        with open_bus(port) as sending, open_bus(port) as listening:
            sending.send(
                can.Message(
                    arbitration_id=identifier, is_extended_id=identifier > 0x7FF, data=[0xAB]
                )
            )
            return listening.recv(2.0)

    async def dialogue(port: int) -> None:
        heard = await asyncio.to_thread(talk, port)
        assert heard is not None
        assert (heard.arbitration_id, heard.is_extended_id) == (identifier, identifier > 0x7FF)

    with_server(dialogue)


@pytest.mark.parametrize(
    ("said", "answered"),
    [
        (b"< open can7 >", b"< error unknown command >"),
        (b"< jump >", b"< error unknown command >"),
        (b"< send 7DF 3 2 1 >", b"< error bad frame >"),
        (b"< send xyz 1 2 >", b"< error bad frame >"),
        (b"< send 7DF 1 100 >", b"< error bad frame >"),
        (b"\xff< echo >", b"< echo >"),
        (b"< ec", b""),
    ],
)
def test_nonsense_is_answered_with_an_error_and_the_bus_goes_on(
    said: bytes, answered: bytes
) -> None:
    async def dialogue(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        assert await reader.readexactly(6) == b"< hi >"
        writer.write(said)
        assert await reader.readexactly(len(answered)) == answered
        writer.close()
        await writer.wait_closed()

    with_server(dialogue)


def test_a_client_that_never_ends_a_message_is_hung_up_on() -> None:
    async def dialogue(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"<" * 5000)
        assert await reader.read() == b"< hi >"
        writer.close()

    with_server(dialogue)
