"""The output sinks of the daemon, which no core reads: journal, files, page, live interface."""

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import structlog

from onboard.interface.event_server import EventServer
from onboard.interface.requests import MessageRequest
from onboard.interface.settings import InterfaceSettings
from onboard.recorder.build import present_build
from onboard.recorder.records import RecorderState
from onboard.replay.tap import Tap
from onboard.trace.file_failure import FileFailure, FileUse
from onboard.trace.trace_file import TraceFile
from onboard.trace.trace_line import Event, as_json, as_record, as_trace_record
from onboard.vehicle.config import CarConfig, TraceSettings
from onboard.vehicle.stack import Stack
from onboard.wave_udp.capture import PcapWriter

if TYPE_CHECKING:
    from onboard.runtime.driver_page import DriverPage

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
        "signer_ignored",
        "recorder",
    }
)
"""Kinds of events for the journal; the trace has all."""

FLUSH_S = 0.1
"""Time for which lines and frames gather: a write of each would be a quarter of the loop's work."""


class OutputSinks:
    """The output sinks of one vehicle: the journal and, if configured, the others."""

    def __init__(self) -> None:
        """Start with the journal only."""
        self._files: list[TraceFile] = []
        self._flushed_at = -math.inf
        self._trace: TraceFile | None = None
        self._capture: PcapWriter | None = None
        self._page: DriverPage | None = None
        self._interface: EventServer | None = None
        self._before_page: list[Event] = []
        """What the page is to show of the time before it is open."""

    def open_files(self, settings: TraceSettings, edges: contextlib.AsyncExitStack) -> None:
        """Open trace and capture, until `edges` are closed; one that cannot be created fails."""
        self._trace = self._opened(FileUse.TRACE, settings.file, edges)
        capture = self._opened(FileUse.CAPTURE, settings.capture, edges)
        self._capture = None if capture is None else PcapWriter(capture)

    def _opened(
        self, use: FileUse, path: Path | None, edges: contextlib.AsyncExitStack
    ) -> TraceFile | None:
        if path is None:
            return None
        try:
            file = edges.enter_context(TraceFile(path, partial(self.report_failure, use)))
        except OSError as error:
            self.report_failure(use, f"{path}: {error.strerror}")
            return None
        self._files.append(file)
        return file

    def report_failure(self, use: FileUse, reason: str) -> None:
        """Report a file that cannot be written; the vehicle drives on without it."""
        log.error("file failed", use=use.value, reason=reason)
        self.show(FileFailure(time.monotonic(), use, reason))

    async def open_page(
        self,
        config: CarConfig,
        stack: Stack | Tap,
        on_brake: Callable[[None], None],
        edges: contextlib.AsyncExitStack,
    ) -> None:
        """Serve the driver's page, if it is configured, until `edges` are closed.

        Args:
            config: address of the page, and which sensors there are.
            stack: where the page reads the group and the perceived objects.
            on_brake: called when the page's brake button is pressed.
            edges: closes the page.

        Raises:
            UserError: its address cannot be opened.
        """
        if config.hmi is None:
            return
        # Importing the web server takes a tenth of the start-up time.
        from onboard.runtime.driver_page import DriverPage  # noqa: PLC0415 (see above)

        self._page = DriverPage(config.hmi, config, stack, on_brake)
        await self._page.start()
        edges.push_async_callback(self._page.close)
        for event in self._before_page:
            self._page.receive_event(event)

    async def open_interface(
        self,
        settings: InterfaceSettings | None,
        on_brake: Callable[[None], None],
        on_object_list: Callable[[bytes], None],
        on_message: Callable[[MessageRequest], None],
        edges: contextlib.AsyncExitStack,
    ) -> None:
        """Serve events to other programs, if that is configured, until `edges` are closed.

        Args:
            settings: port, and what the programs may send.
            on_brake: called when one of them presses the brake button.
            on_object_list: called with what one of them detects.
            on_message: called with what one of them has the vehicle send.
            edges: closes the server.

        Raises:
            UserError: its port cannot be opened.
        """
        if settings is not None:
            build = present_build().name
            server = EventServer(
                settings, build, lambda: on_brake(None), on_object_list, on_message
            )
            await server.start()
            edges.push_async_callback(server.close)
            self._interface = server

    def show(self, event: Event) -> None:
        """Show and write an event that no step has put out."""
        if self._page is not None:
            self._page.receive_event(event)
        elif isinstance(event, FileFailure | RecorderState):
            self._before_page.append(event)
        self._write(event)

    def show_step(self, events: Sequence[Event], now: float) -> None:
        """Show the driver what a step has put out, and a view if one is due; then write it.

        What is written is in the files after `FLUSH_S`, by a step of then.
        """
        if self._page is not None:
            self._page.receive_events(events)
            self._page.show(now)
        for event in events:
            self._write(event)
        if now - self._flushed_at >= FLUSH_S:
            self._flushed_at = now
            for file in self._files:
                file.flush()

    def _write(self, event: Event) -> None:
        """Write an event to trace, live interface and journal."""
        is_read = self._interface is not None and self._interface.wants(event.kind)
        if self._trace is not None or is_read:
            record = as_trace_record(event) | {"traced_s": time.monotonic()}
            line = as_json(record).encode() + b"\n"
            if self._trace is not None:
                self._trace.write(line)
            if self._interface is not None and is_read:
                self._interface.publish(event.kind, line)
        if event.kind in LOGGED_KINDS:
            is_fault = isinstance(event, RecorderState) and not event.is_recording
            report = log.error if is_fault else log.info
            report(event.kind, details=as_record(event))

    def show_frame(self, wsm: bytes, sender_mac: bytes) -> None:
        """Write a WSM that was sent or received to the capture."""
        if self._capture is not None:
            self._capture.write(wsm, time.time(), sender_mac)
