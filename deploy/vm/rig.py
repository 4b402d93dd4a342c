"""Runs in the guest: the rig's ends of the box's wires, and the lead vehicle on commands.

The bus is vcan0, or a socketcand server where the kernel has no CAN. The rig accepts commands on
UDP: `brake`; `radio off` and `radio on` for the power of the radio units, `radio ocb` for the lead
vehicle on the network interface `wlan1`; `bus off` and `bus on` for the server.

    python rig.py IMAGES KEYS (vcan | socketcand)
"""

import asyncio
import math
import sys
import time
from pathlib import Path

import numpy as np
from typing_extensions import override

from onboard.kinematics.units import KM_H
from onboard.obd.can_frame import CanFrame
from onboard.observations import Speed
from onboard.security.key_files import read_credentials
from onboard.settings import parse_settings
from onboard.step import BrakeButton, Input, ReceivedWsm
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp.raw import RawEndpoint
from onboard.wave_udp.settings import RawSettings
from sim_rig.cars.can_interface import CanInterface
from sim_rig.cars.device_line import DeviceLine, UdpLine
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.mjpeg_server import MjpegServer
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.radio.air import Delivery
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.roads.road import CarState
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.scenario.sensor_settings import ReceiverSettings
from sim_rig.scenario.wire_settings import LOOPBACK, RadioWire

SPEED_M_S = 54 * KM_H
CAMERA_PORT, CAMERA_FPS = 8081, 4.0
RADIO = RadioWire(port=5399, box_port=5398)
NMEA_PORT, NMEA_HZ = 5000, 2.0
COMMAND_PORT = 5397
SOCKETCAND_PORT = 29536
BOX, LEAD = "car", "ahead"
LEAD_VEHICLE = {
    "car": {"plate": "TAG1"},
    "beacons": False,
    "security": {"plate_digest": {"scrypt_log2_n": 6}},
}
STEP_S = 0.05
"""Step of the lead vehicle while it receives nothing."""


def state_at(now: float) -> CarState:
    """State of the box's car, which drives north."""
    driven_m = now * SPEED_M_S % 10_000.0
    return CarState(0.0, driven_m, 0.0, 0.0, driven_m, SPEED_M_S, 0.0, 4.5, 1.8, 1.5)


class ServedBus:
    """An ECU behind a socketcand server that can be stopped."""

    def __init__(self) -> None:
        """Begin without a server."""
        self._server: SocketcandServer | None = None

    async def switch(self, state: str) -> None:
        """Start (`on`) or stop (`off`) the server."""
        if self._server is not None:
            await self._server.close()
            self._server = None
        if state == "on":
            self._server = SocketcandServer(ecu(), "can0", ignore)
            await self._server.start(SOCKETCAND_PORT)


def ecu() -> Ecu:
    """Return the ECU of the box's car."""
    return Ecu(lambda now: state_at(now).speed_m_s)


def ignore(_frame: CanFrame) -> None:
    """Take a frame of the ECU."""


class SwitchedAir:
    """A channel on which each frame reaches the other car at once, while the units have power."""

    def __init__(self) -> None:
        """Begin with the units on."""
        self._is_on = True
        self._arrived: list[Delivery] = []

    def switch(self, state: str) -> None:
        """Switch the units `on` or `off`."""
        self._is_on = state == "on"

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """See `Air`."""
        if self._is_on:
            receiver = LEAD if sender == BOX else BOX
            self._arrived.append(Delivery(now, 0, sender, receiver, user_priority, wsm))

    def wsms_to_deliver(self, _now: float) -> list[Delivery]:
        """See `Air`."""
        arrived, self._arrived = self._arrived, []
        return arrived

    def get_timer(self) -> float:
        """See `Air`."""
        return self._arrived[0].at_s if self._arrived else math.inf


class LeadVehicle:
    """The cores of the lead vehicle, with a radio unit."""

    def __init__(self, keys: Path, units: RadioUnits) -> None:
        """Start the cores."""
        self._stack = Stack(
            parse_settings(LEAD_VEHICLE, CarConfig, "rig"),
            (),
            np.random.default_rng(1),
            now=time.monotonic(),
            utc_s=time.time(),
            credentials=read_credentials(keys),
        )
        self._units = units
        units.add_in_process(LEAD, self._receive)
        self._ocb: RawEndpoint | None = None

    def use_ocb(self) -> None:
        """Send and receive by the kernel's 802.11p from now on."""
        self._ocb = RawEndpoint(
            RawSettings(endpoint="raw", interface="wlan1"), self._receive, print
        )
        self._ocb.start(asyncio.get_running_loop())

    def brake(self) -> None:
        """Brake hard, by the brake button."""
        self._step(BrakeButton(time.monotonic()))

    async def drive(self) -> None:
        """Drive straight on until cancelled."""
        while True:
            self._step(Speed(time.monotonic(), SPEED_M_S, 0.1, "rig"))
            await asyncio.sleep(STEP_S)

    def _receive(self, wsm: bytes) -> None:
        self._step(ReceivedWsm(time.monotonic(), wsm))

    def _step(self, *inputs: Input) -> None:
        for wsm in self._stack.step(inputs, time.monotonic(), time.time()).wsms:
            if self._ocb is None:
                self._units.transmit(LEAD, wsm.data, wsm.user_priority)
            else:
                self._ocb.send(wsm.data, wsm.user_priority)


def camera(folder: Path) -> MjpegServer:
    """Return a server of the images of `folder`, in a loop."""
    jpegs = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]
    return MjpegServer({BOX: lambda now: jpegs[int(now * CAMERA_FPS) % len(jpegs)]}, CAMERA_FPS)


def receiver() -> GnssReceiver:
    """Return the GNSS receiver of the box's car."""
    seeds = np.random.SeedSequence(1).spawn(2)
    own_rng, shared_rng = map(np.random.default_rng, seeds)
    settings = ReceiverSettings(rate_hz=NMEA_HZ)
    return GnssReceiver(settings, state_at, time.time() - time.monotonic(), own_rng, shared_rng)


class Commands(asyncio.DatagramProtocol):
    """Obeys the commands, and prints each with the time at which it came."""

    def __init__(self, lead: LeadVehicle, air: SwitchedAir, bus: ServedBus) -> None:
        """Control these."""
        self._lead, self._air, self._bus = lead, air, bus
        self._tasks: set[asyncio.Task[None]] = set()

    @override
    def datagram_received(self, data: bytes, addr: object) -> None:
        now = time.monotonic()
        command = data.decode().split()
        match command:
            case ["brake"]:
                self._lead.brake()
            case ["radio", "ocb"]:
                self._lead.use_ocb()
            case ["radio", state]:
                self._air.switch(state)
            case ["bus", state]:
                self._tasks.add(asyncio.create_task(self._bus.switch(state)))
        print(f"{now:.4f} {' '.join(command)}", flush=True)


async def main(images: Path, keys: Path, kind: str) -> None:
    """Run all parts until the process is ended.

    Args:
        images: folder of the camera's images.
        keys: folder of the lead vehicle's credentials.
        kind: of the bus: `vcan` or `socketcand`.
    """
    air, bus = SwitchedAir(), ServedBus()
    units = RadioUnits(air, RigRecorder())
    units.add(BOX, RADIO)
    lead = LeadVehicle(keys, units)
    if kind == "socketcand":
        await bus.switch("on")
    else:
        CanInterface(ecu(), "vcan0")
    DeviceLine(receiver(), UdpLine(LOOPBACK, NMEA_PORT))
    await camera(images).start([(str(LOOPBACK), CAMERA_PORT)])
    await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: Commands(lead, air, bus), (str(LOOPBACK), COMMAND_PORT)
    )
    print("ready", flush=True)
    await lead.drive()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]))
