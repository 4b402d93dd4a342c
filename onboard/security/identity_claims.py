"""Who goes by which name: certificates do not name the IDs that their owners use in messages."""

from collections import OrderedDict
from dataclasses import dataclass


@dataclass(slots=True)
class _Claim:
    signer: bytes
    is_disputed: bool = False


class IdentityClaims:
    """Remembers who used a name first, and whether somebody else did later."""

    def __init__(self, most: int) -> None:
        """Remember at most `most` names, those that were used last."""
        self._most = most
        self._claims: OrderedDict[bytes, _Claim] = OrderedDict()

    def __len__(self) -> int:
        return len(self._claims)

    def receive(self, name: bytes, signer: bytes) -> bool:
        """Note that `signer` goes by `name`; return whether it was the first to."""
        claim = self._claims.setdefault(name, _Claim(signer))
        self._claims.move_to_end(name)
        if len(self._claims) > self._most:
            self._claims.popitem(last=False)
        claim.is_disputed |= claim.signer != signer
        return claim.signer == signer

    def is_disputed(self, name: bytes) -> bool:
        """Whether two have gone by `name`."""
        claim = self._claims.get(name)
        return claim is not None and claim.is_disputed

    def owner(self, name: bytes) -> bytes | None:
        """The only signer that goes by `name`; `None` if there is none, or more than one."""
        claim = self._claims.get(name)
        return None if claim is None or claim.is_disputed else claim.signer
