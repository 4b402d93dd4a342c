"""Test of the connection to the radio unit; only empty datagrams are sent to it, no message."""

import asyncio
import contextlib
import socket

from onboard.tools.doctor.finding import Finding, FindingLevel
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
    return [Finding("radio", FindingLevel.GOOD, f"{len(received)} messages in {patience_s:g} s")]


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
