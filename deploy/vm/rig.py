"""Runs in the guest: an ECU on its bus, a camera, a GNSS receiver for gpsd, and the lead vehicle.

The bus is vcan0, or a socketcand server where the kernel has no CAN. The lead vehicle is the whole
stack of another car behind a radio unit on UDP. The rig accepts commands on UDP: `brake`; `radio
off` and `radio on` for the power of the unit; `bus off` and `bus on` for the server.

    python rig.py IMAGES KEYS (vcan | socketcand)
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
from onboard.step import BrakeButton, Input, ReceivedWsm
from onboard.units import KM_H
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer

SPEED_M_S = 54 * KM_H
CAMERA_PORT, CAMERA_FPS = 8081, 4.0
UNIT_PORT, CAR_PORT = 5399, 5398
NMEA_PORT, NMEA_HZ = 5000, 2.0
COMMAND_PORT = 5397
SOCKETCAND_PORT = 29536
LEAD_VEHICLE = {
    "car": {"plate": "TAG1"},
    "beacons": False,
    "security": {"plate_digest": {"scrypt_log2_n": 6}},
}
STEP_S = 0.05
"""Step of the lead vehicle while it receives nothing."""


class VirtualBus:
    """An ECU on vcan0, which continues after the interface was down."""

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
    """An ECU behind a socketcand server that can be stopped."""

    def __init__(self) -> None:
        """Begin without a server."""
        self._server: SocketcandServer | None = None

    async def switch(self, state: str) -> None:
        """Start (`on`) or stop (`off`) the server."""
        if self._server is not None:
            await self._server.close()
        if state == "on":
            ecu = Ecu(lambda _now: SPEED_M_S)
            self._server = SocketcandServer(ecu, "can0", lambda _frame: None)
            await self._server.start(SOCKETCAND_PORT)


async def serve_camera(folder: Path) -> asyncio.Server:
    """Serve the images of `folder` as MJPEG, in a loop."""
    jpegs = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(
            b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=image\r\n\r\n"
        )
        number = 0
        while not writer.is_closing():
            jpeg = jpegs[number % len(jpegs)]
            head = f"--image\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            writer.write(head.encode() + jpeg + b"\r\n")
            number += 1
            await asyncio.sleep(1 / CAMERA_FPS)

    return await asyncio.start_server(serve, "127.0.0.1", CAMERA_PORT)


async def drive_receiver() -> None:
    """Send the sentences of a receiver that moves north to gpsd by UDP."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        began_s = time.monotonic()
        while True:
            latitude = 52.0 + (time.monotonic() - began_s) * SPEED_M_S / 111_000
            wire.sendto(sentences(latitude, datetime.now(UTC)), ("127.0.0.1", NMEA_PORT))
            await asyncio.sleep(1 / NMEA_HZ)


def sentences(latitude: float, utc: datetime) -> bytes:
    """RMC and GGA of one fix."""
    clock = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02}"
    position = f"52{(latitude - 52) * 60:08.5f},N"
    knots = SPEED_M_S / 0.514444
    return b"".join(
        f"${body}*{reduce(xor, body.encode()):02X}\r\n".encode()
        for body in (
            f"GPRMC,{clock},A,{position},00500.00000,E,{knots:.1f},0.0,{utc:%d%m%y},,,A",
            f"GPGGA,{clock},{position},00500.00000,E,1,09,1.0,10.0,M,45.0,M,,",
        )
    )


def udp_socket(port: int, receive: Callable[[bytes], None]) -> socket.socket:
    """Open a port of localhost, and pass each datagram to `receive`."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind(("127.0.0.1", port))
    asyncio.get_running_loop().add_reader(wire, lambda: receive(wire.recv(65535)))
    return wire


class LeadVehicle:
    """The cores of the lead vehicle behind a radio unit, connected to the daemon by datagrams."""

    def __init__(self, keys: Path) -> None:
        """Start the cores, with the radio unit on."""
        self._stack = Stack(
            parse_settings(LEAD_VEHICLE, CarConfig, "rig"),
            (),
            np.random.default_rng(1),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=read_credentials(keys),
        )
        self._is_on = True
        self._unit = udp_socket(UNIT_PORT, self._receive)

    def _receive(self, data: bytes) -> None:
        """Receive a WSM that the daemon sends through its radio unit."""
        if self._is_on:
            self._step(ReceivedWsm(time.monotonic(), data))

    def brake(self) -> None:
        """Brake hard, by the brake button."""
        self._step(BrakeButton(time.monotonic()))

    def switch(self, state: str) -> None:
        """Switch the radio unit `on` or `off`."""
        self._is_on = state == "on"

    async def drive(self) -> None:
        """Drive straight on until cancelled."""
        while True:
            now = time.monotonic()
            self._step(Speed(now, SPEED_M_S, 0.1, "rig"))
            await asyncio.sleep(STEP_S)

    def _step(self, *inputs: Input) -> None:
        for wsm in self._stack.step(inputs, time.monotonic(), time.time()).wsms:
            if self._is_on:
                self._unit.sendto(wsm.data, ("127.0.0.1", CAR_PORT))


async def main(images: Path, keys: Path, bus: str) -> None:
    """Run all parts until the process is ended.

    Args:
        images: folder of the camera's images.
        keys: folder of the lead vehicle's credentials.
        bus: `vcan` or `socketcand`.
    """
    lead = LeadVehicle(keys)
    camera = await serve_camera(images)
    served = ServedBus()
    if bus == "socketcand":
        await served.switch("on")
    else:
        VirtualBus()
    tasks = set()

    def receive_command(data: bytes) -> None:
        now = time.monotonic()
        command = data.decode().split()
        match command:
            case ["brake"]:
                lead.brake()
            case ["radio", state]:
                lead.switch(state)
            case ["bus", state]:
                tasks.add(asyncio.create_task(served.switch(state)))
        print(f"{now:.4f} {' '.join(command)}", flush=True)

    udp_socket(COMMAND_PORT, receive_command)
    print("ready", flush=True)
    async with camera:
        await asyncio.gather(drive_receiver(), lead.drive())


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]))
