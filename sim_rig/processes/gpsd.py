"""Runs a gpsd for each car of a live run, with a simulated receiver as its UDP source."""

import shutil

from sim_rig.processes.processes import ProcessError, Processes

_SYSTEM_FOLDERS = "/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin"


def gpsd_program() -> str | None:
    """Path of gpsd on this machine; `None` if it is not installed."""
    return shutil.which("gpsd", path=_SYSTEM_FOLDERS)


async def start_gpsd(processes: Processes, car: str, port: int, nmea_port: int) -> None:
    """Start the gpsd of one car.

    Args:
        processes: where it becomes a child process.
        car: name of the car.
        port: TCP port for gpsd's clients.
        nmea_port: UDP port for the NMEA sentences of the receiver.

    Raises:
        ProcessError: gpsd is not installed.
    """
    program = gpsd_program()
    if program is None:
        raise ProcessError("gpsd is not installed (Debian: gpsd); --virtual needs none")
    device = f"udp://127.0.0.1:{nmea_port}"
    await processes.start_program(f"{car}_gpsd", program, "-N", "-n", "-S", str(port), device)
