"""Plays a drive on the wires of a box in real time, and notes how late the rig was."""

import asyncio
import time
from collections.abc import Iterator, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

from sim_rig.boxes.awaited_answers import AwaitedAnswers
from sim_rig.boxes.box_computer import BoxComputer
from sim_rig.boxes.box_log import FLUSHED_AFTER_S
from sim_rig.boxes.contact import BoxNotReadyError
from sim_rig.boxes.played_drive import PlayedDrive, PlayedInput, Wire
from sim_rig.boxes.played_wires import PlayedWires
from sim_rig.boxes.settings import BoxSettings
from sim_rig.run_log.lateness import Lateness, LatenessLine

_BEGIN_S = 1.0
"""From the setting of the box's clock to the first input."""
_RESTARTED_WITHIN_S = 5.0
"""Time for a `start` that restarts a service: what uses the wires before is the old daemon."""
_EXTRA_S = 0.5
"""Time after the last input, for what is in transit."""
_AHEAD = 64
"""Inputs that are read while those before them are played."""
_FIRST = 1000
"""First inputs that are kept, to find the start of the drive in the box's recording."""
_KINDS: dict[Wire, str] = {
    "bus": "CAN frame",
    "radio": "WSM",
    "satellites": "fix",
    "camera": "picture",
    "detector": "detection",
}
"""What is on each wire, as `Lateness` names it."""


@dataclass(frozen=True, slots=True)
class Played:
    """What was played."""

    first: Sequence[PlayedInput]
    """The first inputs."""
    until_s: float
    """How long the drive was played."""
    lateness: Sequence[LatenessLine]
    unasked: int
    """Answers in the drive to questions that the box has not asked; they were not played."""
    why_not_copied: str | None
    """Why there is no recording of the box; `None` if there is one."""


async def play(
    drive: PlayedDrive, car: str, box: BoxSettings, folder: Path, seconds: float
) -> Played:
    """Start the box, play a drive, and copy the box's recording.

    Args:
        drive: the drive.
        car: name of the box.
        box: its file.
        folder: for the output of its `start`.
        seconds: how much is played at most; `math.inf` for all.

    Raises:
        BoxNotReadyError: the box does not use the wires of the drive in time.
        UserError: a wire cannot be opened, a command fails, or the drive cannot be read.
    """
    computer = BoxComputer(car, box, folder)
    wires = PlayedWires()
    async with AsyncExitStack() as edges:
        await wires.open(car, box, edges)
        edges.push_async_callback(computer.stop)
        if drive.start_utc_s is not None:  # the pseudonyms of the box change as the drive's
            await computer.set_clock(drive.start_utc_s - drive.before_s)
        await computer.start()
        await _until_ready(wires, drive, car, box, computer)
        start_s = time.monotonic() + _BEGIN_S
        if drive.start_utc_s is not None:
            await computer.set_clock(drive.start_utc_s - (start_s - time.monotonic()))
        lateness = Lateness()
        inputs = (each for each in drive.inputs() if each.at_s <= seconds)
        answers = AwaitedAnswers(drive.own_ids if "camera" in drive.wires else ())
        wires.on_wsm = partial(_answer, answers, wires)
        first, until_s = await _play(inputs, wires, answers, start_s, lateness)
        await asyncio.sleep(_EXTRA_S + FLUSHED_AFTER_S)
        why_not_copied = await computer.finish()
    return Played(first, until_s, tuple(lateness.lines()), answers.waiting, why_not_copied)


def _answer(answers: AwaitedAnswers, wires: PlayedWires, wsm: bytes) -> None:
    for each in answers.receive_wsm(wsm):
        wires.send(each)


async def _until_ready(
    wires: PlayedWires, drive: PlayedDrive, car: str, box: BoxSettings, computer: BoxComputer
) -> None:
    began_at = time.monotonic()
    give_up_at = began_at + box.ready_within_s
    while computer.is_starting and time.monotonic() < began_at + _RESTARTED_WITHIN_S:
        await asyncio.sleep(0.1)
    wires.forget_use()
    while unused := wires.unused(drive.wires):
        if time.monotonic() > give_up_at:
            raise BoxNotReadyError(
                f"{car}: the box is not ready after {box.ready_within_s:g} s:"
                f" it does not use {', '.join(unused)}"
            )
        computer.check()
        await asyncio.sleep(0.1)


async def _play(
    inputs: Iterator[PlayedInput],
    wires: PlayedWires,
    answers: AwaitedAnswers,
    start_s: float,
    lateness: Lateness,
) -> tuple[list[PlayedInput], float]:
    """Return the first inputs, and the time of the last one in the drive, s."""
    first: list[PlayedInput] = []
    until_s = 0.0
    some = await asyncio.to_thread(_some_of, inputs)
    while some:
        following = asyncio.create_task(asyncio.to_thread(_some_of, inputs))
        for each in some:
            at = start_s + each.at_s
            if (wait_s := at - time.monotonic()) > 0.0:
                await asyncio.sleep(wait_s)
            if not answers.hold(each):
                wires.send(each)
            lateness.note(_KINDS[each.wire], time.monotonic() - at)
            until_s = each.at_s
        first += some[: max(0, _FIRST - len(first))]
        some = await following
    return first, until_s


def _some_of(inputs: Iterator[PlayedInput]) -> list[PlayedInput]:
    """Read ahead; in a thread, since pictures are decoded."""
    return list(islice(inputs, _AHEAD))
