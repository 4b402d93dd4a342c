"""The rig's ends of a box's wires while a recorded drive is played on them."""

import asyncio
import math
from collections import Counter
from collections.abc import Callable, Collection
from contextlib import AsyncExitStack, closing

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.wave_udp.drained_socket import DrainedSocket, udp_socket
from sim_rig.boxes.played_drive import PlayedInput, Wire
from sim_rig.boxes.settings import BoxSettings
from sim_rig.cars.can_interface import open_interface
from sim_rig.cars.device_line import SerialLine, UdpLine
from sim_rig.cars.pushed_pictures import PushedPictures
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.radio.iwcu import wsm_reader
from sim_rig.scenario.wire_settings import BusWire, CameraWire, RadioWire, SatelliteWire


class PlayedWires:
    """All wires of a box: its daemon starts only with all of them."""

    def __init__(self) -> None:
        """Open nothing yet."""
        self._send: dict[Wire, Callable[[PlayedInput], None]] = {}
        self._is_used: dict[Wire, Callable[[], bool]] = {}
        self._received: Counter[Wire] = Counter()
        self.on_wsm: Callable[[bytes], None] = _ignore
        """Called with each WSM that the box sends."""

    async def open(self, car: str, box: BoxSettings, edges: AsyncExitStack) -> None:
        """Open the wires until `edges` are closed.

        Args:
            car: name of the box.
            box: its file.
            edges: close them.

        Raises:
            UserError: one of them cannot be opened.
        """
        try:
            await self._open_bus(box.bus, edges)
            await self._open_camera(car, box.camera, edges)
        except OSError as error:
            raise UserError(f"{car}: {error.strerror}") from error
        self._open_radio(box.radio, edges)
        if box.satellites is not None:
            self._open_line("satellites", _satellite_line(box.satellites), edges)
        if box.detector is not None:
            self._open_line("detector", UdpLine(box.detector.host, box.detector.port), edges)

    @property
    def names(self) -> Collection[Wire]:
        """The wires that are open."""
        return self._send.keys()

    def send(self, played: PlayedInput) -> None:
        """Put an input on its wire."""
        self._send[played.wire](played)

    def forget_use(self) -> None:
        """Forget what the box has sent up to now."""
        self._received.clear()

    def unused(self, wires: Collection[Wire]) -> list[Wire]:
        """Return those of `wires` that the box does not use yet, as far as the rig can see."""
        return sorted(wire for wire in self._is_used.keys() & wires if not self._is_used[wire]())

    async def _open_bus(self, wire: BusWire, edges: AsyncExitStack) -> None:
        if wire.interface != "socketcand":
            interface = wire.serial or wire.channel
            bus = open_interface(interface, lambda _frame: self._note("bus"))
            bus.start(asyncio.get_running_loop())
            edges.callback(bus.close)
            self._send["bus"] = lambda played: bus.send(played.frame)
            self._is_used["bus"] = lambda: self._received["bus"] > 0
            return
        server = SocketcandServer(_NoUnit(), wire.channel)
        await server.start(wire.port, str(wire.host))
        edges.push_async_callback(server.close)
        self._send["bus"] = lambda played: server.send(played.frame)
        self._is_used["bus"] = lambda: server.clients > 0

    async def _open_camera(self, car: str, wire: CameraWire, edges: AsyncExitStack) -> None:
        pictures = PushedPictures(car)
        await pictures.start(str(wire.host), wire.port)
        edges.push_async_callback(pictures.close)
        self._send["camera"] = lambda played: pictures.push(played.data)
        self._is_used["camera"] = lambda: pictures.clients > 0

    def _open_radio(self, wire: RadioWire, edges: AsyncExitStack) -> None:
        read = wsm_reader(wire)
        unit = DrainedSocket(
            udp_socket(str(wire.host), wire.port),
            lambda datagram: self._take_wsm(read(datagram, 0)[0]),
            lambda _why: None,  # the box is off, and gets ready in time or not
        )
        edges.callback(unit.close)
        unit.start(asyncio.get_running_loop())
        address = str(wire.box_host), wire.box_port
        self._send["radio"] = lambda played: unit.send(played.data, address)
        self._is_used["radio"] = lambda: self._received["radio"] > 0

    def _open_line(self, name: Wire, line: UdpLine | SerialLine, edges: AsyncExitStack) -> None:
        edges.enter_context(closing(line))
        self._send[name] = lambda played: line.send(played.data)

    def _take_wsm(self, wsm: bytes) -> None:
        self._note("radio")
        self.on_wsm(wsm)

    def _note(self, wire: Wire) -> None:
        self._received[wire] += 1


def _ignore(_wsm: bytes) -> None:
    pass


class _NoUnit:
    """A bus on which nothing answers: the answers to requests are recorded too."""

    def receive_frame(self, _frame: CanFrame, _now: float) -> None:
        """Ignore a frame."""

    def frames_to_send(self, _now: float) -> list[CanFrame]:
        """Return none."""
        return []

    def get_timer(self) -> float:
        """Return `math.inf`."""
        return math.inf


def _satellite_line(wire: SatelliteWire) -> UdpLine | SerialLine:
    if wire.serial is not None:
        return SerialLine(wire.serial)
    assert wire.port is not None  # noqa: S101 (one of the two is given)
    return UdpLine(wire.host, wire.port)
