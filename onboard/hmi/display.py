"""Turns the events of the stack into views of the driver's page: the core, without I/O.

Changes of alarms, of the group, of the lead's identity and of lost sensors are shown at once, all
else five times a second, which is as fast as a number can be read.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.hmi.driver_view import (
    AlarmView,
    BrakeRequestView,
    Direction,
    DriverView,
    GroupStatus,
    LeadView,
    SensorView,
    VehicleOnMap,
    short_id,
)
from onboard.hmi.group_view import GroupView
from onboard.hmi.vehicle_map import VehicleMap
from onboard.lcca.events import Inquired, WarningLevel, WarningRaised
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import CarIdentity
from onboard.observations import (
    BrakeCause,
    DetectionList,
    Impairment,
    Lead,
    LeadIdentity,
    Sensor,
    SensorImpaired,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.recorder.records import RecorderState
from onboard.risk.alarm import Alarm, AlarmKey, Level
from onboard.risk.alarm_table import Sign, row_of
from onboard.risk.lcca_warning import LCCA
from onboard.trace.file_failure import FileFailure, FileUse
from onboard.trace.trace_line import Event
from onboard.tracking.perceived_object import PerceivedObject

SHOW_S = 0.2
"""Between two views without an urgent event."""
_URGENT = frozenset({
    "alarm", "file_failure", "identified", "identity_lost", "recorder", "sensor_impaired",
    "sensor_lost", "sensor_recovered", "transition",
})  # fmt: skip
"""Kinds of events that are shown at once."""
_LCCA: AlarmKey = LCCA, ""
_SAME_VEHICLE_M = 5.0
"""Largest distance along the lane at which a vehicle on the map is the lead vehicle."""
_HALF_LANE_M = 1.9
"""Largest lateral distance of a vehicle in the host vehicle's lane: half of the widest lanes."""


class Display:
    """The driver's page."""

    def __init__(
        self,
        *,
        sensors: Iterable[Sensor],
        speed_timeout_s: float,
        lead_timeout_s: float,
        safe_headway_s: float,
        length_m: float,
        brake_button: bool = False,
    ) -> None:
        """Start without any data.

        Args:
            sensors: the configured ones.
            speed_timeout_s: age up to which a speed is shown.
            lead_timeout_s: age up to which a lead is shown.
            safe_headway_s: safety distance, as headway.
            length_m: length of the host vehicle.
            brake_button: whether the page has the button that simulates hard braking.
        """
        self._lost: dict[Sensor, str | None] = dict.fromkeys(sorted(sensors))
        self._impaired: dict[Sensor, tuple[Impairment, ...]] = {}
        self._speed_timeout_s = speed_timeout_s
        self._lead_timeout_s = lead_timeout_s
        self._safe_headway_s = safe_headway_s
        self._length_m = length_m
        self._brake_button = brake_button
        self._map = VehicleMap(length_m)
        self._group_view = GroupView()
        self._speed: Speed | None = None
        self._lead: Lead | None = None
        self._detections: list[VehicleDetection] = []
        self._objects: Sequence[PerceivedObject] = ()
        self._inquired: Inquired | None = None
        self._warning: WarningRaised | None = None
        self._alarms: dict[AlarmKey, AlarmView] = {}
        self._in_alarm: dict[AlarmKey, frozenset[str]] = {}
        """Names of the objects that each alarm is about."""
        self._brake_request: BrakeRequest | None = None
        self._recorder_failure: str | None = None
        self._failed_files: dict[FileUse, FileFailure] = {}
        self._show_at = -math.inf

    def receive_event(self, event: Event) -> None:
        """Update the page by an event of the stack."""
        self._group_view.receive_event(event)
        match event:
            case Speed():
                self._speed = event
            case Lead():
                self._lead = event
            case VehicleDetection():
                if self._detections and self._detections[0].stamp_s != event.stamp_s:
                    self._detections.clear()
                self._detections.append(event)
            case DetectionList():
                self._detections = list(event.cars)
            case SensorLost() | SensorRecovered() | SensorImpaired():
                self._receive_sensor(event)
            case Inquired():
                self._inquired = event
            case WarningRaised() | WarningLevel():
                self._receive_warning(event)
            case Alarm():
                self._receive_alarm(event)
            case BrakeRequest() | FileFailure() | RecorderState():
                self._receive_state(event)
        if event.kind in _URGENT:
            self._show_at = -math.inf

    def receive_surroundings(
        self, host: PerceivedObject | None, objects: Sequence[PerceivedObject]
    ) -> None:
        """Store the host vehicle, `None` without a position, and the other perceived objects."""
        self._map.receive_host_vehicle(host)
        self._objects = objects

    def view_to_show(
        self, group: WarningGroup, identity: CarIdentity | None, now: float
    ) -> DriverView | None:
        """Return a view if one is due.

        Args:
            group: of the host vehicle.
            identity: of the lead, if it is identified.
            now: time of the view in s.
        """
        if now < self._show_at:
            return None
        self._show_at = now + SHOW_S
        return DriverView(
            stamp_s=now,
            group=GroupStatus(
                group.state,
                group.group_number,
                short_id(group.leader_id.hex()),
                len(group.followers),
            ),
            members=self._group_view.members(group, now),
            messages=self._group_view.messages(now),
            speed_m_s=self._speed_m_s(now),
            lead=self._lead_view(identity, now),
            vehicles=tuple(self._vehicles(now)),
            alarms=tuple(sorted(self._alarms.values(), key=_urgency)),
            brake_request=self._present_request(now),
            sensors=tuple(
                SensorView(sensor, reason is not None, reason, self._impaired.get(sensor, ()))
                for sensor, reason in self._lost.items()
            ),
            recorder_failure=self._recorder_failure,
            failed_files=tuple(self._failed_files.values()),
            brake_button=self._brake_button,
        )

    def _receive_sensor(self, event: SensorLost | SensorRecovered | SensorImpaired) -> None:
        if isinstance(event, SensorImpaired):
            self._impaired[event.sensor] = event.impairments
        else:
            self._lost[event.sensor] = event.reason if isinstance(event, SensorLost) else None

    def _receive_state(self, state: BrakeRequest | FileFailure | RecorderState) -> None:
        match state:
            case FileFailure():
                self._failed_files[state.use] = state
            case BrakeRequest():
                self._brake_request = state
            case RecorderState():
                self._recorder_failure = None if state.is_recording else state.reason

    def _receive_alarm(self, alarm: Alarm) -> None:
        key = alarm.cause, alarm.vehicle
        if alarm.level is Level.NONE:
            self._alarms.pop(key, None)
            self._in_alarm.pop(key, None)
            return
        self._in_alarm[key] = frozenset(reason.name for reason in alarm.reasons)
        vehicles_ahead, is_test = None, False
        if alarm.cause == LCCA and self._warning is not None:
            vehicles_ahead = self._warning.group_number - self._warning.origin_number
            is_test = self._warning.cause is BrakeCause.TEST
        row, direction = row_of(alarm.cause), self._direction(alarm)
        sign, sentence = row.sign, row.sentence
        if row.from_the_side is not None and direction is not Direction.AHEAD:
            sign = Sign(direction)
            sentence = row.from_the_side[direction is Direction.RIGHT]
        self._alarms[key] = AlarmView(
            alarm.cause,
            alarm.level,
            direction,
            vehicles_ahead,
            alarm.stamp_s,
            row.headline(alarm.level),
            sign,
            sentence,
            is_test,
        )

    def _receive_warning(self, warning: WarningRaised | WarningLevel) -> None:
        """Store it; show a test that has become a real braking as a new alarm."""
        alarm, is_test = self._alarms.get(_LCCA), warning.cause is BrakeCause.TEST
        if isinstance(warning, WarningRaised):
            self._warning = warning
        elif alarm is not None and alarm.is_test != is_test:
            self._alarms[_LCCA] = replace(alarm, is_test=is_test, raised_at_s=warning.stamp_s)

    def _direction(self, alarm: Alarm) -> Direction:
        """Return the side of the vehicle; one alarm at a time is about what is ahead."""
        if not row_of(alarm.cause).of_each_vehicle:
            return Direction.AHEAD
        names = self._in_alarm[alarm.cause, alarm.vehicle]
        for each in self._objects:
            right_m = self._map.right_m(each) if each.name in names else None
            if right_m is not None:
                return Direction.RIGHT if right_m > 0.0 else Direction.LEFT
        return Direction.AHEAD

    def _present_request(self, now: float) -> BrakeRequestView | None:
        request = self._brake_request
        if request is None or now - request.stamp_s >= request.valid_s:
            return None
        return BrakeRequestView(request.deceleration_m_s2, request.certainty)

    def _speed_m_s(self, now: float) -> float | None:
        speed = self._speed
        if speed is None or now - speed.stamp_s > self._speed_timeout_s:
            return None
        return speed.speed_m_s

    def _present_lead(self, now: float) -> Lead | None:
        lead = self._lead
        if lead is None or self._lost.get(Sensor.CAMERA) is not None:
            return None
        return lead if now - lead.stamp_s <= self._lead_timeout_s else None

    def _lead_view(self, identity: CarIdentity | None, now: float) -> LeadView | None:
        lead, speed_m_s = self._present_lead(now), self._speed_m_s(now)
        if lead is None:
            return None
        safe_gap_m = None if speed_m_s is None else speed_m_s * self._safe_headway_s
        asked = self._inquired
        if asked is not None and asked.track_id != lead.track_id:
            asked = None
        return LeadView(
            identity=lead.identity if identity is None else LeadIdentity.KNOWN,
            plate=lead.text if identity is None else identity.text,
            names_asked=None if asked is None else asked.names,
            is_answered=identity is not None,
            gap_m=lead.gap_m,
            safe_gap_m=safe_gap_m,
            closing_speed_m_s=lead.closing_speed_m_s,
        )

    def _vehicles(self, now: float) -> list[VehicleOnMap]:
        """Return the vehicles on the map without the lead vehicle, which is drawn by its gap."""
        lead = self._present_lead(now)
        detections = [
            each for each in self._detections if now - each.stamp_s <= self._lead_timeout_s
        ]
        in_alarm = frozenset[str]().union(*self._in_alarm.values())
        vehicles = self._map.vehicles(self._objects, () if lead is None else detections, in_alarm)
        if lead is None or lead.identity is LeadIdentity.NO_LEAD or lead.gap_m is None:
            return vehicles
        lead_m = lead.gap_m + self._length_m
        same = [
            each
            for each in vehicles
            if abs(each.ahead_m - lead_m) <= _SAME_VEHICLE_M and abs(each.right_m) <= _HALF_LANE_M
        ]
        if not same:
            return vehicles
        nearest = min(same, key=lambda each: abs(each.ahead_m - lead_m))
        return [each for each in vehicles if each is not nearest]


def _urgency(alarm: AlarmView) -> tuple[int, float]:
    return -alarm.level.rank, -alarm.raised_at_s
