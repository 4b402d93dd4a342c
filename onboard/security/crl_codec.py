"""Revocation lists and the permission to sign them, in COER (IEEE 1609.2-2022, 7.3 and 7.4.3.3)."""

from onboard.security import oer
from onboard.security.crl import CrlContents, CrlSsp, HashIdCrl, LinkageCrl, LinkedRevocation
from onboard.security.its_time import from_time32, to_time32
from onboard.security.linkage import LinkageSeed, SeedPair
from onboard.security.oer import Malformed, OerReader, Unsupported

_VERSION = 1
_PRIORITY = 0x40
_FULL_HASH, _DELTA_HASH, _FULL_LINKED, _DELTA_LINKED = range(4)
_INDIVIDUAL, _GROUPS = 0x40, 0x20
"""Presence bits of ToBeSignedLinkageValueCrl."""


def encode_crl(contents: CrlContents) -> bytes:
    """Encode CrlContents with a full list."""
    body = contents.body
    return b"".join(
        (
            bytes((_VERSION,)),
            contents.series.to_bytes(2, "big"),
            contents.craca_id8,
            *(
                to_time32(utc_s).to_bytes(4, "big")
                for utc_s in (contents.issued_utc_s, contents.next_utc_s)
            ),
            bytes(1),  # priorityInfo: none
            _encode_hash_ids(body) if isinstance(body, HashIdCrl) else _encode_linked(body),
        )
    )


def decode_crl(data: bytes) -> CrlContents:
    """Read CrlContents, of a full or a delta list.

    Raises:
        Malformed: the bytes are no CrlContents.
        Unsupported: parts of it are of a later version: some revocation would be overlooked.
    """
    reader = OerReader(data)
    version = reader.byte()
    if version != _VERSION:
        raise Unsupported(f"a revocation list of version {version}")
    series, craca_id8 = reader.integer(2), reader.take(8)
    issued, following = reader.integer(4), reader.integer(4)
    if following <= issued:
        raise Malformed("a revocation list that ends before it begins")
    if reader.byte() & _PRIORITY:
        reader.byte()
    kind = reader.choice()
    if kind in {_FULL_HASH, _DELTA_HASH}:
        body: HashIdCrl | LinkageCrl = _read_hash_ids(reader)
    elif kind in {_FULL_LINKED, _DELTA_LINKED}:
        body = _read_linked(reader)
    else:
        raise Unsupported(f"a revocation list of kind {kind}")
    reader.finish()
    return CrlContents(series, craca_id8, from_time32(issued), from_time32(following), body)


def encode_ssp(ssp: CrlSsp) -> bytes:
    """Encode a CrlSsp."""
    series = oer.sequence([number.to_bytes(2, "big") for number in sorted(ssp.series)])
    return bytes((0, _VERSION, not ssp.is_craca)) + series


def decode_ssp(data: bytes) -> CrlSsp:
    """Read a CrlSsp. Raises `Malformed` or `Unsupported`."""
    reader = OerReader(data)
    _no_extension(reader)
    version, role = reader.byte(), reader.byte()
    if version != _VERSION or role > 1:
        raise Unsupported(f"a permission to sign revocation lists of version {version}")
    series = frozenset(reader.several(lambda inner: inner.integer(2)))
    reader.finish()
    return CrlSsp(role == 0, series)


def _encode_hash_ids(body: HashIdCrl) -> bytes:
    entries = [
        bytes(1) + hashed_id10 + to_time32(utc_s).to_bytes(4, "big")
        for hashed_id10, utc_s in sorted(body.expiry_utc_s.items())
    ]
    serial = body.serial.to_bytes(4, "big")
    return oer.choice(_FULL_HASH) + bytes(1) + serial + oer.sequence(entries)


def _read_hash_ids(reader: OerReader) -> HashIdCrl:
    _no_extension(reader)
    serial = reader.integer(4)
    return HashIdCrl(serial, dict(reader.several(_read_hash_id)))


def _read_hash_id(reader: OerReader) -> tuple[bytes, float]:
    _no_extension(reader)
    return reader.take(10), from_time32(reader.integer(4))


def _encode_linked(body: LinkageCrl) -> bytes:
    individual = [_encode_individual(entry) for entry in body.entries if entry.j_max is not None]
    groups = [_encode_group(entry) for entry in body.entries if entry.j_max is None]
    return b"".join(
        (
            oer.choice(_FULL_LINKED),
            bytes((_INDIVIDUAL | _GROUPS,)),
            body.i_rev.to_bytes(2, "big"),
            bytes((body.index_within_i,)),
            oer.sequence(individual),
            oer.sequence(groups),
        )
    )


def _encode_individual(entry: LinkedRevocation) -> bytes:
    """Encode a JMaxGroup with one LAGroup, one IMaxGroup and one IndividualRevocation."""
    first, second = entry.seeds
    revocation = bytes(1) + first.seed + second.seed
    i_group = bytes(1) + entry.i_max.to_bytes(2, "big") + oer.sequence([revocation])
    la_group = bytes(1) + first.la_id + second.la_id + oer.sequence([i_group])
    return bytes((0, entry.j_max or 0)) + oer.sequence([la_group])


def _encode_group(entry: LinkedRevocation) -> bytes:
    first, second = entry.seeds
    seeds = first.la_id + first.seed + second.la_id + second.seed
    return bytes(1) + entry.i_max.to_bytes(2, "big") + seeds


def _read_linked(reader: OerReader) -> LinkageCrl:
    present = reader.byte()
    if present & ~(_INDIVIDUAL | _GROUPS):
        raise Unsupported("a revocation list with single seeds")
    i_rev, index_within_i = reader.integer(2), reader.byte()
    entries: list[LinkedRevocation] = []
    if present & _INDIVIDUAL:
        for j_group in reader.several(_read_j_group):
            entries.extend(j_group)
    if present & _GROUPS:
        entries.extend(reader.several(_read_group))
    return LinkageCrl(i_rev, index_within_i, tuple(entries))


def _read_j_group(reader: OerReader) -> list[LinkedRevocation]:
    _no_extension(reader)
    j_max = reader.byte()
    return [
        LinkedRevocation(i_max, j_max, seeds)
        for la_group in reader.several(_read_la_group)
        for i_max, seeds in la_group
    ]


def _read_la_group(reader: OerReader) -> list[tuple[int, SeedPair]]:
    _no_extension(reader)
    la_ids = reader.take(2), reader.take(2)
    return [
        (i_max, (LinkageSeed(la_ids[0], first), LinkageSeed(la_ids[1], second)))
        for i_max, pairs in reader.several(_read_i_group)
        for first, second in pairs
    ]


def _read_i_group(reader: OerReader) -> tuple[int, tuple[tuple[bytes, bytes], ...]]:
    _no_extension(reader)
    return reader.integer(2), reader.several(_read_seeds)


def _read_seeds(reader: OerReader) -> tuple[bytes, bytes]:
    _no_extension(reader)
    return reader.take(16), reader.take(16)


def _read_group(reader: OerReader) -> LinkedRevocation:
    _no_extension(reader)
    i_max = reader.integer(2)
    first, second = (LinkageSeed(reader.take(2), reader.take(16)) for _ in range(2))
    return LinkedRevocation(i_max, None, (first, second))


def _no_extension(reader: OerReader) -> None:
    """Read the preamble of a SEQUENCE that has nothing but an extension bit."""
    if reader.byte() != 0:
        raise Unsupported("a revocation list with extensions")
