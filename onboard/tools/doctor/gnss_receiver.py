"""Test of gpsd, and of the fix of its receiver."""

import asyncio
import contextlib

from onboard.gnss.gpsd import Gpsd
from onboard.gnss.gpsd_reader import GpsdReader
from onboard.gnss.settings import GnssSettings
from onboard.observations import Position
from onboard.tools.doctor.finding import Finding, FindingLevel

COARSE_M = 10.0
"""Standard deviation above which a fix is doubtful; a junction is some 10 m wide."""

NO_GPSD = "`systemctl start gpsd`; /etc/default/gpsd names its receiver"
NO_FIX = "give the antenna a view of the sky and a minute; `gpspipe -w` shows what gpsd receives"
COARSE = "give the antenna a better view of the sky; under a roof or between houses this is normal"


async def examine_gnss_receiver(gnss: GnssSettings, patience_s: float) -> list[Finding]:
    """Wait for a position for `patience_s`."""
    loop = asyncio.get_running_loop()
    reader = GpsdReader(gnss)
    positions: asyncio.Queue[Position] = asyncio.Queue()
    failures: list[str] = []

    def take(data: bytes) -> None:
        reader.receive_bytes(data, loop.time())
        while (event := reader.next_event()) is not None:
            if isinstance(event, Position):
                positions.put_nowait(event)

    gpsd = Gpsd(gnss, take, lambda up, why: None if up else failures.append(why))
    gpsd.start(loop)
    with contextlib.closing(gpsd):
        try:
            fix = await asyncio.wait_for(positions.get(), patience_s)
        except TimeoutError:
            if failures:
                return [Finding("gpsd", FindingLevel.MISSING, failures[-1], NO_GPSD)]
            return [Finding("gpsd", FindingLevel.MISSING, f"no fix in {patience_s:g} s", NO_FIX)]
    detail = f"fix, good to {fix.sigma_m:.1f} m"
    if fix.sigma_m > COARSE_M:
        return [Finding("gpsd", FindingLevel.DOUBTFUL, detail, COARSE)]
    return [Finding("gpsd", FindingLevel.GOOD, detail)]
