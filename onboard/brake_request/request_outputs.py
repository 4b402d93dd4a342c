"""The UDP socket and the second CAN bus over which requests to brake leave."""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.brake_request.settings import (
    BrakeRequestSettings,
    RequestDatagramSettings,
    RequestFrameSettings,
)
from onboard.errors import UserError
from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_dbc
from onboard.obd.vehicle_bus import is_diagnostic
from onboard.observations import Discarded

if TYPE_CHECKING:
    from onboard.brake_request.dbc_frame import RequestFrameLayout

COMPONENT = "brake_request"


class RequestOutputs:
    """All ways out that are configured."""

    def __init__(
        self, settings: BrakeRequestSettings, on_discarded: Callable[[Discarded], None]
    ) -> None:
        """Read the DBC file; nothing is opened yet.

        Args:
            settings: the ways out.
            on_discarded: gets why a frame is not sent.

        Raises:
            UserError: the DBC file cannot be read or used.
        """
        self._udp = settings.udp
        self._bus = None
        if settings.can is not None:
            layout = read_layout(settings.can, settings.most_m_s2)
            self._bus = RequestBus(settings.can, layout, on_discarded)

    def open(self, loop: asyncio.AbstractEventLoop, wires: contextlib.AsyncExitStack) -> None:
        """Open them, until `wires` are closed.

        Raises:
            UserError: an address or a bus cannot be opened.
        """
        self._senders: list[Callable[[BrakeRequest], None]] = []
        if self._udp is not None:
            line = wires.enter_context(_connect(self._udp))
            self._senders.append(lambda request: _send(line, datagram.encode(request)))
        if self._bus is not None:
            self._bus.start(loop)
            wires.callback(self._bus.close)
            self._senders.append(self._bus.send)

    def send(self, request: BrakeRequest) -> None:
        """Send a request over all of them; it is lost where nobody receives."""
        for send in self._senders:
            send(request)


class RequestBus:
    """The second bus; if it carries OBD, it is the OBD port after all, and gets no frames."""

    def __init__(
        self,
        settings: RequestFrameSettings,
        layout: "RequestFrameLayout",
        on_discarded: Callable[[Discarded], None],
    ) -> None:
        """Prepare the bus.

        Args:
            settings: of the wire.
            layout: of the frames.
            on_discarded: gets that the bus is lost or carries OBD.
        """
        self._layout = layout
        self._on_discarded = on_discarded
        self._carries_obd = False
        self._bus = CanBus(settings, self._receive, self._on_state, on_discarded)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open the bus.

        Raises:
            UserError: it cannot be opened.
        """
        self._loop = loop
        self._bus.start(loop)

    def send(self, request: BrakeRequest) -> None:
        """Send the frame of a request."""
        if not self._carries_obd:
            self._bus.send(self._layout.frame(request))

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _receive(self, frame: CanFrame) -> None:
        is_obd = is_diagnostic(frame.arbitration_id, is_extended_id=frame.is_extended_id)
        if is_obd and not self._carries_obd:
            self._carries_obd = True
            self._discard("obd_port", f"0x{frame.arbitration_id:X} received: no request is sent")

    def _on_state(self, up: bool, why: str) -> None:
        if not up:
            self._discard("bus_lost", why)

    def _discard(self, reason: str, detail: str) -> None:
        self._on_discarded(Discarded(self._loop.time(), COMPONENT, reason, detail))


def read_layout(settings: RequestFrameSettings, most_m_s2: float) -> "RequestFrameLayout":
    """Read the DBC file of the frames.

    Raises:
        UserError: it cannot be read, or `RequestFrameLayout` finds a mistake in it.
    """
    # The DBC parser's import takes a tenth of a start.
    from onboard.brake_request.dbc_frame import RequestFrameLayout  # noqa: PLC0415 (see above)

    return RequestFrameLayout(settings, read_dbc(settings.dbc), most_m_s2)


def _connect(settings: RequestDatagramSettings) -> socket.socket:
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.setblocking(False)
    try:
        line.connect((settings.host, settings.port))
    except OSError as error:
        line.close()
        why = f"brake_request.udp: {settings.host}:{settings.port}: {error.strerror}"
        raise UserError(why) from error
    return line


def _send(line: socket.socket, data: bytes) -> None:
    with contextlib.suppress(OSError):  # nobody listens, or the queue is full
        line.send(data)
