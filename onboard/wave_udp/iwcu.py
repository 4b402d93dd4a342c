"""Connection to an IWCU radio unit: each UDP datagram is one WSMP frame (LCCA, section 4).

The user priority is sent as the IP precedence, the three high bits of the type of service octet
(RFC 791, 3.1).
"""

import asyncio
import socket
import struct
from collections.abc import Callable

from onboard.wave_udp.drained_socket import DrainedSocket, udp_socket
from onboard.wave_udp.settings import IwcuSettings

_TOS = [
    [(socket.IPPROTO_IP, socket.IP_TOS, struct.pack("i", priority << 5))] for priority in range(8)
]


class IwcuEndpoint:
    """Sends WSMs to the unit and receives those that it forwards."""

    def __init__(
        self,
        settings: IwcuSettings,
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
        self._unit = str(settings.unit_host), settings.unit_port
        wire = udp_socket(str(settings.listen_host), settings.listen_port)
        self._socket = DrainedSocket(wire, on_wsm, on_error, from_host=self._unit[0])

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start to receive on `loop`."""
        self._socket.start(loop)

    def send(self, wsm: bytes, user_priority: int) -> None:
        """Send `wsm` to the unit; it is lost if the unit is not reachable."""
        self._socket.send(wsm, self._unit, _TOS[user_priority])

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
