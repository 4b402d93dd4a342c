"""Signature of a file by the root of a trial, as of a release of this program.

ECDSA P-256 with SHA-256 like every signature here. What is signed begins with `CONTEXT`, so that no
signature of a message, a certificate or a revocation list can pass for one of a file.
"""

import hashlib
from collections.abc import Iterable

from onboard.security import p256
from onboard.security.certificates import Certificate
from onboard.security.credentials import Credential

CONTEXT = b"onboard file signature\n"
_NUMBER_BYTES = 32


def sign_file(content: bytes, signer: Credential) -> str:
    """Return the signature in hexadecimal: r and s."""
    r, s = p256.sign(signer.key, _digest(content))
    return (r.to_bytes(_NUMBER_BYTES) + s.to_bytes(_NUMBER_BYTES)).hex()


def signer_of_file(
    content: bytes, signature: str, roots: Iterable[Certificate]
) -> Certificate | None:
    """Return the root that signed a file; `None` if none of `roots` did."""
    try:
        encoded = bytes.fromhex(signature.strip())
    except ValueError:
        return None
    numbers = int.from_bytes(encoded[:_NUMBER_BYTES]), int.from_bytes(encoded[_NUMBER_BYTES:])
    if len(encoded) != 2 * _NUMBER_BYTES:
        return None
    digest = _digest(content)
    for root in roots:
        point = root.subject.public_key
        if point is not None and p256.is_signed(p256.public_key(point), digest, numbers):
            return root
    return None


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(CONTEXT + hashlib.sha256(content).digest()).digest()
