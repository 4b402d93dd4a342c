"""The rig's radio units on real UDP, with the car's own endpoint at the other end."""

import asyncio
import socket

import numpy as np
import pytest

from onboard.wave_udp import immediate_forward, wsmp
from onboard.wave_udp.endpoint import open_endpoint
from onboard.wave_udp.rsu41 import as_immediate_forward
from onboard.wave_udp.settings import IwcuSettings, Rsu41Settings
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.radio.reach import ReachAir
from sim_rig.roads.road import CarState
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.scenario.radio_settings import ReachSettings
from sim_rig.scenario.wire_settings import RadioWire

CARS = ["ann", "ben", "cat"]
RSU41 = Rsu41Settings(endpoint="rsu41", listen_port=1)
WSM = wsmp.encode(WaveShortMessage(psid=0x20, payload=b"signed data"))


def nowhere(_now: float) -> dict[str, CarState]:
    """The places of the cars, which a list of neighbours does not need."""
    return {}


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_a_wsm_goes_to_all_in_reach_only_with_its_priority() -> None:
    heard: dict[str, list[bytes]] = {car: [] for car in CARS}
    recorder = RigRecorder()

    async def talk() -> None:
        loop = asyncio.get_running_loop()
        settings = ReachSettings(neighbours={"ann": ("ben",)}, delay_s=0.001)
        units = RadioUnits(ReachAir(settings, nowhere, CARS, np.random.default_rng(0)), recorder)
        endpoints = {}
        for car in CARS:
            port = free_port()
            unit_port = free_port()
            units.add(car, RadioWire(port=unit_port, box_port=port))
            wire = IwcuSettings(endpoint="iwcu", listen_port=port, unit_port=unit_port)
            endpoints[car] = open_endpoint(wire, heard[car].append)
            endpoints[car].start(loop)
        endpoints["ann"].send(b"\x03 frame", 7)
        endpoints["cat"].send(b"nobody hears", 0)
        async with asyncio.timeout(5.0):
            while not heard["ben"]:
                await asyncio.sleep(0.001)
        units.close()
        for endpoint in endpoints.values():
            endpoint.close()

    asyncio.run(talk())

    assert heard == {"ann": [], "ben": [b"\x03 frame"], "cat": []}
    sent = {record["car"]: record for record in recorder.records if record["kind"] == "on_air"}
    assert (sent["ann"]["user_priority"], sent["ann"]["size_bytes"]) == (7, 7)
    assert sent["cat"]["user_priority"] == 0
    (arrived,) = (record for record in recorder.records if record["kind"] == "delivered")
    assert (arrived["car"], arrived["sender"], arrived["user_priority"]) == ("ben", "ann", 7)


def test_a_car_without_a_wire_hears_and_is_heard() -> None:
    settings = ReachSettings(neighbours={"ann": ("ben",), "ben": ("ann",)}, delay_s=0.001)

    async def talk() -> tuple[bytes, bytes]:
        units = RadioUnits(
            ReachAir(settings, nowhere, CARS[:2], np.random.default_rng(0)),
            RigRecorder(),
        )
        to_ann, to_ben = asyncio.Queue[bytes](), asyncio.Queue[bytes]()
        wire = RadioWire(port=free_port(), box_port=free_port())
        units.add("ann", wire)
        units.add_in_process("ben", to_ben.put_nowait)
        car = open_endpoint(
            IwcuSettings(endpoint="iwcu", listen_port=wire.box_port, unit_port=wire.port),
            to_ann.put_nowait,
        )
        car.start(asyncio.get_running_loop())
        async with asyncio.timeout(5.0):
            units.transmit("ben", b"\x03 of ben", 0)
            of_ben = await to_ann.get()
            car.send(b"\x03 of ann", 0)
            of_ann = await to_ben.get()
        units.close()
        car.close()
        return of_ben, of_ann

    assert asyncio.run(talk()) == (b"\x03 of ben", b"\x03 of ann")


@pytest.mark.parametrize(
    ("datagram", "frame"),
    [
        (immediate_forward.encode(as_immediate_forward(WSM, 5, RSU41)), (WSM, 5)),
        (b"Version=0.7\n", (b"Version=0.7\n", 0)),
    ],
)
def test_a_unit_of_the_rsu_specification_forwards_immediately(
    datagram: bytes, frame: tuple[bytes, int]
) -> None:
    heard: list[bytes] = []
    recorder = RigRecorder()
    settings = ReachSettings(neighbours={"ann": ("ben",)}, delay_s=0.001)

    async def talk() -> None:
        units = RadioUnits(
            ReachAir(settings, nowhere, CARS[:2], np.random.default_rng(0)), recorder
        )
        units.add_in_process("ben", heard.append)
        wire = RadioWire(endpoint="rsu41", port=free_port(), box_port=free_port())
        units.add("ann", wire)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ann:
            ann.sendto(datagram, ("127.0.0.1", wire.port))
        async with asyncio.timeout(5.0):
            while not heard:
                await asyncio.sleep(0.0)
        units.close()

    asyncio.run(talk())

    priorities = [each["user_priority"] for each in recorder.records if each["kind"] == "on_air"]
    assert (heard, priorities) == ([frame[0]], [frame[1]])


def test_a_frame_arrives_also_while_others_are_transmitted_without_a_pause() -> None:
    settings = ReachSettings(neighbours={"ann": ("ben",)}, delay_s=0.001)
    heard: list[bytes] = []

    async def talk() -> None:
        air = ReachAir(settings, nowhere, CARS[:2], np.random.default_rng(0))
        units = RadioUnits(air, RigRecorder())
        units.add_in_process("ben", heard.append)
        async with asyncio.timeout(5.0):
            while not heard:
                units.transmit("ann", b"\x03 frame", 0)
                await asyncio.sleep(0.0)
        units.close()

    asyncio.run(talk())

    assert heard[0] == b"\x03 frame"


def test_a_missing_daemon_does_not_disturb_others() -> None:
    async def talk() -> int:
        recorder = RigRecorder()
        air = ReachAir(
            ReachSettings(neighbours={"ann": ("ben",)}), nowhere, CARS, np.random.default_rng(0)
        )
        units = RadioUnits(air, recorder)
        unit_port = free_port()
        units.add("ann", RadioWire(port=unit_port, box_port=free_port()))
        units.add("ben", RadioWire(port=free_port(), box_port=free_port()))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            async with asyncio.timeout(5.0):
                while len(recorder.records) < 6:
                    sender.sendto(b"?", ("127.0.0.1", unit_port))
                    await asyncio.sleep(0.003)
        units.close()
        return len(recorder.records)

    assert asyncio.run(talk()) >= 6
