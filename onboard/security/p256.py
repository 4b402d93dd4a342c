"""ECDSA on NIST P-256 with SHA-256, the algorithm of the US profile of IEEE 1609.2."""

import hashlib
from collections.abc import Callable

import numpy as np
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import (
    Prehashed,
    decode_dss_signature,
    encode_dss_signature,
)
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

PrivateKey = ec.EllipticCurvePrivateKey
PublicKey = ec.EllipticCurvePublicKey
Signature = tuple[int, int]
"""r and s."""

_CURVE = ec.SECP256R1()
_VERIFY = ec.ECDSA(Prehashed(hashes.SHA256()))
# RFC 6979: weak random numbers cannot leak the key, and runs are repeatable; 6 % slower.
_SIGN = ec.ECDSA(Prehashed(hashes.SHA256()), deterministic_signing=True)


SELF_SIGNED = hashlib.sha256(b"").digest()
"""In place of the digest of the signer's certificate (IEEE 1609.2-2022, 5.3.1.2.2)."""


def digest_to_sign(data: bytes, signer: bytes) -> bytes:
    """Return the digest that is signed (IEEE 1609.2-2022, 5.3.1.2.2).

    Args:
        data: the encoding of what is signed.
        signer: SHA-256 of the signer's certificate, or `SELF_SIGNED`.
    """
    return hashlib.sha256(hashlib.sha256(data).digest() + signer).digest()


def sign(key: PrivateKey, digest: bytes) -> Signature:
    """Sign a SHA-256 digest."""
    return decode_dss_signature(key.sign(digest, _SIGN))


def is_signed(key: PublicKey, digest: bytes, signature: Signature) -> bool:
    """Return whether the signature is valid.

    Args:
        key: public key of the signer.
        digest: SHA-256 digest, 32 bytes.
        signature: r and s.
    """
    try:
        key.verify(encode_dss_signature(*signature), digest, _VERIFY)
    except InvalidSignature:
        return False
    return True


def new_key() -> PrivateKey:
    """Make a key from the operating system's random numbers."""
    return ec.generate_private_key(_CURVE)


def key_from(rng: np.random.Generator) -> Callable[[], PrivateKey]:
    """Return a source of keys that are the same for the same seed: for simulations only."""
    return lambda: ec.derive_private_key(1 + int.from_bytes(rng.bytes(31), "big"), _CURVE)


def compressed(key: PublicKey) -> bytes:
    """Return the 33 bytes of a compressed point (SEC 1, 2.3.3)."""
    return key.public_bytes(Encoding.X962, PublicFormat.CompressedPoint)


def public_key(point: bytes) -> PublicKey:
    """Return the key of a point, compressed or not.

    Raises:
        ValueError: the point is not on the curve.
    """
    return ec.EllipticCurvePublicKey.from_encoded_point(_CURVE, point)
