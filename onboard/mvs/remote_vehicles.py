"""Remote vehicles: the last BSM of each, and the rate of its footers."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays, map_state
from onboard.misbehaviour.evidence_check import CLOCK_TOLERANCE_S, RADIO_RANGE_M
from onboard.mvs.footer_validation import FOOTERS_AT_ONCE, FOOTERS_PER_S, MAX_SENDERS
from onboard.mvs.host_vehicle import ReportedState
from onboard.tracking.association import OVERLAP_M
from onboard.tracking.kalman import predict
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

SILENCE_S = 1.5
"""A remote vehicle that has been silent for this long is dropped: fifteen BSMs in a row."""

_STAMP_ERROR_S = 0.005
"""Largest difference of the stamps of one fix in two BSMs: rounding of `sec_mark`, and clocks."""
MAX_AHEAD_S = 2.0
"""By which a sender's clock may be ahead, as signatures allow: nothing is received before it is
sent, so its stamps are taken for so much earlier. Evidence of others names times in UTC, and is
held to `CLOCK_TOLERANCE_S`."""
_SET_AHEAD_S = 0.5
"""A stamp that is ahead by so much more than those before counts only with the next one: a single
one is wrong."""
_CATCHING_UP = 0.05
"""By how many seconds a second a sender may be less ahead, as one of both clocks is slewed."""
_MISSED_BSMS_S = 0.25
"""Silence in which at least two BSMs in a row are missing, at 10 Hz."""


@dataclass(slots=True, eq=False)
class RemoteVehicle:
    """A vehicle with a radio."""

    reported: ReportedState
    """By its last BSM."""
    first_s: float
    """Stamp of its first BSM under its temporary ID."""
    acceleration_m_s2: float | None = None
    ahead_s: float = 0.0
    """By which its clock is ahead, as far as it is too much."""
    is_doubtful: bool = False
    """Whether its last stamp was ahead by `_SET_AHEAD_S` more."""
    footers_due_at: float = -math.inf
    """When the footers accepted so far would have been due at `FOOTERS_PER_S`."""

    def accepts_footer(self, now: float) -> bool:
        """Whether a footer at `now` keeps the limits of one sender (a token bucket)."""
        return self.footers_due_at - now <= (FOOTERS_AT_ONCE - 1) / FOOTERS_PER_S

    def count_footer(self, now: float) -> None:
        """Count a footer that is accepted at `now`."""
        self.footers_due_at = max(self.footers_due_at, now) + 1.0 / FOOTERS_PER_S


class RemoteVehicles(dict[bytes, RemoteVehicle]):
    """The remote vehicles that were received lately, by temporary ID."""

    def receive_state(
        self,
        sender_id: bytes,
        reported: ReportedState,
        acceleration_m_s2: float | None,
        *,
        own_m: Array,
        now: float,
    ) -> tuple[str, str] | None:
        """Take the state that a BSM reports.

        Args:
            sender_id: temporary ID.
            reported: its state, in the host vehicle's frame.
            acceleration_m_s2: longitudinal, if the BSM has it.
            own_m: position of the host vehicle (2).
            now: time of receipt.

        Returns:
            `None`, or the reason why it is not used, with a detail: `future`, `sender_far`,
            `too_many_senders`, `older` than the last.
        """
        distance_m = math.hypot(*(reported.state[:2] - own_m))
        known = self.get(sender_id)
        ahead_s = _ahead_s(known, reported.stamp_s, now)
        reported = replace(reported, stamp_s=reported.stamp_s - ahead_s)
        refused = None
        if ahead_s > MAX_AHEAD_S:
            refused = "future", f"BSM of {sender_id.hex()}"
        elif known and not known.is_doubtful and ahead_s > known.ahead_s + _SET_AHEAD_S:
            known.is_doubtful = True
            refused = "future", f"BSM of {sender_id.hex()}"
        elif not distance_m <= RADIO_RANGE_M:
            refused = "sender_far", f"{sender_id.hex()} at {distance_m:.0f} m"
        elif known is None and len(self) >= MAX_SENDERS:
            refused = "too_many_senders", sender_id.hex()
        elif known is None:
            self[sender_id] = RemoteVehicle(reported, reported.stamp_s, acceleration_m_s2, ahead_s)
        elif known.reported.stamp_s > reported.stamp_s + _STAMP_ERROR_S:
            refused = "older", f"BSM of {sender_id.hex()}"
        else:
            if reported.stamp_s > known.reported.stamp_s:
                known.reported = reported
            known.acceleration_m_s2, known.ahead_s = acceleration_m_s2, ahead_s
            known.is_doubtful = False
        return refused

    def drop_silent(self, now: float) -> None:
        """Drop those that have been silent for `SILENCE_S`, or have changed their pseudonym.

        A vehicle that changes its pseudonym falls silent where a new one begins to send.
        """
        quiet = [key for key, each in self.items() if now - each.reported.stamp_s > _MISSED_BSMS_S]
        for key in quiet:
            last = self[key].reported
            is_gone = now - last.stamp_s > SILENCE_S
            if is_gone or any(
                each.first_s > last.stamp_s and _distance_m(last, each.reported) <= OVERLAP_M
                for each in self.values()
            ):
                del self[key]

    def forget_clocks(self) -> None:
        """Forget by how much their clocks are ahead, after a correction of UTC."""
        for each in self.values():
            each.ahead_s = 0.0

    def change_frame(self, turn: Array, shift: Array) -> None:
        """Map everything into another frame (`LocalFrame.mapping_from`)."""
        for each in self.values():
            mapped = map_state(each.reported.state, each.reported.covariance, turn, shift)
            each.reported = ReportedState(each.reported.stamp_s, *mapped)


def _ahead_s(known: RemoteVehicle | None, stamp_s: float, now: float) -> float:
    """Return by how much a sender's clock is ahead, with a stamp that is received now."""
    ahead_s = 0.0
    if known is not None:
        since_s = stamp_s - (known.reported.stamp_s + known.ahead_s)
        ahead_s = max(known.ahead_s - _CATCHING_UP * max(since_s, 0.0), 0.0)
    this_s = stamp_s - now
    return this_s if this_s > (ahead_s or CLOCK_TOLERANCE_S) else ahead_s


def _distance_m(earlier: ReportedState, later: ReportedState) -> float:
    """Distance between the earlier state, predicted to the later's time, and the later one."""
    dt_s = later.stamp_s - earlier.stamp_s
    predicted = earlier.state[:2] + dt_s * earlier.state[2:]
    return math.hypot(*(later.state[:2] - predicted))


def as_state_arrays(
    reported: Sequence[ReportedState], utc_ms: Callable[[float], int]
) -> StateArrays:
    """Return reported states as arrays; `utc_ms` converts their stamps."""
    return StateArrays(
        np.array([utc_ms(each.stamp_s) for each in reported], dtype=np.float64),
        np.array([each.state for each in reported]).T,
        np.array([each.covariance for each in reported]).transpose(1, 2, 0),
        np.ones(len(reported)),
    )


def as_perceived_objects(
    now: float,
    source: ObjectSource,
    vehicles: dict[bytes, RemoteVehicle],
    q: float,
    sensed: Collection[bytes | None] = (),
) -> list[PerceivedObject]:
    """Return vehicles with a radio, predicted to `now`.

    Args:
        now: the time.
        source: of all of them.
        vehicles: by temporary ID.
        q: spectral density of the acceleration noise, m^2/s^3.
        sensed: temporary IDs of those that own sensors measure too.
    """
    if not vehicles:
        return []
    ages_s = [max(now - each.reported.stamp_s, 0.0) for each in vehicles.values()]
    states, covariances = predict(
        np.stack([each.reported.state for each in vehicles.values()], axis=-1),
        np.stack([each.reported.covariance for each in vehicles.values()], axis=-1),
        np.array(ages_s),
        q,
    )
    return [
        PerceivedObject(
            stamp_s=now,
            name=temporary_id.hex(),
            source=source,
            state=tuple(state),
            covariance=tuple(map(tuple, covariance)),
            age_s=age_s,
            provenance=frozenset(),
            acceleration_m_s2=each.acceleration_m_s2,
            is_sensed=temporary_id in sensed,
        )
        for (temporary_id, each), state, covariance, age_s in zip(
            vehicles.items(),
            states.T.tolist(),
            covariances.transpose(2, 0, 1).tolist(),
            ages_s,
            strict=True,
        )
    ]
