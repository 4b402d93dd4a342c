"""Test of the connection to the radio unit; only empty datagrams are sent to it, no message."""

import asyncio
import contextlib
import socket
import time
from collections.abc import Iterable

from onboard.errors import DecodeError
from onboard.security import ieee1609dot2
from onboard.security.clock_check import ClockCheck
from onboard.security.ieee1609dot2 import SignedData
from onboard.security.oer import Malformed, Unsupported
from onboard.security.security_services import MESSAGE_LIFETIME_S
from onboard.tools.doctor.computer import SET_CLOCK
from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.wave_udp import wsmp
from onboard.wave_udp.drained_socket import RadioError
from onboard.wave_udp.endpoint import open_endpoint
from onboard.wave_udp.settings import RadioSettings, RawSettings

BUSY = "onboard uses this connection while it runs: stop it first with `systemctl stop onboard`"
REFUSED = "switch the unit on; check its address and port against `radio` in the configuration"
SILENT = (
    "normal if no other vehicle with a radio is near; else check channel and forwarding of the unit"
)


async def examine_radio(radio: RadioSettings, patience_s: float) -> list[Finding]:
    """Listen for `patience_s`, and test whether the unit's host refuses datagrams."""
    loop = asyncio.get_running_loop()
    received: list[bytes] = []
    try:
        endpoint = open_endpoint(radio, received.append)
    except RadioError as error:
        return [Finding("radio", FindingLevel.MISSING, str(error), BUSY)]
    with contextlib.closing(endpoint):
        endpoint.start(loop)
        refusal = await _refusal(radio, patience_s)
    if refusal:
        return [Finding("radio", FindingLevel.MISSING, refusal, REFUSED)]
    if not received:
        silent = f"nothing received in {patience_s:g} s"
        return [Finding("radio", FindingLevel.DOUBTFUL, silent, SILENT)]
    count = f"{len(received)} messages in {patience_s:g} s"
    error_s = clock_error_s(received, time.time())
    if error_s is not None:
        apart = f"{count}, sent {abs(error_s):.0f} s {'ago' if error_s > 0.0 else 'from now'}"
        return [Finding("radio", FindingLevel.DOUBTFUL, f"{apart} by their clocks", SET_CLOCK)]
    return [Finding("radio", FindingLevel.GOOD, count)]


def clock_error_s(frames: Iterable[bytes], utc_s: float) -> float | None:
    """Return by how much the clock of this computer is ahead of the senders' that agree.

    Args:
        frames: WSMs that were just received; what is not signed is left out.
        utc_s: of this computer, in s since 1970.
    """
    check = ClockCheck()
    for frame in frames:
        try:
            message = ieee1609dot2.decode(wsmp.decode(frame).payload)
        except (DecodeError, Malformed, Unsupported):
            continue
        if isinstance(message, SignedData) and message.generation_utc_s is not None:
            check.receive_error(message.signer_id, utc_s - message.generation_utc_s, 0.0)
    error_s = check.error_s(0.0)
    return error_s if error_s is not None and abs(error_s) > MESSAGE_LIFETIME_S else None


async def _refusal(radio: RadioSettings, patience_s: float) -> str:
    """Return the error that ICMP reports within `patience_s`; empty if there is none."""
    if isinstance(radio, RawSettings):
        await asyncio.sleep(patience_s)
        return ""
    address = str(radio.unit_host), radio.unit_port
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address)
            probe.send(b"")
            await asyncio.sleep(patience_s)
            probe.send(b"")  # The socket raises an ICMP error with the next call.
        except OSError as error:
            return f"unit at {address[0]}:{address[1]}: {error.strerror}"
    return ""
