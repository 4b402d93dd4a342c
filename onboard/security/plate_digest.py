"""The communication ID of a car: a keyed digest of its plate that changes every epoch.

A car that reads a plate by camera can compute the ID of that car, and the plate cannot be read from
messages. The limits of this protection are in docs/design/security.md, "Plate digests".
"""

import hashlib
import math
import struct
import unicodedata
from functools import lru_cache

from onboard.security.settings import PlateDigestSettings

_LOOK_ALIKES = str.maketrans("OI", "01")
"""Pairs that many plate fonts draw alike: a misread one still gives the right ID."""

_CACHE_SIZE = 256
"""Derivations kept: every plate in view, in this epoch and the next."""


class PlateDigest:
    """Derives communication IDs, each (plate, epoch) once."""

    def __init__(self, settings: PlateDigestSettings) -> None:
        self._settings = settings
        self._derive = lru_cache(maxsize=_CACHE_SIZE)(self._derive_uncached)

    def car_id(self, plate_text: str, utc_s: float) -> bytes:
        """Return the communication ID (8 bytes) of the car with this plate at `utc_s`.

        The first call for a plate in an epoch is slow by design; a call with `epoch_ends_at(now)`
        ahead of time makes the change of epoch instant.

        Raises:
            ValueError: the plate has no letter and no digit.
        """
        return self._derive(normalised(plate_text), self.epoch(utc_s))

    def epoch_ends_at(self, utc_s: float) -> float:
        """Return the UTC second from which the IDs of the next epoch are valid."""
        return (self.epoch(utc_s) + 1) * self._settings.epoch_s

    def epoch(self, utc_s: float) -> int:
        """Return the number of the epoch at `utc_s`; the same for all cars."""
        return math.floor(utc_s / self._settings.epoch_s)

    def _derive_uncached(self, plate: str, epoch: int) -> bytes:
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
