"""Puts a car's cores together with everything about them on record, and again from the record."""

import datetime as dt
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from onboard.access.drivers import Driver
from onboard.config import CarConfig
from onboard.observations import Sensor
from onboard.recorder.head import Head, make_head
from onboard.recorder.identities import Aliases, NotedDigest, RecordedDigest
from onboard.recorder.notes import Identity, Note
from onboard.recorder.settings import RecorderSettings
from onboard.recorder.tap import Tap
from onboard.security.credentials import Credentials
from onboard.stack import Stack


class Writer(Protocol):
    """Where a recording goes."""

    @property
    def settings(self) -> RecorderSettings:
        """What may be recorded."""

    def begin(self, head: Head) -> None:
        """Take what the drive begins with."""

    def note(self, note: Note) -> None:
        """Take one message."""


def put_together(
    writer: Writer | None,
    config: CarConfig,
    sensors: frozenset[Sensor],
    seed: np.random.SeedSequence,
    *,
    now: float,
    utc_s: float,
    credentials: Credentials | None = None,
    driver: Driver | None = None,
) -> Stack | Tap:
    """The cores of a car, as `Stack` makes them, and a tap that tells `writer` everything.

    Without a `writer` there is no tap.
    """
    if writer is None:
        rng = np.random.default_rng(seed)
        return Stack(
            config, sensors, rng, now=now, utc_s=utc_s, credentials=credentials, driver=driver
        )
    settings = writer.settings
    aliases = Aliases(in_clear=settings.plates == "clear")
    name = f"{dt.datetime.fromtimestamp(utc_s, dt.UTC):%Y%m%dT%H%M%S.%f}"[:-3] + "Z"
    writer.begin(
        make_head(
            name=name,
            config=config,
            sensors=sensors,
            seed=seed,
            now=now,
            utc_s=utc_s,
            credentials=credentials,
            driver=driver,
            aliases=aliases,
            is_complete=settings.positions,
        )
    )

    tap: Tap | None = None

    def note_identity(plate: str, epoch: int, car_id: bytes) -> None:
        at_s, at_utc_s = (now, utc_s) if tap is None else tap.last_call
        identity = Identity(at_s, aliases.word(plate), epoch, car_id)
        writer.note(Note("/in/identity", at_utc_s, identity))

    stack = Stack(
        config,
        sensors,
        np.random.default_rng(seed),
        now=now,
        utc_s=utc_s,
        credentials=credentials,
        driver=driver,
        digest=NotedDigest(config.security.plate_digest, note_identity),
    )
    tap = Tap(stack, writer.note, aliases, (now, utc_s), positions=settings.positions)
    return tap


def replayed_stack(
    head: Head,
    car_ids: Mapping[tuple[str, int], bytes],
    note: Callable[[Note], None],
    begins: tuple[float, float] | None = None,
) -> Tap:
    """The cores of a recorded drive, new.

    Args:
        head: of the recording.
        car_ids: as in `RecordedDigest`; it may grow while the drive is replayed.
        note: gets what the cores answer.
        begins: the time on the cores' clock and in UTC, where it is not the drive's beginning.
    """
    now_s, utc_s = begins or (head.now_s, head.utc_s)
    config = head.car_config()
    digest = RecordedDigest(config.security.plate_digest, car_ids)
    with tempfile.TemporaryDirectory() as folder:
        if config.obd.broadcast is not None:
            dbc = Path(folder) / "car.dbc"
            dbc.write_text(head.dbc or "", "latin-1")
            broadcast = config.obd.broadcast.model_copy(update={"dbc": dbc})
            obd = config.obd.model_copy(update={"broadcast": broadcast})
            config = config.model_copy(update={"obd": obd})
        stack = Stack(
            config,
            head.sensors,
            head.rng(),
            now=now_s,
            utc_s=utc_s,
            credentials=head.credentials(),
            driver=head.known_driver(),
            digest=digest,
        )
    return Tap(stack, note, Aliases(in_clear=True), (now_s, utc_s), positions=True)
