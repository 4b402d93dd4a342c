"""The driver's page of one vehicle: display, metrics and server, connected to its stack."""

from collections.abc import Callable, Sequence

from onboard.hmi.display import Display
from onboard.hmi.metrics import Metrics
from onboard.hmi.page_server import PageServer
from onboard.hmi.settings import HmiSettings
from onboard.recorder.build import present_build
from onboard.replay.tap import Tap
from onboard.trace.trace_line import Event, as_line
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack


class DriverPage:
    """Updates metrics and open pages with the events of the stack."""

    def __init__(
        self,
        settings: HmiSettings,
        config: CarConfig,
        stack: Stack | Tap,
        on_brake: Callable[[None], None],
    ) -> None:
        """Build the page; nothing is served yet.

        Args:
            settings: where the page is served.
            config: which sensors there are, their timeouts, and the safety distance.
            stack: where the group and the perceived objects are read.
            on_brake: called when the page's brake button is pressed.
        """
        self._stack = stack
        self._display = Display(
            sensors=config.sensors(),
            speed_timeout_s=config.sensor_timeouts.speed_s,
            lead_timeout_s=config.sensor_timeouts.camera_s,
            safe_headway_s=config.lcca.join_headway_s,
            length_m=config.car.length_m,
            brake_button=settings.brake_button,
        )
        self._metrics = Metrics(config.sensors(), present_build())
        self._server = PageServer(
            settings,
            self._metrics,
            lambda: on_brake(None),
            config.recorder.folder if config.recorder is not None else None,
        )

    async def start(self) -> None:
        """Listen.

        Raises:
            UserError: the address cannot be opened.
        """
        await self._server.start()

    async def close(self) -> None:
        """Close all pages and stop listening."""
        await self._server.close()

    def receive_event(self, event: Event) -> None:
        """Update metrics and display by an event of the stack."""
        self.receive_events((event,))

    def receive_events(self, events: Sequence[Event]) -> None:
        """Update metrics and display by the events of a step."""
        if events:
            self._display.receive_surroundings(*self._stack.surroundings)
        for event in events:
            self._metrics.receive_event(event)
            self._display.receive_event(event)

    def show(self, now: float) -> None:
        """Push a view if one is due and a page is open; to be called in every step."""
        if not self._server.has_pages:
            return
        self._display.receive_surroundings(*self._stack.surroundings)
        view = self._display.view_to_show(
            self._stack.group, self._stack.identification.identity, now
        )
        if view is not None:
            self._server.publish(as_line(view))
