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
_FIELD = 2**256 - 2**224 + 2**192 + 2**96 - 1
_B = 0x5AC635D8AA3A93E7B3EBBD55769886BC651D06B0CC53B0F63BCE3C3E27D2604B
"""y^2 = x^3 - 3 x + b modulo the prime of the field (SEC 2, 2.4.2)."""
ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
"""Number of points."""
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
    return lambda: private_key(1 + int.from_bytes(rng.bytes(31), "big"))


def private_key(value: int) -> PrivateKey:
    """Return the private key of a number from 1 to `ORDER` - 1. Raises `ValueError` if beyond."""
    return ec.derive_private_key(value, _CURVE)


def number(key: PrivateKey) -> int:
    """Return the number that a private key is."""
    return key.private_numbers().private_value


def compressed(key: PublicKey) -> bytes:
    """Return the 33 bytes of a compressed point (SEC 1, 2.3.3)."""
    return key.public_bytes(Encoding.X962, PublicFormat.CompressedPoint)


def public_key(point: bytes) -> PublicKey:
    """Return the key of a point, compressed or not.

    Raises:
        ValueError: the point is not on the curve.
    """
    return ec.EllipticCurvePublicKey.from_encoded_point(_CURVE, point)


def multiply_add(factor: int, point: PublicKey, addend: PublicKey) -> PublicKey:
    """Return factor * point + addend; not for secret factors.

    The library multiplies points in ECDH only, which gives x without y. y follows from the x of the
    next multiple (Brier and Joye, PKC 2002, section 4).

    Args:
        factor: 1 to `ORDER` - 2.
        point: any.
        addend: any.

    Raises:
        ValueError: the factor is out of range, or the sum is the point at infinity.
    """
    x, next_x = (
        int.from_bytes(private_key(each).exchange(ec.ECDH(), point), "big")
        for each in (factor, factor + 1)
    )
    base, added = point.public_numbers(), addend.public_numbers()
    y = (2 * _B + (base.x * x - 3) * (base.x + x) - next_x * (base.x - x) ** 2) * pow(
        2 * base.y, -1, _FIELD
    )
    if x == added.x and (y - added.y) % _FIELD == 0:
        slope = (3 * x * x - 3) * pow(2 * y, -1, _FIELD)
    else:
        slope = (added.y - y) * pow(added.x - x, -1, _FIELD)
    sum_x = (slope * slope - x - added.x) % _FIELD
    sum_y = (slope * (x - sum_x) - y) % _FIELD
    return ec.EllipticCurvePublicNumbers(sum_x, sum_y, _CURVE).public_key()
