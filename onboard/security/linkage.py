"""Linkage values: what revoked certificates of one vehicle have in common (IEEE 1609.2, 5.1.3.4).

A certificate has its period i and a linkage value. The value follows from two seeds, of two
authorities of which neither can link certificates alone. A list publishes the seeds of period
i_rev: values of later periods follow, those of earlier ones cannot be computed.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from cryptography.hazmat.primitives.ciphers import Cipher, algorithms, modes

_BLOCK_BYTES, _VALUE_BYTES = 16, 9


@dataclass(frozen=True, slots=True)
class LinkageSeed:
    """Seed of one linkage authority for one vehicle or group, and one period."""

    la_id: bytes
    """Identifier of the authority, 2 bytes."""
    seed: bytes
    """16 bytes."""

    def next(self) -> "LinkageSeed":
        """Return the seed of the next period (seedEvoFn1-sha256)."""
        padded = self.la_id + self.seed + bytes(14)
        return LinkageSeed(self.la_id, hashlib.sha256(padded).digest()[:16])

    def one_way(self, indices: Sequence[bytes]) -> int:
        """Return a block of 16 bytes for each index j of 4 bytes, all as one number (lvGenFn1)."""
        blocks = b"".join(self.la_id + index + bytes(10) for index in indices)
        # Davies-Meyer: each block is a one-way function of its own, so ECB is what is needed.
        cipher = Cipher(algorithms.AES(self.seed), modes.ECB())  # noqa: S305
        encrypted = cipher.encryptor().update(blocks)
        return int.from_bytes(encrypted, "big") ^ int.from_bytes(blocks, "big")


SeedPair = tuple[LinkageSeed, LinkageSeed]


def linkage_values(seeds: SeedPair, indices: Sequence[bytes]) -> list[bytes]:
    """Return the linkage values of 9 bytes for each index j of 4 bytes (lvGenFn1-aes128)."""
    first, second = (seed.one_way(indices) for seed in seeds)
    size = _BLOCK_BYTES * len(indices)
    values = (first ^ second).to_bytes(size, "big")
    return [values[start : start + _VALUE_BYTES] for start in range(0, size, _BLOCK_BYTES)]


def after(seeds: SeedPair, periods: int) -> SeedPair:
    """Return the seeds of `periods` periods later."""
    first, second = seeds
    for _ in range(periods):
        first, second = first.next(), second.next()
    return first, second
