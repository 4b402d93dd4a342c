"""Scheduling of OBD requests, with timeouts of unanswered ones (ISO 15765-4).

    SEARCHING  requests at a slow, steady rate, alternately with 11- and 29-bit identifiers, the
               supported PIDs and (since small ECUs have no bitmap) the speed itself.
               A speed, to whichever tester -> POLLING with the identifiers of that response.
    POLLING    requests the speed at the configured rate. No speed for `SPEED_TIMEOUT_S` ->
               SEARCHING, so that a bus whose ECUs sleep or refuse is not flooded.

All requests are functional: every ECU may respond, and the next one does if the first fails. An
unanswered request is not repeated; the next one is sent when it is due. "Response pending" delays
it until the response, positive or negative, for P2* at most each time that an ECU says so.
"""

from dataclasses import dataclass
from enum import Enum
from itertools import cycle

from onboard.obd.service_01 import (
    RESPONSE_PENDING,
    SUPPORTED_PIDS,
    VEHICLE_SPEED,
    NegativeResponse,
    PositiveResponse,
    supported_pids,
)

P2_S = 0.05
"""Timeout of a response: within it all ECUs have responded (ISO 15765-4, P2 CAN)."""

P2_STAR_S = 5.0
"""Timeout of a response after "response pending" (ISO 15765-4, P2* CAN)."""

SEARCH_PERIOD_S = 0.25
"""Time between two requests of a search: four frames a second on a bus of thousands; all kinds of
requests take 1 s."""

SPEED_TIMEOUT_S = 1.0
"""Time without a speed after which polling gives way to searching."""


class Phase(Enum):
    """Phases of the scheduler; the module's docstring has the rules."""

    SEARCHING = "searching"
    POLLING = "polling"


@dataclass(frozen=True, slots=True)
class Request:
    """A request of one PID to every ECU with this kind of identifier."""

    pid: int
    is_extended_id: bool


class RequestScheduler:
    """Decides when to request what, independent of frames and transport."""

    def __init__(self, polling_hz: float, identifiers: tuple[bool, ...]) -> None:
        """Start searching.

        Args:
            polling_hz: rate of polling.
            identifiers: kinds to try; `True` is 29 bits.
        """
        self._period_s = 1 / polling_hz
        self._searches = cycle(
            Request(pid, is_extended_id)
            for is_extended_id in identifiers
            for pid in (SUPPORTED_PIDS, VEHICLE_SPEED)
        )
        self._phase = Phase.SEARCHING
        self._poll = Request(VEHICLE_SPEED, identifiers[0])
        self._unanswered: Request | None = None
        self._requested_at = 0.0
        self._speed_at = 0.0
        self._request_at = 0.0
        self._pending_until = 0.0
        self._pause_until = 0.0

    @property
    def phase(self) -> Phase:
        """The current phase."""
        return self._phase

    @property
    def unanswered_request(self) -> Request | None:
        """The last request, until it is answered."""
        return self._unanswered

    def receive_response(
        self, response: PositiveResponse | NegativeResponse, now: float, *, is_extended_id: bool
    ) -> None:
        """Receive an ECU's response, to this tester or another.

        Args:
            response: positive or negative.
            now: time of reception.
            is_extended_id: whether it has a 29-bit identifier.
        """
        if isinstance(response, NegativeResponse) and response.response_code == RESPONSE_PENDING:
            if self._unanswered is not None:
                self._pending_until = now + P2_STAR_S
            return
        self._pending_until = 0.0  # any response ends the wait
        if isinstance(response, NegativeResponse):
            return
        if VEHICLE_SPEED in response.values:
            self._speed_at = now
            if self._phase is Phase.SEARCHING:
                self._phase = Phase.POLLING
                self._poll = Request(VEHICLE_SPEED, is_extended_id)
                self._request_at = now + self._period_s
        elif self._unanswered == Request(SUPPORTED_PIDS, is_extended_id) and _supports_speed(
            response
        ):
            self._request_at = self._requested_at + P2_S
        if self._unanswered is not None and self._unanswered.pid in response.values:
            self._unanswered = None

    def pause_until(self, at: float) -> None:
        """Send no request before `at`, while there is a better source."""
        self._pause_until = at

    def requests_to_send(self, now: float) -> list[Request]:
        """The request that is due, if any."""
        if now < self.get_timer():
            return []
        if self._phase is Phase.POLLING and now >= self._speed_at + SPEED_TIMEOUT_S:
            self._phase = Phase.SEARCHING
        if self._phase is Phase.POLLING:
            # In steps of the period, yet never two at once after a pause.
            self._request_at = max(self._request_at, now - self._period_s / 2) + self._period_s
            self._unanswered = self._poll
        else:
            self._request_at = now + SEARCH_PERIOD_S
            self._unanswered = next(self._searches)
        self._requested_at = now
        return [self._unanswered]

    def get_timer(self) -> float:
        """Time of the next request."""
        return max(self._request_at, self._pending_until, self._pause_until)


def _supports_speed(response: PositiveResponse) -> bool:
    bitmap = response.values.get(SUPPORTED_PIDS)
    return bitmap is not None and VEHICLE_SPEED in supported_pids(SUPPORTED_PIDS, bitmap)
