"""The cars with a radio: where each says that it is, and when its footers may be read."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.kinematics.arrays import Array, StateArrays, map_state
from onboard.mvs.host_vehicle import ReportedState
from onboard.mvs.perceived_object import ObjectSource, PerceivedObject
from onboard.mvs.settings import FooterValidationSettings
from onboard.tracking.kalman import predict

_QUIET_S = 0.25
"""Who speaks ten times a second and has been silent for so long has lost two in a row, or more."""


@dataclass(slots=True, eq=False)
class RemoteVehicle:
    """A car with a radio."""

    reported: ReportedState
    first_s: float
    """Stamp of the first that was heard of it under its ID."""
    acceleration_m_s2: float | None = None
    footers_due_at: float = -math.inf
    """When it has had its time for all footers that were read."""

    def may_send_footer(self, settings: FooterValidationSettings, now: float) -> bool:
        """Whether a footer that comes now is none too many; if so, it is counted."""
        if self.footers_due_at - now > (settings.footers_at_once - 1) / settings.footers_per_s:
            return False
        self.footers_due_at = max(self.footers_due_at, now) + 1.0 / settings.footers_per_s
        return True


class RemoteVehicles(dict[bytes, RemoteVehicle]):
    """Those that were heard lately, by temporary ID."""

    def receive(
        self,
        sender_id: bytes,
        reported: ReportedState,
        acceleration_m_s2: float | None,
        *,
        own_m: Array,
        settings: FooterValidationSettings,
        now: float,
    ) -> tuple[str, str] | None:
        """What one says of itself.

        Args:
            sender_id: temporary ID.
            reported: its state, in the own car's frame.
            acceleration_m_s2: forwards, if it says so.
            own_m: where the own car is (2).
            settings: what is believed.
            now: when it came.

        Returns:
            `None`, or why it is not used, with a detail: `future`, `sender_far`,
            `too_many_senders`.
        """
        away_m = math.hypot(*(reported.state[:2] - own_m))
        known = self.get(sender_id)
        refused = None
        if reported.stamp_s > now + settings.clock_tolerance_s:
            refused = "future", f"BSM of {sender_id.hex()}"
        elif not away_m <= settings.radio_range_m:
            refused = "sender_far", f"{sender_id.hex()} at {away_m:.0f} m"
        elif known is None and len(self) >= settings.senders:
            refused = "too_many_senders", sender_id.hex()
        elif known is None:
            known = self[sender_id] = RemoteVehicle(reported, reported.stamp_s)
        elif known.reported.stamp_s <= reported.stamp_s:
            known.reported = reported
        if known is not None:
            known.acceleration_m_s2 = acceleration_m_s2
        return refused

    def forget(self, silence_s: float, overlap_m: float, now: float) -> None:
        """Drop those that have been silent for so long, or speak on under another ID.

        A car that changes its pseudonym falls silent where a new one begins to speak.
        """
        quiet = [key for key, car in self.items() if now - car.reported.stamp_s > _QUIET_S]
        for key in quiet:
            was = self[key].reported
            is_gone = now - was.stamp_s > silence_s
            if is_gone or any(
                car.first_s > was.stamp_s and _apart_m(was, car.reported) <= overlap_m
                for car in self.values()
            ):
                del self[key]

    def map_to(self, turn: Array, shift: Array) -> None:
        """Bring everything into another frame (`LocalFrame.mapping_from`)."""
        for car in self.values():
            mapped = map_state(car.reported.state, car.reported.covariance, turn, shift)
            car.reported = ReportedState(car.reported.stamp_s, *mapped)


def _apart_m(earlier: ReportedState, later: ReportedState) -> float:
    dt_s = later.stamp_s - earlier.stamp_s
    place = earlier.state[:2] + dt_s * earlier.state[2:]
    return math.hypot(*(later.state[:2] - place))


def as_kinematics(reported: Sequence[ReportedState], utc_ms: Callable[[float], int]) -> StateArrays:
    """What cars say of themselves, side by side."""
    return StateArrays(
        np.array([utc_ms(each.stamp_s) for each in reported], dtype=np.float64),
        np.array([each.state for each in reported]).T,
        np.array([each.covariance for each in reported]).transpose(1, 2, 0),
        np.ones(len(reported)),
    )


def as_perceived_objects(
    now: float, source: ObjectSource, cars: dict[bytes, RemoteVehicle], acceleration_density: float
) -> list[PerceivedObject]:
    """Cars that say themselves where they are, as they are expected to be at `now`."""
    if not cars:
        return []
    ages_s = [max(now - car.reported.stamp_s, 0.0) for car in cars.values()]
    states, covariances = predict(
        np.stack([car.reported.state for car in cars.values()], axis=-1),
        np.stack([car.reported.covariance for car in cars.values()], axis=-1),
        np.array(ages_s),
        acceleration_density,
    )
    return [
        PerceivedObject(
            stamp_s=now,
            name=car_id.hex(),
            source=source,
            state=tuple(state),
            covariance=tuple(map(tuple, covariance)),
            age_s=age_s,
            provenance=frozenset(),
            acceleration_m_s2=car.acceleration_m_s2,
        )
        for (car_id, car), state, covariance, age_s in zip(
            cars.items(),
            states.T.tolist(),
            covariances.transpose(2, 0, 1).tolist(),
            ages_s,
            strict=True,
        )
    ]
