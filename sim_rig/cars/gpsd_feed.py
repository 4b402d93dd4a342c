"""The GNSS receivers of a live run: each feeds a gpsd of its own, by UDP on 127.0.0.1."""

import asyncio
import contextlib
import shutil
import socket
import time

from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.processes import ProcessError, Processes

_SYSTEM_FOLDERS = "/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin"


def gpsd_program() -> str | None:
    """Where gpsd is on this machine; `None` if it is not installed."""
    return shutil.which("gpsd", path=_SYSTEM_FOLDERS)


class GpsdFeed:
    """One car's receiver and its gpsd."""

    def __init__(self, receiver: GnssReceiver, nmea_port: int) -> None:
        self._receiver = receiver
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._line.setblocking(False)
        self._line.connect(("127.0.0.1", nmea_port))
        self._timer: asyncio.TimerHandle | None = None

    @staticmethod
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

    def begin(self) -> None:
        """Send from now on."""
        self._receiver.skip_to(time.monotonic())
        self._arm()

    def close(self) -> None:
        """Switch the receiver off."""
        if self._timer is not None:
            self._timer.cancel()
        self._line.close()

    def _arm(self) -> None:
        loop = asyncio.get_running_loop()
        self._timer = loop.call_at(self._receiver.get_timer(), self._send)

    def _send(self) -> None:
        while (at := self._receiver.get_timer()) <= time.monotonic():
            data = self._receiver.bytes_to_send(at)
            if data:
                # A gpsd that is not up yet hears nothing.
                with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
                    self._line.send(data)
        self._arm()
