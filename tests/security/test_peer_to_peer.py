"""Certificates of authorities, asked for and answered among vehicles."""

import copy
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from onboard.security import ieee1609dot2, p256
from onboard.security.ieee1609dot2 import CarriedCertificate
from onboard.security.peer_to_peer import (
    ANSWER_INTERVAL_S,
    BACKOFF_S,
    ENOUGH_ANSWERS,
    MOST_REQUESTED,
    MOST_SIGHTED,
    REQUEST_INTERVAL_S,
    REQUEST_LIFETIME_S,
    SIGHTED_S,
    CertificateDistribution,
    decode_ca_certs,
    encode_ca_certs,
    hashed_id3,
)
from onboard.security.rejection import NotTrusted
from onboard.security.security_services import SecurityServices
from onboard.security.trust import TrustStore
from onboard.tools.test_ca.authority import make_issuing, make_pseudonyms
from onboard.wave_udp.psid import BSM, LCCA
from tests.security.trial import ALICE, ISSUING, ROOT, UTC_S, VALID, reread
from tests.typed import a

NEW_KEY = p256.key_from(np.random.default_rng(8))
OTHER_ISSUING = make_issuing(ROOT, "other issuing", new_key=NEW_KEY, **VALID)
STRANGER = make_pseudonyms(OTHER_ISSUING, 1, {BSM, LCCA}, new_key=NEW_KEY, **VALID)
ISSUER = ISSUING.credential.certificate
WANTED = hashed_id3(ISSUER.hashed_id8)
OWN_ID = b"\x80own-id."


def answering() -> CertificateDistribution:
    distribution = CertificateDistribution([ISSUER])
    distribution.use_certificate(OWN_ID)
    return distribution


def exchange(seconds: float) -> list[float]:
    """Two vehicles under two authorities send BSMs; return when the first is accepted."""
    vehicles = [SecurityServices(UTC_S, keys) for keys in (ALICE, STRANGER)]
    accepted_at = []
    for tenth in range(round(seconds * 10)):
        now = 0.1 * tenth
        for sender, receiver in (vehicles, vehicles[::-1]):
            for answer in sender.distribution.answers_to_send(now):
                receiver.receive_ca_certs(answer, now)
            with suppress(NotTrusted):
                receiver.open(sender.secure(b"bsm", BSM, now), BSM, now)
                accepted_at.append(now)
    return accepted_at


def test_vehicles_under_two_authorities_of_one_root_learn_to_trust_each_other() -> None:
    accepted_at = exchange(4.0)
    assert accepted_at[0] < 2.0
    assert sum(at >= 3.0 for at in accepted_at) == 20


def test_a_request_is_in_the_header_that_public_asn1_describes(oracle: Any) -> None:
    to_be_signed = ieee1609dot2.encode_to_be_signed(b"bsm", BSM, 1, p2pcd_request=WANTED)
    value = reread(oracle.ToBeSignedData, to_be_signed)
    assert value["headerInfo"]["p2pcdLearningRequest"] == WANTED


def test_an_answer_is_a_version_a_choice_and_certificates() -> None:
    answer = encode_ca_certs([ISSUER])
    assert answer == b"\x01\x80\x01\x01" + ISSUER.encoded
    assert decode_ca_certs(answer) == (ISSUER,)


@pytest.mark.parametrize(
    "data", [b"", b"\x02\x80\x01\x01", b"\x01\x81\x00", b"\x01\x80\x01\x00", b"\x01\x80\x01\x09"]
)
def test_what_is_no_answer_is_refused_with_a_reason(data: bytes) -> None:
    with pytest.raises(NotTrusted) as refusal:
        SecurityServices(UTC_S, ALICE).receive_ca_certs(data, 0.0)
    assert refusal.value.reason in ("malformed", "unsupported")


def test_who_floods_with_requests_gets_one_answer_in_an_interval() -> None:
    asked, answers = answering(), 0
    for millisecond in range(round(1000 * 5 * ANSWER_INTERVAL_S)):
        asked.receive_request(WANTED, millisecond / 1000)
        answers += len(asked.answers_to_send(millisecond / 1000))
    assert 4 <= answers <= 5


def test_an_answer_waits_a_part_of_the_backoff_and_then_is_due() -> None:
    asked = answering()
    asked.receive_request(WANTED, 1.0)
    assert asked.answers_to_send(1.0) == []
    assert 1.0 < asked.get_timer() < 1.0 + BACKOFF_S
    assert asked.answers_to_send(asked.get_timer()) == [encode_ca_certs([ISSUER])]


def test_the_time_to_an_answer_does_not_outlast_a_pseudonym() -> None:
    security, waited_s = SecurityServices(UTC_S, ALICE), set()
    for number, pseudonym in enumerate(ALICE.pseudonyms):
        now = 10.0 * number
        security.sign_with(pseudonym)
        security.distribution.receive_request(WANTED, now)
        waited_s.add(round(security.distribution.get_timer() - now, 6))
        security.distribution.answers_to_send(now + BACKOFF_S)
    assert len(waited_s) == len(ALICE.pseudonyms)


def test_enough_answers_of_others_make_ones_own_needless() -> None:
    asked = answering()
    asked.receive_request(WANTED, 1.0)
    for _ in range(ENOUGH_ANSWERS):
        asked.wanted([ISSUER], 1.01, is_known=True)
    assert asked.answers_to_send(2.0) == []


def test_answers_with_other_certificates_of_the_same_hashed_id3_change_nothing() -> None:
    """A HashedId3 of one's choice takes seconds to find, and answers are unsigned."""
    other = OTHER_ISSUING.credential.certificate
    both = answering()
    both.receive_request(WANTED, 1.0)
    both.receive_unknown_issuer(other.hashed_id8, 1.0)
    for issuer in (ISSUER, other):
        forged = copy.copy(issuer)
        object.__setattr__(forged, "digest", bytes(29) + hashed_id3(issuer.hashed_id8))
        for _ in range(ENOUGH_ANSWERS):
            both.wanted([forged], 1.01, is_known=False)
    assert both.answers_to_send(2.0) == [encode_ca_certs([ISSUER])]
    assert both.wanted([other], 2.0, is_known=False) == [other]


def test_only_own_authorities_are_answered_with_and_the_root_is_not() -> None:
    asked = answering()
    for other in (ROOT, OTHER_ISSUING):
        asked.receive_request(hashed_id3(other.credential.certificate.hashed_id8), 1.0)
    assert asked.get_timer() == float("inf")


def unnamed(asking: CertificateDistribution, now: float) -> None:
    """Take an answer whose issuer no message has named, and so the turn of such answers."""
    asking.wanted([ISSUER], now, is_known=False)


def test_of_answers_whose_issuer_no_message_has_named_ten_a_second_are_verified() -> None:
    asking = answering()
    other = OTHER_ISSUING.credential.certificate
    times = [1.0 + 0.001 * number for number in range(1000)]
    assert sum(asking.wanted([other], now, is_known=False) == [other] for now in times) == 10


def test_an_answer_is_verified_once_for_a_message_that_names_its_issuer_lately() -> None:
    asking = answering()
    other = OTHER_ISSUING.credential.certificate
    asking.receive_unknown_issuer(other.hashed_id8, 1.0)
    unnamed(asking, 1.0 + REQUEST_LIFETIME_S)
    assert asking.wanted([other], 1.0 + REQUEST_LIFETIME_S, is_known=False) == []
    asking.receive_unknown_issuer(other.hashed_id8, 7.0)
    unnamed(asking, 7.0)
    assert asking.wanted([other], 7.0, is_known=False) == [other]
    assert asking.wanted([other], 7.0, is_known=False) == []


def test_an_answer_with_a_known_certificate_is_not_verified() -> None:
    asking = answering()
    other = OTHER_ISSUING.credential.certificate
    asking.receive_unknown_issuer(other.hashed_id8, 1.0)
    assert asking.wanted([other], 1.0, is_known=True) == []


def requests(asking: CertificateDistribution, seconds: float) -> list[bytes]:
    """What ten BSMs a second ask for from second 1 on."""
    asked = (asking.request_to_send(1.0 + 0.1 * tenth) for tenth in range(round(10 * seconds)))
    return [each for each in asked if each is not None]


def test_an_issuer_is_asked_for_once_a_second_after_its_last_message() -> None:
    asking = answering()
    asking.receive_unknown_issuer(bytes(8), 1.0)
    assert len(requests(asking, 10.0)) == round(REQUEST_LIFETIME_S / REQUEST_INTERVAL_S)


def test_of_many_issuers_those_are_asked_for_that_come_again_after_a_while() -> None:
    asking = answering()
    for number in range(1000):
        for at in (0.5, 0.5 + 0.9 * SIGHTED_S):
            asking.receive_unknown_issuer(number.to_bytes(8), at)
    asking.receive_unknown_issuer(b"vehicle.", 0.8)
    assert hashed_id3(b"vehicle.") not in requests(asking, 2.0)
    asking.receive_unknown_issuer(b"vehicle.", 0.8 + SIGHTED_S)
    assert hashed_id3(b"vehicle.") in requests(asking, 2.0)


def test_one_that_was_asked_for_gives_its_place_to_another_one() -> None:
    asking = answering()
    for number in range(MOST_REQUESTED):
        asking.receive_unknown_issuer(number.to_bytes(8), 1.0)
    asking.receive_unknown_issuer(b"vehicle.", 1.0)
    asking.receive_unknown_issuer(b"vehicle.", 1.0 + SIGHTED_S)
    assert hashed_id3(b"vehicle.") not in requests(asking, 1.0), "no place yet"
    asking.receive_unknown_issuer(b"vehicle.", 1.0 + SIGHTED_S)
    assert hashed_id3(b"vehicle.") in requests(asking, 1.0)


def test_issuers_of_no_message_are_forgotten_before_those_of_vehicles() -> None:
    asking = answering()
    other = OTHER_ISSUING.credential.certificate
    asking.receive_unknown_issuer(other.hashed_id8, 0.0)
    for number in range(MOST_SIGHTED - 1):
        asking.receive_unknown_issuer(number.to_bytes(8), 0.0)
    asking.receive_unknown_issuer(other.hashed_id8, 1.0)
    for number in range(MOST_SIGHTED - 1):
        asking.receive_unknown_issuer(number.to_bytes(7) + b"!", 1.0)
    unnamed(asking, 1.0)
    assert asking.wanted([other], 1.0, is_known=False) == [other]
    asking.receive_unknown_issuer(other.hashed_id8, 1.0)
    for number in range(MOST_SIGHTED):
        asking.receive_unknown_issuer(number.to_bytes(8), 1.0)
    assert asking.wanted([other], 1.0, is_known=False) == []


def test_who_hears_an_unknown_issuer_announces_the_own_one() -> None:
    """Where requests are drowned, whoever needs the answer gets it."""
    hears = CertificateDistribution([ISSUER])
    hears.use_certificate(OWN_ID, ISSUER.hashed_id8)
    hears.receive_unknown_issuer(b"unknown.", 1.0)
    assert hears.answers_to_send(1.0 + BACKOFF_S) == [encode_ca_certs([ISSUER])]
    for millisecond in range(999):
        hears.receive_unknown_issuer(b"unknown.", 1.0 + BACKOFF_S + millisecond / 1000)
    assert hears.answers_to_send(2.2) == [], "no more often than it would answer"


def test_whether_a_certificate_may_be_valid_is_asked_without_a_trace() -> None:
    """It is asked of received frames before any step takes them: a replay does not ask."""
    services, kept = SecurityServices(UTC_S, ALICE), []
    for number in range(2):
        issuer = make_issuing(ROOT, f"issuing {number}", new_key=NEW_KEY, **VALID)
        kept.append(issuer.credential.certificate)
        services.receive_ca_certs(encode_ca_certs(kept[-1:]), float(number))
    received = a(TrustStore, services._trust)._received
    before = list(received)

    assert services.can_verify(CarriedCertificate(bytes(8), kept[0].hashed_id8))
    assert not services.can_verify(CarriedCertificate(bytes(8), b"unknown."))
    assert list(received) == before == [each.hashed_id8 for each in kept]
