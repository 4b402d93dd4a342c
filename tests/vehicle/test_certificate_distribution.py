"""Two whole vehicles whose certificates come from different authorities under one root."""

from onboard.trace.trace_line import as_record
from tests.security.test_peer_to_peer import STRANGER
from tests.security.trial import ALICE, UTC_S
from tests.vehicle.platoon import Platoon, car

LEARNT_S = 2.0


def test_they_learn_the_authorities_and_form_a_group() -> None:
    platoon = Platoon(
        {
            "AAA1": car("AAA1", credentials=ALICE, utc_s=UTC_S),
            "BBB2": car("BBB2", credentials=STRANGER, utc_s=UTC_S),
        }
    )
    platoon.drive(LEARNT_S + 3.0)
    refused = [
        event.stamp_s
        for plate in platoon.cars
        for event in platoon.events_of(plate, "discarded")
        if as_record(event)["reason"] == "unknown_issuer"
    ]
    assert refused, "at least by the first one that is received"
    assert max(refused) < LEARNT_S
    assert platoon.cars["BBB2"].group.leader_id == platoon.cars["AAA1"].group.leader_id
