"""Certificates in canonical octet encoding (COER, IEEE 1609.2, 6.4)."""

from dataclasses import dataclass, field
from math import ceil

from onboard.security import oer, p256
from onboard.security.certificates import (
    Certificate,
    GroupLinkageValue,
    IssuePermission,
    LinkageData,
    Permission,
    SspRange,
    Subject,
)
from onboard.security.its_time import from_time32, to_time32
from onboard.security.oer import Malformed, OerReader, Unsupported
from onboard.security.region import encode_region, read_region

_VERSION = 3
_EXPLICIT, _IMPLICIT = 0, 1
_DURATIONS_S = (1e-6, 1e-3, 1.0, 60.0, 3600.0, 216_000.0, 31_556_952.0)
"""Alternatives of Duration in their order, microseconds to years."""
_ANY_SSP, _BITMAP_RANGE = 1, 2
"""Alternatives of SspRange, after `opaque`."""
_BITMAP = 1
"""Alternative of ServiceSpecificPermissions, after `opaque`."""
_ENTITY_APP = 0x80
"""EndEntityType `app`: certificates for applications, the default."""

# Presence bits of ToBeSignedCertificate, the extension bit first.
_EXTENDED, _REGION, _ASSURANCE, _APP, _ISSUE, _REQUEST, _ROLLOVER, _ENCRYPTION = (
    1 << bit for bit in range(7, -1, -1)
)


def encode_point(point: bytes) -> bytes:
    """Encode a compressed EccP256CurvePoint; alternatives 2 and 3 are y even and y odd."""
    return oer.choice(point[0]) + point[1:]


def encode_signature(signature: p256.Signature) -> bytes:
    """Encode an ecdsaNistP256Signature with r as x-only."""
    r, s = signature
    return b"\x80\x80" + r.to_bytes(32, "big") + s.to_bytes(32, "big")


def read_signature(reader: OerReader) -> p256.Signature:
    """Read a Signature; `Unsupported` if it is of another curve."""
    if reader.choice() != 0:
        raise Unsupported("a signature that is not ECDSA on NIST P-256")
    r = _read_point(reader)
    if r is None:
        raise Malformed("a signature without r")
    return int.from_bytes(r[1:], "big"), reader.integer(32)


def encode_to_be_signed(subject: Subject) -> bytes:
    """Encode a ToBeSignedCertificate.

    Raises:
        ValueError: the subject has no permission, not one key, a validity beyond the range, or a
            country as region, an assurance level or a binary identifier, which are only read.
    """
    if (subject.assurance_level, subject.binary_id) != (None, None):
        raise ValueError("certificates with assurance level or binary id are only read")
    key, value = subject.public_key, subject.reconstruction_value
    if (key is None) == (value is None) or not (subject.permissions or subject.issue_permissions):
        raise ValueError(
            "a certificate has a public key, or a reconstruction value, and permissions"
        )
    present = _APP * bool(subject.permissions) | _ISSUE * bool(subject.issue_permissions)
    present |= _REGION * (subject.region is not None)
    parts = [
        bytes((present,)),
        _encode_id(subject),
        subject.craca_id,
        subject.crl_series.to_bytes(2, "big"),
        to_time32(subject.valid_from_utc_s).to_bytes(4, "big"),
        _encode_duration(subject.valid_for_s),
    ]
    if subject.region is not None:
        parts.append(encode_region(subject.region))
    if subject.permissions:
        parts.append(oer.sequence([_encode_permission(p) for p in subject.permissions]))
    if subject.issue_permissions:
        parts.append(oer.sequence([_encode_issue(p) for p in subject.issue_permissions]))
    if key is not None:
        parts.append(oer.choice(0) + oer.choice(0) + encode_point(key))  # ecdsaNistP256
    if value is not None:
        parts.append(oer.choice(1) + encode_point(value))
    return b"".join(parts)


def _encode_id(subject: Subject) -> bytes:
    if subject.linkage is not None:
        linkage, group = subject.linkage, subject.linkage.group
        value = linkage.i_cert.to_bytes(2, "big") + linkage.linkage_value
        if group is None:
            return oer.choice(0) + b"\x00" + value
        return oer.choice(0) + b"\x80" + value + group.j_value + group.value
    if subject.name is not None:
        return oer.choice(1) + oer.octets(subject.name.encode())
    return oer.choice(3)


def encode_certificate(
    issuer_id: bytes | None, to_be_signed: bytes, signature: bytes | None
) -> bytes:
    """Encode a certificate, an explicit one if it is signed.

    Args:
        issuer_id: HashedId8 of the issuer's certificate; `None` if self-signed.
        to_be_signed: encoded ToBeSignedCertificate.
        signature: encoded Signature; `None` in an implicit certificate.
    """
    issuer = b"\x81\x00" if issuer_id is None else b"\x80" + issuer_id
    if signature is None:
        return bytes((0x00, _VERSION, _IMPLICIT)) + issuer + to_be_signed
    return bytes((0x80, _VERSION, _EXPLICIT)) + issuer + to_be_signed + signature


def decode_certificate(data: bytes) -> Certificate:
    """Read one certificate and nothing else.

    Raises:
        Malformed, Unsupported: it is not a certificate that can be used.
    """
    reader = OerReader(data)
    certificate = read_certificate(reader)
    reader.finish()
    return certificate


def read_certificate(reader: OerReader) -> Certificate:
    """Read the next certificate, explicit or implicit."""
    has_signature = reader.byte()
    version = reader.byte()
    if has_signature not in {0x00, 0x80} or version != _VERSION:
        raise Malformed(f"a certificate of version {version}")
    kind = reader.byte()
    issuer_id = _read_issuer(reader)
    body = _Canonical(reader)
    subject = _read_subject(body)
    to_be_signed = body.finish()
    is_explicit = subject.public_key is not None
    expected = (_EXPLICIT, True) if is_explicit else (_IMPLICIT, False)
    if (kind, bool(has_signature)) != expected:
        raise Malformed(f"a certificate of type {kind} with the wrong key or signature")
    if issuer_id is None and not is_explicit:
        raise Malformed("an implicit certificate without issuer")
    signature = read_signature(reader) if is_explicit else None
    encoded = encode_certificate(
        issuer_id, to_be_signed, None if signature is None else encode_signature(signature)
    )
    return Certificate(subject, issuer_id, to_be_signed, signature, encoded)


def read_issuer_id(reader: OerReader) -> bytes | None:
    """Return the HashedId8 of the next certificate's issuer; `None` if it is signed by itself.

    Raises:
        Malformed, Unsupported: it is no certificate, or its issuer is not named by SHA-256.
    """
    reader.take(3)  # presence bits, version, type
    return _read_issuer(reader)


@dataclass(slots=True)
class _Canonical:
    """Builds the canonical encoding of what a reader reads."""

    reader: OerReader
    start: int = field(init=False)
    done: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.start = self.reader.position

    def point(self) -> bytes:
        """Read a point; its canonical encoding is compressed."""
        reader = self.reader
        self.done.append(reader.data[self.start : reader.position])
        point = _read_point(reader)
        self.start = reader.position
        if point is None or point[0] == 0:
            raise Malformed("a public key without y")
        self.done.append(encode_point(point))
        return point

    def finish(self) -> bytes:
        """Return the canonical encoding of everything read."""
        self.done.append(self.reader.data[self.start : self.reader.position])
        return b"".join(self.done)


def _read_point(reader: OerReader) -> bytes | None:
    """Return an EccP256CurvePoint compressed, with 0 in front for x-only; `None` for fill."""
    form = reader.choice()
    if form in {0, 2, 3}:
        return bytes((form,)) + reader.take(32)
    if form == 4:
        x, y = reader.take(32), reader.take(32)
        return bytes((2 | y[-1] & 1,)) + x
    if form == 1:
        return None
    raise Malformed(f"a point of form {form}")


def _read_issuer(reader: OerReader) -> bytes | None:
    issuer = reader.choice()
    if issuer == 0:
        return reader.take(8)
    if issuer == 1 and reader.byte() == 0:
        return None
    raise Unsupported("an issuer that is not named by SHA-256")


def _read_subject(body: _Canonical) -> Subject:
    reader = body.reader
    present = reader.byte()
    name, binary_id, linkage = _read_id(reader)
    craca_id, crl_series = reader.take(3), reader.integer(2)
    valid_from_utc_s = from_time32(reader.integer(4))
    unit = reader.choice()
    if unit >= len(_DURATIONS_S):
        raise Malformed(f"a duration in unit {unit}")
    valid_for_s = reader.integer(2) * _DURATIONS_S[unit]
    region = read_region(reader) if present & _REGION else None
    assurance_level = reader.byte() if present & _ASSURANCE else None
    permissions = reader.several(_read_permission) if present & _APP else ()
    issue_permissions = reader.several(_read_issue) if present & _ISSUE else ()
    if present & _REQUEST:
        reader.several(_read_issue)
    if present & _ENCRYPTION:
        if reader.byte() != 0 or reader.choice() > 1:
            raise Unsupported("an encryption key of an unknown kind")
        body.point()
    public_key, reconstruction_value = _read_key(body)
    if present & _EXTENDED:
        reader.skip_additions()
    return Subject(
        name,
        valid_from_utc_s,
        valid_for_s,
        public_key,
        permissions,
        issue_permissions,
        reconstruction_value,
        linkage,
        craca_id,
        crl_series,
        binary_id,
        region,
        assurance_level,
    )


def _read_key(body: _Canonical) -> tuple[bytes | None, bytes | None]:
    """Return the verification key, or else the reconstruction value."""
    indicator = body.reader.choice()
    if indicator == 0:
        if body.reader.choice() != 0:
            raise Unsupported("a verification key that is not on NIST P-256")
        return body.point(), None
    if indicator == 1:
        return None, body.point()
    raise Malformed(f"a key indicator {indicator}")


def _read_id(reader: OerReader) -> tuple[str | None, bytes | None, LinkageData | None]:
    """Return name, binary identifier and linkage data, of which there is one at most."""
    kind = reader.choice()
    if kind == 0:
        is_grouped = reader.byte()
        i_cert, value = reader.integer(2), reader.take(9)
        group = GroupLinkageValue(reader.take(4), reader.take(9)) if is_grouped else None
        return None, None, LinkageData(i_cert, value, group)
    if kind == 1:
        return reader.octets().decode(errors="replace"), None, None
    if kind == 2:
        return None, reader.octets(), None
    if kind == 3:
        return None, None, None
    raise Malformed(f"a certificate id of kind {kind}")


def _encode_duration(valid_for_s: float) -> bytes:
    for unit, unit_s in enumerate(_DURATIONS_S):
        if unit_s >= 1 and ceil(valid_for_s / unit_s) < 1 << 16:
            return oer.choice(unit) + ceil(valid_for_s / unit_s).to_bytes(2, "big")
    raise ValueError(f"{valid_for_s} s is longer than a certificate can be valid")


def _encode_permission(permission: Permission) -> bytes:
    psid = oer.unsigned(permission.psid)
    if permission.ssp is None:
        return b"\x00" + psid
    if permission.is_bitmap:
        return b"\x80" + psid + oer.choice(_BITMAP) + oer.octets(oer.octets(permission.ssp))
    return b"\x80" + psid + oer.choice(0) + oer.octets(permission.ssp)


def _read_permission(reader: OerReader) -> Permission:
    has_ssp = reader.byte()
    psid = reader.unsigned()
    if not has_ssp:
        return Permission(psid)
    kind, ssp = reader.choice(), reader.octets()
    if kind == _BITMAP:  # of an open type
        inner = OerReader(ssp)
        ssp = inner.octets()
        inner.finish()
    return Permission(psid, ssp, is_bitmap=kind == _BITMAP)


def _encode_issue(permission: IssuePermission) -> bytes:
    shortest, further = permission.min_chain_length, permission.chain_length_range
    present = 0x80 * (shortest != 1) | 0x40 * (further != 0)
    if permission.psids is None:
        subject = oer.choice(1)
    else:
        subject = oer.choice(0) + oer.sequence(
            [
                *(b"\x00" + oer.unsigned(psid) for psid in sorted(permission.psids)),
                *(
                    b"\x80" + oer.unsigned(psid) + oer.choice(_ANY_SSP)
                    for psid in sorted(permission.any_ssp)
                ),
                *sorted(map(_encode_range, permission.some_ssps)),
            ]
        )
    lengths = [
        oer.signed(length) for length, default in ((shortest, 1), (further, 0)) if length != default
    ]
    return b"".join((bytes((present,)), subject, *lengths))


def _read_issue(reader: OerReader) -> IssuePermission:
    present = reader.byte()
    kind = reader.choice()
    if kind > 1:
        raise Unsupported(f"subject permissions of kind {kind}")
    ranges = reader.several(_read_range) if kind == 0 else ()
    shortest = reader.signed() if present & 0x80 else 1
    further = reader.signed() if present & 0x40 else 0
    entity = reader.byte() if present & 0x20 else _ENTITY_APP
    if not entity & _ENTITY_APP:
        ranges, kind = (), 0
    return IssuePermission(
        psids=None if kind == 1 else frozenset(psid for psid, ssps in ranges if ssps is None),
        any_ssp=frozenset(psid for psid, ssps in ranges if ssps == _ANY_SSP),
        some_ssps=frozenset(ssps for _, ssps in ranges if isinstance(ssps, SspRange)),
        min_chain_length=shortest,
        chain_length_range=further,
    )


def _encode_range(ssps: SspRange) -> bytes:
    head = b"\x80" + oer.unsigned(ssps.psid)
    if ssps.bitmap is None:
        return head + oer.choice(0) + oer.sequence([oer.octets(ssp) for ssp in sorted(ssps.opaque)])
    value, mask = ssps.bitmap
    return head + oer.choice(_BITMAP_RANGE) + oer.octets(oer.octets(value) + oer.octets(mask))


def _read_range(reader: OerReader) -> tuple[int, SspRange | int | None]:
    """Return the PSID with its SSPs: some, `_ANY_SSP`, or `None` without a range."""
    has_range = reader.byte()
    psid = reader.unsigned()
    if not has_range:
        return psid, None
    kind = reader.choice()
    if kind == _ANY_SSP:
        return psid, _ANY_SSP
    if kind == 0:
        return psid, SspRange(psid, frozenset(reader.several(OerReader.octets)))
    inner = OerReader(reader.octets())
    if kind != _BITMAP_RANGE:
        return psid, SspRange(psid)  # of a later version: it grants nothing that is known
    bitmap = inner.octets(), inner.octets()
    inner.finish()
    return psid, SspRange(psid, bitmap=bitmap)
