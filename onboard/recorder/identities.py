"""Aliases of plates in recordings, and the communication IDs that a replay looks up by alias.

The cores use a plate to derive the communication ID of its vehicle, and to tell whether another
has almost the same number. So a recording holds an alias for each plate, which shows only that, and
the ID of each alias and epoch.
"""

import hashlib
import hmac
import secrets
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any

from typing_extensions import override

from onboard.errors import UserError
from onboard.lcca.plate_series import letters_and_number
from onboard.observations import DetectionList, Lead
from onboard.security.plate_digest import PlateDigest, normalised
from onboard.security.settings import PlateDigestSettings

ALIAS_LENGTH = 10
"""Four letters and six digits: valid in every plate format, and not changed by `normalised`."""
_LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ"
_NUMBERS, _SHIFTS = 100_000, 900_000


class Aliases:
    """Aliases of plates in one drive, by HMAC with a random key that is never stored."""

    def __init__(self, *, in_clear: bool) -> None:
        """Return plates unchanged if `in_clear`."""
        self._in_clear = in_clear
        self._key = secrets.token_bytes(16)

    def alias(self, plate: str) -> str:
        """Return the name of a plate in the recording.

        Plates with the same letters have aliases with the same letters, and numbers with the same
        difference: all are shifted by one that depends on the letters.
        """
        text = normalised(plate)
        if self._in_clear:
            return text
        letters, number = letters_and_number(text)
        higher, number = divmod(number, _NUMBERS)
        digest = hmac.digest(self._key, f"{letters} {higher}".encode(), hashlib.sha256)
        name = "".join(_LETTERS[byte % len(_LETTERS)] for byte in digest[:4])
        return f"{name}{number + int.from_bytes(digest[4:]) % _SHIFTS:06d}"

    def replace_plates(self, value: Any) -> Any:
        """Return the value with aliases in place of the plates in it, which are named `text`."""
        value_type: type = type(value)
        if not _may_hold_plate(value_type):
            return value
        match value:
            case Lead():
                value = replace(value, candidates=tuple(map(self.replace_plates, value.candidates)))
            case DetectionList():
                value = replace(value, cars=tuple(map(self.replace_plates, value.cars)))
        text = getattr(value, "text", None)
        return value if text is None else replace(value, text=self.alias(text))


@cache
def _may_hold_plate(value_type: type) -> bool:
    if issubclass(value_type, Lead | DetectionList) or hasattr(value_type, "text"):
        return True
    return is_dataclass(value_type) and any(each.name == "text" for each in fields(value_type))


class RecordingDigest(PlateDigest):
    """Reports every communication ID that it derives."""

    def __init__(
        self, settings: PlateDigestSettings, on_derived: Callable[[str, int, bytes], None]
    ) -> None:
        """Call `on_derived` with plate, epoch and ID, from the thread that derives the ID."""
        super().__init__(settings)
        self._on_derived = on_derived

    @override
    def _derive(self, plate: str, epoch: int) -> bytes:
        car_id = super()._derive(plate, epoch)
        self._on_derived(plate, epoch, car_id)
        return car_id


class ReplayedDigest(PlateDigest):
    """Looks up the communication IDs of a recording."""

    def __init__(
        self, settings: PlateDigestSettings, car_ids: Mapping[tuple[str, int], bytes]
    ) -> None:
        """Look up `car_ids` by plate, as named in the recording, and epoch."""
        super().__init__(settings)
        self._car_ids = car_ids

    @override
    def _derive(self, plate: str, epoch: int) -> bytes:
        car_id = self._car_ids.get((plate, epoch))
        if car_id is None:
            raise UserError(
                f"the recording has no ID of {plate} in epoch {epoch}:"
                " the replayed cores need the ID of a vehicle that the recorded cores did not need"
            )
        return car_id
