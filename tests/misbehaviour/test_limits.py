"""At each limit itself: which side of it is accepted, and what is kept."""

from dataclasses import replace

import numpy as np
import pytest

from onboard.kinematics.geodesy import distance_m
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.messages.lcca import Leave, LeaveReason, Warn, WarnCause
from onboard.misbehaviour import alarm_claims, misbehaviour_detection, signer_credibility
from onboard.misbehaviour.alarm_claims import MAX_SIGMA_M_S, AlarmClaims
from onboard.misbehaviour.evidence_check import violations
from onboard.misbehaviour.identity_claims import IdentityClaims
from onboard.misbehaviour.misbehaviour_detection import (
    BRAKE_M_S2,
    BRAKE_WINDOW_S,
    HIGHEST_ACCELERATION_M_S2,
    HIGHEST_SPEED_M_S,
    MIN_SPAN_S,
    POSITION_ERROR_M,
    SENDER_TIMEOUT_S,
    SPEED_ERROR_M_S,
    Misbehaviour,
    MisbehaviourDetector,
)
from onboard.misbehaviour.pending_warnings import FRESH_S, PendingWarnings
from onboard.misbehaviour.sender_check import OPPOSITE_RAD, sender_violation
from onboard.misbehaviour.signer_credibility import (
    CLAIM_S,
    MOST_ALARMS,
    SLOWED_M_S,
    SLOWED_WITHIN_S,
    SignerCredibility,
)
from onboard.observations import Lead, LeadIdentity, Speed
from onboard.risk.alarm import AlarmReason, Assessment, Level
from onboard.risk.lcca_warning import LCCA
from onboard.sensors.host_state import HostState
from onboard.tracking.evidence import (
    Estimate,
    Evidence,
    Measurement,
    ProvenanceSpans,
    as_arrays,
    measurement_id,
)
from tests.risk.lcca_warnings import lcca_warning

CORE = CoreData(0, b"abcd", latitude_deg=25.0, longitude_deg=121.5)
HARD_BRAKING = VehicleSafetyExtensions(events=VehicleEventFlags.HARD_BRAKING)
ONE, TWO, THREE = b"signer 1", b"signer 2", b"signer 3"


class Detector(MisbehaviourDetector):
    """Is given BSMs that are received when they are generated."""

    def hears(
        self,
        at_s: float,
        speed_m_s: float | None = None,
        *,
        sender: bytes = ONE,
        heading_rad: float | None = None,
        north_deg: float = 0.0,
        is_braking: bool = False,
    ) -> Misbehaviour | None:
        core = replace(
            CORE, speed_m_s=speed_m_s, heading_rad=heading_rad, latitude_deg=25.0 + north_deg
        )
        message = BasicSafetyMessage(core, HARD_BRAKING if is_braking else None)
        return self.receive_bsm(sender, message, at_s, at_s)


# ---- BSMs ---------------------------------------------------------------------------------------


def test_the_highest_speed_is_possible() -> None:
    assert Detector().hears(0.0, HIGHEST_SPEED_M_S) is None
    assert Detector().hears(0.0, HIGHEST_SPEED_M_S + 0.02) is Misbehaviour.SPEED


@pytest.mark.parametrize("more_m_s", [0.0, 0.02])
def test_the_greatest_change_of_speed_is_possible(more_m_s: float) -> None:
    detector = Detector()
    detector.hears(0.0, 20.0)
    greatest_m_s = HIGHEST_ACCELERATION_M_S2 + SPEED_ERROR_M_S
    found = detector.hears(1.0, 20.0 + greatest_m_s + more_m_s)
    assert found is (Misbehaviour.ACCELERATION if more_m_s else None)


def test_as_far_as_the_speed_allows_is_possible() -> None:
    """In a second, at a speed that is chosen for the distance to be the greatest to the bit."""
    for tenths in range(400, 600):
        north_deg = tenths / 10 / 111_195
        travelled_m = distance_m(25.0, 121.5, 25.0 + north_deg, 121.5)
        speed_m_s = travelled_m - HIGHEST_ACCELERATION_M_S2 / 2 - POSITION_ERROR_M
        if speed_m_s + HIGHEST_ACCELERATION_M_S2 / 2 + POSITION_ERROR_M == travelled_m:
            break
    else:
        pytest.fail("no such distance")
    for less_m_s, found in ((0.0, None), (0.02, Misbehaviour.POSITION)):
        detector = Detector()
        detector.hears(0.0, speed_m_s - less_m_s)
        assert detector.hears(1.0, speed_m_s - less_m_s, north_deg=north_deg) is found


def test_a_bsm_older_than_the_newest_is_not_kept_and_one_of_the_same_time_is() -> None:
    detector = Detector()
    detector.hears(10.0, heading_rad=1.0)
    detector.hears(5.0, heading_rad=2.0)
    assert detector.heading_rad(ONE) == 1.0
    detector.hears(10.0, heading_rad=3.0)
    assert detector.heading_rad(ONE) == 3.0


def test_a_sender_is_dropped_after_its_time_of_silence() -> None:
    detector = Detector()
    detector.hears(0.0, heading_rad=1.0)
    detector.hears(SENDER_TIMEOUT_S, sender=TWO)
    assert detector.heading_rad(ONE) == 1.0
    detector.hears(SENDER_TIMEOUT_S + 0.1, sender=TWO)
    assert detector.heading_rad(ONE) is None


def test_as_many_senders_are_kept_as_the_limit_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour_detection, "_MAX_SENDERS", 2)
    detector = Detector()
    kept = []
    for sender in (ONE, TWO, THREE):
        detector.hears(0.0, sender=sender, heading_rad=1.0)
        kept.append(detector.heading_rad(ONE) is not None)
    assert kept == [True, True, False]


def test_a_speed_is_newer_only_if_it_came_and_was_made_later() -> None:
    detector = Detector()
    detector.receive_car_id(ONE, b"the lead")
    detector.hears(1.0, 20.0)
    assert detector.has_speed_since(b"the lead", 0.9, 0.9)
    assert not detector.has_speed_since(b"the lead", 1.0, 0.9)
    assert not detector.has_speed_since(b"the lead", 0.9, 1.0)


# ---- hard braking -------------------------------------------------------------------------------


def claims_braking(*speeds: tuple[float, float]) -> Misbehaviour | None:
    """Speeds at their times, the last one with the claim of hard braking."""
    detector = Detector()
    for at_s, speed_m_s in speeds[:-1]:
        detector.hears(at_s, speed_m_s)
    return detector.hears(*speeds[-1], is_braking=True)


def test_a_speed_at_the_edge_of_the_window_confirms() -> None:
    drop_m_s = 2.0 * BRAKE_M_S2
    slower = (1.0, 20.0), (BRAKE_WINDOW_S, 20.0)
    assert claims_braking((0.0, 20.0 + drop_m_s), *slower) is None
    assert claims_braking((-0.01, 20.0 + drop_m_s), *slower) is Misbehaviour.BRAKE


def test_the_least_deceleration_confirms() -> None:
    assert claims_braking((0.0, 20.0), (1.0, 20.0 - BRAKE_M_S2)) is None
    assert claims_braking((0.0, 20.0), (1.0, 20.02 - BRAKE_M_S2)) is Misbehaviour.BRAKE


def test_steady_speeds_contradict_over_the_least_span_at_any_time_of_day() -> None:
    assert claims_braking((0.0, 20.0), (MIN_SPAN_S, 20.0)) is Misbehaviour.BRAKE
    assert claims_braking((0.0, 20.0), (MIN_SPAN_S - 0.01, 20.0)) is None
    assert claims_braking((1000.0, 20.0), (1000.1, 20.0)) is None


# ---- identities and group messages --------------------------------------------------------------


def test_as_many_ids_are_kept_as_the_capacity_says() -> None:
    claims = IdentityClaims(2)
    kept = []
    for name in (b"a", b"b", b"c"):
        claims.receive_claim(name, ONE)
        kept.append((len(claims), claims.owner(b"a")))
    assert kept == [(1, ONE), (2, ONE), (2, None)]


def test_a_dispute_lasts_when_the_first_signer_comes_again() -> None:
    claims = IdentityClaims(2)
    for signer in (ONE, TWO, ONE):
        claims.receive_claim(b"a", signer)
    assert claims.is_disputed(b"a")


def test_a_signer_has_the_name_that_it_used_last_unless_another_one_uses_it() -> None:
    claims = IdentityClaims(2)
    names = []
    for name, signer in ((b"a", ONE), (b"b", ONE), (b"b", TWO), (b"c", THREE), (b"d", b"signer 4")):
        claims.receive_claim(name, signer)
        names.append((claims.name_of(ONE), claims.name_of(signer)))
    assert names == [
        (b"a", b"a"),
        (b"b", b"b"),
        (None, None),
        (None, b"c"),
        (None, b"d"),
    ]


@pytest.mark.parametrize("more_rad", [0.0, 0.01])
def test_who_turns_by_the_greatest_angle_drives_in_the_own_direction(more_rad: float) -> None:
    detector = Detector()
    detector.hears(0.0, heading_rad=OPPOSITE_RAD + more_rad)
    refused = sender_violation(
        Leave(b"a member", b"the lead", 2, b"the lead", LeaveReason.GAP),
        ONE,
        detector,
        predecessor_id=None,
        predecessor_signer=None,
        heading_rad=0.0,
    )
    assert refused == ("opposite_direction" if more_rad else None)


def warn(sequence: int) -> Warn:
    cause = WarnCause.DECELERATION
    return Warn(ORIGIN, ORIGIN, 1, ORIGIN, sequence, 0, 1, sequence, cause, 6.0, 0.0, 1)


ORIGIN = b"12345678"


@pytest.mark.parametrize("more_s", [0.0, 0.01])
@pytest.mark.parametrize("is_early", [False, True])
def test_a_warning_is_fresh_for_as_long_as_clocks_and_air_take(
    more_s: float, *, is_early: bool
) -> None:
    pending = PendingWarnings(MisbehaviourDetector())
    apart_s = (FRESH_S + more_s) * (-1 if is_early else 1)
    pending.receive_warning(warn(1), ONE, 10.0 - apart_s, 10.0)
    assert (pending.next_warning() is None) is (more_s > 0.0)


# ---- who is charged -----------------------------------------------------------------------------


def claims_of(host: HostState | None = None) -> AlarmClaims:
    return AlarmClaims(lambda _: None, lambda _: False, host or HostState(), has_sight=True)


def alarm(claims: AlarmClaims, now: float, origin: bytes = ORIGIN) -> bool:
    reason = AlarmReason("warning", origin.hex(), 0.0)
    return claims.admit(LCCA, Assessment(Level.WARNING, 6.0, (reason,)), now)


def charged(claims: AlarmClaims, now: float) -> dict[bytes, float]:
    return {signer: each.at(now) for signer, each in claims.credibility._charges.items()}


def test_who_repeats_a_warning_is_not_charged_for_it() -> None:
    claims = claims_of()
    claims.receive_warn(warn(1), ONE, 0.0)
    claims.receive_warn(warn(1), TWO, 0.0)
    claims.receive_warning(lcca_warning(0.0, ORIGIN, 1))
    alarm(claims, 0.0)
    assert charged(claims, 0.0) == {ONE: 1.0}


def test_a_braking_without_a_signer_is_charged_to_the_first_who_signs_it() -> None:
    claims = claims_of()
    claims.receive_warning(lcca_warning(0.0, ORIGIN, 1))
    claims.receive_warn(warn(1), ONE, 0.0)
    claims.receive_warn(warn(2), TWO, 0.0)
    alarm(claims, 0.0)
    assert charged(claims, 0.0) == {ONE: 1.0}


def test_as_many_brakings_are_kept_as_the_limit_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alarm_claims, "_MAX_BRAKINGS", 2)
    for brakings, payer in ((2, ONE), (3, alarm_claims.NOBODY)):
        claims = claims_of()
        for sequence in range(1, brakings + 1):
            claims.receive_warn(warn(sequence), ONE, 0.0)
        claims.receive_warning(lcca_warning(0.0, ORIGIN, 1))
        alarm(claims, 0.0)
        assert charged(claims, 0.0) == {payer: 1.0}


def test_as_many_braking_vehicles_are_kept_as_the_limit_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(alarm_claims, "_MAX_BRAKINGS", 2)
    claims = claims_of()
    for number in range(2):
        claims.receive_warning(lcca_warning(0.0, bytes([number]) * 8, 1))
    assert [alarm(claims, 0.0, bytes([number]) * 8) for number in range(2)] == [True, True]
    assert charged(claims, 0.0) == {alarm_claims.NOBODY: 2.0}


@pytest.mark.parametrize(
    ("sigma_m_s", "confirms"),
    [(None, True), (0.2, True), (MAX_SIGMA_M_S, True), (MAX_SIGMA_M_S + 0.01, False)],
)
def test_a_closing_speed_confirms_up_to_its_greatest_sigma(
    sigma_m_s: float | None, confirms: bool
) -> None:
    host = HostState()
    claims = claims_of(host)
    host.receive_observation(Speed(0.0, 20.0, 0.28, "obd"))
    seen = Lead(0.0, LeadIdentity.UNKNOWN, None, 30.0, 0.5, 0.0, sigma_m_s, track_id=1)
    claims.receive_lead(seen, 0.0)
    claims.receive_warn(warn(1), ONE, 0.0)
    claims.receive_warning(lcca_warning(0.0, ORIGIN, 1))
    alarm(claims, 0.0)
    claims.receive_lead(replace(seen, closing_speed_m_s=5.0), 0.0)
    assert charged(claims, 0.0) == {ONE: 0.0 if confirms else 1.0}


def claim(credibility: SignerCredibility, vehicle: str, now: float, signer: bytes = ONE) -> bool:
    return credibility.admit("ima", vehicle, (signer,), now, slows_traffic=True)


def test_who_can_pay_for_one_more_alarm_is_not_ignored() -> None:
    credibility = SignerCredibility()
    ignored = []
    for number in range(MOST_ALARMS):
        claim(credibility, str(number), 0.0)
        ignored.append(credibility.is_ignored(ONE, 0.0))
    assert ignored == [False] * (MOST_ALARMS - 1) + [True]


def test_as_many_signers_and_claims_are_kept_as_the_limits_say(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(signer_credibility, "_MAX_SIGNERS", 2)
    monkeypatch.setattr(signer_credibility, "_MAX_CLAIMS", 2)
    credibility = SignerCredibility()
    kept = []
    for vehicle, signer in (("a", ONE), ("b", TWO), ("c", THREE)):
        claim(credibility, vehicle, 0.0, signer)
        kept.append((credibility.is_paid("a", 0.0), ONE in credibility._charges))
    assert kept == [(True, True), (True, True), (False, False)]


def test_an_alarm_is_paid_for_until_its_claim_ends() -> None:
    credibility = SignerCredibility()
    for tenth in range(100):
        claim(credibility, "a", tenth / 10)
    assert credibility.is_paid("a", CLAIM_S - 0.05)
    assert not credibility.is_paid("a", CLAIM_S)


@pytest.mark.parametrize(
    ("before_s", "slowed_m_s", "confirms"),
    [
        (SLOWED_WITHIN_S, SLOWED_M_S, True),
        (SLOWED_WITHIN_S + 0.01, SLOWED_M_S, False),
        (SLOWED_WITHIN_S, SLOWED_M_S - 0.01, False),
    ],
)
def test_traffic_that_slowed_down_by_the_least_since_the_earliest_time_confirms(
    before_s: float, slowed_m_s: float, confirms: bool
) -> None:
    credibility = SignerCredibility()
    credibility.receive_traffic_speed(20.0, 0.0)
    claim(credibility, "a", before_s)
    credibility.receive_traffic_speed(20.0 - slowed_m_s, before_s)
    assert credibility._charges[ONE].at(before_s) == (0.0 if confirms else 1.0)


# ---- evidence -----------------------------------------------------------------------------------


def refused(piece: Evidence) -> dict[int, str]:
    """What is wrong with one piece of evidence of a sender where it is."""
    found, _ = violations(
        as_arrays([piece]),
        ProvenanceSpans.of([piece.provenance]),
        ranges_m=np.full(1, 1700.0),
        senders_m=np.zeros((2, 1)),
        received_ms=np.full(1, 1000.0),
    )
    return found


def estimate(covariance: np.ndarray) -> Estimate:
    moments = frozenset(measurement_id(ONE, stamp_ms) for stamp_ms in (5, 905))
    return Estimate(moments, np.zeros(4), covariance)


@pytest.mark.parametrize("seed", range(20))
def test_a_covariance_is_positive_if_all_its_eigenvalues_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    values = rng.uniform(1.0, 20.0, 4)
    positive = turned @ np.diag(values) @ turned.T
    negative = positive - 1.01 * values[0] * np.outer(turned[:, 0], turned[:, 0])

    assert refused(estimate((positive + positive.T) / 2)) == {}
    assert refused(estimate((negative + negative.T) / 2)) == {0: "not_positive"}


@pytest.mark.parametrize(("apart", "found"), [(1e-6, {}), (1.1e-6, {0: "not_positive"})])
def test_a_covariance_is_symmetric_but_for_its_rounding(
    apart: float, found: dict[int, str]
) -> None:
    covariance = np.eye(4)
    covariance[0, 1] = apart
    assert refused(estimate(covariance)) == found


def test_a_mere_position_is_not_asked_for_its_speed() -> None:
    """Which is unknown, and has no covariance."""
    entries = as_arrays([Measurement(measurement_id(ONE, 5), np.zeros(2), np.eye(2))])
    entries.covariances[2:, 2:] = -1.0
    found, _ = violations(
        entries,
        ProvenanceSpans.of([frozenset({measurement_id(ONE, 5)})]),
        ranges_m=np.full(1, 1700.0),
        senders_m=np.zeros((2, 1)),
        received_ms=np.full(1, 1000.0),
    )
    assert found == {}
