"""What own sensors show of the traffic ahead confirms a claim, as far as they know it."""

import pytest

from onboard.messages import lcca
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.misbehaviour.signer_credibility import MOST_ALARMS
from onboard.observations import Lead, LeadIdentity, Speed
from onboard.risk.alarm import AlarmReason, Assessment, Level
from onboard.risk.lcca_warning import LCCA
from onboard.sensors.host_state import SPEED_VALID_S, HostState
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
    claims.receive_warn(warn, SIGNER)
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
