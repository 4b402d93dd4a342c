"""Test of the connection to a detector of the user's."""

import asyncio
import contextlib

from onboard.detector.detector_socket import DetectorError, open_detector
from onboard.detector.object_list import ObjectListReader
from onboard.detector.settings import DetectorSettings
from onboard.observations import Discarded
from onboard.tools.doctor.finding import Finding, FindingLevel

BUSY = "onboard uses this port while it runs: stop it first with `systemctl stop onboard`"
SILENT = (
    "start the detector, and check the port that it sends to; it must also send images without"
    " vehicles"
)
UNREADABLE = "see docs/mvs.md for the format"


async def examine_detector(detector: DetectorSettings, patience_s: float) -> list[Finding]:
    """Listen for `patience_s`, and decode what arrives."""
    loop = asyncio.get_running_loop()
    reader = ObjectListReader()
    try:
        transport = await open_detector(
            detector, lambda data: reader.receive_bytes(data, loop.time())
        )
    except DetectorError as error:
        return [Finding("detector", FindingLevel.MISSING, str(error), BUSY)]
    with contextlib.closing(transport):
        await asyncio.sleep(patience_s)
    events = list(iter(reader.next_event, None))
    discarded = [event for event in events if isinstance(event, Discarded)]
    if not events:
        silent = f"nothing at port {detector.port} in {patience_s:g} s"
        return [Finding("detector", FindingLevel.MISSING, silent, SILENT)]
    if discarded:
        detail = f"{discarded[0].reason}: {discarded[0].detail}"
        level = FindingLevel.MISSING if len(discarded) == len(events) else FindingLevel.DOUBTFUL
        return [Finding("detector", level, detail, UNREADABLE)]
    return [Finding("detector", FindingLevel.GOOD, f"{len(events)} images in {patience_s:g} s")]
