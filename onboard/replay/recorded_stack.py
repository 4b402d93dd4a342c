"""Makes the cores of a vehicle: recorded, or with the initial state of a recording."""

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
from onboard.vehicle.stack import Stack


class RecordWriter(Protocol):
    """Destination of a recording."""

    @property
    def settings(self) -> RecorderSettings:
        """Settings: what may be recorded, and in which form plates are."""

    def begin(self, header: RecordingHeader) -> None:
        """Take the header, before the first record."""

    def record(self, record: RecordedMessage) -> None:
        """Take one record."""


def recorded_stack(writer: RecordWriter | None, initial: InitialState) -> Stack | Tap:
    """Return the cores of a vehicle, recorded by `writer` if there is one."""
    if writer is None:
        return initial.stack()
    settings = writer.settings
    aliases = Aliases(in_clear=settings.plates == "clear")
    writer.begin(make_header(initial, aliases, is_complete=settings.positions))
    begins = initial.now, initial.utc_s
    tap: Tap | None = None

    def record_identity(plate: str, epoch: int, car_id: bytes) -> None:
        # The cores derive their own ID in their constructor, before the tap exists.
        at_s, at_utc_s = begins if tap is None else tap.last_step
        identity = Identity(at_s, aliases.alias(plate), epoch, car_id)
        writer.record(RecordedMessage("/in/identity", at_utc_s, identity))

    stack = initial.stack(RecordingDigest(initial.config.security.plate_digest, record_identity))
    tap = Tap(stack, writer.record, aliases, begins, positions=settings.positions)
    return tap


def replayed_stack(
    header: RecordingHeader,
    car_ids: Mapping[tuple[str, int], bytes],
    on_record: Callable[[RecordedMessage], None],
    begins: tuple[float, float] | None = None,
) -> Tap:
    """Return new cores with the initial state of a recorded drive.

    Args:
        header: header of the recording.
        car_ids: as in `ReplayedDigest`; may grow during the replay.
        on_record: takes the records of the replay.
        begins: start in s, on the clock of the cores and since 1970, if not that of the drive.
    """
    initial = initial_state_of(header)
    now, utc_s = begins or (initial.now, initial.utc_s)
    digest = ReplayedDigest(initial.config.security.plate_digest, car_ids)
    stack = replace(initial, now=now, utc_s=utc_s).stack(digest)
    return Tap(stack, on_record, Aliases(in_clear=True), (now, utc_s), positions=True)
