"""The local frame against geodesics on the ellipsoid, and frames against each other."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.local_frame import LocalFrame

latitudes = st.floats(-75, 75)
longitudes = st.floats(-180, 180)
metres = st.floats(-3000, 3000)


@pytest.mark.parametrize(
    ("latitude_deg", "east_m", "north_m"),
    # Length of 0.01 deg on the WGS 84 ellipsoid (NGA.STND.0036, radii of curvature).
    [(0.0, 1113.195, 1105.743), (45.0, 788.468, 1111.316), (60.0, 558.002, 1114.121)],
)
def test_a_hundredth_of_a_degree(latitude_deg: float, east_m: float, north_m: float) -> None:
    frame = LocalFrame(latitude_deg, 11.0)

    assert frame.position_m(latitude_deg, 11.01)[0] == pytest.approx(east_m, abs=0.01)
    assert frame.position_m(latitude_deg + 0.005, 11.0)[1] - frame.position_m(
        latitude_deg - 0.005, 11.0
    )[1] == pytest.approx(north_m, abs=0.01)


@given(st.tuples(latitudes, longitudes), st.tuples(metres, metres), st.tuples(metres, metres))
def test_a_place_is_the_same_seen_from_either_frame(
    here: tuple[float, float], there_m: tuple[float, float], place_m: tuple[float, float]
) -> None:
    def near(e: float, n: float, at: LocalFrame) -> tuple[float, float]:
        shrink = math.cos(math.radians(at.latitude_deg))
        return at.latitude_deg + n / 111_000, at.longitude_deg + e / 111_000 / shrink

    mine = LocalFrame(*here)
    yours = LocalFrame(*near(*there_m, mine))
    place = near(*place_m, yours)

    turn, shift = mine.mapping_from(yours)

    np.testing.assert_allclose(
        turn @ yours.position_m(*place) + shift, mine.position_m(*place), atol=0.01
    )


def test_across_the_date_line() -> None:
    west, east = LocalFrame(10.0, 179.9999), LocalFrame(10.0, -179.9999)

    turn, shift = west.mapping_from(east)

    assert shift[0] == pytest.approx(21.9, abs=0.1)
    np.testing.assert_allclose(turn, np.eye(2), atol=1e-5)
