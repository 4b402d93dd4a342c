"""When the lead of a rendered drive is named, if it has a radio and answers.

The real identification takes what perception reports; the only other vehicle on the air is the
lead, which answers inquiries for its own plate and moves as fast as the host vehicle.
"""

import hashlib
from collections.abc import Iterable

import numpy as np

from onboard.lcca.events import CandidateCar, TrackedVehicle
from onboard.lcca.identification import Identification
from onboard.messages.lcca import NAME_BYTES, Answer, CarId, Inquiry
from onboard.observations import Lead
from onboard.security.plate_digest import normalised

SPEED_M_S = 15.0
_OWN, _OWN_TEMPORARY, _TEMPORARY = b"host-car", b"host", b"lead"


def named_after_s(plate: str, leads: Iterable[Lead]) -> float | None:
    """Time from the first lead of a drive until its vehicle is identified; `None` if never.

    Args:
        plate: the text that the lead bears.
        leads: what perception reports, in order of time, with the first image at 0 s.
    """
    core = Identification(_OWN, _OWN_TEMPORARY, np.random.default_rng(1))
    answering = _car_id(plate)
    for lead in leads:
        now = lead.stamp_s
        core.receive_speed(SPEED_M_S, now)
        core.receive_speed_on_air(_TEMPORARY, _TEMPORARY, SPEED_M_S, now)
        core.receive_lead(_tracked(lead), now)
        for message in core.messages_to_send():
            if isinstance(message, Inquiry) and answering[:NAME_BYTES] in message.names:
                answer = Answer(answering, _OWN, message.sequence, _TEMPORARY, SPEED_M_S)
                core.receive_message(answer, None, now)
        if core.identity is not None and core.identity.car_id == answering:
            return now
    return None


def _tracked(lead: Lead) -> TrackedVehicle | None:
    if lead.gap_m is None or lead.track_id is None:
        return None
    candidates = tuple(
        CandidateCar(each.text, _car_id(each.text), each.probability) for each in lead.candidates
    )
    return TrackedVehicle(
        lead.track_id,
        lead.gap_m,
        lead.closing_speed_m_s,
        lead.closing_speed_sigma_m_s,
        candidates,
    )


def _car_id(plate: str) -> CarId:
    """A communication ID without the time that deriving a real one takes."""
    return hashlib.blake2b(normalised(plate).encode(), digest_size=8).digest()
