"""Power cuts of a run: when they are made, and what a trace has of them."""

import asyncio
import time
from collections.abc import Sequence
from typing import Protocol

from sim_rig.run_log.run_log import Record
from sim_rig.scenario.faults import PowerCut
from sim_rig.scenario.schema import Scenario


class PowerSwitch(Protocol):
    """Power of the computer of one car."""

    async def cut(self) -> None:
        """Switch it off, in the midst of its work."""

    async def restore(self) -> None:
        """Switch it on."""


async def cut_power(fault: PowerCut, switch: PowerSwitch, start_s: float, end_s: float) -> None:
    """Cut the power of one car, and restore it by `end_s`, also when cancelled.

    Args:
        fault: when.
        switch: of its car.
        start_s: monotonic time of the start of the scenario, s.
        end_s: monotonic time of the end of the run, s.
    """
    await asyncio.sleep(start_s + fault.from_s - time.monotonic())
    try:
        await switch.cut()
        await asyncio.sleep(min(start_s + fault.until_s, end_s) - time.monotonic())
    finally:
        await switch.restore()


def with_power_cuts(
    trace: Sequence[Record], scenario: Scenario, car: str, start_s: float
) -> list[Record]:
    """Return a trace with what each power cut ends: the car's group and its hard braking.

    Args:
        trace: of `car`, in order of time.
        scenario: the scenario of the run.
        car: name of the car.
        start_s: stamp of the start of the scenario, s.
    """
    records = list(trace)
    for fault in scenario.power_cuts():
        if fault.car == car:
            # At its end again: a box may take a while to lose its power.
            for at_s in (fault.from_s, fault.until_s):
                _add_start(records, start_s + at_s, car)
    return records


def _add_start(records: list[Record], stamp_s: float, car: str) -> None:
    """Insert at `stamp_s` what a daemon is in when it starts: no group, and no hard braking."""
    place = next((n for n, each in enumerate(records) if each["stamp_s"] >= stamp_s), len(records))
    braking = [each for each in records[:place] if each["kind"] == "hard_brake"][-1:]
    ends = [{**each, "stamp_s": stamp_s, "is_over": True} for each in braking]
    regular = {
        "stamp_s": stamp_s,
        "kind": "transition",
        "state": "regular",
        "group_number": 1,
        "leader_id": car,
        "event": "power_cut",
        "cause": "fault",
    }
    records[place:place] = [*(each for each in ends if not braking[0]["is_over"]), regular]
