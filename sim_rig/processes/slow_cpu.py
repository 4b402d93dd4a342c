"""Stops and continues daemons periodically, as a busy processor would."""

import asyncio
import signal
import time
from collections.abc import Container

from sim_rig.processes.processes import Processes
from sim_rig.scenario.faults import SlowCpu
from sim_rig.scenario.schema import Scenario


async def slow_down(
    scenario: Scenario, start_s: float, processes: Processes, daemons: Container[str]
) -> None:
    """Slow the daemons of cars with the fault `SlowCpu`; when cancelled, all run again.

    Args:
        scenario: the scenario of the run.
        start_s: monotonic time of its start, s.
        processes: the daemons, by the name of their car.
        daemons: the cars that have one.
    """
    faults = [
        fault for fault in scenario.faults if isinstance(fault, SlowCpu) and fault.car in daemons
    ]
    await asyncio.gather(*(_slow_one(fault, start_s, processes) for fault in faults))


async def _slow_one(fault: SlowCpu, start_s: float, processes: Processes) -> None:
    await asyncio.sleep(start_s + fault.from_s - time.monotonic())
    asleep_s = (1.0 - fault.share) * fault.period_s
    try:
        while time.monotonic() < start_s + fault.until_s:
            await asyncio.sleep(fault.share * fault.period_s)
            processes.send_signal(fault.car, signal.SIGSTOP)
            await asyncio.sleep(asleep_s)
            processes.send_signal(fault.car, signal.SIGCONT)
    finally:
        processes.send_signal(fault.car, signal.SIGCONT)
