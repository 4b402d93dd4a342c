"""The wire to the radio unit. Nothing goes on the air: the unit is sent an empty datagram."""

import asyncio
import contextlib
import socket

from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.wave_udp.drained_socket import RadioError
from onboard.wave_udp.endpoint import open_endpoint
from onboard.wave_udp.settings import RadioSettings, RawSettings

BUSY = "if onboard is running, it has this wire: `systemctl stop onboard` before this"
NOBODY = "switch the unit on; check its address and port against `radio` in the configuration"
ALONE = "normal where no other car is near; else check the channel and the unit's forwarding"


async def examine_radio(radio: RadioSettings, patience_s: float) -> list[Finding]:
    """Listen for `patience_s`, and see whether the unit's host refuses."""
    loop = asyncio.get_running_loop()
    heard: list[bytes] = []
    try:
        endpoint = open_endpoint(radio, heard.append)
    except RadioError as error:
        return [Finding("radio", FindingLevel.MISSING, str(error), BUSY)]
    with contextlib.closing(endpoint):
        endpoint.start(loop)
        refusal = await _refusal(radio, patience_s)
    if refusal:
        return [Finding("radio", FindingLevel.MISSING, refusal, NOBODY)]
    if not heard:
        silent = f"nothing heard in {patience_s:g} s"
        return [Finding("radio", FindingLevel.DOUBTFUL, silent, ALONE)]
    return [Finding("radio", FindingLevel.GOOD, f"{len(heard)} messages in {patience_s:g} s")]


async def _refusal(radio: RadioSettings, patience_s: float) -> str:
    """Why the unit cannot be there, as ICMP tells within `patience_s`; empty where it may be."""
    if isinstance(radio, RawSettings):
        await asyncio.sleep(patience_s)
        return ""
    address = str(radio.unit_host), radio.unit_port
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address)
            probe.send(b"")
            await asyncio.sleep(patience_s)
            probe.send(b"")  # which is when a socket tells what ICMP said
        except OSError as error:
            return f"unit at {address[0]}:{address[1]}: {error.strerror}"
    return ""
