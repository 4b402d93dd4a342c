"""Messages from where their certificate is not valid are refused."""

import pytest

from onboard.observations import Discarded
from onboard.security.credentials import Credentials
from onboard.security.region import CircularRegion, TwoDLocation
from onboard.step import ReceivedWsm
from onboard.tools.test_ca.authority import make_pseudonyms
from sim_rig.studies.attacks.attack_world import ORIGIN, SPEED_M_S, STEP_S, AttackedHost, Signer
from tests.security.trial import ALICE, BSM, ISSUING, LCCA, UTC_S, VALID, new_key


def credentials(radius_m: int) -> Credentials:
    """Valid around the place where the host vehicle starts."""
    region = CircularRegion(TwoDLocation(ORIGIN.latitude_deg, ORIGIN.longitude_deg), radius_m)
    return make_pseudonyms(ISSUING, 1, {BSM, LCCA}, new_key=new_key, region=region, **VALID)


@pytest.mark.parametrize(("radius_m", "refused"), [(200, True), (1000, False)])
def test_a_bsm_from_outside_the_region_is_refused(radius_m: int, *, refused: bool) -> None:
    host, sender = AttackedHost(ALICE, UTC_S), Signer(credentials(radius_m), UTC_S)
    host.drive(0.5, lambda now: [sender.bsm_at((0.0, 500.0), (0.0, 10.0), now)])
    reasons = [each.reason for each in host.events if isinstance(each, Discarded)]
    assert ("outside_region" in reasons) == refused
    assert (len(host.stack.surroundings[1]) == 0) == refused


def test_a_message_without_a_place_is_judged_by_the_place_of_the_receiver() -> None:
    host, sender = AttackedHost(ALICE, UTC_S), Signer(credentials(100), UTC_S)
    host.drive(5.0, lambda now: [sender.signed(b"?", LCCA, now)])
    host.drive(5.0, lambda now: [sender.signed(b"?", LCCA, now)])
    reasons = [each.reason for each in host.events if isinstance(each, Discarded)]
    inside = sum(SPEED_M_S * STEP_S * step <= 100.0 for step in range(1, 101))
    assert reasons == ["too_short"] * inside + ["outside_region"] * (100 - inside)


def test_where_the_receiver_is_a_minute_after_its_last_fix_is_not_known() -> None:
    host, sender = AttackedHost(ALICE, UTC_S), Signer(credentials(100), UTC_S)
    host.drive(8.0)
    for fix_age_s, reason in ((5.0, "outside_region"), (60.0, "too_short")):
        now = host.now + fix_age_s
        received = ReceivedWsm(now, sender.signed(b"?", LCCA, now))
        events = host.stack.step([received], now).events
        assert reason in [each.reason for each in events if isinstance(each, Discarded)]
