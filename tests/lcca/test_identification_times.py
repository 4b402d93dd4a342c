"""The followers of close rows whose leads took longest to identify, of 2,300."""

import pytest

from tests.lcca.identification_times import identified_after_s


@pytest.mark.parametrize(
    ("seed", "within_s"),
    [
        pytest.param(391, 8.0, id="the plate is misread for seconds, and not listed at first"),
        pytest.param(1459, 2.5, id="its text is listed as unlikely"),
        pytest.param(776, 20.0, id="a near number is read with certainty, until motion decides"),
    ],
)
def test_a_misread_lead_is_identified(seed: int, within_s: float) -> None:
    assert identified_after_s(seed) < within_s
