"""The own hard braking: a state that is sent when it changes, and again while it lasts."""

import math

import numpy as np

from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId, Warn, WarnCause
from onboard.observations import BrakeCause, HardBrake

MAX_DECELERATION_M_S2 = 25.5
"""Highest value of `Warn.deceleration_m_s2`: a collision exceeds it."""


class OwnBraking:
    """From the first `HardBrake` to the one that ends it."""

    def __init__(self, parameters: GroupParameters, rng: np.random.Generator) -> None:
        """Start without braking.

        Args:
            parameters: times and limits of the warning group.
            rng: draws the spread of repetitions.
        """
        self._parameters = parameters
        self._rng = rng
        self._brake: HardBrake | None = None
        self._send_at = self._test_until = math.inf
        self._is_new = False
        """Whether the present state has not been sent yet."""
        self.origin_id = CarId()
        """The own ID when the braking began, or since the IDs have changed in it."""
        self.first_sequence: int | None = None
        """Event sequence number of the first warning under that ID; `None` before that."""
        self._former: tuple[CarId, int | None] = (CarId(), None)
        """As a braking was named before the last change of the own ID."""

    @property
    def cause(self) -> WarnCause:
        """Why to warn; OVER if the vehicle does not brake hard."""
        brake = self._brake
        return WarnCause.OVER if brake is None or brake.is_over else WarnCause[brake.cause.name]

    @property
    def deceleration_m_s2(self) -> float:
        """As far as a message can tell."""
        brake = self._brake
        return 0.0 if brake is None else min(brake.deceleration_m_s2, MAX_DECELERATION_M_S2)

    def receive_hard_brake(self, brake: HardBrake, own_id: CarId, now: float) -> None:
        """Take a change of the braking; it is to be sent now."""
        is_test = brake.cause is BrakeCause.TEST and not brake.is_over
        test_until = now + self._parameters.test_warning_s if is_test else math.inf
        if self.cause is WarnCause.OVER:
            if brake.is_over:
                return
            self.origin_id, self.first_sequence = own_id, None
        elif is_test:
            if self.cause is WarnCause.TEST:  # it goes on: nothing changes that is to be sent
                self._test_until = test_until
            return
        self._test_until = test_until
        self._brake, self._send_at, self._is_new = brake, now, True

    def rename(self, own_id: CarId, now: float) -> None:
        """Take the own ID of a new epoch, under which a braking that lasts is sent at once.

        Others accept only what its vehicle has signed under the ID that names it.
        """
        self._former = (self.origin_id, self.first_sequence)
        if self.cause is not WarnCause.OVER:
            self.origin_id, self.first_sequence = own_id, None
            self._send_at = now

    def is_own(self, warn: Warn) -> bool:
        """Whether the warning is a copy of what this vehicle sends, or has sent lately."""
        name = (warn.event_origin_id, warn.first_sequence)
        return name in ((self.origin_id, self.first_sequence), self._former)

    def age_s(self, now: float) -> float:
        """Time since the state that is sent now began; a repeated state is one of now."""
        brake = self._brake
        return 0.0 if brake is None or not self._is_new else max(now - brake.stamp_s, 0.0)

    def get_timer(self) -> float:
        """When the state is to be sent; infinite if it is over."""
        return min(self._send_at, self._test_until)

    def end_test(self, now: float) -> None:
        """End the braking that the driver's button pretends, if its time is over."""
        brake = self._brake
        if brake is not None and now >= self._test_until:
            over = HardBrake(now, 0.0, brake.source, brake.cause, is_over=True)
            self.receive_hard_brake(over, b"", now)

    def is_due(self, now: float) -> bool:
        """Whether the state is to be sent now."""
        return now >= self._send_at

    def sent(self, sequence: int, now: float) -> None:
        """Plan the repetition of what has been sent under this event sequence number."""
        self._is_new = False
        if self.first_sequence is None:
            self.first_sequence = sequence
        spread_s = float(self._rng.uniform(0.0, self._parameters.spread_s))
        is_over = self.cause is WarnCause.OVER
        self._send_at = math.inf if is_over else now + self._parameters.warn_refresh_s + spread_s
