"""Stands around a car's cores and notes every call that tells them something, and their answers.

The cores have no I/O, so the calls with their times are all that they ever learn: made again in
the same order, they give the same answers. A round is what every driver of the cores does: inputs,
the timer if it is due, then `wsms_to_send`, `can_to_send` and `next_event` until it is empty.
"""

from collections.abc import Callable

from onboard import psid
from onboard.errors import DecodeError
from onboard.lcca.group import WarningGroup
from onboard.mvs.perceived_object import PerceivedObject
from onboard.obd.can_frame import CanFrame
from onboard.recorder.identities import Aliases
from onboard.recorder.records import BrakeButton, ReceivedWsm, Record, SentWsm, Step
from onboard.security.plate_digest import PlateDigest
from onboard.stack import Observation, Stack
from onboard.trace.trace_line import Event
from onboard.wave_udp import wsmp

PLACES = frozenset({"position", "perceived_object"})
"""Kinds that say where somebody is."""


class Tap:
    """A `Stack` that is listened to; it has the same verbs."""

    def __init__(
        self,
        stack: Stack,
        note: Callable[[Record], None],
        aliases: Aliases,
        begins: tuple[float, float],
        *,
        positions: bool,
    ) -> None:
        """Give notes to `note`, with plates as `aliases` name them.

        Args:
            stack: what is listened to.
            note: must return at once.
            aliases: of plates.
            begins: when the cores begin, on their clock and in UTC.
            positions: whether to note where cars are.
        """
        self._stack = stack
        self._note = note
        self._aliases = aliases
        self._now, utc_s = begins
        self._utc_offset_s = utc_s - self._now
        self._positions = positions
        self._utc_s: float | None = None
        self._timer = False
        self._inputs: list[object] = []

    @property
    def last_call(self) -> tuple[float, float]:
        """When a verb was last called, on the cores' clock and in UTC."""
        return self._now, self._now + self._utc_offset_s

    @property
    def digest(self) -> PlateDigest:
        """See `Stack`."""
        return self._stack.digest

    @property
    def group(self) -> WarningGroup:
        """See `Stack`."""
        return self._stack.group

    @property
    def surroundings(self) -> tuple[PerceivedObject | None, list[PerceivedObject]]:
        """See `Stack`."""
        return self._stack.surroundings

    def set_utc(self, utc_s: float, now: float) -> None:
        """See `Stack`."""
        self._utc_s = utc_s
        self._utc_offset_s = utc_s - now
        self._stack.set_utc(utc_s, now)

    # ---- in -------------------------------------------------------------------------------

    def receive_can(self, frame: CanFrame, now: float) -> None:
        """See `Stack`."""
        self._take("in", frame, now)
        self._stack.receive_can(frame, now)

    def receive_observation(self, observation: Observation, now: float) -> None:
        """See `Stack`."""
        self._inputs.append(observation)
        self._take("in", observation, now)
        self._stack.receive_observation(observation, now)

    def receive_wsm(self, data: bytes, now: float) -> None:
        """See `Stack`."""
        self._take("in", ReceivedWsm(now, data), now)
        self._stack.receive_wsm(data, now)

    def press_brake_button(self, now: float) -> None:
        """See `Stack`."""
        self._take("in", BrakeButton(now), now)
        self._stack.press_brake_button(now)

    # ---- time, and out --------------------------------------------------------------------

    def get_timer(self) -> float:
        """See `Stack`."""
        return self._stack.get_timer()

    def handle_timer(self, now: float) -> None:
        """See `Stack`."""
        self._timer = True
        self._stack.handle_timer(now)

    def wsms_to_send(self, now: float) -> list[tuple[int, bytes]]:
        """See `Stack`; this ends the inputs of the round."""
        self._take("in", Step(now, self._utc_s, self._timer), now)
        self._utc_s, self._timer = None, False
        wsms = self._stack.wsms_to_send(now)
        for user_priority, data in wsms:
            self._take("out", SentWsm(now, user_priority, data), now)
        return wsms

    def can_to_send(self, now: float) -> list[CanFrame]:
        """See `Stack`."""
        frames = self._stack.can_to_send(now)
        for frame in frames:
            self._take("out", frame, now)
        return frames

    def next_event(self) -> Event | None:
        """See `Stack`. What went in and comes out as it was is no decision, and not noted twice."""
        event = self._stack.next_event()
        if event is None:
            self._inputs.clear()
        elif not any(event is given for given in self._inputs):
            self._take("out", event, self._now)
        return event

    def _take(self, direction: str, value: Event, now: float) -> None:
        self._now = now
        if self._positions or not _tells_places(value):
            topic = f"/{direction}/{value.kind}"
            self._note(Record(topic, now + self._utc_offset_s, self._aliases.hide(value)))


def _tells_places(value: Event) -> bool:
    if isinstance(value, ReceivedWsm | SentWsm):
        try:
            return wsmp.decode(value.data).psid == psid.BSM
        except DecodeError:
            return True  # whatever it says
    return value.kind in PLACES
