"""Compares range rates with ranges: a detector may state what it does not measure.

The range rate of a vehicle is integrated over `SPAN_S` and compared with the change of its range.
A vehicle whose range rates contradict its ranges has none until both have agreed over another span.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from onboard.observations import VehicleDetection

SPAN_S = 1.0
"""Time over which ranges and range rates are compared."""
MOST_SIGMAS = 5.0
"""A larger difference is a contradiction."""
FACE_M = 0.5
"""Change of the range while a vehicle turns and shows another side, beside sigmas."""


@dataclass(slots=True)
class _Span:
    """One vehicle since the begin of a span."""

    begin: VehicleDetection
    last: VehicleDetection
    integral_m: float = 0.0
    is_trusted: bool = True

    def add(self, detection: VehicleDetection) -> bool:
        """Add the next detection; returns whether the span contradicts it."""
        elapsed_s = detection.stamp_s - self.last.stamp_s
        rates_m_s = (self.last.range_rate_m_s or 0.0) + (detection.range_rate_m_s or 0.0)
        self.integral_m += rates_m_s / 2.0 * elapsed_s
        self.last = detection
        span_s = detection.stamp_s - self.begin.stamp_s
        off_m = detection.range_m - self.begin.range_m - self.integral_m
        variance = self.begin.range_sigma_m**2 + detection.range_sigma_m**2
        variance += ((detection.range_rate_sigma_m_s or 0.0) * span_s) ** 2
        return abs(off_m) > FACE_M + MOST_SIGMAS * math.sqrt(variance)


class RangeRateCheck:
    """Checks all vehicles of one detector."""

    def __init__(self) -> None:
        self._spans: dict[int, _Span] = {}

    def contradicted(self, detections: Iterable[VehicleDetection]) -> set[int]:
        """Take the detections of one image or sweep.

        Returns:
            the numbers of the tracks whose range rates must not be used.
        """
        spans: dict[int, _Span] = {}
        for each in detections:
            if each.range_rate_m_s is None:
                continue
            span = self._spans.get(each.track_id)
            if span is None or not 0.0 < each.stamp_s - span.last.stamp_s <= SPAN_S:
                spans[each.track_id] = _Span(each, each)
                continue
            is_over = span.last.stamp_s - span.begin.stamp_s >= SPAN_S
            if span.add(each):
                span = _Span(each, each, is_trusted=False)
            elif is_over:
                span = _Span(each, each)
            spans[each.track_id] = span
        self._spans = spans
        return {track_id for track_id, span in spans.items() if not span.is_trusted}
