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

_ID_BYTES, _SECRET_BYTES = 8, 16

_CACHE_SIZE = 256
"""Derivations kept, the least recently used dropped first. A lead's 16 candidates in this epoch and
the next and the own plate's take 34: seven leads in turn."""


class PlateDigest:
    """Derives communication IDs, each (plate, epoch) once.

    Threads may share it: two that need one ID at the same moment may both derive it.
    """

    def __init__(self, settings: PlateDigestSettings) -> None:
        self._settings = settings
        # The cache is atomic and holds, for each (plate, epoch), a list of the digest once derived.
        self._derived = lru_cache(maxsize=_CACHE_SIZE)(_not_derived)

    def car_id(self, plate_text: str, utc_s: float) -> bytes:
        """Return the communication ID (8 bytes) of the car with this plate at `utc_s`.

        The first call for a plate in an epoch is slow by design; a call with `epoch_ends_at(now)`
        ahead of time makes the change of epoch instant.

        Raises:
            ValueError: the plate has no letter and no digit.
        """
        return self._digest(plate_text, utc_s)[:_ID_BYTES]

    def secret(self, plate_text: str, utc_s: float) -> bytes:
        """Return 16 bytes that, like the ID, follow from the plate, but are never sent.

        Raises:
            ValueError: the plate has no letter and no digit.
        """
        return self._digest(plate_text, utc_s)[_ID_BYTES:]

    def is_derived(self, plate_text: str, utc_s: float) -> bool:
        """Whether `car_id` returns at once.

        Raises:
            ValueError: the plate has no letter and no digit.
        """
        return bool(self._derived(normalised(plate_text), self.epoch(utc_s)))

    def epoch_ends_at(self, utc_s: float) -> float:
        """Return the UTC second from which the IDs of the next epoch are valid."""
        return self.begins_at(self.epoch(utc_s) + 1)

    def begins_at(self, epoch: int) -> float:
        """Return the UTC second at which an epoch begins."""
        return epoch * self._settings.epoch_s

    def epoch(self, utc_s: float) -> int:
        """Return the number of the epoch at `utc_s`; the same for all cars."""
        return math.floor(utc_s / self._settings.epoch_s)

    def _digest(self, plate_text: str, utc_s: float) -> bytes:
        plate, epoch = normalised(plate_text), self.epoch(utc_s)
        derived = self._derived(plate, epoch)
        if not derived:
            derived.append(self._derive(plate, epoch))
        return derived[0]

    def _derive(self, plate: str, epoch: int) -> bytes:
        n = 1 << self._settings.scrypt_log2_n
        key = self._settings.community_key.get_secret_value().encode()
        return hashlib.scrypt(
            plate.encode(),
            salt=struct.pack(">q", epoch) + key,
            n=n,
            r=8,
            p=1,
            maxmem=128 * 8 * n + 1_000_000,  # OpenSSL takes less than 2 GiB
            dklen=_ID_BYTES + _SECRET_BYTES,  # its length leaves the first bytes as they are
        )


def _not_derived(_plate: str, _epoch: int) -> list[bytes]:
    return []


@lru_cache(maxsize=_CACHE_SIZE)
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
