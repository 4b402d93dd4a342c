"""When the external test equipment of ISO 15765-4 asks the car's ECUs, and for what.

    SEARCHING  asks at a slow, steady pace, by turns with 11- and 29-bit identifiers, which PIDs
               are supported and (since small ECUs know no bitmaps) for the speed itself.
               A speed, whoever asked for it -> POLLING with the identifiers that it came with.
    POLLING    asks for the speed at the configured rate. No speed for `SILENCE_S` -> SEARCHING,
               so a bus whose ECUs sleep or refuse is not flooded.

All requests are functional: every ECU may answer, and the next one is there when the first fails.
"Response pending" holds the next request back until the answer comes, be it a refusal, at most P2*
long.
"""

from dataclasses import dataclass
from enum import Enum
from itertools import cycle

from onboard.obd.service_01 import (
    RESPONSE_PENDING,
    SUPPORTED_PIDS,
    VEHICLE_SPEED,
    CurrentData,
    Refused,
    supported_pids,
)

P2_S = 0.05
"""Within this all ECUs have answered (ISO 15765-4)."""

P2_STAR_S = 5.0
"""The same after "response pending"."""

SEARCH_PERIOD_S = 0.25
"""Four frames a second on a bus that carries thousands; one round over all questions takes 1 s."""

SILENCE_S = 1.0
"""Without a speed, until polling gives way to searching."""


class Phase(Enum):
    """See the module's head."""

    SEARCHING = "searching"
    POLLING = "polling"


@dataclass(frozen=True, slots=True)
class Request:
    """One PID, asked of every ECU that listens to this kind of identifier."""

    pid: int
    is_extended_id: bool


class RequestScheduler:
    """Decides on requests; knows neither frames nor transport."""

    def __init__(self, polling_hz: float, identifiers: tuple[bool, ...]) -> None:
        """Poll at `polling_hz`; `identifiers` are the kinds to try (`True`: 29 bits)."""
        self._period_s = 1 / polling_hz
        self._questions = cycle(
            Request(pid, is_extended_id)
            for is_extended_id in identifiers
            for pid in (SUPPORTED_PIDS, VEHICLE_SPEED)
        )
        self._phase = Phase.SEARCHING
        self._poll = Request(VEHICLE_SPEED, identifiers[0])
        self._open: Request | None = None
        self._asked_at = 0.0
        self._heard_at = 0.0
        self._request_at = 0.0
        self._pending_until = 0.0
        self._rest_until = 0.0

    @property
    def phase(self) -> Phase:
        """See the module's head."""
        return self._phase

    @property
    def open_request(self) -> Request | None:
        """The request that nobody has answered yet, if any."""
        return self._open

    def receive_answer(
        self, answer: CurrentData | Refused, now: float, *, is_extended_id: bool
    ) -> None:
        """Any ECU's answer, to us or to another tester."""
        if isinstance(answer, Refused) and answer.response_code == RESPONSE_PENDING:
            if self._open is not None:
                self._pending_until = now + P2_STAR_S
            return
        self._pending_until = 0.0  # whatever came is what was waited for
        if isinstance(answer, Refused):
            return
        if VEHICLE_SPEED in answer.values:
            self._heard_at = now
            if self._phase is Phase.SEARCHING:
                self._phase = Phase.POLLING
                self._poll = Request(VEHICLE_SPEED, is_extended_id)
                self._request_at = now + self._period_s
        elif self._open == Request(SUPPORTED_PIDS, is_extended_id) and _promises_speed(answer):
            self._request_at = self._asked_at + P2_S
        if self._open is not None and self._open.pid in answer.values:
            self._open = None

    def rest_until(self, at: float) -> None:
        """Ask nothing before `at`: a better source is there."""
        self._rest_until = at

    def requests_to_send(self, now: float) -> list[Request]:
        """The request that is due, if any."""
        if now < self.get_timer():
            return []
        if self._phase is Phase.POLLING and now >= self._heard_at + SILENCE_S:
            self._phase = Phase.SEARCHING
        if self._phase is Phase.POLLING:
            # On the grid of the rate, yet never two at once after a pause.
            self._request_at = max(self._request_at, now - self._period_s / 2) + self._period_s
            self._open = self._poll
        else:
            self._request_at = now + SEARCH_PERIOD_S
            self._open = next(self._questions)
        self._asked_at = now
        return [self._open]

    def get_timer(self) -> float:
        """When the next request is due."""
        return max(self._request_at, self._pending_until, self._rest_until)


def _promises_speed(answer: CurrentData) -> bool:
    bitmap = answer.values.get(SUPPORTED_PIDS)
    return bitmap is not None and VEHICLE_SPEED in supported_pids(SUPPORTED_PIDS, bitmap)
