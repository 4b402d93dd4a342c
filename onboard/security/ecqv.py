"""Implicit certificates: Elliptic Curve Qu-Vanstone (SEC 4; IEEE 1609.2-2022, 5.3.2).

An implicit certificate has a reconstruction point in place of key and signature. From it, and from
the issuer's key, everybody computes the holder's public key. Only the holder, whom the issuer gave
the other half, knows the private key. A forged certificate gives a key as well, one that nobody can
sign with: what is proven is proven by the first valid signature.

Names follow SEC 4. `e` is the digest of certificate and issuer (`p256.digest_to_sign`).
"""

from onboard.security import p256


def scalar(digest: bytes) -> int:
    """Return e: the whole digest as an integer modulo the order.

    SEC 4, 2.3, drops the last bit instead; certificates in use follow 1609.2.
    """
    return int.from_bytes(digest, "big") % p256.ORDER


def public_key(point: bytes, e: int, issuer: p256.PublicKey) -> p256.PublicKey:
    """Return the holder's key Q_U = e P_U + Q_CA (SEC 4, 3.5).

    Args:
        point: the reconstruction point P_U, compressed or not.
        e: of the certificate.
        issuer: Q_CA.

    Raises:
        ValueError: the point is not on the curve, or the key would be the point at infinity.
    """
    return p256.multiply_add(e, p256.public_key(point), issuer)


def reconstruction_point(request: p256.PublicKey, ephemeral: p256.PrivateKey) -> bytes:
    """Return P_U = R_U + k G, compressed (SEC 4, 3.4).

    Args:
        request: the holder's R_U.
        ephemeral: the issuer's k, for this certificate only.
    """
    return p256.compressed(p256.multiply_add(1, request, ephemeral.public_key()))


def private_reconstruction(e: int, ephemeral: p256.PrivateKey, issuer: p256.PrivateKey) -> int:
    """Return r = e k + d_CA, which the issuer gives to the holder (SEC 4, 3.4)."""
    return (e * p256.number(ephemeral) + p256.number(issuer)) % p256.ORDER


def private_key(e: int, request: p256.PrivateKey, r: int) -> p256.PrivateKey:
    """Return the holder's key d_U = e k_U + r (SEC 4, 3.6).

    Args:
        e: of the certificate.
        request: k_U, the private key of R_U.
        r: from the issuer.
    """
    return p256.private_key((e * p256.number(request) + r) % p256.ORDER)
