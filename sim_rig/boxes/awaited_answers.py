"""Answers in a drive that wait until the box has asked.

A recorded answer repeats the sequence number of an inquiry, a reply that of a join. With the seed
of the drive, a box asks under the same numbers, but not at the same times, and it discards an
answer that arrives before it has asked.
"""

from collections import defaultdict
from collections.abc import Collection
from typing import NamedTuple

from onboard.messages.lcca import Answer, CarId, Inquiry, Join, LccaMessage, Reply
from sim_rig.boxes.played_drive import PlayedInput
from sim_rig.boxes.sent_messages import lcca_message


class _Question(NamedTuple):
    answered_by: type[Answer | Reply]
    asker_id: CarId
    sequence: int


class AwaitedAnswers:
    """The answers to one box, without I/O."""

    def __init__(self, own_ids: Collection[CarId]) -> None:
        """Start before the first question.

        Args:
            own_ids: communication IDs of the box in the drive; nothing waits without them.
        """
        self._own_ids = own_ids
        self._asked: set[_Question] = set()
        self._waiting: defaultdict[_Question, list[PlayedInput]] = defaultdict(list)

    @property
    def waiting(self) -> int:
        """How many answers wait."""
        return sum(map(len, self._waiting.values()))

    def hold(self, played: PlayedInput) -> bool:
        """Return whether an input is kept, since the box has not asked for it yet."""
        question = self._answered_by(played)
        if question is None or question in self._asked:
            return False
        self._waiting[question].append(played)
        return True

    def receive_wsm(self, wsm: bytes) -> list[PlayedInput]:
        """Take what the box sends; return the answers that waited for it."""
        question = _asked_by(lcca_message(wsm))
        if question is None:
            return []
        self._asked.add(question)
        return self._waiting.pop(question, [])

    def _answered_by(self, played: PlayedInput) -> _Question | None:
        if played.wire != "radio" or not self._own_ids:
            return None
        message = lcca_message(played.data)
        if not isinstance(message, Answer | Reply) or message.to_id not in self._own_ids:
            return None
        return _Question(type(message), message.to_id, message.sequence)


def _asked_by(message: LccaMessage | None) -> _Question | None:
    match message:
        case Inquiry():
            return _Question(Answer, message.sender_id, message.sequence)
        case Join():
            return _Question(Reply, message.sender_id, message.sequence)
    return None
