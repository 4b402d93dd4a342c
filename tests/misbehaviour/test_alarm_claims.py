"""What own sensors show of the traffic ahead confirms a claim, as far as they know it."""

import pytest

from onboard.messages import lcca
from onboard.misbehaviour import alarm_claims
from onboard.misbehaviour.alarm_claims import NOBODY, TEST_EVERY_S, TEST_S, AlarmClaims
from onboard.misbehaviour.signer_credibility import MOST_ALARMS, PASSING_ON
from onboard.observations import Lead, LeadIdentity, Speed
from onboard.risk.alarm import AlarmReason, Assessment, Level
from onboard.risk.braking_ahead import BRAKING_AHEAD
from onboard.risk.bsw import BSW
from onboard.risk.ima import IMA
from onboard.risk.lcca_warning import LCCA
from onboard.sensors.host_state import SPEED_VALID_S, HostState
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.risk.lcca_warnings import lcca_warning

ORIGIN, SIGNER = b"12345678", b"signer 1"


def lead(stamp_s: float, closing_m_s: float) -> Lead:
    return Lead(stamp_s, LeadIdentity.UNKNOWN, None, 30.0, 0.5, closing_m_s, 0.2, track_id=1)


def claim_braking(claims: AlarmClaims, sequence: int, now: float) -> None:
    """A braking of the lead of which a group message warns; the alarm is admitted."""
    warning = lcca_warning(now, ORIGIN, sequence)
    warn = lcca.Warn(
        ORIGIN, ORIGIN, 1, ORIGIN, sequence, 0, 1, sequence,
        lcca.WarnCause.DECELERATION, 6.0, 0.0, 1,
    )  # fmt: skip
    claims.receive_warn(warn, SIGNER, now)
    claims.receive_warning(warning)
    reason = AlarmReason(warning.kind, ORIGIN.hex(), 0.0)
    assert claims.admit(LCCA, Assessment(Level.WARNING, 6.0, (reason,)), now)


@pytest.mark.parametrize(("speed_age_s", "is_ignored"), [(0.1, False), (SPEED_VALID_S + 0.1, True)])
def test_a_lead_that_closes_in_confirms_nothing_without_a_recent_own_speed(
    speed_age_s: float, is_ignored: bool
) -> None:
    """The host vehicle may have gained speed as well as the lead may have lost it."""
    host = HostState()
    claims = AlarmClaims(lambda _: None, lambda _: False, host, has_sight=True)
    now = 0.0
    for sequence in range(MOST_ALARMS):
        now += 30.0
        host.receive_observation(Speed(now - speed_age_s, 20.0, 0.28, "obd:7E8"))
        claims.receive_lead(lead(now, 0.0), now)
        claim_braking(claims, sequence, now)
        claims.receive_lead(lead(now, 5.0), now)

    assert claims.credibility.is_ignored(SIGNER, now) is is_ignored


FORWARDER, UNKNOWN = b"forwards", [bytes([number]) * 8 for number in range(MOST_ALARMS)]


def claims_of_nothing() -> AlarmClaims:
    return AlarmClaims(lambda _: None, lambda _: False, HostState(), has_sight=True)


def warn(origin: bytes, sequence: int) -> lcca.Warn:
    return lcca.Warn(
        origin, origin, 1, origin, sequence, 0, 1, sequence,
        lcca.WarnCause.DECELERATION, 6.0, 0.0, 1,
    )  # fmt: skip


def alarms(claims: AlarmClaims, claimant: bytes, sequence: int, now: float) -> bool:
    """Whether a braking that this one claims raises an alarm."""
    if claims.is_refused(ORIGIN.hex(), claimant, now):
        return False
    claims.receive_warn(warn(ORIGIN, sequence), claimant, now)
    claims.receive_warning(lcca_warning(now, ORIGIN, sequence))
    reason = AlarmReason("warning", ORIGIN.hex(), 0.0)
    return claims.admit(LCCA, Assessment(Level.WARNING, 6.0, (reason,)), now)


def test_whoever_passes_on_a_braking_claims_no_more_than_that_it_is_ahead() -> None:
    claims = claims_of_nothing()
    assert claims.claimant(FORWARDER, SIGNER, 0.0) == SIGNER
    assert claims.claimant(FORWARDER, None, 0.0) == PASSING_ON + FORWARDER


def test_whoever_is_identified_vouches_three_times_for_signers_that_are_not_heard() -> None:
    claims = claims_of_nothing()
    for sequence, unknown in enumerate(UNKNOWN):
        assert alarms(claims, unknown, sequence, 100.0 * sequence)
    now = 100.0 * MOST_ALARMS
    assert not alarms(claims, SIGNER, 100, now)
    assert claims.claimant(FORWARDER, SIGNER, now) == SIGNER

    claims.receive_identified({FORWARDER})

    heard = []
    for sequence in range(101, 101 + MOST_ALARMS + 1):
        now += 100.0
        heard.append(alarms(claims, claims.claimant(FORWARDER, SIGNER, now), sequence, now))
    assert heard == [True] * MOST_ALARMS + [False]
    assert alarms(claims, FORWARDER, 200, now + 100.0)


def test_nobody_vouches_for_a_signer_that_is_ignored() -> None:
    claims = claims_of_nothing()
    for sequence in range(MOST_ALARMS):
        assert alarms(claims, SIGNER, sequence, 100.0 * sequence)
    claims.receive_identified({FORWARDER})

    assert claims.claimant(FORWARDER, SIGNER, 1000.0) == SIGNER


def test_a_braking_is_the_next_ones_claim_when_the_first_who_claimed_it_is_not_credible_now() -> (
    None
):
    """An insider who passes it on first, and spends its alarms at once, hid it for that long."""
    claims = claims_of_nothing()
    claims.receive_warn(warn(ORIGIN, 900), PASSING_ON + FORWARDER, 0.0)
    claims.receive_warning(lcca_warning(0.0, ORIGIN, 900))
    for number in range(MOST_ALARMS):
        claims.credibility.admit(
            "ima", str(number), (PASSING_ON + FORWARDER,), 0.0, slows_traffic=False
        )
    claims.receive_identified({SIGNER})
    reason = AlarmReason("warning", ORIGIN.hex(), 0.0)
    assessment = Assessment(Level.WARNING, 6.0, (reason,))
    assert not claims.admit(LCCA, assessment, 0.1)

    claims.receive_warn(warn(ORIGIN, 900), PASSING_ON + SIGNER, 0.2)

    assert claims.admit(LCCA, assessment, 0.2)


def test_who_claims_many_brakings_displaces_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alarm_claims, "_MAX_BRAKINGS", 4)
    claims = claims_of_nothing()
    claims.receive_warn(warn(ORIGIN, 1), SIGNER, 0.0)
    for sequence in range(10):
        claims.receive_warn(warn(b"evil" * 2, sequence), FORWARDER, 0.0)
    claims.receive_warning(lcca_warning(0.0, ORIGIN, 1))
    reason = AlarmReason("warning", ORIGIN.hex(), 0.0)

    assert claims.admit(LCCA, Assessment(Level.WARNING, 6.0, (reason,)), 0.0)
    assert SIGNER in claims.credibility._charges
    assert NOBODY not in claims.credibility._charges


def test_tests_of_one_vehicle_are_shown_for_a_moment_and_those_of_another_beside() -> None:
    """Whoever sends them without end would have them on for ever."""
    claims = claims_of_nothing()

    def is_shown(origin: bytes, now: float) -> bool:
        reason = AlarmReason("warning_raised", origin.hex(), 0.0)
        return claims.admit(LCCA, Assessment(Level.WARNING, 6.0, (reason,), is_test=True), now)

    shown_s = [at / 10.0 for at in range(600) if is_shown(ORIGIN, at / 10.0)]
    assert len(shown_s) == 3 * 10 * TEST_S
    assert not is_shown(ORIGIN, 59.9)
    assert is_shown(UNKNOWN[0], 59.9)
    assert is_shown(ORIGIN, 3 * TEST_EVERY_S)


def test_a_braking_raises_its_alarm_after_tests_of_the_same_vehicle() -> None:
    claims = claims_of_nothing()
    reason = AlarmReason("warning_raised", ORIGIN.hex(), 0.0)
    test = Assessment(Level.WARNING, 6.0, (reason,), is_test=True)
    for at in range(50):
        claims.admit(LCCA, test, at / 10.0)

    claim_braking(claims, 1, 5.0)


def test_a_braking_ahead_without_positions_is_charged_to_who_signs_its_bsm() -> None:
    signer = {bytes.fromhex("0a0b0c0d"): SIGNER}
    claims = AlarmClaims(signer.get, lambda _: False, HostState(), has_sight=True)

    admitted = [
        claims.admit(
            BRAKING_AHEAD,
            Assessment(Level.CAUTION, 4.0, (AlarmReason("bsm", "0a0b0c0d", 0.0),)),
            30.0 * number,
        )
        for number in range(MOST_ALARMS + 1)
    ]

    assert admitted == [True] * MOST_ALARMS + [False]
    assert not claims.credibility.is_ignored(SIGNER, 100.0), "its place among others is its own"


def test_unconfirmed_cautions_of_honest_traffic_take_no_alarm_from_a_crossing_vehicle() -> None:
    """Eleven in two hours had left none to vehicles that the host has not identified."""
    signers = {bytes((number,)) * 4: bytes((number,)) * 8 for number in range(12)}
    claims = AlarmClaims(signers.get, lambda _: False, HostState(), has_sight=True)
    *cautioned, crossing = (each.hex() for each in signers)
    for number, name in enumerate(cautioned):
        reason = AlarmReason("bsm", name, 0.0)
        assert claims.admit(BRAKING_AHEAD, Assessment(Level.CAUTION, 4.0, (reason,)), 30.0 * number)
    claims.alarming([vehicle(crossing)], 400.0)

    reason = AlarmReason("perceived_object:bsm", crossing, 0.0)
    assert claims.admit(IMA, Assessment(Level.WARNING, 0.9, (reason,), crossing), 400.0)


def test_a_vehicle_that_stays_in_the_blind_spot_is_warned_of_until_it_has_gone() -> None:
    """After half a minute there had been no alarm any more: it was charged for every 10 s."""
    claims = claims_of_nothing()
    claims.alarming([vehicle("0a0b0c0d")], 0.0)
    reason = AlarmReason("perceived_object:bsm", "0a0b0c0d", 0.0)
    beside = Assessment(Level.WARNING, 0.9, (reason,), "0a0b0c0d")

    assert all(claims.admit(BSW, beside, 0.1 * step) for step in range(1200))
    again = [claims.admit(BSW, beside, 200.0 + 10.0 * number) for number in range(MOST_ALARMS)]
    assert again == [True] * (MOST_ALARMS - 1) + [False]


def vehicle(name: str) -> PerceivedObject:
    state = 0.0, 0.0, 0.0, 20.0
    return PerceivedObject(0.0, name, ObjectSource.BSM, state, ((1.0,),), 0.1, frozenset())
