"""An outsider without keys floods two vehicles, whose authorities differ, with certificates.

Each vehicle has its radio link, and a queue of which it can open `SERVED_HZ` frames of unknown
signers a second: what the daemon's share of time allows on a slow processor.
"""

from collections.abc import Callable
from functools import partial

import pytest

from sim_rig.studies.attacks.certificate_flood import (
    FLOOD_HZ,
    LEARNS_S,
    MadeUp,
    count_known,
    made_up_by,
)
from tests.security.test_peer_to_peer import STRANGER
from tests.security.trial import ALICE, UTC_S


def always_others(number: int) -> MadeUp:
    return MadeUp(number.to_bytes(8))


def the_same_again(number: int, *, every: int = 1500) -> MadeUp:
    """Of 1,500 issuers, each twice a second, as vehicles send."""
    return MadeUp((number % every).to_bytes(8))


def of_own_issuer(number: int) -> MadeUp:
    return MadeUp(number.to_bytes(8), is_of_own_issuer=True)


def answers(number: int) -> MadeUp:
    """Two of three frames are answers."""
    return MadeUp(number.to_bytes(8), is_answer=number % 3 > 0)


@pytest.mark.long
@pytest.mark.parametrize(
    ("rate_hz", "flood"),
    [
        (0, always_others),
        (40, always_others),
        (FLOOD_HZ, always_others),
        (FLOOD_HZ, the_same_again),
        (FLOOD_HZ, partial(the_same_again, every=8000)),
        (FLOOD_HZ, partial(made_up_by, 2)),
        (FLOOD_HZ, partial(made_up_by, 3)),
        (FLOOD_HZ, of_own_issuer),
        (FLOOD_HZ, answers),
    ],
)
def test_each_vehicle_learns_the_other_ones_issuer_within_two_seconds(
    rate_hz: int, flood: Callable[[int], MadeUp]
) -> None:
    assert LEARNS_S <= 2.0
    assert count_known([ALICE, STRANGER], UTC_S, flood, (1,), rate_hz) == 2
