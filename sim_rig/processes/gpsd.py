"""The gpsd of each car of a live run, which a receiver of the rig feeds by UDP."""

import shutil

from sim_rig.processes.processes import ProcessError, Processes

_SYSTEM_FOLDERS = "/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin"


def gpsd_program() -> str | None:
    """Where gpsd is on this machine; `None` if it is not installed."""
    return shutil.which("gpsd", path=_SYSTEM_FOLDERS)


async def start_gpsd(processes: Processes, car: str, port: int, nmea_port: int) -> None:
    """Have gpsd serve on `port` what comes to it on `nmea_port`.

    Raises:
        ProcessError: it is not installed.
    """
    program = gpsd_program()
    if program is None:
        raise ProcessError("gpsd is not installed (Debian: gpsd); --virtual does without it")
    device = f"udp://127.0.0.1:{nmea_port}"
    await processes.start_program(f"{car}_gpsd", program, "-N", "-n", "-S", str(port), device)
