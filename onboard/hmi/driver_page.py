"""The driver's page of one car: the display, the metrics and the server, held against its stack."""

from collections.abc import Callable

from onboard.config import CarConfig
from onboard.hmi.display import Display
from onboard.hmi.metrics import Metrics
from onboard.hmi.page_server import PageServer
from onboard.hmi.settings import HmiSettings
from onboard.recorder.tap import Tap
from onboard.stack import Stack
from onboard.trace.trace_line import Event, as_line


class DriverPage:
    """Told what the stack says, it keeps every page up to date."""

    def __init__(
        self,
        settings: HmiSettings,
        config: CarConfig,
        stack: Stack | Tap,
        on_brake: Callable[[None], None],
    ) -> None:
        self._stack = stack
        self._display = Display(
            sensors=config.sensors(),
            speed_held_s=config.sensor_timeouts.speed_s,
            lead_held_s=config.sensor_timeouts.camera_s,
            safe_headway_s=config.lcca.join_headway_s,
            length_m=config.car.length_m,
            brake_button=settings.brake_button,
        )
        self._metrics = Metrics(config.sensors())
        self._server = PageServer(settings, self._metrics, lambda: on_brake(None))

    async def start(self) -> None:
        """Listen.

        Raises:
            UserError: the address cannot be had.
        """
        await self._server.start()

    async def close(self) -> None:
        """Say goodbye to every page."""
        await self._server.close()

    def receive_event(self, event: Event) -> None:
        """Anything that the stack says."""
        self._metrics.receive_event(event)
        self._display.receive_surroundings(*self._stack.surroundings)
        self._display.receive_event(event)

    def show(self, now: float) -> None:
        """Push a view if one is due and anybody looks; to be called in every round."""
        if not self._server.has_readers:
            return
        self._display.receive_surroundings(*self._stack.surroundings)
        view = self._display.view_to_show(self._stack.group, now)
        if view is not None:
            self._server.publish(as_line(view))
