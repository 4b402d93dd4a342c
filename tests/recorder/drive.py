"""Records a drive of the second of two vehicles with an ideal radio, signed or unsigned."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from onboard.observations import ImageBox as Pixels
from onboard.observations import Lead, LeadIdentity, Plate, PlateCandidate, Position, Sensor, Speed
from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import RecordedMessage
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.security.credentials import Credentials
from onboard.security.pseudonyms import FreshEntropy
from onboard.settings import parse_settings
from onboard.step import BrakeButton, Input, ReceivedWsm
from onboard.tools.test_ca.authority import make_trial
from onboard.vehicle.config import CarConfig
from onboard.wave_udp import psid

START_UTC_S = 1_750_000_480.0
"""20 s before the communication IDs change."""
START_S = 1000.0
AHEAD, BEHIND = "GN417KB", "RD288HX"
SIMILAR = ("GN417K8", "GN4T7KB", "6N417KB")
"""Other texts that the plate of the lead may bear, by the camera."""
KEY = "a secret of this trial only"
STEP_S = 0.05
"""Time of one step in s; each vehicle has one speed and one camera result per step."""


class SegmentWriter:
    """A `RecordWriter` that writes each record at once."""

    def __init__(self, folder: Path, flush_every: int = 1000, **settings: object) -> None:
        self._flush_every = flush_every
        self._records = 0
        tree = {"folder": str(folder), **settings}
        self.settings = parse_settings(tree, RecorderSettings, "recorder")

    def begin(self, header: RecordingHeader) -> None:
        self.segments = Segments(self.settings, header)
        self.segments.open(header.now_s, header.utc_s)

    def record(self, record: RecordedMessage) -> None:
        self.segments.write(record)
        self._records += 1
        if self._records % self._flush_every == 0:
            self.segments.flush()


def _candidates(step: int) -> tuple[PlateCandidate, ...]:
    """Return texts of which more and more are derived, and whose probabilities change."""
    true = 0.5 + 0.4 * step / (step + 10)
    texts = (AHEAD, *SIMILAR)[: 1 + step]
    return tuple(PlateCandidate(text, true / 3.0**rank) for rank, text in enumerate(texts))


def config(plate: str, **more: object) -> CarConfig:
    digest = {"scrypt_log2_n": 1, "community_key": KEY}
    tree = {"car": {"plate": plate}, "security": {"plate_digest": digest}, **more}
    return parse_settings(tree, CarConfig, plate)


def credentials() -> Iterator[Credentials]:
    trial = make_trial([AHEAD, BEHIND], {psid.BSM, psid.LCCA}, START_UTC_S - 10.0)
    return iter(trial.values())


def record_drive(
    folder: Path,
    duration_s: float = 4.0,
    *,
    signed: bool = False,
    start_utc_s: float = START_UTC_S,
    leads: Sequence[Lead] | None = None,
    fresh_entropy: FreshEntropy | None = None,
    **settings: Any,
) -> Path:
    """Record how a vehicle joins the group of the one ahead, which brakes; return `folder`.

    Args:
        folder: of the recording.
        duration_s: of the drive.
        signed: whether messages are.
        start_utc_s: UTC at the start of the drive.
        leads: one a step as the vehicle behind sees it; the lead if not given.
        fresh_entropy: seeds the vehicle behind at each change of its pseudonym.
        settings: of the recorder.
    """
    folder.mkdir(exist_ok=True)
    recorder = SegmentWriter(folder, **settings)
    keys = list(credentials()) if signed else [None, None]
    cars = [
        recorded_stack(
            writer,
            InitialState(
                config=config(plate),
                sensors=frozenset({Sensor.SPEED, Sensor.CAMERA, Sensor.POSITION}),
                seed=np.random.SeedSequence(seed),
                now=START_S,
                utc_s=start_utc_s,
                credentials=key,
            ),
            None if writer is None else fresh_entropy,
        )
        for writer, plate, seed, key in zip(
            (None, recorder), (AHEAD, BEHIND), (1, 2), keys, strict=True
        )
    ]
    for step in range(round(duration_s / STEP_S)):
        now, utc_s = START_S + step * STEP_S, start_utc_s + step * STEP_S + 1e-7 * (step % 3)
        inputs = [list(_inputs(number, step, now)) for number in range(len(cars))]
        if leads is not None:
            inputs[1][-1] = replace(leads[step], stamp_s=now)
        for _ in range(3):  # so that replies get replies in the same step
            all_inputs, inputs = inputs, [[] for _ in cars]
            for number, car in enumerate(cars):
                for wsm in car.step(all_inputs[number], now, utc_s).wsms:
                    inputs[1 - number].append(ReceivedWsm(now, wsm.data))
    recorder.segments.close(START_S + duration_s)
    return folder


def _inputs(number: int, step: int, now: float) -> Iterator[Input]:
    """Yield the sensor inputs of the lead (0) or behind (1)."""
    yield Speed(now, 15.0, 0.28, "obd:7E8")
    if step % 4 == 0:
        yield Position(now, 48.1, 11.5 - 2e-4 * number, 500.0, 2.0, 15.0, 1.57)
    if number == 1:
        yield Plate(now, Pixels(10.0, 20.0, 52.0, 11.0), AHEAD, 0.9, is_lead=True)
        candidates = _candidates(step)
        yield Lead(now, LeadIdentity.KNOWN, AHEAD, 15.0, 0.3, 0.0, 0.3, 3, candidates)
        return
    yield Lead(now, LeadIdentity.NO_LEAD)
    if step == round(3.0 / STEP_S):
        yield BrakeButton(now)
