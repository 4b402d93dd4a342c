"""Adapts the BSM interval to the driver's crash probability (section II-B).

Each measurement of the lead vehicle gives a new crash probability, which sets the longest BSM
interval until the next measurement: the paper's iteration. The paper's slots and access
probabilities do not exist on a DSRC channel; what a vehicle can choose is its BSM interval. SAE
J2945/1 lengthens this interval where many vehicles are near. A safe vehicle follows the standard;
an unsafe one limits the lengthening. The interval is never longer than the standard demands, and
never shorter than its 100 ms.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import ClassVar

from typing_extensions import override

from onboard.access.crash_probability import rear_end_crash_probability
from onboard.access.driver_model import DriverModel
from onboard.access.reaction_times import Reaction, ReactionObserver
from onboard.bsm_transmission.schedule import MAXIMUM_INTERVAL_S, MINIMUM_INTERVAL_S
from onboard.core import Core
from onboard.observations import BrakePedal, HardBrake, Lead
from onboard.sensors.host_state import HostState
from onboard.step import HostObservation

UNSAFE_ABOVE = 0.5
"""Crash probability above which a vehicle becomes unsafe: a crash is more likely than none."""
SAFE_BELOW = 0.4
"""Crash probability below which it is safe again; the hysteresis covers the noise of the gap."""
UNSAFE_INTERVAL_S = MINIMUM_INTERVAL_S
"""Longest BSM interval of an unsafe vehicle: the shortest that SAE J2945/1 allows."""
LEAD_VALID_S = 1.0
"""Validity of the last measurement of the lead; without a lead the vehicle is safe."""
DECELERATION_M_S2 = 4.0, 8.0
"""Limits of the uniform distribution of both vehicles' decelerations (Table III)."""
CREEPING_M_S = 1.0
"""Below this speed the crash probability is 0: a vehicle that creeps can stop at once."""
MINIMUM_HEADWAY_GAP_M = 1.0
"""Gaps below this count as this in the headway, whose logarithm would diverge."""
REACTION_HEADWAY_S = 1.2
"""Headway of the median reaction time: that of all drivers is 1.0 s there."""
LEAST_REACTIONS = 10
"""Before, the driver is one of all drivers."""


@dataclass(frozen=True, slots=True)
class FollowingSafety:
    """The vehicle has become safe or unsafe."""

    kind: ClassVar[str] = "following_safety"
    stamp_s: float
    """Time of the lead measurement that decided, or of its expiry."""
    is_unsafe: bool
    safety_index: float
    """1 minus the probability of running into the lead vehicle if that brakes."""
    longest_interval_s: float
    """Upper limit of the BSM interval from now on."""


@dataclass(frozen=True, slots=True)
class ReactionObserved:
    """The lead vehicle braked, and then the driver did. Never leaves the computer."""

    kind: ClassVar[str] = "reaction_observed"
    stamp_s: float
    reaction_s: float
    headway_s: float


class AccessAdaptation(Core):
    """Computes the longest BSM interval from the lead, the speed and the driver model."""

    def __init__(self, driver: DriverModel, host: HostState) -> None:
        """Start safe.

        Args:
            driver: updated with each reaction that is observed.
            host: the host vehicle by its sensors, filled by the caller.
        """
        self.driver = driver
        self._host = host
        self._reactions = ReactionObserver()
        self._lead_expires_at = math.inf
        self._events: deque[FollowingSafety | ReactionObserved] = deque()
        self.is_unsafe = False
        self.safety_index = 1.0

    @property
    def longest_interval_s(self) -> float:
        """Upper limit of the BSM interval."""
        return UNSAFE_INTERVAL_S if self.is_unsafe else MAXIMUM_INTERVAL_S

    @property
    def reaction_s(self) -> float | None:
        """Median reaction time of the driver at `REACTION_HEADWAY_S`; `None` if few are known."""
        if self.driver.observed < LEAST_REACTIONS:
            return None
        return self.driver.percentile_s(0.5, REACTION_HEADWAY_S)[0]

    def receive_observation(self, observation: HostObservation, now: float) -> None:
        """Take an observation of the host vehicle's sensors; most kinds change nothing."""
        match observation:
            case Lead():
                self.receive_lead(observation, now)
            case BrakePedal():
                self.receive_brake_pedal(observation)
            case HardBrake():
                self.receive_hard_brake(observation)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """Compute the crash probability for the lead of one camera frame."""
        speed = self._host.speed(now)
        self._reactions.receive_lead(lead, speed)
        if lead.gap_m is None or speed is None:
            return
        self._lead_expires_at = now + LEAD_VALID_S
        self._update(lead.stamp_s, self._crash_probability(lead, lead.gap_m, speed.speed_m_s))

    def receive_brake_pedal(self, pedal: BrakePedal) -> None:
        """Learn from the driver's brake pedal, if this is a reaction."""
        self._learn(pedal.stamp_s, self._reactions.receive_brake_pedal(pedal))

    def receive_hard_brake(self, brake: HardBrake) -> None:
        """Learn from the host vehicle's hard braking, if this is a reaction."""
        self._learn(brake.stamp_s, self._reactions.receive_hard_brake(brake))

    @override
    def get_timer(self) -> float:
        """Return when the last lead measurement expires; `math.inf` without one."""
        return self._lead_expires_at

    @override
    def handle_timer(self, now: float) -> None:
        """Become safe when the last lead measurement has expired."""
        if now >= self._lead_expires_at:
            self._lead_expires_at = math.inf
            self._update(now, 0.0)

    @override
    def next_event(self) -> FollowingSafety | ReactionObserved | None:
        """Return the oldest event not yet taken, or `None`."""
        return self._events.popleft() if self._events else None

    def _crash_probability(self, lead: Lead, gap_m: float, speed_m_s: float) -> float:
        if speed_m_s < CREEPING_M_S:
            return 0.0
        closing_m_s = lead.closing_speed_m_s or 0.0
        gap_m = max(gap_m, 0.0)
        log_reaction = self.driver.log_reaction(max(gap_m, MINIMUM_HEADWAY_GAP_M) / speed_m_s)
        lead_speed_m_s = max(speed_m_s - closing_m_s, 0.0)
        return float(
            rear_end_crash_probability(
                gap_m, lead_speed_m_s, speed_m_s, log_reaction, DECELERATION_M_S2
            )
        )

    def _update(self, stamp_s: float, crash_probability: float) -> None:
        self.safety_index = 1.0 - crash_probability
        limit = SAFE_BELOW if self.is_unsafe else UNSAFE_ABOVE
        if (crash_probability > limit) is self.is_unsafe:
            return
        self.is_unsafe = not self.is_unsafe
        self._events.append(
            FollowingSafety(stamp_s, self.is_unsafe, self.safety_index, self.longest_interval_s)
        )

    def _learn(self, stamp_s: float, reaction: Reaction | None) -> None:
        if reaction is not None and self.driver.receive_reaction(*reaction):
            self._events.append(ReactionObserved(stamp_s, *reaction))
