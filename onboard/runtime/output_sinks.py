"""Who is told what a car does and has no say in it: journal, trace, capture, driver's page."""

import contextlib
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import structlog

from onboard.config import CarConfig, TraceSettings
from onboard.recorder.tap import Tap
from onboard.stack import Stack
from onboard.trace.trace_file import TraceFile
from onboard.trace.trace_line import Event, as_line, as_record
from onboard.wave_udp.capture import PcapWriter

if TYPE_CHECKING:
    from onboard.hmi.driver_page import DriverPage

log = structlog.get_logger()

LOGGED_KINDS = frozenset(
    {
        "transition",
        "warning",
        "alarm",
        "hard_brake",
        "sensor_lost",
        "sensor_recovered",
        "certificate_expired",
        "recorder",
    }
)
"""What an operator wants to read in the journal; the trace has the rest."""


class OutputSinks:
    """Of one car. Without file and page, only the journal."""

    def __init__(self) -> None:
        self._trace: TraceFile | None = None
        self._capture: PcapWriter | None = None
        self._page: DriverPage | None = None

    def open_files(self, settings: TraceSettings, wires: contextlib.AsyncExitStack) -> None:
        """Open trace and capture, until `wires` are closed.

        Raises:
            UserError: one of them cannot be made.
        """
        if settings.file is not None:
            self._trace = wires.enter_context(TraceFile(settings.file))
        if settings.capture is not None:
            self._capture = PcapWriter(wires.enter_context(TraceFile(settings.capture)))

    async def open_page(
        self,
        config: CarConfig,
        stack: Stack | Tap,
        on_brake: Callable[[None], None],
        wires: contextlib.AsyncExitStack,
    ) -> None:
        """Serve the driver's page, if the car has one, until `wires` are closed.

        Raises:
            UserError: its address cannot be had.
        """
        if config.hmi is None:
            return
        # A web server is a tenth of a start, and a box may have nobody who looks.
        from onboard.hmi.driver_page import DriverPage  # noqa: PLC0415 (said above)

        self._page = DriverPage(config.hmi, config, stack, on_brake)
        await self._page.start()
        wires.push_async_callback(self._page.close)

    def show(self, event: Event) -> None:
        """Anything that the stack says, or the daemon."""
        if self._page is not None:
            self._page.receive_event(event)
        if self._trace is not None:
            self._trace.write(as_line(event, traced_s=time.monotonic()).encode() + b"\n")
        if event.kind in LOGGED_KINDS:
            log.info(event.kind, details=as_record(event))

    def show_frame(self, wsm: bytes, sender_mac: bytes) -> None:
        """What goes over the radio."""
        if self._capture is not None:
            self._capture.write(wsm, time.time(), sender_mac)

    def show_view(self, now: float) -> None:
        """What the driver is to see, if it is time; called in every round."""
        if self._page is not None:
            self._page.show(now)
