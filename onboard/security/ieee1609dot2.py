"""Ieee1609Dot2Data: unsecured, or signed with ECDSA on NIST P-256.

Canonical octet encoding of the structures of IEEE 1609.2, 6.3, that vehicles exchange. Encrypted
data and certificate requests are `Unsupported`.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache

from onboard.security import oer, p256
from onboard.security.certificate_codec import (
    encode_signature,
    read_certificate,
    read_issuer_id,
    read_signature,
)
from onboard.security.certificates import Certificate
from onboard.security.its_time import from_time64
from onboard.security.oer import Malformed, OerReader, Unsupported

_VERSION = 3
_UNSECURED_HEAD = bytes((_VERSION, 0x80))
_SIGNED_HEAD = bytes((_VERSION, 0x81, 0x00))
"""Version, signedData, SHA-256."""
_PAYLOAD_ONLY = b"\x40"
"""SignedDataPayload: no extension, data present, no external hash."""
_UNKNOWN_LATITUDE, _UNKNOWN_LONGITUDE = 900_000_001, 1_800_000_001
_MOST_CERTIFICATES = 8
_CACHED_CERTIFICATES = 512
"""Certificates that are not read again: those of the vehicles in range."""
_READ_AGAIN = 256
"""Messages whose header is kept: the receive queue reads it for the signer, then the cores."""
_SIGNATURE_BYTES = 66
"""Kind of signature, kind of point, r and s."""

# Presence bits of HeaderInfo, the extension bit first.
_EXTENDED, _GENERATION, _EXPIRY, _LOCATION, _P2PCD, _MISSING_CRL, _ENCRYPTION = (
    1 << bit for bit in range(7, 0, -1)
)


@dataclass(frozen=True, slots=True)
class Location:
    """ThreeDLocation: where a message was generated."""

    latitude_deg: float
    longitude_deg: float
    elevation_m: float


@dataclass(frozen=True, slots=True)
class UnsecuredData:
    """A payload without signature."""

    payload: bytes


@dataclass(frozen=True, slots=True)
class SignedData:
    """A payload, its header, and the signature over both."""

    payload: bytes
    psid: int
    generation_time64: int | None
    expiry_time64: int | None
    location: Location | None
    signer: bytes | tuple[Certificate, ...]
    """HashedId8 of the signer's certificate, or the certificate and its chain."""
    signature: p256.Signature
    to_be_signed: bytes
    p2pcd_request: bytes | None = None
    """HashedId3 of a certificate that the sender asks for."""

    @property
    def generation_utc_s(self) -> float | None:
        """Generation time in seconds since 1970."""
        return None if self.generation_time64 is None else from_time64(self.generation_time64)

    @property
    def signer_id(self) -> bytes:
        """HashedId8 of who claims to have signed it."""
        return self.signer if isinstance(self.signer, bytes) else self.signer[0].hashed_id8


@dataclass(frozen=True, slots=True)
class CarriedCertificate:
    """What tells a certificate in a message from others, unverified."""

    hashed_id8: bytes
    issuer_id: bytes | None
    """HashedId8 of the issuer's certificate; `None` if it is signed by itself."""


def encode_unsecured(payload: bytes) -> bytes:
    """Return `payload` as unsecured data."""
    return _UNSECURED_HEAD + oer.octets(payload)


def encode_to_be_signed(
    payload: bytes,
    psid: int,
    generation_time64: int | None,
    expiry_time64: int | None = None,
    location: Location | None = None,
    *,
    p2pcd_request: bytes | None = None,
) -> bytes:
    """Return the ToBeSignedData that the signature covers.

    Args:
        payload: the message.
        psid: its service.
        generation_time64: generation time (Time64), if any.
        expiry_time64: expiry time (Time64), if any.
        location: generation location, if any.
        p2pcd_request: HashedId3 of a certificate that is asked for, if any.
    """
    present = 0
    header = [oer.unsigned(psid)]
    if generation_time64 is not None:
        present |= _GENERATION
        header.append(generation_time64.to_bytes(8, "big"))
    if expiry_time64 is not None:
        present |= _EXPIRY
        header.append(expiry_time64.to_bytes(8, "big"))
    if location is not None:
        present |= _LOCATION
        header.append(_encode_location(location))
    if p2pcd_request is not None:
        present |= _P2PCD
        header.append(p2pcd_request)
    return b"".join((_PAYLOAD_ONLY, encode_unsecured(payload), bytes((present,)), *header))


def encode_signed(
    to_be_signed: bytes, signer: bytes | Certificate, signature: p256.Signature
) -> bytes:
    """Return Ieee1609Dot2Data with signed data.

    Args:
        to_be_signed: ToBeSignedData.
        signer: HashedId8 of the certificate, or the certificate itself.
        signature: over `to_be_signed`.
    """
    if isinstance(signer, Certificate):
        identifier = b"\x81" + oer.sequence([signer.encoded])
    else:
        identifier = b"\x80" + signer
    return _SIGNED_HEAD + to_be_signed + identifier + encode_signature(signature)


def decode(data: bytes) -> UnsecuredData | SignedData:
    """Read Ieee1609Dot2Data without verifying it.

    Raises:
        Malformed: the bytes are not Ieee1609Dot2Data.
        Unsupported: it is of a kind that is not supported.
    """
    reader = OerReader(data)
    content = _read_content(reader)
    if content == 0:
        unsecured = UnsecuredData(reader.octets())
        reader.finish()
        return unsecured
    if content != 1:
        raise Unsupported(f"1609.2 content of kind {content}")
    if reader.byte() != 0:
        raise Unsupported("a hash that is not SHA-256")
    signed = _read_signed(reader)
    reader.finish()
    return signed


def is_signed(data: bytes) -> bool:
    """Whether `data` begins as signed data does."""
    return data[:2] == _SIGNED_HEAD[:2]


def payload_in(data: bytes) -> bytes | None:
    """Return the payload of unsecured or signed `data`, at a tenth of the cost of `decode`.

    Nothing is checked: it may be truncated, or not a payload at all. `None` for other data.
    """
    for head in (_SIGNED_HEAD + _PAYLOAD_ONLY + _UNSECURED_HEAD, _UNSECURED_HEAD):
        if data.startswith(head):
            octets_of_length = max(0, data[len(head)] - 0x80) if len(data) > len(head) else 0
            return data[len(head) + 1 + octets_of_length :]
    return None


def signer_in(data: bytes) -> bytes | None:
    """Return the HashedId8 of the certificate that signed `data` names or carries, unverified.

    At a fraction of the cost of `decode`; `None` for other data and for several certificates. For a
    certificate in another than the canonical form it is another value.
    """
    signer = _signer_in(data)
    return signer.hashed_id8 if isinstance(signer, CarriedCertificate) else signer


def certificate_in(data: bytes) -> CarriedCertificate | None:
    """Return the certificate that signed `data` carries, as `signer_in`; `None` without one."""
    signer = _signer_in(data)
    return signer if isinstance(signer, CarriedCertificate) else None


def _signer_in(data: bytes) -> bytes | CarriedCertificate | None:
    """Return the HashedId8 of the signer, or its certificate if that is there."""
    reader = OerReader(data)
    try:
        if _read_content(reader) != 1:
            return None
        reader.byte()
        _read_to_be_signed(reader)
        if reader.choice() == 0:
            return reader.take(8)
        if reader.unsigned() != 1:
            return None
        certificate = data[reader.position : -_SIGNATURE_BYTES]
        hashed_id8 = hashlib.sha256(certificate).digest()[-8:]
        return CarriedCertificate(hashed_id8, read_issuer_id(reader))
    except (Malformed, Unsupported):
        return None


def _read_content(reader: OerReader) -> int:
    version = reader.byte()
    if version != _VERSION:
        raise Malformed(f"1609.2 data of version {version}")
    return reader.choice()


def _read_signed(reader: OerReader) -> SignedData:
    header = _read_to_be_signed(reader)
    return SignedData(*header[:5], _read_signer(reader), read_signature(reader), *header[5:])


_ToBeSigned = tuple[bytes, int, int | None, int | None, Location | None, bytes, bytes | None]
"""Payload, PSID, generation and expiry time, location, all as encoded, and request."""


def _read_to_be_signed(reader: OerReader) -> _ToBeSigned:
    header, reader.position = _to_be_signed_at(reader.position, reader.data)
    return header


@lru_cache(_READ_AGAIN)
def _to_be_signed_at(start: int, data: bytes) -> tuple[_ToBeSigned, int]:
    """Return what is signed from `start` on, and where it ends."""
    reader = OerReader(data, start)
    if reader.byte() != _PAYLOAD_ONLY[0]:
        raise Unsupported("a signature over something else than a payload")
    if _read_content(reader) != 0:
        raise Unsupported("signed data around secured data")
    payload = reader.octets()
    present = reader.byte()
    psid = reader.unsigned()
    generation_time64 = reader.integer(8) if present & _GENERATION else None
    expiry_time64 = reader.integer(8) if present & _EXPIRY else None
    location = _read_location(reader) if present & _LOCATION else None
    p2pcd_request = reader.take(3) if present & _P2PCD else None
    if present & (_MISSING_CRL | _ENCRYPTION):
        raise Unsupported("a header that asks for revocation lists or encryption")
    if present & _EXTENDED:
        reader.skip_additions()
    to_be_signed = data[start : reader.position]
    header = (
        payload, psid, generation_time64, expiry_time64, location, to_be_signed, p2pcd_request
    )  # fmt: skip
    return header, reader.position


def _read_signer(reader: OerReader) -> bytes | tuple[Certificate, ...]:
    kind = reader.choice()
    if kind == 0:
        return reader.take(8)
    if kind != 1:
        raise Unsupported(f"a signer of kind {kind}")
    count = reader.unsigned()
    if not 1 <= count <= _MOST_CERTIFICATES:
        raise Malformed(f"{count} certificates")
    if count == 1 and (known := _certificate(reader.data[reader.position : -_SIGNATURE_BYTES])):
        reader.take(len(reader.data) - _SIGNATURE_BYTES - reader.position)
        return (known,)
    return tuple(read_certificate(reader) for _ in range(count))


@lru_cache(maxsize=_CACHED_CERTIFICATES)
def _certificate(encoded: bytes) -> Certificate | None:
    """Return the certificate that these bytes are; `None` if they are not one and nothing else."""
    reader = OerReader(encoded)
    try:
        certificate = read_certificate(reader)
        reader.finish()
    except (Malformed, Unsupported):
        return None
    return certificate


def _encode_location(location: Location) -> bytes:
    return b"".join(
        (
            round(location.latitude_deg * 1e7).to_bytes(4, "big", signed=True),
            round(location.longitude_deg * 1e7).to_bytes(4, "big", signed=True),
            min(max(round(location.elevation_m * 10) + 4096, 0), 0xFFFF).to_bytes(2, "big"),
        )
    )


def _read_location(reader: OerReader) -> Location | None:
    """Read a ThreeDLocation; `None` for one that its sender does not know."""
    latitude, longitude = (int.from_bytes(reader.take(4), "big", signed=True) for _ in range(2))
    elevation_m = (reader.integer(2) - 4096) / 10
    if latitude == _UNKNOWN_LATITUDE or longitude == _UNKNOWN_LONGITUDE:
        return None
    return Location(latitude / 1e7, longitude / 1e7, elevation_m)
