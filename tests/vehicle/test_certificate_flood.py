"""An outsider without keys floods two vehicles, whose authorities differ, with certificates.

Each vehicle has its radio link, and a queue of which it can open `SERVED_HZ` frames of unknown
signers a second: what the daemon's share of time allows on a slow processor.
"""

from collections.abc import Callable

import pytest

from sim_rig.studies.attacks.certificate_flood import FLOOD_HZ, LEARNS_S, count_known
from tests.security.test_peer_to_peer import STRANGER
from tests.security.trial import ALICE, UTC_S


def always_others(number: int) -> bytes:
    return number.to_bytes(8)


def the_same_again(number: int) -> bytes:
    """Of 1,500 issuers, each twice a second, as vehicles send."""
    return (number % 1500).to_bytes(8)


@pytest.mark.parametrize(
    ("rate_hz", "issuer"),
    [
        (0, always_others),
        (40, always_others),
        (FLOOD_HZ, always_others),
        (FLOOD_HZ, the_same_again),
    ],
)
def test_each_vehicle_learns_the_other_ones_issuer_within_two_seconds(
    rate_hz: int, issuer: Callable[[int], bytes]
) -> None:
    assert LEARNS_S <= 2.0
    assert count_known([ALICE, STRANGER], UTC_S, issuer, rate_hz) == 2
