"""IDs of the adjacent epochs: who knows them, and who can read them in a message."""

import pytest

from onboard.lcca.epoch_ids import ADJACENT_S, OWN_NEXT_S, EpochIds
from onboard.messages.lcca import NO_ID, Reply, Update
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings
from tests.typed import a

BEGINS_S = 1_700_000_100.0
MIDDLE_S, ENDS_S = BEGINS_S + 150.0, BEGINS_S + 300.0
AHEAD, BEHIND, STRANGER = "GN417KB", "RD288HX", "BL635TN"
LEADER, NEXT_LEADER = b"leader-1", b"leader-2"


def ids_of(own_plate: str) -> EpochIds:
    return EpochIds(PlateDigest(PlateDigestSettings(scrypt_log2_n=1)), own_plate)


def car_id(plate: str, utc_s: float) -> bytes:
    return PlateDigest(PlateDigestSettings(scrypt_log2_n=1)).car_id(plate, utc_s)


@pytest.mark.parametrize(
    ("utc_s", "knows_previous", "knows_next"),
    [
        (BEGINS_S, True, False),
        (BEGINS_S + ADJACENT_S - 0.1, True, False),
        (MIDDLE_S, False, False),
        (ENDS_S - ADJACENT_S + 0.1, False, True),
    ],
)
def test_adjacent_ids_are_looked_up_near_the_change_only(
    utc_s: float, knows_previous: bool, knows_next: bool
) -> None:
    ids = ids_of(BEHIND).of(AHEAD, utc_s)

    assert ids.present == car_id(AHEAD, MIDDLE_S)
    assert ids.previous == (car_id(AHEAD, BEGINS_S - 1.0) if knows_previous else None)
    assert ids.following == (car_id(AHEAD, ENDS_S) if knows_next else None)


def test_the_own_next_id_is_known_a_minute_ahead() -> None:
    ids = ids_of(BEHIND)
    assert ids.own_next(ENDS_S - OWN_NEXT_S - 1.0) is None
    assert ids.own_next(ENDS_S - OWN_NEXT_S + 1.0) == car_id(BEHIND, ENDS_S)


def reply(utc_s: float) -> Reply:
    sender, to = car_id(AHEAD, utc_s), car_id(BEHIND, utc_s)
    return Reply(sender, LEADER, 2, to, 7, 9, 20.0, NEXT_LEADER)


@pytest.mark.parametrize("clocks_apart_s", [-2.0, 0.0, 2.0])
@pytest.mark.parametrize("utc_s", [MIDDLE_S, ENDS_S - 1.0, ENDS_S + 1.0])
def test_who_has_read_the_lead_plate_reads_the_leaders_next_id(
    utc_s: float, clocks_apart_s: float
) -> None:
    sent = a(Reply, ids_of(AHEAD).to_send(reply(utc_s), utc_s))

    assert sent.next_leader_id not in (NEXT_LEADER, NO_ID)
    received = ids_of(BEHIND).received(sent, AHEAD, utc_s + clocks_apart_s)
    assert received == reply(utc_s)


def test_who_follows_another_plate_or_none_cannot_read_it() -> None:
    sent = ids_of(AHEAD).to_send(reply(MIDDLE_S), MIDDLE_S)

    for plate in (STRANGER, None):
        received = a(Reply, ids_of(BEHIND).received(sent, plate, MIDDLE_S))
        assert received.next_leader_id == NO_ID


def test_messages_without_such_ids_stay_as_they_are() -> None:
    update = Update(LEADER, LEADER, 1, 9)
    assert ids_of(AHEAD).to_send(update, MIDDLE_S) is update
    assert ids_of(AHEAD).received(update, BEHIND, MIDDLE_S) is update
