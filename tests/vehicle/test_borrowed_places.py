"""Who sends BSMs under the temporary ID of another vehicle has its own place, not the other's."""

from collections.abc import Iterator

import pytest

from onboard.messages.exchanged import MessageSent
from onboard.messages.lcca import Inquiry
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings
from onboard.step import ReceivedWsm
from onboard.vehicle.framing import bsm_sender
from onboard.wave_udp import wsmp
from sim_rig.studies.attacks.attack_world import SPEED_M_S, STEP_S, AttackedHost
from sim_rig.studies.attacks.group_attacks import GroupInsider
from tests.security.trial import UTC_S, credentials_of

BEHIND_M, AHEAD_M = -30.0, 60.0


@pytest.mark.parametrize(("place_m", "is_answered"), [(AHEAD_M, False), (BEHIND_M - 10.0, True)])
def test_an_asker_under_the_id_of_a_vehicle_behind_is_where_its_own_bsms_say(
    place_m: float, *, is_answered: bool
) -> None:
    host = AttackedHost(credentials_of("AAA1"), UTC_S)
    digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=1))
    behind, asker = (
        GroupInsider(plate, digest, credentials_of(plate), UTC_S) for plate in ("BBB2", "EVIL9")
    )

    def bsms(now: float) -> Iterator[bytes]:
        for each, ahead_m in ((behind, BEHIND_M), (asker, place_m)):
            place = 0.0, host.north_m + ahead_m
            yield each.bsm_at(place, (0.0, SPEED_M_S), now, temporary_id=b"hone")

    host.drive(2.0, bsms)
    wsms = host.stack.step([], host.now + STEP_S).wsms
    (host_id,) = filter(None, (bsm_sender(wsmp.decode(wsm.data)) for wsm in wsms))
    inquiry = asker.signed(Inquiry(asker.own_id(host.now), 7, (host_id,)), host.now)
    received = ReceivedWsm(host.now + STEP_S, inquiry)
    events = host.stack.step([received], host.now + STEP_S).events
    sent = [each for each in events if isinstance(each, MessageSent)]
    assert any(each.message == "answer" for each in sent) is is_answered
