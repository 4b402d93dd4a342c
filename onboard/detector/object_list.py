"""Decodes the detector's datagrams: one JSON object list for each image or sweep, also if empty.

    {"sent_s": 5120.35, "age_s": 0.04,
     "cars": [{"id": 7, "range_m": 31.5, "range_sigma_m": 1.5,
               "bearing_rad": -0.12, "bearing_sigma_rad": 0.01,
               "range_rate_m_s": -2.5, "range_rate_sigma_m_s": 0.1}]}

`sent_s` is the time of sending on a monotonic clock of the detector, `age_s` the age of the image
at that time. A range goes from the camera (`mvs.sensing.camera_ahead_m`) to the visible side of the
vehicle, a bearing to its centre, clockwise from the host vehicle's heading. A vehicle keeps its
`id` while it is tracked. The range rate, positive while the range grows, may be left out with its
sigma; it is measured (radar), not derived from ranges. Other keys are ignored.
"""

import math
from collections import Counter, deque
from dataclasses import replace
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from onboard.detector.range_rate_check import RangeRateCheck
from onboard.errors import first_mistake
from onboard.observations import DetectionList, Discarded, VehicleDetection
from onboard.sensors.remote_clock import RemoteClock

MOST_VEHICLES = 64
"""In one datagram."""
OLDEST_S = 1.0
"""Largest age of an image when it is sent."""
LEAST_INTERVAL_S = 0.01
"""Smallest time between two images; faster ones are discarded."""
_LATEST_S = 1e11
"""Three thousand years: a larger time is in another unit, such as ms since 1970."""


class _External(BaseModel):
    """Strict about types, but not about unknown keys."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


class _Object(_External):
    id: int = Field(ge=0, lt=1 << 31)
    range_m: float = Field(gt=0.0, le=500.0)
    range_sigma_m: float = Field(gt=0.0, le=100.0)
    bearing_rad: float = Field(ge=-math.pi, le=math.pi)
    bearing_sigma_rad: float = Field(gt=0.0, le=1.0)
    range_rate_m_s: float | None = Field(None, ge=-150.0, le=150.0)
    range_rate_sigma_m_s: float | None = Field(None, gt=0.0, le=50.0)

    @model_validator(mode="after")
    def _has_rate_with_sigma(self) -> Self:
        if (self.range_rate_m_s is None) != (self.range_rate_sigma_m_s is None):
            raise ValueError("range_rate_m_s and range_rate_sigma_m_s: both or none")
        return self


class _ObjectList(_External):
    sent_s: float = Field(ge=-_LATEST_S, le=_LATEST_S)
    age_s: float = Field(ge=0.0, le=OLDEST_S)
    cars: list[_Object] = Field(max_length=MOST_VEHICLES)


class ObjectListReader:
    """Converts datagrams to detections on the host's clock."""

    def __init__(self) -> None:
        """Start with nothing received."""
        self._clock = RemoteClock(latency_s=0.0)
        self._sent_s = -math.inf
        self._range_rates = RangeRateCheck()
        self._events: deque[DetectionList | Discarded] = deque()

    def receive_bytes(self, data: bytes, now: float) -> None:
        """Decode one datagram; it is used as a whole or discarded with a reason."""
        try:
            received = _ObjectList.model_validate_json(data)
        except ValidationError as error:
            return self._discard(now, "no_object_list", first_mistake(error))
        (_, most), *_ = Counter(each.id for each in received.cars).most_common(1) or [(0, 0)]
        if most > 1:
            return self._discard(now, "repeated_id", "two vehicles have one id")
        if abs(received.sent_s - self._sent_s) < LEAST_INTERVAL_S:
            return self._discard(now, "too_often", f"less than {LEAST_INTERVAL_S} s after another")
        self._sent_s = received.sent_s
        stamp_s = self._clock.receive_stamp(received.sent_s, now) - received.age_s
        detections = tuple(
            VehicleDetection(
                stamp_s,
                each.id,
                each.range_m,
                each.range_sigma_m,
                each.bearing_rad,
                each.bearing_sigma_rad,
                range_rate_m_s=each.range_rate_m_s,
                range_rate_sigma_m_s=each.range_rate_sigma_m_s,
            )
            for each in received.cars
        )
        contradicted = self._range_rates.contradicted(detections)
        if contradicted:
            named = ", ".join(map(str, sorted(contradicted)))
            self._discard(now, "range_rate", f"contradicts the ranges of {named}")
            detections = tuple(
                replace(each, range_rate_m_s=None, range_rate_sigma_m_s=None)
                if each.track_id in contradicted
                else each
                for each in detections
            )
        self._events.append(DetectionList(stamp_s, detections))
        return None

    def next_event(self) -> DetectionList | Discarded | None:
        """Return the oldest event not yet taken, or `None`."""
        return self._events.popleft() if self._events else None

    def _discard(self, now: float, reason: str, detail: str) -> None:
        self._events.append(Discarded(now, "detector", reason, detail))
