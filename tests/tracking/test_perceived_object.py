"""Where remote vehicles are relative to the host vehicle."""

import math

import pytest

from onboard.tracking.perceived_object import ObjectSource, PerceivedObject, remote_offsets_m


def perceived(name: str, source: ObjectSource, east_m: float, north_m: float) -> PerceivedObject:
    rows = tuple(tuple(4.0 if row == column else 0.0 for column in range(4)) for row in range(4))
    return PerceivedObject(0.0, name, source, (east_m, north_m, 0.0, 0.0), rows, 0.1, frozenset())


@pytest.mark.parametrize(
    ("heading_deg", "ahead_m", "right_m"),
    [(0.0, 30.0, 4.0), (90.0, 4.0, -30.0), (180.0, -30.0, -4.0), (270.0, -4.0, 30.0)],
)
def test_offsets_are_ahead_and_to_the_right(
    heading_deg: float, ahead_m: float, right_m: float
) -> None:
    host = perceived("00000001", ObjectSource.HOST, 10.0, 20.0)
    others = [
        perceived("0000000a", ObjectSource.BSM, 14.0, 50.0),
        perceived("17", ObjectSource.SENSOR, 14.0, 50.0),
    ]

    offsets_m = remote_offsets_m(host, others, math.radians(heading_deg))

    expected = (ahead_m, right_m, math.sqrt(8.0))
    assert offsets_m == {bytes.fromhex("0000000a"): pytest.approx(expected)}
