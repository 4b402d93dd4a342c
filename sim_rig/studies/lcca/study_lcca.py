"""LCCA of a study's car: the vehicle's own application, unsigned, in one epoch of IDs.

Nobody guesses plates from IDs here, so these are cheap to derive.
"""

from collections.abc import Iterator

import numpy as np

from onboard.lcca.events import WarningLevel, WarningOver, WarningRaised
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import CarId
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.settings import PlateDigestSettings
from onboard.vehicle.lcca_application import LccaApplication

GroupWarning = WarningRaised | WarningLevel | WarningOver

_EPOCH_S = 86_400.0
_UTC_OFFSET_S = _EPOCH_S / 2.0
"""Far from both ends of the epoch, between which a study lasts."""
_DIGEST = PlateDigest(PlateDigestSettings(epoch_s=_EPOCH_S, scrypt_log2_n=1))


def car_id_of(plate: str) -> CarId:
    """The communication ID of a plate in a study."""
    return _DIGEST.car_id(plate, _UTC_OFFSET_S)


def study_lcca(
    plate: str, temporary_id: bytes, parameters: GroupParameters, rng: np.random.Generator
) -> LccaApplication:
    """Return the LCCA of the car with this plate, without a lead and a group.

    Args:
        plate: its plate.
        temporary_id: of its BSMs, 4 bytes.
        parameters: of the group's protocol.
        rng: for start values of sequence numbers and random delays.
    """
    return LccaApplication(
        parameters,
        plate,
        Pseudonym(car_id_of(plate), temporary_id, 0, None, _EPOCH_S),
        rng,
        digest=_DIGEST,
        utc_offset_s=_UTC_OFFSET_S,
        misbehaviour=MisbehaviourDetector(),
    )


def timer_of(lcca: LccaApplication) -> float:
    """Return when `handle_timers` is next due."""
    return min(core.get_timer() for core in lcca.cores)


def handle_timers(lcca: LccaApplication, now: float) -> None:
    """Handle the timers that are due."""
    for core in lcca.cores:
        if core.get_timer() <= now:
            core.handle_timer(now)


def take_warnings(lcca: LccaApplication, now: float) -> Iterator[GroupWarning]:
    """Yield the warnings since the last call, and drop all other events."""
    for event in lcca.take_events(now):
        if isinstance(event, GroupWarning):
            yield event
    for core in lcca.cores:
        while core.next_event() is not None:
            pass
