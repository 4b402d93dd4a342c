"""gpsd, and whether its receiver has a fix."""

import asyncio
import contextlib

from onboard.gnss.gpsd import Gpsd
from onboard.gnss.gpsd_reader import GpsdReader
from onboard.gnss.settings import GnssSettings
from onboard.observations import Position
from onboard.tools.doctor.finding import Finding, FindingLevel

COARSE_M = 10.0
"""One standard deviation; a lane is 3.5 m wide, a junction some 10."""

NO_GPSD = "`systemctl start gpsd`; which receiver it reads stands in /etc/default/gpsd"
NO_FIX = "give the antenna a view of the sky and a minute; `gpspipe -w` shows what gpsd hears"
COARSE = "give the antenna a better view of the sky; under a roof and between houses it is so"


async def examine_satellites(gnss: GnssSettings, patience_s: float) -> list[Finding]:
    """Wait for a position for `patience_s`."""
    loop = asyncio.get_running_loop()
    reader = GpsdReader(gnss)
    positions: asyncio.Queue[Position] = asyncio.Queue()
    troubles: list[str] = []

    def take(data: bytes) -> None:
        reader.receive_bytes(data, loop.time())
        while (event := reader.next_event()) is not None:
            if isinstance(event, Position):
                positions.put_nowait(event)

    gpsd = Gpsd(gnss, take, lambda up, why: None if up else troubles.append(why))
    gpsd.start(loop)
    with contextlib.closing(gpsd):
        try:
            fix = await asyncio.wait_for(positions.get(), patience_s)
        except TimeoutError:
            if troubles:
                return [Finding("gpsd", FindingLevel.MISSING, troubles[-1], NO_GPSD)]
            return [Finding("gpsd", FindingLevel.MISSING, f"no fix in {patience_s:g} s", NO_FIX)]
    detail = f"fix, good to {fix.sigma_m:.1f} m"
    if fix.sigma_m > COARSE_M:
        return [Finding("gpsd", FindingLevel.DOUBTFUL, detail, COARSE)]
    return [Finding("gpsd", FindingLevel.GOOD, detail)]
