"""What an operator counts, in Prometheus' exposition format."""

from functools import partial

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    ProcessCollector,
    disable_created_metrics,
    generate_latest,
)
from prometheus_client.exposition import CONTENT_TYPE_LATEST

from onboard.lcca.events import Transition
from onboard.lcca.transitions import GroupState
from onboard.observations import Discarded, Lead, Sensor, SensorLost, SensorRecovered, Speed
from onboard.recorder.records import RecorderState
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.trace.trace_line import Event
from onboard.wave_link import MessageReceived, MessageSent

_DELAY_BUCKETS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)


class Metrics:
    """Counts what the stack says. Each car has a registry of its own."""

    def __init__(self, sensors: frozenset[Sensor]) -> None:
        """`sensors`: those that the car has."""
        disable_created_metrics()  # type: ignore[no-untyped-call]  # it says nothing of its types
        self._registry = registry = CollectorRegistry()
        counter, gauge = partial(Counter, registry=registry), partial(Gauge, registry=registry)
        delay = partial(Histogram, registry=registry, buckets=_DELAY_BUCKETS_S)
        ProcessCollector(registry=registry)
        self._events = counter("onboard_events", "What the cores said, by kind.", ["kind"])
        self._discarded = counter(
            "onboard_discarded",
            "What came from outside and was not believed.",
            ["component", "reason"],
        )
        self._sent = counter("onboard_sent", "Group messages handed to the radio.", ["message"])
        self._received = counter("onboard_received", "Group messages opened.", ["message"])
        self._alarms = counter("onboard_alarms", "Alarms that began or rose.", ["cause", "level"])
        self._alarm_level = gauge("onboard_alarm_level", "0 none, 1 caution, 2 warning.", ["cause"])
        self._sensor_up = gauge("onboard_sensor_up", "1, or 0 while it is lost.", ["sensor"])
        self._state = gauge("onboard_group_state", "1 for the state that holds.", ["state"])
        self._number = gauge("onboard_group_number", "1 unless a member.")
        self._speed = gauge("onboard_speed_metres_per_second", "Own speed; NaN while lost.")
        self._gap = gauge("onboard_gap_metres", "To the car ahead; NaN without one.")
        self._recording = gauge(
            "onboard_recording", "1, or 0 while the black box does not; NaN without one."
        )
        self._notes_lost = gauge(
            "onboard_notes_lost", "Notes that the black box has lost since the start."
        )
        self._loop_delay = delay(
            "onboard_loop_delay_seconds",
            "How late the loop comes to what is due, sampled ten times a second.",
        )
        self._pages = gauge("onboard_pages", "Driver's pages that are open.")
        self._shown = delay(
            "onboard_page_shown_seconds",
            "From a view's being pushed to the page's word that it is shown.",
        )
        self._refused = counter("onboard_page_refused", "Who was not let in, and why.", ["reason"])
        for sensor in sensors:
            self._sensor_up.labels(sensor.value).set(1)
        for cause in Cause:
            self._alarm_level.labels(cause.value).set(0)
        for unknown in (self._gap, self._speed, self._recording):
            unknown.set(float("nan"))
        self._number.set(1)
        self._enter(GroupState.REGULAR)

    def receive_event(self, event: Event) -> None:
        """Anything that the stack says."""
        self._events.labels(event.kind).inc()
        match event:
            case Discarded():
                self._discarded.labels(event.component, event.reason).inc()
            case MessageSent():
                self._sent.labels(event.message).inc()
            case MessageReceived():
                self._received.labels(event.message).inc()
            case Alarm():
                self._alarm_level.labels(event.cause.value).set(event.level.rank)
                if event.level is not Level.NONE:
                    self._alarms.labels(event.cause.value, event.level.value).inc()
            case SensorRecovered():
                self._sensor_up.labels(event.sensor.value).set(1)
            case SensorLost():
                self._sensor_up.labels(event.sensor.value).set(0)
                self._forget(event.sensor)
            case Transition():
                self._enter(event.state)
                self._number.set(event.group_number)
            case RecorderState():
                self._recording.set(event.is_recording)
                self._notes_lost.set(event.dropped)
            case Speed():
                self._speed.set(event.speed_m_s)
            case Lead():
                self._gap.set(float("nan") if event.gap_m is None else event.gap_m)

    def loop_delay(self, delay_s: float) -> None:
        """The loop came so late."""
        self._loop_delay.observe(delay_s)

    def pages(self, count: int) -> None:
        """So many pages are open."""
        self._pages.set(count)

    def shown(self, delay_s: float) -> None:
        """A page has shown a view so long after it was pushed."""
        self._shown.observe(delay_s)

    def refused(self, reason: str) -> None:
        """Somebody was not let in."""
        self._refused.labels(reason).inc()

    def exposition(self) -> tuple[bytes, str]:
        """All of it as text, and its content type."""
        return generate_latest(self._registry), CONTENT_TYPE_LATEST

    def _forget(self, sensor: Sensor) -> None:
        """The last value of a sensor that is lost is not the present one."""
        match sensor:
            case Sensor.SPEED:
                self._speed.set(float("nan"))
            case Sensor.CAMERA:
                self._gap.set(float("nan"))

    def _enter(self, state: GroupState) -> None:
        for each in GroupState:
            self._state.labels(each.value).set(each is state)
