"""Communication IDs of the present epoch and, near its ends, of the epochs before and after it.

Clocks differ, so other cars use the IDs of the next epoch before the own clock does, and those of
the previous one after it. Whoever knows a plate derives all of its IDs.
"""

from typing import NamedTuple

from onboard.messages.lcca import CarId
from onboard.security.plate_digest import PlateDigest

ADJACENT_S = 5.0
"""Time before and after the change of epochs in which adjacent IDs are looked up: clocks may
differ by 2 s, and the groups need their time."""


class CarIds(NamedTuple):
    """IDs of one car."""

    present: CarId | None
    """`None` if it is not known."""
    previous: CarId | None = None
    """`None` except in the first `ADJACENT_S` of an epoch."""
    following: CarId | None = None
    """`None` except in the last `ADJACENT_S` of an epoch."""


def car_ids(digest: PlateDigest, plate_text: str, utc_s: float) -> CarIds:
    """Return the IDs of the car with this plate.

    Args:
        digest: derives them.
        plate_text: its plate.
        utc_s: seconds since 1970.

    Raises:
        ValueError: the plate has no letter and no digit.
    """
    before_s, after_s = utc_s - ADJACENT_S, utc_s + ADJACENT_S
    epoch = digest.epoch(utc_s)
    return CarIds(
        digest.car_id(plate_text, utc_s),
        digest.car_id(plate_text, before_s) if digest.epoch(before_s) != epoch else None,
        digest.car_id(plate_text, after_s) if digest.epoch(after_s) != epoch else None,
    )
