"""Puts a car's cores together with everything about them on record, and again from the record."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol

from onboard.recorder.header import RecordingHeader
from onboard.recorder.identities import Aliases, RecordingDigest, ReplayedDigest
from onboard.recorder.records import Identity, RecordedMessage
from onboard.recorder.settings import RecorderSettings
from onboard.replay.drive_header import initial_state_of, make_header
from onboard.replay.initial_state import InitialState
from onboard.replay.tap import Tap
from onboard.stack import Stack


class RecordWriter(Protocol):
    """Where a recording goes."""

    @property
    def settings(self) -> RecorderSettings:
        """What may be recorded."""

    def begin(self, head: RecordingHeader) -> None:
        """Take what the drive begins with."""

    def note(self, note: RecordedMessage) -> None:
        """Take one message."""


def recorded_stack(writer: RecordWriter | None, beginning: InitialState) -> Stack | Tap:
    """The cores of a car, and a tap that tells `writer` everything.

    Without a `writer` there is no tap.
    """
    if writer is None:
        return beginning.stack()
    settings = writer.settings
    aliases = Aliases(in_clear=settings.plates == "clear")
    writer.begin(make_header(beginning, aliases, is_complete=settings.positions))
    begins = beginning.now, beginning.utc_s
    tap: Tap | None = None

    def note_identity(plate: str, epoch: int, car_id: bytes) -> None:
        # The cores derive their own ID while they are made, before they can be tapped.
        at_s, at_utc_s = begins if tap is None else tap.last_step
        identity = Identity(at_s, aliases.word(plate), epoch, car_id)
        writer.note(RecordedMessage("/in/identity", at_utc_s, identity))

    stack = beginning.stack(RecordingDigest(beginning.config.security.plate_digest, note_identity))
    tap = Tap(stack, writer.note, aliases, begins, positions=settings.positions)
    return tap


def replayed_stack(
    head: RecordingHeader,
    car_ids: Mapping[tuple[str, int], bytes],
    note: Callable[[RecordedMessage], None],
    begins: tuple[float, float] | None = None,
) -> Tap:
    """The cores of a recorded drive, new.

    Args:
        head: of the recording.
        car_ids: as in `ReplayedDigest`; it may grow while the drive is replayed.
        note: gets what the cores answer.
        begins: the time on the cores' clock and in UTC, where it is not the drive's beginning.
    """
    beginning = initial_state_of(head)
    now, utc_s = begins or (beginning.now, beginning.utc_s)
    digest = ReplayedDigest(beginning.config.security.plate_digest, car_ids)
    stack = replace(beginning, now=now, utc_s=utc_s).stack(digest)
    return Tap(stack, note, Aliases(in_clear=True), (now, utc_s), positions=True)
