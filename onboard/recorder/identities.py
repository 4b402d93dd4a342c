"""How a recording speaks of cars without their plates, and how a replay knows them all the same.

The cores make one use of a plate: they derive the ID that its car goes by. So the recording gives
each plate a word, and notes which ID the word had in which epoch; the replay looks it up.
"""

import hashlib
import hmac
import secrets
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from typing_extensions import override

from onboard.errors import UserError
from onboard.observations import Lead, Plate, VehicleDetection
from onboard.security.plate_digest import PlateDigest, normalised
from onboard.security.settings import PlateDigestSettings

WORD_LENGTH = 10
"""Hexadecimal: a plate's pattern allows it, and no letter of it is mistaken for a digit."""


class Aliases:
    """Words for plates, for one drive: the key is never written, and gone with the process."""

    def __init__(self, *, in_clear: bool) -> None:
        """Leave plates as they are if `in_clear`."""
        self._in_clear = in_clear
        self._key = secrets.token_bytes(16)

    def word(self, plate: str) -> str:
        """What the recording calls the car with this plate."""
        text = normalised(plate)
        if self._in_clear:
            return text
        return hmac.digest(self._key, text.encode(), hashlib.sha256).hex()[:WORD_LENGTH].upper()

    def hide(self, value: Any) -> Any:
        """The value as it may be written."""
        if isinstance(value, Lead | Plate | VehicleDetection) and value.text is not None:
            return replace(value, text=self.word(value.text))
        return value


class RecordingDigest(PlateDigest):
    """Tells every ID that it derives."""

    def __init__(
        self, settings: PlateDigestSettings, note: Callable[[str, int, bytes], None]
    ) -> None:
        """`note` gets plate, epoch and ID, from whichever thread asked first."""
        super().__init__(settings)
        self._note = note

    @override
    def _derive_uncached(self, plate: str, epoch: int) -> bytes:
        car_id = super()._derive_uncached(plate, epoch)
        self._note(plate, epoch, car_id)
        return car_id


class ReplayedDigest(PlateDigest):
    """Knows the IDs of a recording, and no other."""

    def __init__(
        self, settings: PlateDigestSettings, car_ids: Mapping[tuple[str, int], bytes]
    ) -> None:
        """`car_ids` by plate, as the recording names it, and epoch."""
        super().__init__(settings)
        self._car_ids = car_ids

    @override
    def _derive_uncached(self, plate: str, epoch: int) -> bytes:
        car_id = self._car_ids.get((plate, epoch))
        if car_id is None:
            raise UserError(
                f"the recording does not say what ID {plate} has in epoch {epoch}:"
                " these cores ask for other cars than the recorded ones did"
            )
        return car_id
