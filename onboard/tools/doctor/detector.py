"""The wire to a detector of the user's."""

import asyncio
import contextlib

from onboard.detector.detector_socket import DetectorError, open_detector
from onboard.detector.object_list import ObjectListReader
from onboard.detector.settings import DetectorSettings
from onboard.observations import Discarded
from onboard.tools.doctor.finding import Finding, FindingLevel

BUSY = "if onboard is running, it has this port: `systemctl stop onboard` before this"
SILENT = (
    "start the detector, and check the port that it sends to; it sends pictures without cars too"
)
UNREADABLE = "what it is to send stands in docs/mvs.md"


async def examine_detector(detector: DetectorSettings, patience_s: float) -> list[Finding]:
    """Listen for `patience_s`, and read what comes."""
    loop = asyncio.get_running_loop()
    reader = ObjectListReader()
    try:
        wire = await open_detector(detector, lambda data: reader.receive_bytes(data, loop.time()))
    except DetectorError as error:
        return [Finding("detector", FindingLevel.MISSING, str(error), BUSY)]
    with contextlib.closing(wire):
        await asyncio.sleep(patience_s)
    events = list(iter(reader.next_event, None))
    wrong = [event for event in events if isinstance(event, Discarded)]
    if not events:
        silent = f"nothing at port {detector.port} in {patience_s:g} s"
        return [Finding("detector", FindingLevel.MISSING, silent, SILENT)]
    if wrong:
        detail = f"{wrong[0].reason}: {wrong[0].detail}"
        verdict = FindingLevel.MISSING if len(wrong) == len(events) else FindingLevel.DOUBTFUL
        return [Finding("detector", verdict, detail, UNREADABLE)]
    return [Finding("detector", FindingLevel.GOOD, f"{len(events)} pictures in {patience_s:g} s")]
