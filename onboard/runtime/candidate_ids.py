"""Derives communication IDs beside the loop: of the lead's candidate texts, and the own next one.

A derivation is slow by design (`onboard/security/plate_digest.py`), and the cores derive none: they
get a candidate once its ID is derived.
"""

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

from onboard.lcca.epoch_ids import ADJACENT_S, OWN_NEXT_S
from onboard.lcca.events import Identified, IdentityLost
from onboard.lcca.identification import MIN_ASKED
from onboard.messages.lcca import MAX_NAMES
from onboard.observations import Lead
from onboard.security.plate_digest import PlateDigest
from onboard.thread_priority import lower_thread_priority

EPOCH_AHEAD_S = OWN_NEXT_S + 10.0
"""Time before the start of an epoch at which its IDs are derived: before the step needs the own
one, which would otherwise be derived there."""

WAKE_S = 5.0
"""Longest time between two looks at what is to be derived, without a lead."""

STEP_WITHIN_S = 1.0
"""Longest time from an observation to the step that receives it."""

LEAST_PROBABILITY = MIN_ASKED / 4
"""Probability from which a text is derived: the next readings may make it likely enough to be asked
for. Once a plate is legible, most of the 16 are below 0.0001."""

NICENESS = 10
"""Niceness of the thread: the same as the camera's."""

JOIN_S = 0.5
"""Longest wait for the thread at the end; a derivation at the highest cost takes longer."""


class CandidateIds:
    """A thread that derives the IDs of the newest lead's candidates, the likeliest first."""

    def __init__(self, digest: PlateDigest, own_plate: str) -> None:
        """Derive into `digest`; `own_plate` is derived ahead of each epoch, with or without leads.

        Nothing is derived until `start`.
        """
        self._digest = digest
        self._own_plate = own_plate
        self._texts: tuple[str, ...] = ()
        """Of the newest lead: those of the lead before are no longer derived."""
        self._identified: Identified | None = None
        self._has_news = threading.Event()
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name="candidate-ids", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread after its present derivation."""
        self._is_closed = True
        self._has_news.set()
        self._thread.join(JOIN_S)

    def receive_identity(self, event: Identified | IdentityLost) -> None:
        """Derive of an identified track only the text of its car, until the identity is lost."""
        self._identified = event if isinstance(event, Identified) and event.text else None

    def derived(self, lead: Lead, utc_s: float) -> Lead:
        """Return `lead` with only those candidates whose IDs are derived; plan the others.

        The ID of its voted text is derived here, if it is not known yet: the one derivation that
        the caller waits for.

        Args:
            lead: as the camera reports it.
            utc_s: present time in seconds since 1970.

        Raises:
            ValueError: a text has no letter and no digit.
        """
        candidates = lead.candidates[:MAX_NAMES]
        self._texts = self.texts_to_derive(lead)
        self._has_news.set()
        if lead.text is not None:
            for at_utc_s in _times_in_step(utc_s):
                self._digest.car_id(lead.text, at_utc_s)
        ready = tuple(each for each in candidates if self._is_ready(each.text, utc_s))
        return replace(lead, candidates=ready)

    def texts_to_derive(self, lead: Lead) -> tuple[str, ...]:
        """Return the texts whose IDs are needed while `lead` is the newest, the likeliest first."""
        identified = self._identified
        if identified is not None and identified.text and identified.track_id == lead.track_id:
            return (identified.text,)
        likely = (each for each in lead.candidates if each.probability >= LEAST_PROBABILITY)
        return tuple(each.text for each in islice(likely, MAX_NAMES))

    def _is_ready(self, text: str, utc_s: float) -> bool:
        """Whether a step that follows finds the IDs, also if the epoch changes before it."""
        return all(self._digest.is_derived(text, at_utc_s) for at_utc_s in _times_in_step(utc_s))

    def _run(self) -> None:
        lower_thread_priority(NICENESS)
        while not self._is_closed:
            texts = (self._own_plate, *self._texts)
            due = next_derivation(self._digest, texts, time.time())
            if due is None:
                self._has_news.wait(WAKE_S)
                self._has_news.clear()
            else:
                self._digest.car_id(*due)


def next_derivation(
    digest: PlateDigest, texts: Sequence[str], utc_s: float
) -> tuple[str, float] | None:
    """Return the text to derive next, with a UTC time in its epoch; `None` if all are derived.

    A text's ID of the present epoch is followed by that of the epoch before, while that is in use;
    those of the next epoch come last.

    Args:
        digest: knows what is derived.
        texts: the most urgent first.
        utc_s: present time in seconds since 1970.

    Raises:
        ValueError: a text has no letter and no digit.
    """
    present = [(text, at_s) for text in texts for at_s in (utc_s, utc_s - ADJACENT_S)]
    ahead = [(text, utc_s + EPOCH_AHEAD_S) for text in texts]
    return next((each for each in present + ahead if not digest.is_derived(*each)), None)


def _times_in_step(utc_s: float) -> tuple[float, ...]:
    """Times whose IDs a step within `STEP_WITHIN_S` needs, as `EpochIds.of` does."""
    return utc_s, utc_s + STEP_WITHIN_S, utc_s - ADJACENT_S
