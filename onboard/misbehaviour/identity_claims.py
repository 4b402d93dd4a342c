"""Which signer uses which ID: certificates do not name the IDs in their owners' messages."""

from collections import OrderedDict
from dataclasses import dataclass


@dataclass(slots=True)
class _Claim:
    signer: bytes
    is_disputed: bool = False


class IdentityClaims:
    """The first signer of each ID, and whether another one used it later."""

    def __init__(self, capacity: int) -> None:
        """Keep the `capacity` IDs that were used last."""
        self._capacity = capacity
        self._claims: OrderedDict[bytes, _Claim] = OrderedDict()
        self._names: OrderedDict[bytes, bytes] = OrderedDict()
        """The name that each signer used last."""

    def __len__(self) -> int:
        return len(self._claims)

    def receive_claim(self, name: bytes, signer: bytes) -> bool:
        """Record that `signer` uses `name`; return whether it is the first to."""
        claim = self._claims.setdefault(name, _Claim(signer))
        self._names[signer] = name
        for kept, key in ((self._claims, name), (self._names, signer)):
            kept.move_to_end(key)
            if len(kept) > self._capacity:
                kept.popitem(last=False)
        claim.is_disputed |= claim.signer != signer
        return claim.signer == signer

    def is_disputed(self, name: bytes) -> bool:
        """Whether two signers have used `name`."""
        claim = self._claims.get(name)
        return claim is not None and claim.is_disputed

    def first(self, name: bytes) -> bytes | None:
        """Return the first signer of `name`; `None` if there is none."""
        claim = self._claims.get(name)
        return None if claim is None else claim.signer

    def owner(self, name: bytes) -> bytes | None:
        """Return the only signer of `name`; `None` if there is none, or more than one."""
        claim = self._claims.get(name)
        return None if claim is None or claim.is_disputed else claim.signer

    def name_of(self, signer: bytes) -> bytes | None:
        """Return the name that a signer used last; `None` if there is none, or others use it."""
        name = self._names.get(signer)
        return None if name is None or self.owner(name) != signer else name
