"""From what the stack says to what the driver is shown: the core without I/O.

Alarms, a new place in the group and lost sensors are shown at once; all else five times a second,
which is as fast as a number can be read.
"""

import math
from collections.abc import Iterable, Sequence

from onboard.hmi.driver_view import (
    AlarmView,
    Direction,
    DriverView,
    GroupStatus,
    LeadView,
    SensorView,
    VehicleOnMap,
)
from onboard.hmi.vehicle_map import VehicleMap
from onboard.lcca.events import WarningRaised
from onboard.lcca.group import WarningGroup
from onboard.mvs.perceived_object import PerceivedObject
from onboard.observations import (
    DetectionList,
    Lead,
    LeadIdentity,
    Sensor,
    SensorLost,
    SensorRecovered,
    Speed,
    VehicleDetection,
)
from onboard.recorder.records import RecorderState
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.trace.trace_line import Event

SHOW_S = 0.2
"""Between views when nothing happens."""
_AT_ONCE = frozenset({"alarm", "transition", "sensor_lost", "sensor_recovered", "recorder"})
_GROUP_DIGITS = 4
_SAME_CAR_M = 5.0
"""A car on the map this near to the lead car's place, along the lane, is the lead car."""
_OWN_LANE_M = 1.9


class Display:
    """What the driver's page shows."""

    def __init__(
        self,
        *,
        sensors: Iterable[Sensor],
        speed_held_s: float,
        lead_held_s: float,
        safe_headway_s: float,
        length_m: float,
        brake_button: bool = False,
    ) -> None:
        """Start with nothing known.

        Args:
            sensors: those that the car has.
            speed_held_s: how old a speed may be shown.
            lead_held_s: how old a look ahead may be shown.
            safe_headway_s: the time that the safety distance is long.
            length_m: of the own car.
            brake_button: whether the page has one.
        """
        self._lost: dict[Sensor, str | None] = dict.fromkeys(sorted(sensors))
        self._speed_held_s = speed_held_s
        self._lead_held_s = lead_held_s
        self._safe_headway_s = safe_headway_s
        self._length_m = length_m
        self._brake_button = brake_button
        self._around = VehicleMap(length_m)
        self._speed: Speed | None = None
        self._lead: Lead | None = None
        self._seen: list[VehicleDetection] = []
        self._own: PerceivedObject | None = None
        self._cars: Sequence[PerceivedObject] = ()
        self._warning: WarningRaised | None = None
        self._alarms: dict[Cause, AlarmView] = {}
        self._in_alarm: dict[Cause, frozenset[str]] = {}
        """Names of the cars that each alarm is about."""
        self._not_recording: str | None = None
        self._show_at = -math.inf

    def receive_event(self, event: Event) -> None:
        """Anything that the stack says."""
        match event:
            case Speed():
                self._speed = event
            case Lead():
                self._lead = event
            case VehicleDetection():
                if self._seen and self._seen[0].stamp_s != event.stamp_s:
                    self._seen.clear()
                self._seen.append(event)
            case DetectionList():
                self._seen = list(event.cars)
            case SensorLost():
                self._lost[event.sensor] = event.reason
            case SensorRecovered():
                self._lost[event.sensor] = None
            case WarningRaised():
                self._warning = event
            case Alarm():
                self._receive_alarm(event)
            case RecorderState():
                self._not_recording = None if event.is_recording else event.reason
        if event.kind in _AT_ONCE:
            self._show_at = -math.inf

    def receive_surroundings(
        self, own: PerceivedObject | None, cars: Sequence[PerceivedObject]
    ) -> None:
        """The own car, `None` without a position, and the others, as they are now."""
        self._own, self._cars = own, cars

    def view_to_show(self, group: WarningGroup, now: float) -> DriverView | None:
        """The view if one is due, else `None`."""
        if now < self._show_at:
            return None
        self._show_at = now + SHOW_S
        return DriverView(
            stamp_s=now,
            place=GroupStatus(
                group.state,
                group.group_number,
                group.leader_id.hex()[:_GROUP_DIGITS],
                len(group.followers),
            ),
            speed_m_s=self._speed_m_s(now),
            ahead=self._ahead(now),
            cars=tuple(self._cars_around(now)),
            alarms=tuple(sorted(self._alarms.values(), key=_urgency)),
            sensors=tuple(
                SensorView(sensor, reason is not None, reason)
                for sensor, reason in self._lost.items()
            ),
            not_recording=self._not_recording,
            brake_button=self._brake_button,
        )

    def _receive_alarm(self, alarm: Alarm) -> None:
        if alarm.level is Level.NONE:
            self._alarms.pop(alarm.cause, None)
            self._in_alarm.pop(alarm.cause, None)
            return
        self._in_alarm[alarm.cause] = frozenset(reason.name for reason in alarm.reasons)
        cars_ahead = None
        if alarm.cause is Cause.LCCA and self._warning is not None:
            cars_ahead = self._warning.group_number - self._warning.origin_number
        self._alarms[alarm.cause] = AlarmView(
            alarm.cause, alarm.level, self._direction(alarm), cars_ahead, alarm.stamp_s
        )

    def _direction(self, alarm: Alarm) -> Direction:
        """Only crossing cars come from a side; the cars know which."""
        if alarm.cause is not Cause.IMA:
            return Direction.AHEAD
        names = self._in_alarm[alarm.cause]
        for car in self._cars:
            right_m = self._around.right_m(self._own, car) if car.name in names else None
            if right_m is not None:
                return Direction.RIGHT if right_m > 0.0 else Direction.LEFT
        return Direction.AHEAD

    def _speed_m_s(self, now: float) -> float | None:
        speed = self._speed
        if speed is None or now - speed.stamp_s > self._speed_held_s:
            return None
        return speed.speed_m_s

    def _fresh_lead(self, now: float) -> Lead | None:
        lead = self._lead
        if lead is None or self._lost.get(Sensor.CAMERA) is not None:
            return None
        return lead if now - lead.stamp_s <= self._lead_held_s else None

    def _ahead(self, now: float) -> LeadView | None:
        lead, speed_m_s = self._fresh_lead(now), self._speed_m_s(now)
        if lead is None:
            return None
        safe_gap_m = None if speed_m_s is None else speed_m_s * self._safe_headway_s
        return LeadView(lead.identity, lead.text, lead.gap_m, safe_gap_m, lead.closing_speed_m_s)

    def _cars_around(self, now: float) -> list[VehicleOnMap]:
        """Without the lead car, which the page draws by its gap."""
        lead = self._fresh_lead(now)
        seen = [car for car in self._seen if now - car.stamp_s <= self._lead_held_s]
        in_alarm = frozenset[str]().union(*self._in_alarm.values())
        cars = self._around.place(self._own, self._cars, () if lead is None else seen, in_alarm)
        if lead is None or lead.identity is LeadIdentity.NO_LEAD or lead.gap_m is None:
            return cars
        lead_m = lead.gap_m + self._length_m
        same = [
            car
            for car in cars
            if abs(car.ahead_m - lead_m) <= _SAME_CAR_M and abs(car.right_m) <= _OWN_LANE_M
        ]
        if not same:
            return cars
        nearest = min(same, key=lambda car: abs(car.ahead_m - lead_m))
        return [car for car in cars if car is not nearest]


def _urgency(alarm: AlarmView) -> tuple[int, float]:
    return -alarm.level.rank, -alarm.raised_at_s
