"""The messages of warning groups that a box has sent, as the rig received them.

A box without a recording, as of another vendor, has no other trace.
"""

from collections.abc import Mapping

from onboard.errors import DecodeError
from onboard.messages import lcca
from onboard.messages.exchanged import MessageSent
from onboard.messages.lcca import LccaMessage
from onboard.security import ieee1609dot2
from onboard.security.oer import Malformed, Unsupported
from onboard.trace.trace_line import as_record
from onboard.wave_udp import psid, wsmp
from sim_rig.run_log.run_log import Record


def sent_messages(from_box: Mapping[bytes, float]) -> list[Record]:
    """Return records of kind `sent`, as in the trace of a daemon, in order.

    Args:
        from_box: when each WSM of the box arrived first, s.
    """
    found = (_sent(wsm, at) for wsm, at in from_box.items())
    return [as_record(each) for each in found if each is not None]


def lcca_message(wsm: bytes) -> LccaMessage | None:
    """Return the message in a WSM; `None` if it is of another service or malformed."""
    try:
        frame = wsmp.decode(wsm)
        if frame.psid != psid.LCCA:
            return None
        return lcca.decode(ieee1609dot2.decode(frame.payload).payload).message
    except (DecodeError, Malformed, Unsupported):
        return None


def _sent(wsm: bytes, stamp_s: float) -> MessageSent | None:
    message = lcca_message(wsm)
    if message is None:
        return None
    content = lcca.as_dict(message)
    return MessageSent(stamp_s, message.kind, message.user_priority, len(wsm), content)
