"""Signs outgoing messages and verifies incoming ones (IEEE 1609.2), without I/O.

A received message is used only after `SecurityServices.open` has returned it. The cheapest checks
come first, the signature last.
"""

from collections import OrderedDict
from dataclasses import dataclass, field

from onboard.security import ieee1609dot2, p256
from onboard.security.clock_check import ClockCheck
from onboard.security.credentials import Credential, Credentials
from onboard.security.ieee1609dot2 import SignedData, UnsecuredData
from onboard.security.its_time import from_time64, to_time64
from onboard.security.oer import Malformed, Unsupported
from onboard.security.peer_to_peer import CertificateDistribution, decode_ca_certs
from onboard.security.region import GeographicRegion, TwoDLocation, is_in
from onboard.security.rejection import NotTrusted, RejectionReason
from onboard.security.replay_window import ReplayWindow
from onboard.security.secured_crl import trust_store
from onboard.security.trust import Trusted, TrustStore
from onboard.wave_udp.psid import AWARENESS, BSM, CPM, SIGNALS

__all__ = ["NotTrusted", "Opened", "RejectionReason", "SecurityServices"]

MESSAGE_LIFETIME_S = 5.0
"""Age beyond which a signed message is refused; the replay window reaches as far back. Ours."""
CLOCK_TOLERANCE_S = 2.0
"""How far a sender's clock may be ahead of the host vehicle's. Ours."""
CERTIFICATE_INTERVAL_S = 0.45
"""Longest time between BSMs that carry the certificate instead of its digest: vCertAttachInterval
of SAE J2945/1."""

_MAX_VERIFIED_SIGNERS = 1024
"""More vehicles than are in radio range on any road."""
_MAX_FORGED = 8192
"""Forged certificates that are remembered, the last ones: 5 s of 1,500 verified a second."""
_MAX_REPLAY_DIGESTS = 32_768
"""Size of the replay window: 5 s of 6,000 messages a second."""


@dataclass(frozen=True, slots=True)
class Opened:
    """The content of an accepted message."""

    payload: bytes
    signer_id: bytes | None
    """HashedId8 of the signer's certificate; `None` if the message was not verified."""
    generation_utc_s: float | None
    regions: tuple[GeographicRegion, ...] = ()
    """In all of which the signer must be: of its certificate, and of those above it."""
    location: TwoDLocation | None = None
    """Where it was generated, if its header says so."""
    ssp: bytes | None = None
    """Of this service in the signer's certificate; `None` without."""
    secured: bytes = field(default=b"", repr=False)
    """The 1609.2 data, if it was verified."""

    def is_valid_at(self, place: TwoDLocation | None) -> bool:
        """Whether the certificate is valid where the message comes from (IEEE 1609.2, 5.2.3).

        Args:
            place: what is known of that place if the header does not say it: from the payload, or
                where the receiver is.
        """
        place = self.location or place
        return place is None or all(is_in(place, region) for region in self.regions)


class SecurityServices:
    """Makes and opens 1609.2 data. `now` is the monotonic clock; UTC is `now + utc_offset_s`."""

    def __init__(
        self,
        utc_offset_s: float,
        credentials: Credentials | None = None,
        *,
        certificate_interval_s: float = CERTIFICATE_INTERVAL_S,
        distributes: bool = True,
    ) -> None:
        """Sign and verify with `credentials`; without them, neither.

        Args:
            utc_offset_s: UTC less the monotonic clock.
            credentials: pseudonym certificates with their keys, and the trusted roots.
            certificate_interval_s: longest time between BSMs that carry the certificate.
            distributes: whether vehicles ask each other for certificates of authorities.

        Raises:
            NotTrusted: an authority's certificate or a revocation list is not valid.
        """
        self.utc_offset_s = utc_offset_s
        self._certificate_interval_s = certificate_interval_s
        self._certificate_due_at = self._awareness_due_at = float("-inf")
        """When a message is to carry the certificate, and when a BSM is, whatever others carry."""
        self._last_generation = 0
        self._replays = ReplayWindow(round(MESSAGE_LIFETIME_S * 1e6), capacity=_MAX_REPLAY_DIGESTS)
        self._verified_signers: OrderedDict[bytes, None] = OrderedDict()
        self._forged: OrderedDict[bytes, None] = OrderedDict()
        """HashedId8 of certificates that their issuers did not sign, as they were received."""
        self._own_ids: frozenset[bytes] = frozenset()
        self._credential: Credential | None = None
        self._trust: TrustStore | None = None
        self.clock_check = ClockCheck()
        """Whether the own UTC is wrong."""
        self.distribution = CertificateDistribution(())
        """Of certificates that vehicles lack."""
        if credentials is not None:
            self._own_ids = frozenset(own.certificate.hashed_id8 for own in credentials.pseudonyms)
            self._trust = trust_store(credentials)
            if distributes:
                self.distribution = CertificateDistribution(credentials.authorities)
            self.sign_with(credentials.pseudonyms[0])

    def utc_s(self, now: float) -> float:
        """Return UTC in seconds since 1970."""
        return now + self.utc_offset_s

    def made_at_s(self, opened: Opened, now: float) -> float:
        """Return when a message was generated, on the monotonic clock; `now` if it does not say."""
        if opened.generation_utc_s is None:
            return now
        return opened.generation_utc_s - self.utc_offset_s

    def sign_with(self, credential: Credential) -> None:
        """Use `credential` from now on; the next message carries its certificate."""
        self._credential = credential
        self._certificate_due_at = self._awareness_due_at = float("-inf")
        certificate = credential.certificate
        self.distribution.use_certificate(certificate.hashed_id8, certificate.issuer_id)

    @property
    def verifies(self) -> bool:
        """Whether there are credentials, so that unsigned messages are refused."""
        return self._trust is not None

    def has_verified(self, signer_id: bytes) -> bool:
        """Whether a signature by this HashedId8 was valid, among the signers heard last."""
        return signer_id in self._verified_signers

    def can_verify(self, carried: ieee1609dot2.CarriedCertificate) -> bool:
        """Whether a certificate may be valid: its issuer is known, and did not deny it before."""
        return (
            self._trust is not None
            and carried.issuer_id is not None
            and self._trust.knows(carried.issuer_id)
            and carried.hashed_id8 not in self._forged
        )

    def is_road_side_unit(self, signer_id: bytes) -> bool:
        """Whether a received certificate, by its HashedId8, permits MAP or SPAT, and no BSM.

        MAPEM, SPATEM and CAM are their equals.
        """
        signer = None if self._trust is None else self._trust.find(signer_id)
        return signer is not None and not AWARENESS & signer.psids and bool(SIGNALS & signer.psids)

    # ---- out ------------------------------------------------------------------------------

    def secure(
        self,
        payload: bytes,
        psid: int,
        now: float,
        *,
        expires_in_s: float | None = None,
        location: ieee1609dot2.Location | None = None,
        may_wait: bool = False,
    ) -> bytes:
        """Return `payload` as Ieee1609Dot2Data, signed if there are credentials.

        Args:
            payload: the message.
            psid: the service it is sent under, which the signature covers.
            now: generation time.
            expires_in_s: sets the expiry time in the header.
            location: sets the generation location in the header.
            may_wait: whether receivers that lack the certificate may wait until it is due again: a
                digest suffices until then, as it does in BSMs.
        """
        if self._credential is None:
            return ieee1609dot2.encode_unsecured(payload)
        generation = self._generation_time64(now)
        expiry = None if expires_in_s is None else generation + round(expires_in_s * 1e6)
        request = self.distribution.request_to_send(now) if psid == BSM else None
        to_be_signed = ieee1609dot2.encode_to_be_signed(
            payload, psid, generation, expiry, location, p2pcd_request=request
        )
        certificate = self._credential.certificate
        digest = p256.digest_to_sign(to_be_signed, certificate.digest)
        return ieee1609dot2.encode_signed(
            to_be_signed,
            certificate
            if self._attaches_certificate(psid, now, may_wait=may_wait)
            else certificate.hashed_id8,
            p256.sign(self._credential.key, digest),
        )

    def _generation_time64(self, now: float) -> int:
        """Return the generation time (Time64), different for every message of a car.

        A clock that has not been set may be before 2004; receivers refuse the messages until it is.
        """
        generation = max(0, to_time64(now + self.utc_offset_s))
        if 0 <= self._last_generation - generation < 1_000:
            generation = self._last_generation + 1
        self._last_generation = generation
        return generation

    def _attaches_certificate(self, psid: int, now: float, *, may_wait: bool) -> bool:
        if psid == CPM:  # of use only beside the sender's CAMs, which have it
            return False
        is_awareness = psid in AWARENESS
        due_at = self._awareness_due_at if is_awareness else self._certificate_due_at
        if (may_wait or is_awareness) and now < due_at:
            return False
        self._certificate_due_at = now + self._certificate_interval_s
        if is_awareness:
            self._awareness_due_at = self._certificate_due_at
        return True

    # ---- in -------------------------------------------------------------------------------

    def open(self, data: bytes, psid: int, now: float, *, is_repeated: bool = False) -> Opened:
        """Verify 1609.2 data and return its content.

        Without credentials, nothing is verified: whatever can be decoded is returned.

        Args:
            data: Ieee1609Dot2Data.
            psid: the service it was received under.
            now: the present time.
            is_repeated: whether others than its signer send it too: it is no replay.

        Raises:
            NotTrusted: the message is refused; `reason` is the cause.
        """
        try:
            message = ieee1609dot2.decode(data)
        except Malformed as malformed:
            raise NotTrusted(RejectionReason.MALFORMED, str(malformed)) from malformed
        except Unsupported as unsupported:
            raise NotTrusted(RejectionReason.UNSUPPORTED, str(unsupported)) from unsupported
        if isinstance(message, UnsecuredData):
            if self._trust is not None:
                raise NotTrusted(RejectionReason.UNSIGNED)
            return Opened(message.payload, signer_id=None, generation_utc_s=None)
        if message.psid != psid:
            raise NotTrusted(RejectionReason.WRONG_PSID, f"signed for 0x{message.psid:X}")
        if self._trust is None:
            return Opened(message.payload, None, message.generation_utc_s)
        if message.p2pcd_request is not None:
            self.distribution.receive_request(message.p2pcd_request, now)
        try:
            return self._verified(data, message, self._trust, now, is_repeated=is_repeated)
        except NotTrusted as refusal:
            if refusal.reason is RejectionReason.UNKNOWN_ISSUER:
                self.distribution.receive_unknown_issuer(bytes.fromhex(refusal.detail), now)
            elif refusal.reason is RejectionReason.BAD_CERTIFICATE:
                self._receive_forged(ieee1609dot2.certificate_in(data))
            raise

    def receive_ca_certs(self, data: bytes, now: float) -> None:
        """Keep the certificates in an answer that was asked for (`peer_to_peer`).

        Raises:
            NotTrusted: it is malformed, or one of them cannot be verified.
        """
        if self._trust is None:
            return
        try:
            certificates = decode_ca_certs(data)
        except Malformed as malformed:
            raise NotTrusted(RejectionReason.MALFORMED, str(malformed)) from malformed
        except Unsupported as unsupported:
            raise NotTrusted(RejectionReason.UNSUPPORTED, str(unsupported)) from unsupported
        is_known = self._trust.knows(certificates[0].hashed_id8)
        for certificate in self.distribution.wanted(certificates, now, is_known=is_known):
            self._trust.receive_certificate(certificate)

    def _receive_forged(self, carried: ieee1609dot2.CarriedCertificate | None) -> None:
        if carried is not None:
            self._forged[carried.hashed_id8] = None
            if len(self._forged) > _MAX_FORGED:
                self._forged.popitem(last=False)

    def _verified(
        self,
        data: bytes,
        message: SignedData,
        trust: TrustStore,
        now: float,
        *,
        is_repeated: bool,
    ) -> Opened:
        utc_s = now + self.utc_offset_s
        generation = self._check_time(message, utc_s, now)
        signer = self._signer(message, trust)
        self._check_signer(signer, message.psid, from_time64(generation), utc_s)
        self._check_revocation(signer, trust)
        digest = p256.digest_to_sign(message.to_be_signed, signer.certificate.digest)
        if digest in self._replays and not is_repeated:
            raise NotTrusted(RejectionReason.REPLAY)
        if not p256.is_signed(signer.key, digest, message.signature):
            raise NotTrusted(RejectionReason.BAD_SIGNATURE)
        if signer.certificate.is_implicit:
            trust.keep(signer)
            self._check_revocation(signer, trust)
        self.clock_check.receive_agreement(now)
        if not is_repeated:
            self._replays.add(digest, generation, to_time64(utc_s))
        self._verified_signers[signer.certificate.hashed_id8] = None
        self._verified_signers.move_to_end(signer.certificate.hashed_id8)
        if len(self._verified_signers) > _MAX_VERIFIED_SIGNERS:
            self._verified_signers.popitem(last=False)
        place = message.location
        return Opened(
            message.payload,
            signer.certificate.hashed_id8,
            from_time64(generation),
            signer.regions,
            None if place is None else TwoDLocation(place.latitude_deg, place.longitude_deg),
            signer.certificate.ssp(message.psid),
            data,
        )

    def _check_time(self, message: SignedData, utc_s: float, now: float) -> int:
        generation = message.generation_time64
        if generation is None:
            raise NotTrusted(RejectionReason.STALE, "no generation time")
        age_s = utc_s - from_time64(generation)
        if not -CLOCK_TOLERANCE_S <= age_s <= MESSAGE_LIFETIME_S:
            self.clock_check.receive_error(message.signer_id, age_s, now)
        if age_s > MESSAGE_LIFETIME_S:
            raise NotTrusted(RejectionReason.STALE, f"{age_s:.3f} s old")
        self._replays.receive_time(to_time64(utc_s))
        if generation <= self._replays.forgotten_us:
            raise NotTrusted(RejectionReason.STALE, "older than the replay window reaches back")
        if age_s < -CLOCK_TOLERANCE_S:
            raise NotTrusted(RejectionReason.FROM_THE_FUTURE, f"{-age_s:.3f} s ahead")
        if message.expiry_time64 is not None and utc_s >= from_time64(message.expiry_time64):
            raise NotTrusted(RejectionReason.EXPIRED, "the message")
        return generation

    def _signer(self, message: SignedData, trust: TrustStore) -> Trusted:
        if message.signer_id in self._own_ids:
            raise NotTrusted(RejectionReason.OWN_ECHO)
        return trust.signer(message.signer)

    def _check_revocation(self, signer: Trusted, trust: TrustStore) -> None:
        if trust.is_revoked(signer):
            raise NotTrusted(RejectionReason.REVOKED)

    def _check_signer(
        self, signer: Trusted, psid: int, generation_utc_s: float, utc_s: float
    ) -> None:
        if psid not in signer.psids:
            raise NotTrusted(
                RejectionReason.WRONG_PSID, f"its certificate does not allow 0x{psid:X}"
            )
        for at_utc_s in (generation_utc_s, utc_s):
            if at_utc_s >= signer.valid_until_utc_s:
                raise NotTrusted(RejectionReason.EXPIRED, "its certificate")
            if at_utc_s < signer.valid_from_utc_s:
                raise NotTrusted(RejectionReason.NOT_YET_VALID, "its certificate")
