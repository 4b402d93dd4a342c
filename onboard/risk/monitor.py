"""When to warn: one place for all causes, each with its own alarm, level and reasons.

Crossing paths and hard braking told by radio need positions of both cars: without an own position
neither is claimed. The group's warnings and the gap ahead need none.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from typing_extensions import override

from onboard.core import Core
from onboard.lcca.events import WarningRaised
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_safety import VehicleEventFlags
from onboard.mvs.perceived_object import ObjectSource, PerceivedObject
from onboard.observations import BrakePedal, Discarded, Lead, Position, Speed
from onboard.risk.alarm import NOTHING, Alarm, AlarmReason, Assessment, Cause, Hysteresis, Level
from onboard.risk.fcw import (
    LeadMotion,
    judged,
    required_deceleration_m_s2,
    settled_closing_speed_m_s,
)
from onboard.risk.host_braking import HostBraking
from onboard.risk.ima import Driven, averaged_collision_probabilities
from onboard.risk.path_crossing import CovarianceError, PathCrossing, path_crossing
from onboard.risk.settings import RiskSettings
from onboard.risk.vehicle_motion import VehicleMotion

_NO_BRAKING_HELPS_M_S2 = 20.0
"""Alarms name no greater need than this."""

_SAID_HELD_S = 5.0
"""How long height and size of a car are kept without a word from it."""


_NEW_HEIGHT = 0.1
"""Share of a new height in the mean of the last ones: at 10 Hz, those of a second."""


@dataclass(frozen=True, slots=True)
class _Said:
    """What a car's BSM says beside its motion."""

    at_s: float
    height_m: float | None
    length_m: float | None
    width_m: float | None
    brakes_hard_at_s: float


class RiskMonitor(Core):
    """Told what the other rooms know, says when an alarm begins, changes and ends."""

    def __init__(self, settings: RiskSettings, length_m: float, width_m: float) -> None:
        """Start with no alarm, in a car of the given size."""
        self._settings = settings
        self._own_size = (length_m, width_m)
        self._speed: Speed | None = None
        self._own_braking = HostBraking(settings.fcw.lead_window_s)
        self._lead: Lead | None = None
        self._lead_motion = LeadMotion(settings.fcw)
        self._height_m: float | None = None
        self._said: dict[str, _Said] = {}
        self._motions: dict[str, VehicleMotion] = {}
        self._warning: WarningRaised | None = None
        self._alarms = {
            cause: Hysteresis(
                cause,
                settings.fcw.confirm_s if cause is Cause.FCW else 0.0,
                settings.release_s,
            )
            for cause in Cause
        }
        self._events: deque[Alarm | Discarded] = deque(maxlen=1024)

    def receive_speed(self, speed: Speed) -> None:
        """The own speed."""
        self._speed = speed
        self._own_braking.receive_speed(speed)

    def receive_pedal(self, pedal: BrakePedal) -> None:
        """The own brake pedal, where the car tells it."""
        self._own_braking.receive_pedal(pedal)

    def receive_position(self, position: Position) -> None:
        """The own height; place and motion come with `assess`."""
        self._height_m = _mean_height_m(self._height_m, position.altitude_m)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """The car ahead that the camera sees, or that there is none."""
        self._lead = lead
        speed = self._fresh_speed(now)
        if speed is not None and lead.gap_m is not None and lead.closing_speed_m_s is not None:
            if (lead.closing_speed_sigma_m_s or 0.0) > self._settings.fcw.settled_sigma_m_s:
                self._lead_motion.clear()  # a speed that settles is not braking
            lead_speed_m_s = speed.speed_m_s - lead.closing_speed_m_s
            self._lead_motion.receive(lead.stamp_s, lead.gap_m, lead_speed_m_s)
        self._judge(Cause.FCW, self._fcw(now), now)

    def receive_warning(self, warning: WarningRaised, now: float) -> None:
        """The group's warning of a car ahead that brakes hard."""
        self._warning = warning
        self._judge(Cause.LCCA, self._group(now), now)

    def receive_bsm(self, bsm: BasicSafetyMessage, now: float) -> None:
        """What another car says beside its motion: height, size, whether it brakes hard."""
        core, name = bsm.core, bsm.core.temporary_id.hex()
        events = bsm.safety.events if bsm.safety is not None else None
        before = self._said.get(name)
        brakes_hard_at_s = before.brakes_hard_at_s if before is not None else -math.inf
        if events is not None and VehicleEventFlags.HARD_BRAKING in events:
            brakes_hard_at_s = now
        size = core.size
        height_m = _mean_height_m(before.height_m if before else None, core.elevation_m)
        self._said[name] = _Said(now, height_m, size.length_m, size.width_m, brakes_hard_at_s)

    def assess(
        self, own: PerceivedObject | None, cars: Sequence[PerceivedObject], now: float
    ) -> None:
        """Judge every cause; to be called at 10 Hz, also when nothing comes in.

        Args:
            own: the own car; `None` without a position.
            cars: all others that are known, in the same frame, as they are at `now`.
            now: the time.
        """
        self._said = {
            name: said for name, said in self._said.items() if now - said.at_s <= _SAID_HELD_S
        }
        self._judge(Cause.LCCA, self._group(now), now)
        fcw = self._fcw(now)
        if fcw.level is Level.NONE:  # between frames it can end, but not begin
            self._judge(Cause.FCW, fcw, now)
        others = [] if own is None else [car for car in cars if _is_other(car, own)]
        self._follow_motions([*others, own] if own is not None else [], now)
        if own is None or math.hypot(*own.state[2:]) < self._settings.least_speed_m_s:
            self._judge(Cause.EEBL, NOTHING, now)
            self._judge(Cause.IMA, NOTHING, now)
        else:
            self._judge(Cause.EEBL, self._eebl(own, others, now), now)
            self._judge(Cause.IMA, self._crossing(own, others, now), now)

    @override
    def next_event(self) -> Alarm | Discarded | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _judge(self, cause: Cause, seen: Assessment, now: float) -> None:
        alarm = self._alarms[cause].receive(seen, now)
        if alarm is not None:
            self._events.append(alarm)

    def _group(self, now: float) -> Assessment:
        warning = self._warning
        if warning is None or now - warning.stamp_s > self._settings.group_warning_s:
            return NOTHING
        age_s = now - warning.stamp_s + warning.age_s
        reason = AlarmReason(warning.kind, warning.origin_id.hex(), age_s)
        return Assessment(Level.WARNING, warning.deceleration_m_s2, (reason,))

    def _fcw(self, now: float) -> Assessment:
        settings, lead, speed = self._settings.fcw, self._lead, self._fresh_speed(now)
        if (
            lead is None
            or speed is None
            or lead.gap_m is None
            or lead.closing_speed_m_s is None
            or abs(now - lead.stamp_s) > settings.lead_held_s
            or speed.speed_m_s < self._settings.least_speed_m_s
        ):
            return NOTHING
        closing_m_s = settled_closing_speed_m_s(
            lead.closing_speed_m_s, lead.closing_speed_sigma_m_s, settings
        )
        seen, needed_m_s2 = judged(
            lead.gap_m,
            speed.speed_m_s,
            closing_m_s,
            self._lead_motion.deceleration_m_s2,
            self._own_braking.at_least_m_s2(now),
            settings=settings,
        )
        return Assessment(
            seen,
            min(needed_m_s2, _NO_BRAKING_HELPS_M_S2),
            (
                AlarmReason(lead.kind, lead.identity.value, now - lead.stamp_s),
                AlarmReason(speed.kind, speed.source, now - speed.stamp_s),
            ),
        )

    def _eebl(
        self, own: PerceivedObject, others: Sequence[PerceivedObject], now: float
    ) -> Assessment:
        settings = self._settings.eebl
        worst = NOTHING
        for car in others:
            said = self._said.get(car.name)
            if said is None or now - said.brakes_hard_at_s > settings.held_s:
                continue
            gap_m = self._gap_on_path_m(own, car, said)
            if gap_m is None or self._is_on_another_level(said, gap_m):
                continue
            speed_m_s, other_m_s = math.hypot(*own.state[2:]), math.hypot(*car.state[2:])
            reaction_s = self._settings.fcw.reaction_s
            braking_m_s2 = max(settings.assumed_m_s2, -(car.acceleration_m_s2 or 0.0))
            needed_m_s2 = required_deceleration_m_s2(
                gap_m, speed_m_s, other_m_s, braking_m_s2, reaction_s
            )
            urgent = needed_m_s2 >= self._settings.fcw.warning_m_s2
            if worst is NOTHING or needed_m_s2 > worst.value:
                worst = Assessment(
                    Level.WARNING if urgent else Level.CAUTION,
                    min(needed_m_s2, _NO_BRAKING_HELPS_M_S2),
                    (AlarmReason("bsm", car.name, now - said.brakes_hard_at_s), _reason(car, own)),
                )
        return worst

    def _gap_on_path_m(
        self, own: PerceivedObject, car: PerceivedObject, said: _Said
    ) -> float | None:
        """Bumper to bumper, if the car is ahead in the own lane and drives the same way."""
        settings = self._settings.eebl
        heading = math.atan2(own.state[3], own.state[2])
        east_m, north_m = car.state[0] - own.state[0], car.state[1] - own.state[1]
        ahead_m = east_m * math.cos(heading) + north_m * math.sin(heading)
        beside_m = north_m * math.cos(heading) - east_m * math.sin(heading)
        if not 0.0 < ahead_m <= settings.range_m or abs(beside_m) > settings.beside_m:
            return None
        if math.hypot(*car.state[2:]) >= self._settings.ima.least_speed_m_s:
            turned = math.atan2(car.state[3], car.state[2]) - heading
            if math.cos(turned) < math.cos(settings.heading_rad):
                return None
        length_m = said.length_m or self._settings.other_length_m
        return max(ahead_m - (self._own_size[0] + length_m) / 2.0, 0.0)

    def _crossing(
        self, own: PerceivedObject, others: Sequence[PerceivedObject], now: float
    ) -> Assessment:
        settings = self._settings.ima
        found: list[tuple[PerceivedObject, PathCrossing]] = []
        for car in others:
            if car.age_s > settings.oldest_s:
                continue
            try:
                met = path_crossing(own, car, settings)
            except CovarianceError as error:
                self._events.append(Discarded(now, "risk", "covariance", f"{car.name}: {error}"))
                continue
            if met is not None and not self._is_over_or_under(car, met):
                found.append((car, met))
        p_c = averaged_collision_probabilities(
            [met for _, met in found],
            [self._driven(car) for car, _ in found],
            Driven(*self._own_size, *self._changes(own)),
            settings,
        )
        seen = [self._grade(car, float(p), own) for (car, _), p in zip(found, p_c, strict=True)]
        return max(seen, key=lambda each: (each.level.rank, each.value), default=NOTHING)

    def _grade(self, car: PerceivedObject, p_c: float, own: PerceivedObject) -> Assessment:
        settings = self._settings.ima
        if p_c >= settings.warning_p_c:
            return Assessment(Level.WARNING, p_c, (_reason(car, own),))
        if p_c >= settings.caution_p_c:
            return Assessment(Level.CAUTION, p_c, (_reason(car, own),))
        return Assessment(Level.NONE, p_c, ())

    def _follow_motions(self, cars: Sequence[PerceivedObject], now: float) -> None:
        self._motions = {
            car.name: self._motions.get(car.name) or VehicleMotion(self._settings.ima.trend_s)
            for car in cars
        }
        for car in cars:
            _, _, east_m_s, north_m_s = car.state
            self._motions[car.name].receive(now, east_m_s, north_m_s)

    def _changes(self, car: PerceivedObject) -> tuple[float | None, float | None]:
        """Acceleration, as the car says, else as its speed changes; and that across."""
        motion = self._motions[car.name]
        said_m_s2 = car.acceleration_m_s2
        return motion.acceleration_m_s2 if said_m_s2 is None else said_m_s2, motion.sideways_m_s2

    def _is_over_or_under(self, car: PerceivedObject, met: PathCrossing) -> bool:
        said = self._said.get(car.name)
        to_go_m = abs(float(met.mean[0])) + abs(float(met.mean[2]))
        return said is not None and self._is_on_another_level(said, to_go_m)

    def _is_on_another_level(self, said: _Said, to_go_m: float) -> bool:
        if said.height_m is None or self._height_m is None:
            return False
        settings = self._settings.ima
        allowed_m = settings.other_level_m + settings.slope * to_go_m
        return abs(said.height_m - self._height_m) > allowed_m

    def _driven(self, car: PerceivedObject) -> Driven:
        said = self._said.get(car.name)
        return Driven(
            (said.length_m if said else None) or self._settings.other_length_m,
            (said.width_m if said else None) or self._settings.other_width_m,
            *self._changes(car),
        )

    def _fresh_speed(self, now: float) -> Speed | None:
        speed = self._speed
        fresh = speed is not None and abs(now - speed.stamp_s) <= self._settings.speed_held_s
        return speed if fresh else None


def _mean_height_m(mean_m: float | None, height_m: float | None) -> float | None:
    """A receiver's heights scatter: a single one would put a car on a bridge for a moment."""
    if mean_m is None or height_m is None:
        return height_m
    return mean_m + _NEW_HEIGHT * (height_m - mean_m)


def _is_other(car: PerceivedObject, own: PerceivedObject) -> bool:
    return car.source is not ObjectSource.HOST and car.name != own.name


def _reason(car: PerceivedObject, own: PerceivedObject) -> AlarmReason:
    return AlarmReason(f"{car.kind}:{car.source.value}", car.name, max(car.age_s, own.age_s))
