"""Which certificates are revoked, by the lists that were accepted (IEEE 1609.2, 5.1.3)."""

from collections import OrderedDict, defaultdict
from collections.abc import Iterable

from onboard.security.certificates import Certificate, LinkageData
from onboard.security.crl import CrlContents, HashIdCrl, LinkageCrl, LinkedRevocation
from onboard.security.linkage import SeedPair, after, linkage_values

_PERIODS = 3
"""Periods whose linkage values are kept: the present one and its neighbours."""


class Revocations:
    """All accepted lists. What one of them revokes stays revoked."""

    def __init__(self) -> None:
        self._hashed: defaultdict[tuple[int, bytes], set[bytes]] = defaultdict(set)
        self._linked: defaultdict[tuple[int, bytes], _LinkedRevocations] = defaultdict(
            _LinkedRevocations
        )

    def add(self, contents: CrlContents) -> None:
        """Add a list whose signature was verified."""
        key = contents.series, contents.craca_id8
        if isinstance(contents.body, HashIdCrl):
            self._hashed[key].update(contents.body.expiry_utc_s)
        else:
            self._linked[key].add(contents.body)

    def is_revoked(self, certificate: Certificate, chain_id8s: Iterable[bytes]) -> bool:
        """Return whether a list names `certificate`.

        Only lists count that the CRACA of the certificate authorised, for its series.

        Args:
            certificate: any.
            chain_id8s: HashedId8 of the certificates from it up to its root.
        """
        subject = certificate.subject
        for craca_id8 in chain_id8s:
            key = subject.crl_series, craca_id8
            if craca_id8[-3:] != subject.craca_id:
                continue
            if certificate.digest[-10:] in self._hashed.get(key, ()):
                return True
            if subject.linkage is not None and key in self._linked:
                return self._linked[key].names(subject.linkage)
        return False


class _LinkedRevocations:
    """Lists of linkage seeds of one CRACA and series."""

    def __init__(self) -> None:
        self._entries: list[tuple[int, LinkedRevocation]] = []
        self._values: OrderedDict[int, frozenset[bytes]] = OrderedDict()

    def add(self, body: LinkageCrl) -> None:
        self._entries.extend((body.i_rev, entry) for entry in body.entries)
        self._values.clear()

    def names(self, linkage: LinkageData) -> bool:
        period = linkage.i_cert
        if linkage.linkage_value in self._individual_values(period):
            return True
        group = linkage.group
        return group is not None and any(
            linkage_values(seeds, [group.j_value]) == [group.value]
            for entry, seeds in self._at(period)
            if entry.j_max is None
        )

    def _individual_values(self, period: int) -> frozenset[bytes]:
        """Return the linkage values of all revoked vehicles in `period`."""
        values = self._values.get(period)
        if values is None:
            # Issuers count j from 0 or from 1.
            values = frozenset(
                value
                for entry, seeds in self._at(period)
                if entry.j_max is not None
                for value in linkage_values(
                    seeds, [j.to_bytes(4, "big") for j in range(entry.j_max + 1)]
                )
            )
            self._values[period] = values
            if len(self._values) > _PERIODS:
                self._values.popitem(last=False)
        return values

    def _at(self, period: int) -> Iterable[tuple[LinkedRevocation, SeedPair]]:
        """Yield the entries that revoke certificates of `period`, with their seeds of it."""
        for i_rev, entry in self._entries:
            if i_rev <= period <= entry.i_max:
                yield entry, after(entry.seeds, period - i_rev)
