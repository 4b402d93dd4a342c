"""Private keys that stay in a PKCS #11 token: a TPM, a smart card, an HSM.

A vehicle's private key is found by its public key, which its certificate has; so certificates are
explicit. `Pkcs11Key` is a key as `cryptography` has them, of which only signing is possible.
"""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, NoReturn

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import Prehashed, encode_dss_signature
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    KeySerializationEncryption,
    PrivateFormat,
    PublicFormat,
)
from typing_extensions import override

from onboard.errors import UserError
from onboard.security import p256
from onboard.security.private_file import exposure
from onboard.security.settings import TokenSettings

try:
    import pkcs11
except ImportError:
    pkcs11 = None  # type: ignore[assignment]

_P256 = bytes.fromhex("06082a8648ce3d030107")
"""OID of NIST P-256 in DER, CKA_EC_PARAMS."""
_POINT = bytes.fromhex("0441")
"""Tag and length of an uncompressed point of P-256 as an OCTET STRING, CKA_EC_POINT."""
_ID_BYTES = 16


class TokenError(UserError):
    """The token cannot be used; one line for the user."""


class Pkcs11Token:
    """An open session with a token."""

    def __init__(self, settings: TokenSettings) -> None:
        """Open the token.

        Raises:
            TokenError: python-pkcs11, the module or the token is missing, or the PIN is wrong, or
                others may read it.
        """
        if pkcs11 is None:
            raise TokenError("security.token needs python-pkcs11: pip install 'onboard[pkcs11]'")
        self._label = settings.label
        try:
            exposed = exposure(settings.pin_file)
            pin = settings.pin_file.read_text("utf-8").strip()
        except OSError as error:
            raise TokenError(f"{settings.pin_file}: cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise TokenError(f"{settings.pin_file}: is no text in UTF-8") from error
        if exposed is not None:
            raise TokenError(exposed)
        with _naming(f"{settings.label} of {settings.module}"):
            self._session = _session(str(settings.module), settings.label, pin)

    def key_of(self, public_key: p256.PublicKey) -> p256.PrivateKey:
        """Return the private key that belongs to a public one.

        Raises:
            TokenError: the token does not have it, or fails.
        """
        point = _POINT + public_key.public_bytes(Encoding.X962, PublicFormat.UncompressedPoint)
        wanted = {
            pkcs11.Attribute.CLASS: pkcs11.ObjectClass.PUBLIC_KEY,
            pkcs11.Attribute.EC_POINT: point,
        }
        with _naming(self._label):
            found = list(self._session.get_objects(wanted))  # one search at a time
            if not found:
                compressed = p256.compressed(public_key).hex()
                raise TokenError(f"token {self._label}: has no key for {compressed}")
            key = self._session.get_key(
                object_class=pkcs11.ObjectClass.PRIVATE_KEY, id=found[0][pkcs11.Attribute.ID]
            )
        return Pkcs11Key(key, public_key, self._label)

    def new_key(self) -> p256.PrivateKey:
        """Make a key in the token, which never leaves it.

        Raises:
            TokenError: the token is full, or fails.
        """
        with _naming(self._label):
            parameters = self._session.create_domain_parameters(
                pkcs11.KeyType.EC, {pkcs11.Attribute.EC_PARAMS: _P256}, local=True
            )
            public, private = parameters.generate_keypair(
                id=secrets.token_bytes(_ID_BYTES), label="onboard", store=True
            )
            point = public[pkcs11.Attribute.EC_POINT].removeprefix(_POINT)
        return Pkcs11Key(private, p256.public_key(point), self._label)


class Pkcs11Key(ec.EllipticCurvePrivateKey):
    """A private key in a token: it signs, and shows its public key."""

    def __init__(self, key: Any, public_key: p256.PublicKey, label: str) -> None:
        self._key = key
        self._public_key = public_key
        self._label = label

    @override
    def sign(
        self,
        data: bytes | bytearray | memoryview,
        signature_algorithm: ec.EllipticCurveSignatureAlgorithm,
    ) -> bytes:
        """Sign a digest, with the token's random numbers; the DER of r and s.

        Raises:
            TokenError: the token fails.
        """
        assert isinstance(signature_algorithm.algorithm, Prehashed)  # noqa: S101 (see `p256.sign`)
        with _naming(self._label):
            raw = self._key.sign(bytes(data), mechanism=pkcs11.Mechanism.ECDSA)
        half = len(raw) // 2
        return encode_dss_signature(
            int.from_bytes(raw[:half], "big"), int.from_bytes(raw[half:], "big")
        )

    @override
    def public_key(self) -> p256.PublicKey:
        return self._public_key

    @property
    @override
    def curve(self) -> ec.EllipticCurve:
        return self._public_key.curve

    @property
    @override
    def key_size(self) -> int:
        return self._public_key.key_size

    @override
    def exchange(self, algorithm: ec.ECDH, peer_public_key: p256.PublicKey) -> NoReturn:
        raise _stays()

    @override
    def private_numbers(self) -> NoReturn:
        raise _stays()

    @override
    def private_bytes(
        self,
        encoding: Encoding,
        format: PrivateFormat,
        encryption_algorithm: KeySerializationEncryption,
    ) -> NoReturn:
        raise _stays()

    @override
    def __copy__(self) -> "Pkcs11Key":
        return self

    @override
    def __deepcopy__(self, memo: dict[int, object]) -> "Pkcs11Key":
        return self


@cache
def _session(module: str, label: str, pin: str) -> "pkcs11.Session":
    """One session for each token: a program logs in once, also if its configuration is reloaded.

    Raises:
        PKCS11Error, RuntimeError: it cannot be opened, or has one try left for a right PIN. A
            service starts again and again, and would lock it.
    """
    token = pkcs11.lib(module).get_token(token_label=label)
    if token.flags & pkcs11.TokenFlag.USER_PIN_FINAL_TRY:
        raise RuntimeError(
            "a wrong PIN would lock it; correct pin_file, and log in once with pkcs11-tool --login"
        )
    return token.open(user_pin=pin, rw=True)


@contextmanager
def _naming(token: str) -> Iterator[None]:
    """Name the token in errors of its module."""
    try:
        yield
    except (pkcs11.PKCS11Error, RuntimeError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise TokenError(f"token {token}: {why}") from error


def _stays() -> TokenError:
    return TokenError("the private key stays in its token")
