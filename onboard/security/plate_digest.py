"""The communication ID of a car: a keyed digest of its plate that changes with time.

Whoever sees a plate can compute the ID its car sends under, and nobody reads the plate off the
air. What that protects against, and what it does not, is in docs/decisions/0050.
"""

import hashlib
import math
import struct
import unicodedata
from functools import lru_cache

from onboard.security.settings import PlateDigestSettings

_LOOK_ALIKES = str.maketrans("OI", "01")
"""Pairs that many plate fonts draw alike: a camera that mistakes one still finds the car."""

_REMEMBERED = 256
"""Derivations kept: every plate in view, in this epoch and the next."""


class PlateDigest:
    """Derives communication IDs, each (plate, epoch) once."""

    def __init__(self, settings: PlateDigestSettings) -> None:
        self._settings = settings
        self._derive = lru_cache(maxsize=_REMEMBERED)(self._derive_slowly)

    def car_id(self, plate_text: str, utc_s: float) -> bytes:
        """Return the eight bytes that the car with this plate is known by at `utc_s`.

        The first call for a plate in an epoch is slow by design. Calling it ahead of time, with
        `epoch_ends_at(now)`, makes the switch instant.

        Raises:
            ValueError: the plate has no letter and no digit.
        """
        return self._derive(normalised(plate_text), self.epoch(utc_s))

    def epoch_ends_at(self, utc_s: float) -> float:
        """Return the UTC second from which the IDs of the next epoch hold."""
        return (self.epoch(utc_s) + 1) * self._settings.epoch_s

    def epoch(self, utc_s: float) -> int:
        """Return the number of the epoch at `utc_s`; the same for all cars."""
        return math.floor(utc_s / self._settings.epoch_s)

    def _derive_slowly(self, plate: str, epoch: int) -> bytes:
        n = 1 << self._settings.scrypt_log2_n
        key = self._settings.community_key.get_secret_value().encode()
        return hashlib.scrypt(
            plate.encode(),
            salt=struct.pack(">q", epoch) + key,
            n=n,
            r=8,
            p=1,
            maxmem=2 * 128 * 8 * n + 1_000_000,
            dklen=8,
        )


def normalised(plate_text: str) -> str:
    """Return the plate as it is digested: upper case, letters and digits only, O as 0, I as 1.

    Raises:
        ValueError: nothing is left.
    """
    upper = unicodedata.normalize("NFKC", plate_text).upper()
    plate = "".join(filter(str.isalnum, upper)).translate(_LOOK_ALIKES)
    if not plate:
        raise ValueError(f"a plate has letters or digits (given {plate_text!r})")
    return plate
