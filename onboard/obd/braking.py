"""The host vehicle's hard braking: one state of all that shows it.

    cause                           counts while
    DECELERATION                    the speeds show hard braking (`hard_brake.py`)
    COLLISION                       the speeds show one (`speed_collapse.py`)
    BRAKE_PRESSURE                  the pressure is above its threshold, and the vehicle moves
    ABS, STABILITY_CONTROL          they are active, and the vehicle brakes: its pedal is pressed,
                                    or it decelerates with half the threshold
    HAZARD_LIGHTS                   they are on, and the vehicle decelerates with half the threshold
    AIRBAG                          one is deployed, also without a speed

Half the threshold is what coasting does not reach. The most severe cause is shown. The state begins
with the first cause, changes with the cause or clearly with the level, and ends with the last
cause. A broadcast cause is shown for `RELEASE_S` after it ends, so that lamps may blink.
"""

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from typing_extensions import override

from onboard.core import Core
from onboard.kinematics.units import STANDARD_GRAVITY_M_S2
from onboard.obd.hard_brake import MIN_SPEED_M_S, WINDOW_S, HardBrakeDetector
from onboard.obd.speed_collapse import CollapseDetector
from onboard.observations import BrakeCause, BrakePedal, HardBrake, Speed

STALE_S = 2.0
"""Silence of a broadcast signal after which it counts as not active."""

RELEASE_S = 0.6
"""Time for which a broadcast cause is shown after it ends: longer than the dark phase of lamps that
blink 60 to 120 times a minute (UN R48)."""

LEVEL_STEP_M_S2 = 1.0
"""Least change of the level that is put out."""

LEAST_M_S2 = 0.1
"""Least deceleration that is put out: an airbag may be deployed at a constant speed."""

CHANGE_INTERVAL_S = 0.5
"""Least time between changes of the state, except to a more severe cause."""

_SEVERITY = tuple(BrakeCause)


class BrakeTrigger(NamedTuple):
    """A broadcast signal that may show hard braking."""

    stamp_s: float
    cause: BrakeCause
    is_active: bool
    source: str


class Braking(Core):
    """Merges all that shows hard braking to one state; the module's docstring has the rules."""

    def __init__(self, threshold_g: float) -> None:
        """Start without braking.

        Args:
            threshold_g: deceleration of hard braking, in units of standard gravity.
        """
        self._threshold_m_s2 = threshold_g * STANDARD_GRAVITY_M_S2
        self._detector = HardBrakeDetector(threshold_g)
        self._collapse = CollapseDetector()
        self._speed: Speed | None = None
        self._speed_until = self._pedal_until = -math.inf
        self._triggers: dict[BrakeCause, BrakeTrigger] = {}
        self._active_until: dict[BrakeCause, float] = {}
        """When each trigger that is set becomes stale."""
        self._shown_until: dict[BrakeCause, float] = {}
        self._shown: HardBrake | None = None
        """The state as put out last; `None` while there is no braking."""
        self._shown_at = 0.0
        self._events: deque[HardBrake] = deque()

    def receive_speed(self, speed: Speed, now: float) -> None:
        """Receive the next sample of the source in use."""
        self._speed, self._speed_until = speed, now + WINDOW_S
        self._detector.receive_speed(speed)
        self._collapse.receive_speed(speed, now)
        self._update(speed.stamp_s, now)

    def receive_other_speed(self, speed: Speed, now: float) -> None:
        """Receive a speed of a source that is not in use."""
        self._collapse.receive_other_speed(speed, now)
        self._update(speed.stamp_s, now)

    def receive_pedal(self, pedal: BrakePedal, now: float) -> None:
        """Receive the state of the brake pedal."""
        self._detector.receive_pedal(pedal)
        self._pedal_until = now + STALE_S if pedal.pressed else -math.inf
        self._update(pedal.stamp_s, now)

    def receive_trigger(self, trigger: BrakeTrigger, now: float) -> None:
        """Receive a broadcast signal that may show hard braking."""
        self._triggers[trigger.cause] = trigger
        self._active_until[trigger.cause] = now + STALE_S if trigger.is_active else -math.inf
        self._update(trigger.stamp_s, now)

    @override
    def get_timer(self) -> float:
        """When a cause may end without any input; infinite without braking."""
        if self._shown is None:
            return math.inf
        return min(
            self._collapse.get_timer(),
            self._speed_until if self._detector.level_m_s2 is not None else math.inf,
            min(self._shown_until.values(), default=math.inf),
        )

    @override
    def handle_timer(self, now: float) -> None:
        """End what is over, or silent."""
        if now >= self.get_timer():
            self._collapse.handle_timer(now)
            self._update(now, now)

    @override
    def next_event(self) -> HardBrake | None:
        """The oldest change of the state not yet taken."""
        return self._events.popleft() if self._events else None

    def _update(self, stamp_s: float, now: float) -> None:
        if now >= self._speed_until:
            self._detector.reset()
        for cause in self._triggered(now):
            self._shown_until[cause] = now + RELEASE_S
        self._shown_until = {c: until for c, until in self._shown_until.items() if until > now}
        causes = [*self._shown_until, *self._of_speed()]
        shown = self._shown
        if causes:
            cause = max(causes, key=_SEVERITY.index)
            brake = HardBrake(stamp_s, self._deceleration_m_s2(), self._source(cause), cause)
            if shown is None or self._is_change(shown, brake, now):
                self._shown, self._shown_at = brake, now
                self._events.append(brake)
        elif shown is not None:
            self._shown = None
            self._events.append(HardBrake(stamp_s, 0.0, shown.source, shown.cause, is_over=True))

    def _of_speed(self) -> Iterator[BrakeCause]:
        if self._detector.level_m_s2 is not None:
            yield BrakeCause.DECELERATION
        if self._collapse.level_m_s2 is not None:
            yield BrakeCause.COLLISION

    def _triggered(self, now: float) -> Iterator[BrakeCause]:
        if not self._active_until:
            return
        speed = self._speed
        is_moving = (
            speed is not None and now < self._speed_until and speed.speed_m_s >= MIN_SPEED_M_S
        )
        is_slowing = (
            is_moving and (self._detector.deceleration_m_s2 or 0.0) >= self._threshold_m_s2 / 2
        )
        is_braking = is_slowing or (is_moving and now < self._pedal_until)
        for cause, until in self._active_until.items():
            match cause:
                case BrakeCause.AIRBAG:
                    counts = True
                case BrakeCause.BRAKE_PRESSURE:
                    counts = is_moving
                case BrakeCause.HAZARD_LIGHTS:
                    counts = is_slowing
                case _:
                    counts = is_braking
            if counts and now < until:
                yield cause

    def _source(self, cause: BrakeCause) -> str:
        if cause in self._shown_until:
            return self._triggers[cause].source
        return self._speed.source if self._speed is not None else ""

    def _deceleration_m_s2(self) -> float:
        """Of a state: as the speeds show it; the threshold if they show nothing."""
        levels = (self._detector.level_m_s2, self._collapse.level_m_s2)
        level_m_s2 = max((each for each in levels if each is not None), default=None)
        if level_m_s2 is None:
            level_m_s2 = self._detector.deceleration_m_s2
        return self._threshold_m_s2 if level_m_s2 is None else max(level_m_s2, LEAST_M_S2)

    def _is_change(self, shown: HardBrake, brake: HardBrake, now: float) -> bool:
        if _SEVERITY.index(brake.cause) > _SEVERITY.index(shown.cause):
            return True
        rise_m_s2 = brake.deceleration_m_s2 - shown.deceleration_m_s2
        is_easing = self._detector.level_m_s2 is not None and -rise_m_s2 >= LEVEL_STEP_M_S2
        is_other = brake.cause is not shown.cause or rise_m_s2 >= LEVEL_STEP_M_S2 or is_easing
        return is_other and now >= self._shown_at + CHANGE_INTERVAL_S
