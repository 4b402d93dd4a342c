"""Test of the CAN bus, and of the ECU's answers."""

import asyncio
import contextlib

from onboard.errors import UserError
from onboard.kinematics.units import KM_H
from onboard.obd.can_bus import CanBus
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_signals
from onboard.obd.settings import CanSettings, ObdSettings
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import Speed
from onboard.tools.doctor.finding import Finding, FindingLevel

STEP_S = 0.01
"""Between two calls of the core."""

NO_BUS = (
    "plug the adapter in; `ip -details link show type can` lists the interfaces of the"
    " kernel, /etc/systemd/network/80-onboard-can.network starts it"
)
SILENT = (
    "switch the ignition on; check the bit rate (500K or 250K, in 80-onboard-can.network) and the"
    " wires (pins 6 and 14 of the OBD-II port)"
)
UNANSWERED = (
    "switch the ignition on; if it is on, the bus may be behind a gateway, or the vehicle needs"
    " `obd.addressing` or a DBC file (`obd.broadcast`)"
)


async def examine_bus(can: CanSettings, obd: ObdSettings, patience_s: float) -> list[Finding]:
    """Receive and request as the daemon does, until there is a speed.

    Args:
        can: the bus.
        obd: what to request.
        patience_s: time limit.

    Raises:
        UserError: the DBC file cannot be read.
    """
    loop = asyncio.get_running_loop()
    core = VehicleBus(obd, read_signals(obd.broadcast))
    frames = 0
    speed: Speed | None = None
    lost: list[str] = []

    def receive_frame(frame: CanFrame) -> None:
        nonlocal frames
        frames += 1
        core.receive_frame(frame, loop.time())

    bus = CanBus(can, receive_frame, lambda up, why: None if up else lost.append(why))
    try:
        bus.start(loop)
    except UserError as error:
        return [
            Finding("bus", FindingLevel.MISSING, str(error), NO_BUS),
            Finding("ECU", FindingLevel.MISSING, "not tested without a bus"),
        ]
    began_at = loop.time()
    with contextlib.closing(bus):
        while speed is None and loop.time() < began_at + patience_s:
            now = loop.time()
            core.handle_timer(now)
            for frame in core.frames_to_send(now):
                bus.send(frame)
            while (event := core.next_event()) is not None:
                speed = event if isinstance(event, Speed) else speed
            await asyncio.sleep(STEP_S)
    return [_bus(frames, loop.time() - began_at, lost), _ecu(speed, frames, patience_s)]


def _bus(frames: int, took_s: float, lost: list[str]) -> Finding:
    if lost:
        return Finding("bus", FindingLevel.MISSING, f"connection lost: {lost[0]}", NO_BUS)
    if frames == 0:
        return Finding("bus", FindingLevel.MISSING, f"open, but silent for {took_s:.1f} s", SILENT)
    return Finding("bus", FindingLevel.GOOD, f"{frames} frames in {took_s:.1f} s")


def _ecu(speed: Speed | None, frames: int, patience_s: float) -> Finding:
    if speed is None:
        advice = UNANSWERED if frames else SILENT
        return Finding("ECU", FindingLevel.MISSING, f"no speed in {patience_s:g} s", advice)
    return Finding(
        "ECU", FindingLevel.GOOD, f"{speed.speed_m_s / KM_H:.0f} km/h from {speed.source}"
    )
