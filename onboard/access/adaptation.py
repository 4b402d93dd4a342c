"""How often this car talks, from how dangerous its driver's following is (section II-B).

With each look at the car ahead the collision probability is worked out anew, by physics alone, and
decides how often the car talks until the next: that is the paper's iteration. Slots and their
access probabilities do not exist on the real channel; what a car may choose is the interval of its
BSMs. SAE J2945/1 stretches that among many cars. A safe car keeps to it; an unsafe one stretches
less. No car ever talks more rarely than the standard demands, nor more often than its ten a second.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import ClassVar

from onboard.access.crash_probability import rear_end_crash_probability
from onboard.access.driver_model import DriverModel
from onboard.access.reaction_times import Reaction, ReactionObserver
from onboard.access.settings import AccessSettings
from onboard.bsm_transmission.schedule import MAXIMUM_INTERVAL_S
from onboard.observations import BrakePedal, HardBrake, Lead, Speed

SLOWEST_M_S = 1.0
"""Slower, a car does not run into anybody that this could help with."""


@dataclass(frozen=True, slots=True)
class FollowingSafety:
    """The car has become safe or unsafe."""

    kind: ClassVar[str] = "following_safety"
    stamp_s: float
    """Of the look at the car ahead that decided; of the loss of it where there is none."""
    is_unsafe: bool
    safety_index: float
    """1 minus the probability of running into the car ahead, should it brake."""
    longest_interval_s: float
    """Between two BSMs from now on, if J2945/1 does not ask for a shorter one."""


@dataclass(frozen=True, slots=True)
class ReactionObserved:
    """The car ahead braked, and then the driver did. Stays on the box."""

    kind: ClassVar[str] = "reaction_observed"
    stamp_s: float
    reaction_s: float
    headway_s: float


class AccessAdaptation:
    """Watches one driver, and says how far apart BSMs may be."""

    def __init__(self, settings: AccessSettings, driver: DriverModel) -> None:
        """`driver` is what is known already; it learns from what is seen."""
        self.driver = driver
        self._settings = settings
        self._watch = ReactionObserver()
        self._speed: Speed | None = None
        self._good_until = math.inf
        self._events: deque[FollowingSafety | ReactionObserved] = deque()
        self.is_unsafe = False
        self.safety_index = 1.0

    @property
    def longest_interval_s(self) -> float:
        """The most that may lie between two BSMs."""
        return self._settings.unsafe_interval_s if self.is_unsafe else MAXIMUM_INTERVAL_S

    def receive_speed(self, speed: Speed) -> None:
        """The own speed."""
        self._speed = speed
        self._watch.receive_speed(speed)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """The car ahead, in each frame."""
        self._watch.receive_lead(lead)
        speed = self._speed
        if lead.gap_m is None or speed is None or now - speed.stamp_s > self._settings.hold_s:
            return
        self._good_until = now + self._settings.hold_s
        self._judge(lead.stamp_s, self._danger(lead, lead.gap_m, speed.speed_m_s))

    def receive_brake_pedal(self, pedal: BrakePedal) -> None:
        """The driver's foot."""
        self._learn(pedal.stamp_s, self._watch.receive_brake_pedal(pedal))

    def receive_hard_brake(self, brake: HardBrake) -> None:
        """The own car brakes hard."""
        self._learn(brake.stamp_s, self._watch.receive_hard_brake(brake))

    def get_timer(self) -> float:
        """Return when the last measured lead expires; `math.inf` without one."""
        return self._good_until

    def handle_timer(self, now: float) -> None:
        """Be safe when nobody has been seen ahead for long."""
        if now >= self._good_until:
            self._good_until = math.inf
            self._judge(now, 0.0)

    def next_event(self) -> FollowingSafety | ReactionObserved | None:
        """The oldest event not yet taken; `None` when there is none."""
        return self._events.popleft() if self._events else None

    def _danger(self, lead: Lead, gap_m: float, speed_m_s: float) -> float:
        if speed_m_s < SLOWEST_M_S:
            return 0.0
        closing_m_s = lead.closing_speed_m_s or 0.0
        gap_m = max(gap_m, 0.0)
        log_reaction = self.driver.log_reaction(max(gap_m, 1.0) / speed_m_s)
        brakes = self._settings.deceleration_low_m_s2, self._settings.deceleration_high_m_s2
        lead_speed_m_s = max(speed_m_s - closing_m_s, 0.0)
        return float(
            rear_end_crash_probability(gap_m, lead_speed_m_s, speed_m_s, log_reaction, brakes)
        )

    def _judge(self, stamp_s: float, danger: float) -> None:
        self.safety_index = 1.0 - danger
        limit = self._settings.safe_below if self.is_unsafe else self._settings.unsafe_above
        if (danger > limit) is self.is_unsafe:
            return
        self.is_unsafe = not self.is_unsafe
        self._events.append(
            FollowingSafety(stamp_s, self.is_unsafe, self.safety_index, self.longest_interval_s)
        )

    def _learn(self, stamp_s: float, reaction: Reaction | None) -> None:
        if reaction is not None and self.driver.receive_reaction(*reaction):
            self._events.append(ReactionObserved(stamp_s, *reaction))
