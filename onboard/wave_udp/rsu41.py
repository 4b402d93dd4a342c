"""Connection to a radio unit of the USDOT RSU Specification 4.1.

WSMs are sent to it as Immediate Forward messages. Depending on its configuration, the unit forwards
what it receives as the WSM or as the 1609.2 data in it; both are accepted.
"""

import asyncio
from collections.abc import Callable

from onboard.errors import DecodeError
from onboard.wave_udp import immediate_forward, wsmp
from onboard.wave_udp.drained_socket import DrainedSocket, udp_socket
from onboard.wave_udp.immediate_forward import ImmediateForward
from onboard.wave_udp.psid import BSM
from onboard.wave_udp.settings import Rsu41Settings
from onboard.wave_udp.wsmp import WaveShortMessage


class Rsu41Endpoint:
    """Sends WSMs through the unit and receives those that it forwards."""

    def __init__(
        self,
        settings: Rsu41Settings,
        on_wsm: Callable[[bytes], None],
        on_error: Callable[[str], None],
    ) -> None:
        """Bind the port.

        Args:
            settings: of the connection.
            on_wsm: called with each received WSM.
            on_error: called with the reason when the radio cannot be reached.

        Raises:
            RadioError: it cannot be bound.
        """
        self._settings = settings
        self._unit = str(settings.unit_host), settings.unit_port
        self._on_wsm = on_wsm
        wire = udp_socket(str(settings.listen_host), settings.listen_port)
        self._socket = DrainedSocket(wire, self._receive, on_error, from_host=self._unit[0])

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start to receive on `loop`."""
        self._socket.start(loop)

    def send(self, wsm: bytes, user_priority: int) -> None:
        """Send `wsm` to the unit; it is lost if the unit is not reachable."""
        text = immediate_forward.encode(as_immediate_forward(wsm, user_priority, self._settings))
        self._socket.send(text, self._unit)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _receive(self, datagram: bytes) -> None:
        self._on_wsm(as_wsm(datagram, self._settings.forwarded_psid))


def as_immediate_forward(
    wsm: bytes, user_priority: int, settings: Rsu41Settings
) -> ImmediateForward:
    """Return the message that makes the unit transmit `wsm`, whose data is secured already.

    Args:
        wsm: a WSMP frame.
        user_priority: 0 to 7.
        settings: gives the channel of frames that name none.
    """
    message = wsmp.decode(wsm)
    channel = settings.channel if message.channel_number is None else message.channel_number
    return ImmediateForward(
        type="BSM" if message.psid == BSM else "OTHER",
        psid=message.psid,
        priority=user_priority,
        payload=message.payload,
        tx_channel=str(channel),
    )


def as_wsm(datagram: bytes, forwarded_psid: int | None) -> bytes:
    """Return a forwarded packet as a WSM; unchanged if that is impossible, to be counted."""
    try:
        wsmp.decode(datagram)
    except DecodeError:
        if forwarded_psid is not None and len(datagram) <= wsmp.MAX_DATA_BYTES:
            return wsmp.encode(WaveShortMessage(psid=forwarded_psid, payload=datagram))
    return datagram
