"""Communication IDs of the present epoch and, near its ends, of the epochs before and after it.

Clocks differ, so other cars use the IDs of the next epoch before the own clock does, and those of
the previous one after it. Whoever knows a plate derives all of its IDs. A leader several cars ahead
is known by its present ID only; its next one comes with the replies of the predecessor, masked by
a secret that follows from the predecessor's plate. A listener without the plate cannot link the two
IDs, not even once both have been sent.
"""

import hashlib
import hmac
from dataclasses import replace
from typing import NamedTuple

from onboard.messages.lcca import NO_ID, CarId, GroupMessage, Reply
from onboard.security.plate_digest import PlateDigest

ADJACENT_S = 5.0
"""Time before and after the change of epochs in which adjacent IDs are looked up: clocks may
differ by 2 s, and the groups need their time."""

OWN_NEXT_S = 60.0
"""Time before the change at which the own next ID is given to the cars behind: it takes 0.5 s for
each car on its way down a group."""


class CarIds(NamedTuple):
    """IDs of one car."""

    present: CarId | None
    """`None` if it is not known."""
    previous: CarId | None = None
    """`None` except in the first `ADJACENT_S` of an epoch."""
    following: CarId | None = None
    """`None` except in the last `ADJACENT_S` of an epoch."""


class EpochIds:
    """Looks up IDs by plate and time; derived by `PlateDigest`."""

    def __init__(self, digest: PlateDigest, own_plate: str) -> None:
        """Look up by `digest`; replies are masked by `own_plate`."""
        self._digest = digest
        self._own_plate = own_plate

    def of(self, plate_text: str, utc_s: float) -> CarIds:
        """Return the IDs of the car with this plate.

        Args:
            plate_text: its plate.
            utc_s: seconds since 1970.

        Raises:
            ValueError: the plate has no letter and no digit.
        """
        before_s, after_s = utc_s - ADJACENT_S, utc_s + ADJACENT_S
        epoch = self._digest.epoch(utc_s)
        return CarIds(
            self._digest.car_id(plate_text, utc_s),
            self._digest.car_id(plate_text, before_s)
            if self._digest.epoch(before_s) != epoch
            else None,
            self._digest.car_id(plate_text, after_s)
            if self._digest.epoch(after_s) != epoch
            else None,
        )

    def own_next(self, utc_s: float) -> CarId | None:
        """Return the own ID of the next epoch in the last `OWN_NEXT_S` of this one."""
        ends_at_utc_s = self._digest.epoch_ends_at(utc_s)
        if utc_s < ends_at_utc_s - OWN_NEXT_S:
            return None
        return self._digest.car_id(self._own_plate, ends_at_utc_s)

    def to_send(self, message: GroupMessage, utc_s: float) -> GroupMessage:
        """Return an own message with the IDs of other epochs masked.

        Args:
            message: in clear.
            utc_s: seconds since 1970.
        """
        return self._masked(message, self._own_plate, utc_s)

    def received(self, message: GroupMessage, lead_text: str | None, utc_s: float) -> GroupMessage:
        """Return a received message with the IDs of other epochs in clear.

        Those that cannot be read become `NO_ID`.

        Args:
            message: masked.
            lead_text: plate of the lead, if it is known.
            utc_s: seconds since 1970.
        """
        return self._masked(message, lead_text, utc_s)

    def _masked(self, message: GroupMessage, plate: str | None, utc_s: float) -> GroupMessage:
        """Mask, or unmask, by the plate of the car that replies."""
        if not isinstance(message, Reply):
            return message
        secret = self._secret(plate, message.sender_id, utc_s)
        return replace(
            message, next_leader_id=_xor(message.next_leader_id, message.leader_id, secret)
        )

    def _secret(self, plate_text: str | None, car_id: CarId, utc_s: float) -> bytes | None:
        """Return the secret of the plate's epoch in which `car_id` is its ID, near the present."""
        if plate_text is None:
            return None
        at_s = (utc_s, utc_s - ADJACENT_S, utc_s + ADJACENT_S)
        return next(
            (
                self._digest.secret(plate_text, each_s)
                for each_s in at_s
                if self._digest.car_id(plate_text, each_s) == car_id
            ),
            None,
        )


def _xor(masked_id: CarId, named_id: CarId, secret: bytes | None) -> CarId:
    """Mask or unmask an ID; each named ID has a mask of its own."""
    if masked_id == NO_ID or secret is None:
        return NO_ID
    mask = hmac.digest(secret, named_id, hashlib.sha256)
    return bytes(a ^ b for a, b in zip(masked_id, mask, strict=False))
