"""The link layer as the radio: frames of a profile's EtherType on OCB-mode Wi-Fi or veth."""

import asyncio
import contextlib
import socket
from collections.abc import Callable

from onboard.wave_udp.drained_socket import DrainedSocket, RadioError
from onboard.wave_udp.settings import RadioProfile, RawSettings
from onboard.wave_udp.wsmp import ETHERTYPE, ETHERTYPE_GEONETWORKING

BROADCAST = b"\xff" * 6

_USER_PRIORITY_BASE = 256
"""Linux maps socket priorities 256 to 263 to user priorities 0 to 7 for every EtherType
(net/wireless, cfg80211_classify8021d); 0 to 7 would all be best effort."""


class RawEndpoint:
    """Sends WSMs as broadcast frames and receives those of others."""

    def __init__(
        self,
        settings: RawSettings,
        on_wsm: Callable[[bytes], None],
        on_error: Callable[[str], None],
    ) -> None:
        """Bind the interface.

        Args:
            settings: of the connection.
            on_wsm: called with each received WSM.
            on_error: called with the reason when the radio cannot be reached.

        Raises:
            RadioError: it cannot be bound.
        """
        is_its = settings.profile is RadioProfile.ITS_G5
        self._ethertype = ETHERTYPE_GEONETWORKING if is_its else ETHERTYPE
        self._address = settings.interface, self._ethertype, 0, 0, BROADCAST
        self._user_priority: int | None = None
        self._socket = DrainedSocket(_open(settings.interface, self._ethertype), on_wsm, on_error)
        self._index = socket.if_nametoindex(settings.interface)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start to receive on `loop`."""
        self._socket.start(loop)

    def send(self, wsm: bytes, user_priority: int) -> None:
        """Broadcast `wsm`; it is lost if the interface is missing or down, or its queue full."""
        wire = self._socket.wire
        with contextlib.suppress(OSError):  # the socket reports what prevents sending
            self._rebind(wire)
            if user_priority != self._user_priority:
                wire.setsockopt(
                    socket.SOL_SOCKET, socket.SO_PRIORITY, _USER_PRIORITY_BASE + user_priority
                )
                self._user_priority = user_priority
        self._socket.send(wsm, self._address)

    def _rebind(self, wire: socket.socket) -> None:
        """Bind again to a radio that was plugged in again: same name, another interface."""
        interface = self._address[0]
        index = socket.if_nametoindex(interface)
        if index != self._index:
            wire.bind((interface, self._ethertype))
            self._index = index

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _open(interface: str, ethertype: int) -> socket.socket:
    """Return a socket for which the kernel writes and strips the Ethernet header."""
    try:
        wire = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(ethertype))
    except PermissionError as error:
        raise RadioError(f"radio: {interface} needs CAP_NET_RAW and CAP_NET_ADMIN") from error
    try:
        wire.bind((interface, ethertype))
    except OSError as error:
        wire.close()
        raise RadioError(f"radio: no interface {interface}: {error.strerror}") from error
    return wire
