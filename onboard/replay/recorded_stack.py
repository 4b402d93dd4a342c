"""Makes the cores of a vehicle: recorded, or with the initial state of a recording."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol

from onboard.recorder.header import RecordingHeader
from onboard.recorder.identities import Aliases, RecordingDigest, ReplayedDigest
from onboard.recorder.records import EntropyInput, Identity, RecordedMessage
from onboard.recorder.settings import RecorderSettings
from onboard.replay.drive_header import initial_state_of, make_header
from onboard.replay.initial_state import InitialState
from onboard.replay.tap import Tap
from onboard.security.pseudonyms import FreshEntropy
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


def recorded_stack(
    writer: RecordWriter | None, initial: InitialState, fresh_entropy: FreshEntropy | None = None
) -> Stack | Tap:
    """Return the cores of a vehicle, recorded by `writer` if there is one.

    A seed of `fresh_entropy` is recorded when it is in use: whoever steals the recording of a drive
    computes no later pseudonym.
    """
    if writer is None:
        return initial.stack(fresh_entropy=fresh_entropy)
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

    def recorded_entropy() -> bytes | None:
        entropy = None if fresh_entropy is None else fresh_entropy()
        if entropy is not None and tap is not None:
            at_s, at_utc_s = tap.last_step
            used = RecordedMessage("/in/entropy_input", at_utc_s, EntropyInput(at_s, entropy))
            writer.record(used)
        return entropy

    stack = initial.stack(
        RecordingDigest(initial.config.security.plate_digest, record_identity), recorded_entropy
    )
    tap = Tap(
        stack,
        writer.record,
        aliases,
        begins,
        lcca_psid=initial.config.lcca_psid,
        positions=settings.positions,
    )
    return tap


def replayed_stack(
    header: RecordingHeader,
    car_ids: Mapping[tuple[str, int], bytes],
    entropies: deque[bytes],
    on_record: Callable[[RecordedMessage], None],
    begins: tuple[float, float] | None = None,
) -> Tap:
    """Return new cores with the initial state of a recorded drive.

    Args:
        header: header of the recording.
        car_ids: as in `ReplayedDigest`; may grow during the replay.
        entropies: seeds that the drive has used, the next one first; grows like `car_ids`.
        on_record: takes the records of the replay.
        begins: start in s, on the clock of the cores and since 1970, if not that of the drive.
    """
    initial = initial_state_of(header)
    now, utc_s = begins or (initial.now, initial.utc_s)
    digest = ReplayedDigest(initial.config.security.plate_digest, car_ids)
    stack = replace(initial, now=now, utc_s=utc_s).stack(
        digest, lambda: entropies.popleft() if entropies else None
    )
    psid = initial.config.lcca_psid
    return Tap(
        stack, on_record, Aliases(in_clear=True), (now, utc_s), lcca_psid=psid, positions=True
    )
