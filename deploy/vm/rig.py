"""Runs in the guest: an ECU on its bus, a camera, a GNSS receiver for gpsd, and the car ahead.

The bus is vcan0, or a socketcand server where the kernel has no CAN. The car ahead is the whole
stack of another car behind a radio unit on UDP. The rig hears words on UDP: `brake`; `radio off`,
which is the unit without power, and `radio on`; `bus off` and `bus on` for the server.

    python rig.py PICTURES KEYS (vcan | socketcand)
"""

import asyncio
import math
import socket
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np

from onboard.config import CarConfig
from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import CanSettings
from onboard.observations import Speed
from onboard.security.key_files import read_credentials
from onboard.settings import parse_settings
from onboard.stack import Stack
from onboard.units import KM_H
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer

SPEED_M_S = 54 * KM_H
CAMERA_PORT, CAMERA_FPS = 8081, 4.0
UNIT_PORT, CAR_PORT = 5399, 5398
NMEA_PORT, NMEA_HZ = 5000, 2.0
WORDS_PORT = 5397
SOCKETCAND_PORT = 29536
CAR_AHEAD = {
    "car": {"plate": "TAG1"},
    "beacons": False,
    "security": {"plate_digest": {"scrypt_log2_n": 6}},
}
STEP_S = 0.05
"""Of the car ahead, while nothing comes in."""


class VirtualBus:
    """An ECU on vcan0, also after the interface was down."""

    def __init__(self) -> None:
        """Open the bus."""
        self._loop = asyncio.get_running_loop()
        self._ecu = Ecu(lambda _now: SPEED_M_S)
        can = CanSettings(interface="socketcan", channel="vcan0")
        self._bus = CanBus(can, self._receive, lambda _up, _why: None)
        self._bus.start(self._loop)

    def _receive(self, frame: CanFrame) -> None:
        self._ecu.receive_frame(frame, self._loop.time())
        at = self._ecu.get_timer()
        if at < math.inf:
            self._loop.call_at(at, self._answer)

    def _answer(self) -> None:
        for frame in self._ecu.frames_to_send(self._loop.time()):
            self._bus.send(frame)


class ServedBus:
    """An ECU behind a socketcand server that can be switched off."""

    def __init__(self) -> None:
        """Keep off, until told."""
        self._server: SocketcandServer | None = None

    async def switch(self, state: str) -> None:
        """On or off."""
        if self._server is not None:
            await self._server.close()
        if state == "on":
            ecu = Ecu(lambda _now: SPEED_M_S)
            self._server = SocketcandServer(ecu, "can0", lambda _frame: None)
            await self._server.start(SOCKETCAND_PORT)


async def serve_camera(folder: Path) -> asyncio.Server:
    """Serve the pictures of `folder` as MJPEG, round and round."""
    pictures = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(
            b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=picture\r\n\r\n"
        )
        number = 0
        while not writer.is_closing():
            jpeg = pictures[number % len(pictures)]
            head = f"--picture\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            writer.write(head.encode() + jpeg + b"\r\n")
            number += 1
            await asyncio.sleep(1 / CAMERA_FPS)

    return await asyncio.start_server(serve, "127.0.0.1", CAMERA_PORT)


async def drive_receiver() -> None:
    """Send gpsd the sentences of a receiver that goes north, by UDP."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        began_s = time.monotonic()
        while True:
            latitude = 52.0 + (time.monotonic() - began_s) * SPEED_M_S / 111_000
            wire.sendto(sentences(latitude, datetime.now(UTC)), ("127.0.0.1", NMEA_PORT))
            await asyncio.sleep(1 / NMEA_HZ)


def sentences(latitude: float, utc: datetime) -> bytes:
    """RMC and GGA of one instant."""
    clock = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02}"
    place = f"52{(latitude - 52) * 60:08.5f},N"
    knots = SPEED_M_S / 0.514444
    return b"".join(
        f"${body}*{reduce(xor, body.encode()):02X}\r\n".encode()
        for body in (
            f"GPRMC,{clock},A,{place},00500.00000,E,{knots:.1f},0.0,{utc:%d%m%y},,,A",
            f"GPGGA,{clock},{place},00500.00000,E,1,09,1.0,10.0,M,45.0,M,,",
        )
    )


def udp_socket(port: int, receive: Callable[[bytes], None]) -> socket.socket:
    """Hand over each datagram that comes to `port`."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind(("127.0.0.1", port))
    asyncio.get_running_loop().add_reader(wire, lambda: receive(wire.recv(65535)))
    return wire


class CarAhead:
    """Another car's cores behind a radio unit: datagrams from and to the car under test."""

    def __init__(self, keys: Path) -> None:
        """Switch the unit on."""
        self._stack = Stack(
            parse_settings(CAR_AHEAD, CarConfig, "rig"),
            (),
            np.random.default_rng(1),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=read_credentials(keys),
        )
        self._is_on = True
        self._unit = udp_socket(UNIT_PORT, self._receive)

    def _receive(self, data: bytes) -> None:
        """The unit was handed a WSM to send, and the car ahead hears it."""
        if self._is_on:
            self._stack.receive_wsm(data, time.monotonic())
            self._step()

    def brake(self) -> None:
        """Hard, by the button."""
        self._stack.press_brake_button(time.monotonic())
        self._step()

    def switch(self, state: str) -> None:
        """Give the radio unit power, or take it."""
        self._is_on = state == "on"

    async def drive(self) -> None:
        """Go straight on, for ever."""
        while True:
            now = time.monotonic()
            self._stack.receive_observation(Speed(now, SPEED_M_S, 0.1, "rig"), now)
            self._step()
            await asyncio.sleep(STEP_S)

    def _step(self) -> None:
        now = time.monotonic()
        self._stack.set_utc(time.time(), now)
        if self._stack.get_timer() <= now:
            self._stack.handle_timer(now)
        for _, wsm in self._stack.wsms_to_send(now):
            if self._is_on:
                self._unit.sendto(wsm, ("127.0.0.1", CAR_PORT))
        while self._stack.next_event() is not None:
            pass


async def main(pictures: Path, keys: Path, bus: str) -> None:
    """Serve until ended."""
    car = CarAhead(keys)
    camera = await serve_camera(pictures)
    served = ServedBus()
    if bus == "socketcand":
        await served.switch("on")
    else:
        VirtualBus()
    tasks = set()

    def hear(data: bytes) -> None:
        now = time.monotonic()
        words = data.decode().split()
        match words:
            case ["brake"]:
                car.brake()
            case ["radio", state]:
                car.switch(state)
            case ["bus", state]:
                tasks.add(asyncio.create_task(served.switch(state)))
        print(f"{now:.4f} {' '.join(words)}", flush=True)

    udp_socket(WORDS_PORT, hear)
    print("all wires are there", flush=True)
    async with camera:
        await asyncio.gather(drive_receiver(), car.drive())


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]))
