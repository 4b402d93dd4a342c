"""Model of the time that communication IDs take to derive (`onboard/runtime/candidate_ids.py`)."""

from dataclasses import replace

from onboard.messages.lcca import MAX_NAMES
from onboard.observations import Lead
from onboard.runtime.candidate_ids import LEAST_PROBABILITY

DERIVING_S = 0.034
"""Time that one ID takes, with the default cost."""


class DerivationDelay:
    """Derives the IDs of the newest lead's candidates one after the other, the likeliest first."""

    def __init__(self) -> None:
        self._derived: set[str] = set()
        self._waiting: list[str] = []
        self._began_at = 0.0

    def derived(self, lead: Lead, now: float, ids_of_each: int = 1) -> Lead:
        """Return `lead` with only those candidates whose IDs are derived; plan the others.

        Args:
            lead: as the camera reports it.
            now: seconds on any clock, not before the last call.
            ids_of_each: IDs of one text, of this and other epochs, that a step needs.
        """
        takes_s = ids_of_each * DERIVING_S
        while self._waiting and self._began_at + takes_s <= now:
            self._derived.add(self._waiting.pop(0))
            self._began_at += takes_s
        if lead.text is not None:
            self._derived.add(lead.text)  # its caller waits for that one
        if not self._waiting:
            self._began_at = now
        candidates = lead.candidates[:MAX_NAMES]
        self._waiting = [
            each.text
            for each in candidates
            if each.probability >= LEAST_PROBABILITY and each.text not in self._derived
        ]
        ready = tuple(each for each in candidates if each.text in self._derived)
        return replace(lead, candidates=ready)
