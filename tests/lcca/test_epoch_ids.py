"""IDs of the adjacent epochs: when they are known."""

import pytest

from onboard.lcca.epoch_ids import ADJACENT_S, car_ids
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings

BEGINS_S = 1_700_000_100.0
MIDDLE_S, ENDS_S = BEGINS_S + 150.0, BEGINS_S + 300.0
DIGEST = PlateDigest(PlateDigestSettings(scrypt_log2_n=1))
PLATE = "GN417KB"


@pytest.mark.parametrize(
    ("utc_s", "knows_previous", "knows_next"),
    [
        (BEGINS_S, True, False),
        (BEGINS_S + ADJACENT_S - 0.1, True, False),
        (MIDDLE_S, False, False),
        (ENDS_S - ADJACENT_S + 0.1, False, True),
    ],
)
def test_adjacent_ids_are_looked_up_near_the_change_only(
    utc_s: float, knows_previous: bool, knows_next: bool
) -> None:
    ids = car_ids(DIGEST, PLATE, utc_s)

    assert ids.present == DIGEST.car_id(PLATE, MIDDLE_S)
    assert ids.previous == (DIGEST.car_id(PLATE, BEGINS_S - 1.0) if knows_previous else None)
    assert ids.following == (DIGEST.car_id(PLATE, ENDS_S) if knows_next else None)
