"""Variance that the measurements of an observer have in common."""

import pytest

from onboard.tracking.common_errors import common_variance_m2
from onboard.tracking.evidence import Provenance, measurement_id

SIGMA_M = {b"AAAA": 1.0, b"BBBB": 2.0}


def measured(**counts: int) -> Provenance:
    return frozenset(
        measurement_id(name.encode() * 4, stamp_ms)
        for name, count in counts.items()
        for stamp_ms in range(count)
    )


@pytest.mark.parametrize(
    ("provenance", "variance_m2"),
    [
        (measured(A=1), 0.0),
        (measured(A=1, B=1), 0.0),
        (measured(A=10), 1.0 * 0.9),
        (measured(B=10), 4.0 * 0.9),
        (measured(A=5, B=5), (1.0 + 4.0) * 0.2),
    ],
)
def test_what_the_filter_leaves_out(provenance: Provenance, variance_m2: float) -> None:
    assert common_variance_m2(provenance, SIGMA_M.__getitem__) == pytest.approx(variance_m2)
