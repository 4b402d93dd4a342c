"""Records every input and output of a vehicle's cores.

The cores have no I/O, so the inputs of their steps, with the time, determine every output: a replay
that repeats the steps gets the same outputs.
"""

from collections.abc import Callable, Iterable, Iterator

from onboard.errors import DecodeError
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import Identification
from onboard.observations import Curvature
from onboard.recorder.identities import Aliases
from onboard.recorder.records import RecordedMessage, StepEnd
from onboard.security.plate_digest import PlateDigest
from onboard.step import Input, ProgramMessage, ReceivedWsm, SentWsm, StepOutputs, send_later
from onboard.trace.trace_line import Event
from onboard.tracking.perceived_object import PerceivedObject
from onboard.vehicle.framing import RadioFraming
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

POSITION_KINDS = frozenset({"position", "perceived_object", "signal_ahead"})
"""Kinds of events that hold a position, or name a crossing."""
_WITHOUT_POSITION = frozenset({psid.PEER_TO_PEER, psid.CRL})
"""Services of WSMs that, as those of groups, do not tell where the vehicle is. Others may, those
of other programs too; every GeoNetworking packet has the position of its sender."""


class Tap:
    """A `Stack` whose steps are recorded."""

    def __init__(
        self,
        stack: Stack,
        on_record: Callable[[RecordedMessage], None],
        aliases: Aliases,
        begins: tuple[float, float],
        *,
        lcca_psid: int,
        positions: bool,
    ) -> None:
        """Pass each record to `on_record`.

        Args:
            stack: the cores.
            on_record: takes a record; must return at once.
            aliases: names to record in place of plates.
            begins: start of the drive in s, on the clock of the cores and since 1970.
            lcca_psid: service of the group messages.
            positions: whether records that may hold positions are kept.
        """
        self._stack = stack
        self._on_record = on_record
        self._aliases = aliases
        self._now, utc_s = begins
        self._utc_offset_s = utc_s - self._now
        self._positions = positions
        self._without_position = _WITHOUT_POSITION | {lcca_psid}

    @property
    def last_step(self) -> tuple[float, float]:
        """Time of the last step in s, on the clock of the cores and since 1970."""
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
    def identification(self) -> Identification:
        """See `Stack`."""
        return self._stack.identification

    @property
    def surroundings(self) -> tuple[PerceivedObject | None, list[PerceivedObject]]:
        """See `Stack`."""
        return self._stack.surroundings

    @property
    def framing(self) -> RadioFraming:
        """See `Stack`."""
        return self._stack.framing

    @property
    def awaits_speeds(self) -> bool:
        """See `Stack`."""
        return self._stack.awaits_speeds

    def curvature(self, now: float) -> Curvature | None:
        """See `Stack`."""
        return self._stack.curvature(now)

    def known_signer(self, wsm: WaveShortMessage) -> bytes | None:
        """See `Stack`."""
        return self._stack.known_signer(wsm)

    def certificate_in(self, wsm: WaveShortMessage) -> tuple[bytes, bool] | None:
        """See `Stack`."""
        return self._stack.certificate_in(wsm)

    def get_timer(self) -> float:
        """See `Stack`."""
        return self._stack.get_timer()

    def step(
        self,
        inputs: Iterable[Input],
        now: float,
        utc_s: float | None = None,
        send: Callable[[SentWsm], None] = send_later,
    ) -> StepOutputs:
        """Step the stack, and record its inputs and outputs; see `Stack.step`.

        WSMs are sent before they are recorded. An event that only repeats an input is not recorded
        again.

        Args:
            inputs: what arrived since the last step.
            now: seconds on the cores' clock.
            utc_s: seconds since 1970, if the UTC time is known.
            send: see `Stack.step`.
        """
        self._now = now
        if utc_s is not None:
            self._utc_offset_s = utc_s - now
        received: list[Input] = []
        outputs = self._stack.step(self._recorded(inputs, received), now, utc_s, send)
        self._record("in", StepEnd(now, utc_s))
        for wsm in outputs.wsms:
            self._record("out", wsm)
        for frame in outputs.can_frames:
            self._record("out", frame)
        for event in outputs.events:
            if not any(event is each for each in received):
                self._record("out", event)
        return outputs

    def _recorded(self, inputs: Iterable[Input], received: list[Input]) -> Iterator[Input]:
        for each in inputs:
            received.append(each)
            self._record("in", each)
            yield each

    def _record(self, direction: str, value: Event) -> None:
        if self._positions or not self._may_hold_position(value):
            topic = f"/{direction}/{value.kind}"
            utc_s = self._now + self._utc_offset_s
            self._on_record(RecordedMessage(topic, utc_s, self._aliases.replace_plates(value)))

    def _may_hold_position(self, value: Event) -> bool:
        match value:
            case ReceivedWsm() | SentWsm():
                try:
                    service = wsmp.decode(value.data).psid
                except DecodeError:
                    return True
            case ProgramMessage():
                service = value.service
            case _:
                return value.kind in POSITION_KINDS
        return service not in self._without_position
