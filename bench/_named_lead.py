"""When the lead of a rendered drive is named, if it has a radio and answers.

The real identification takes what perception reports; the only other vehicle on the air is the
lead, which answers inquiries for its own plate and moves as fast as the host vehicle.
"""

from collections.abc import Iterable

import numpy as np

from onboard.lcca.events import TrackedLead
from onboard.lcca.identification import Identification
from onboard.messages.lcca import NAME_BYTES, Answer, Inquiry
from onboard.observations import Lead
from sim_rig.studies.lcca.study_lcca import car_id_of

SPEED_M_S = 15.0
_OWN, _OWN_TEMPORARY, _TEMPORARY = b"host-car", b"host", b"lead"


def named_after_s(plate: str, leads: Iterable[Lead]) -> float | None:
    """Time from the first lead of a drive until its vehicle is identified; `None` if never.

    Args:
        plate: the text that the lead bears.
        leads: what perception reports, in order of time, with the first image at 0 s.
    """
    core = Identification(_OWN, _OWN_TEMPORARY, np.random.default_rng(1))
    answering = car_id_of(plate)
    for lead in leads:
        now = lead.stamp_s
        core.receive_speed(SPEED_M_S, now)
        core.receive_speed_on_air(_TEMPORARY, _TEMPORARY, SPEED_M_S, now)
        core.receive_lead(TrackedLead.of(lead, car_id_of), now)
        for message in core.messages_to_send():
            if isinstance(message, Inquiry) and answering[:NAME_BYTES] in message.names:
                answer = Answer(answering, _OWN, message.sequence, _TEMPORARY, SPEED_M_S)
                core.receive_message(answer, None, now)
        if core.identity is not None and core.identity.car_id == answering:
            return now
    return None
