"""Metrics for an operator, in Prometheus' exposition format."""

from dataclasses import asdict
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
from onboard.messages.exchanged import MessageReceived, MessageSent
from onboard.observations import Discarded, Lead, Sensor, SensorLost, SensorRecovered, Speed
from onboard.recorder.build import Build
from onboard.recorder.records import RecorderState
from onboard.risk import alarm_table
from onboard.risk.alarm import Alarm, AlarmKey, Level
from onboard.trace.file_failure import FileFailure
from onboard.trace.trace_line import Event

_DELAY_BUCKETS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)


class Metrics:
    """Metrics of one vehicle, in a registry of its own."""

    def __init__(self, sensors: frozenset[Sensor], build: Build) -> None:
        """Start all counters at 0.

        Args:
            sensors: the configured ones.
            build: of this program.
        """
        disable_created_metrics()  # type: ignore[no-untyped-call]  # untyped upstream
        self._registry = registry = CollectorRegistry()
        counter, gauge = partial(Counter, registry=registry), partial(Gauge, registry=registry)
        delay = partial(Histogram, registry=registry, buckets=_DELAY_BUCKETS_S)
        ProcessCollector(registry=registry)
        origin = asdict(build) | {"is_modified": str(build.is_modified).lower()}
        gauge("onboard_build_info", "1, with the build of this program.", list(origin)).labels(
            **origin
        ).set(1)
        self._events = counter("onboard_events", "Events of the cores.", ["kind"])
        self._discarded = counter(
            "onboard_discarded",
            "Inputs from outside that were discarded.",
            ["component", "reason"],
        )
        self._messages_sent = counter(
            "onboard_messages_sent", "Group messages passed to the radio.", ["message"]
        )
        self._messages_received = counter(
            "onboard_messages_received", "Group messages that were accepted.", ["message"]
        )
        self._alarms = counter("onboard_alarms", "Alarms raised to this level.", ["cause", "level"])
        self._alarm_level = gauge(
            "onboard_alarm_level",
            "Level of the most urgent alarm: 0 none, 1 caution, 2 warning.",
            ["cause"],
        )
        self._sensor_up = gauge(
            "onboard_sensor_up", "1 while the sensor works, 0 while it is lost.", ["sensor"]
        )
        self._state = gauge("onboard_group_state", "1 for the present group state.", ["state"])
        self._group_number = gauge("onboard_group_number", "Group number; 1 without a group.")
        self._speed = gauge(
            "onboard_speed_metres_per_second", "Speed of the vehicle; NaN while lost."
        )
        self._gap = gauge("onboard_gap_metres", "Gap to the lead vehicle; NaN without one.")
        self._recording = gauge(
            "onboard_recording", "1 while the black box records, else 0; NaN without a black box."
        )
        self._records_lost = gauge(
            "onboard_records_lost", "Records that the black box could not write since the start."
        )
        self._file_failed = gauge(
            "onboard_file_failed", "1 for a file that is to be written and cannot be.", ["use"]
        )
        self._loop_delay = delay(
            "onboard_loop_delay_seconds",
            "Delay of timers of the daemon's loop, sampled ten times a second.",
        )
        self._pages = gauge("onboard_pages", "Open driver's pages.")
        self._page_delay = delay(
            "onboard_page_shown_seconds",
            "Time from sending a view to the page's confirmation that it is drawn.",
        )
        self._refused = counter("onboard_page_refused", "Requests that were refused.", ["reason"])
        for sensor in sensors:
            self._sensor_up.labels(sensor.value).set(1)
        for row in alarm_table.ALARMS:
            self._alarm_level.labels(row.cause).set(0)
        self._counters: dict[str, Counter] = {}
        self._present_alarms: dict[AlarmKey, Level] = {}
        """By cause and vehicle."""
        for value in (self._gap, self._speed, self._recording):
            value.set(float("nan"))
        self._group_number.set(1)
        self._set_state(GroupState.REGULAR)

    def receive_event(self, event: Event) -> None:
        """Count an event of the stack."""
        self._counter_of(event.kind).inc()
        match event:
            case Discarded():
                self._discarded.labels(event.component, event.reason).inc()
            case MessageSent():
                self._messages_sent.labels(event.message).inc()
            case MessageReceived():
                self._messages_received.labels(event.message).inc()
            case Alarm():
                self._set_alarm_level(event)
                if event.level is not Level.NONE:
                    self._alarms.labels(event.cause, event.level.value).inc()
            case SensorRecovered():
                self._sensor_up.labels(event.sensor.value).set(1)
            case SensorLost():
                self._sensor_up.labels(event.sensor.value).set(0)
                self._clear(event.sensor)
            case Transition():
                self._set_state(event.state)
                self._group_number.set(event.group_number)
            case RecorderState() | FileFailure():
                self._receive_storage(event)
            case Speed():
                self._speed.set(event.speed_m_s)
            case Lead():
                self._gap.set(float("nan") if event.gap_m is None else event.gap_m)

    def _counter_of(self, kind: str) -> Counter:
        """Return the counter of a kind of events, whose look-up by its label takes longer."""
        counter = self._counters.get(kind)
        if counter is None:
            counter = self._counters[kind] = self._events.labels(kind)
        return counter

    def _receive_storage(self, event: RecorderState | FileFailure) -> None:
        if isinstance(event, FileFailure):
            self._file_failed.labels(event.use.value).set(1)
        else:
            self._recording.set(event.is_recording)
            self._records_lost.set(event.dropped)

    def observe_loop_delay(self, delay_s: float) -> None:
        """Count one delay of a timer of the loop."""
        self._loop_delay.observe(delay_s)

    def set_open_pages(self, count: int) -> None:
        """Set the number of open pages."""
        self._pages.set(count)

    def observe_page_delay(self, delay_s: float) -> None:
        """Count one time from sending a view to its confirmation."""
        self._page_delay.observe(delay_s)

    def count_refusal(self, reason: str) -> None:
        """Count one refused request."""
        self._refused.labels(reason).inc()

    def exposition(self) -> tuple[bytes, str]:
        """Return all metrics as text, and its content type."""
        return generate_latest(self._registry), CONTENT_TYPE_LATEST

    def _set_alarm_level(self, alarm: Alarm) -> None:
        """Set the level of the cause to that of its most urgent alarm."""
        self._present_alarms[alarm.cause, alarm.vehicle] = alarm.level
        if alarm.level is Level.NONE:
            del self._present_alarms[alarm.cause, alarm.vehicle]
        ranks = (
            level.rank for (cause, _), level in self._present_alarms.items() if cause == alarm.cause
        )
        self._alarm_level.labels(alarm.cause).set(max(ranks, default=0))

    def _clear(self, sensor: Sensor) -> None:
        """Drop the last value of a lost sensor, which is not the present one."""
        match sensor:
            case Sensor.SPEED:
                self._speed.set(float("nan"))
            case Sensor.CAMERA:
                self._gap.set(float("nan"))

    def _set_state(self, state: GroupState) -> None:
        for each in GroupState:
            self._state.labels(each.value).set(each is state)
