"""Requests on their way out: UDP on the loopback interface, and a bus of the rig."""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.request_outputs import RequestOutputs
from onboard.brake_request.settings import (
    BrakeRequestSettings,
    RequestDatagramSettings,
    RequestFrameSettings,
)
from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.observations import Discarded
from onboard.risk.fcw import FCW
from onboard.settings import SettingsError, parse_settings
from onboard.vehicle.config import CarConfig
from sim_rig.cars.socketcand_server import SocketcandServer
from tests.brake_request.test_request_frame import DBC, WHOLE

REQUEST = BrakeRequest(1.0, 5.0, 0.9, 0.3, 3, (FCW,))


@pytest.fixture(name="dbc")
def _dbc(tmp_path: Path) -> Path:
    path = tmp_path / "brake.dbc"
    path.write_text(DBC, encoding="latin-1")
    return path


class Controller:
    """The other end of the second bus: notes what arrives, and sends what it is given."""

    def __init__(self) -> None:
        self.received: list[CanFrame] = []
        self.to_send: list[CanFrame] = []

    def receive_frame(self, frame: CanFrame, now: float) -> None:
        del now
        self.received.append(frame)

    def frames_to_send(self, now: float) -> list[CanFrame]:
        del now
        frames, self.to_send = self.to_send, []
        return frames

    def get_timer(self) -> float:
        return 0.0 if self.to_send else float("inf")


def frame_settings(port: int, dbc: Path) -> RequestFrameSettings:
    return RequestFrameSettings.model_validate(
        {"channel": "can1", "port": port, "dbc": dbc, **WHOLE}
    )


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(10.0):
        while not condition():
            await asyncio.sleep(0)


def test_a_request_is_sent_as_a_datagram() -> None:
    async def run() -> bytes:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
            controller.bind(("127.0.0.1", 0))
            controller.settimeout(10.0)
            udp = RequestDatagramSettings(port=controller.getsockname()[1])
            outputs = RequestOutputs(BrakeRequestSettings(udp=udp), lambda _each: None)
            async with contextlib.AsyncExitStack() as wires:
                outputs.open(asyncio.get_running_loop(), wires)
                outputs.send(REQUEST)
            return controller.recv(1000)

    assert asyncio.run(run()) == datagram.encode(REQUEST)


def test_nobody_needs_to_listen() -> None:
    async def run() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            port = taken.getsockname()[1]
        settings = BrakeRequestSettings(udp=RequestDatagramSettings(port=port))
        outputs = RequestOutputs(settings, lambda _each: None)
        async with contextlib.AsyncExitStack() as wires:
            outputs.open(asyncio.get_running_loop(), wires)
            for _ in range(3):
                outputs.send(REQUEST)

    asyncio.run(run())


@pytest.mark.parametrize("identifier", [0x7DF, 0x7E8])
def test_frames_go_to_the_second_bus_until_it_carries_obd(dbc: Path, identifier: int) -> None:
    controller, discarded = Controller(), list[Discarded]()

    async def drive(port: int) -> None:
        can = frame_settings(port, dbc)
        outputs = RequestOutputs(BrakeRequestSettings(can=can), discarded.append)
        async with contextlib.AsyncExitStack() as wires:
            outputs.open(asyncio.get_running_loop(), wires)
            outputs.send(REQUEST)
            await until(lambda: len(controller.received) == 1)
            controller.to_send.append(CanFrame(0.0, 0x123, is_extended_id=False, data=b"\x01"))
            outputs.send(REQUEST)
            await until(lambda: len(controller.received) == 2)
            controller.to_send.append(CanFrame(0.0, identifier, is_extended_id=False, data=b"\x01"))
            outputs.send(REQUEST)
            await until(lambda: bool(discarded))
            outputs.send(REQUEST)

    async def run() -> None:
        server = SocketcandServer(controller, "can1", lambda _frame: None)
        # Opening a bus blocks its loop, so the server needs another one.
        await asyncio.to_thread(asyncio.run, drive(await server.start()))
        await server.close()

    asyncio.run(run())

    assert len(controller.received) == 3
    assert {each.arbitration_id for each in controller.received} == {800}
    assert [(each.component, each.reason) for each in discarded] == [("brake_request", "obd_port")]


def test_a_bus_that_cannot_be_opened_is_an_error(dbc: Path) -> None:
    async def run() -> None:
        can = frame_settings(1, dbc)
        outputs = RequestOutputs(BrakeRequestSettings(can=can), lambda _each: None)
        async with contextlib.AsyncExitStack() as wires:
            outputs.open(asyncio.get_running_loop(), wires)

    with pytest.raises(UserError, match="CAN bus can1"):
        asyncio.run(run())


@pytest.mark.parametrize(
    ("tree", "error"),
    [
        ({"can": {"channel": "can0"}}, "can.channel can0 is the OBD port"),
        ({"can": {}}, "brake_request.can: `channel` is required"),
        ({"can": {"channel": "can1", "interface": "log", "file": "x"}}, "takes no frames"),
        ({"can": {"channel": "can1", "deceleration": None}}, "brake_request.can.deceleration"),
        ({"most_m_s2": 11.0}, "brake_request.most_m_s2: .*less than or equal to 10"),
        ({"least_certainty": 0.0}, "brake_request.least_certainty: .*greater than 0"),
        ({"upd": {}}, "brake_request.upd: unknown key .*did you mean udp"),
    ],
)
def test_a_mistake_in_the_configuration_is_named(tree: dict[str, object], error: str) -> None:
    can = tree.get("can")
    if isinstance(can, dict):
        tree = tree | {"can": {"dbc": "x.dbc", "deceleration": "A.B"} | can}
    with pytest.raises(SettingsError, match=error):
        parse_settings(
            {"car": {"plate": "A1"}, "can": {}, "brake_request": tree}, CarConfig, "car.yaml"
        )


def test_frames_need_an_obd_port_to_keep_off() -> None:
    request = {"can": {"dbc": "x.dbc", "deceleration": "A.B", "channel": "can1"}}
    tree = {"car": {"plate": "A1"}, "brake_request": request}
    with pytest.raises(SettingsError, match="requires `can`"):
        parse_settings(tree, CarConfig, "car.yaml")
    assert parse_settings(tree | {"can": {}}, CarConfig, "car.yaml").brake_request is not None
