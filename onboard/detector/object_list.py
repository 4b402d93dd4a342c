"""Reads what a detector sends: one datagram of JSON for each picture, cars or none.

    {"sent_s": 5120.35, "age_s": 0.04,
     "cars": [{"id": 7, "range_m": 31.5, "range_sigma_m": 1.5,
               "bearing_rad": -0.12, "bearing_sigma_rad": 0.01}]}

`sent_s` is when it was sent, on any clock of the detector's that runs steadily, and `age_s` how old
the picture was then. Ranges go from the camera (`mvs.sensing.camera_ahead_m`) to the side of a car
that faces it, bearings to its middle, clockwise from the own heading. A car keeps its `id` while it
is tracked. Other keys are ignored.
"""

import math
from collections import Counter, deque

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from onboard.observations import DetectionList, Discarded, VehicleDetection
from onboard.sensors.remote_clock import RemoteClock

MOST_CARS = 64
OLDEST_S = 1.0
LEAST_INTERVAL_S = 0.01
"""Pictures that come faster are dropped."""
_LATEST_S = 1e11
"""Three thousand years: more is not in seconds, but perhaps in ms since 1970."""


class _Outside(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


class _Car(_Outside):
    id: int = Field(ge=0, lt=1 << 31)
    range_m: float = Field(gt=0.0, le=500.0)
    range_sigma_m: float = Field(gt=0.0, le=100.0)
    bearing_rad: float = Field(ge=-math.pi, le=math.pi)
    bearing_sigma_rad: float = Field(gt=0.0, le=1.0)


class _ObjectList(_Outside):
    sent_s: float = Field(ge=-_LATEST_S, le=_LATEST_S)
    age_s: float = Field(ge=0.0, le=OLDEST_S)
    cars: list[_Car] = Field(max_length=MOST_CARS)


class ObjectListReader:
    """Makes observations of datagrams."""

    def __init__(self) -> None:
        """Start with nothing received."""
        self._clock = RemoteClock(latency_s=0.0)
        self._sent_s = -math.inf
        self._events: deque[DetectionList | Discarded] = deque()

    def receive_bytes(self, data: bytes, now: float) -> None:
        """One datagram."""
        try:
            told = _ObjectList.model_validate_json(data)
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False)[0]
            where = ".".join(map(str, first["loc"]))
            return self._discard(now, "no_object_list", f"{where}: {first['msg']}".lstrip(": "))
        (_, most), *_ = Counter(car.id for car in told.cars).most_common(1) or [(0, 0)]
        if most > 1:
            return self._discard(now, "repeated_id", "one id, several cars")
        if abs(told.sent_s - self._sent_s) < LEAST_INTERVAL_S:
            return self._discard(now, "too_often", f"less than {LEAST_INTERVAL_S} s after another")
        self._sent_s = told.sent_s
        stamp_s = self._clock.stamp_s(told.sent_s, now) - told.age_s
        cars = tuple(
            VehicleDetection(
                stamp_s,
                car.id,
                car.range_m,
                car.range_sigma_m,
                car.bearing_rad,
                car.bearing_sigma_rad,
            )
            for car in told.cars
        )
        self._events.append(DetectionList(stamp_s, cars))
        return None

    def next_event(self) -> DetectionList | Discarded | None:
        """The oldest event not yet taken."""
        return self._events.popleft() if self._events else None

    def _discard(self, now: float, reason: str, detail: str) -> None:
        self._events.append(Discarded(now, "detector", reason, detail))
