"""Load of the 802.11p channel when many cars at once ask who is ahead.

All cars are in range of each other, send BSMs, and ask for 16 texts each. The lead answers, or no
car bears any of the texts, so that all go on asking. Of the car's cores `Identification` alone is
driven: its candidates are given, not read, and groups would load the channel too.
"""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from onboard.lcca.events import CandidateCar, TrackedLead
from onboard.lcca.identification import Identification
from onboard.messages.lcca import MAX_NAMES, Answer, Inquiry, encode
from onboard.settings import Settings
from sim_rig.radio.ofdm import airtime_s, psdu_bytes
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.lcca.platoon_channel import CHANNEL_STEP_S, PlatoonChannel
from sim_rig.studies.lcca.study_lcca import car_id_of
from sim_rig.studies.radio.study_channel import BSM_BYTES, SECURED_BYTES

SPEED_M_S, GAP_M = 20.0, 20.0
LIKELIEST = 0.6
"""Probability of the likeliest of the 16 texts; the others are equally likely."""
_FRAME_S = 0.1
_BSM_RATE_HZ = 10.0
CASES = ("nobody asks", "all ask, the lead answers", "all ask, nobody answers")


class InquiryLoadSettings(Settings):
    """One campaign; a run is one case."""

    seed: int = Field(1, ge=0)
    """Of all draws."""
    cars: int = Field(60, ge=2, le=300)
    """Number of cars in a line, all in range of each other."""
    apart_m: float = Field(8.0, gt=0.0)
    """Between two cars along the road."""
    seconds: float = Field(5.0, ge=2.0, le=60.0)
    """All begin to ask in the first 0.1 s."""
    csma: CsmaSettings = CsmaSettings()
    """The 802.11p channel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadCase(Case):
    """One part of the time of one way to ask."""

    asking: str
    """Of `CASES`."""
    is_rest: bool
    """Whether the first second is over, in which most is asked."""


def axes(_settings: InquiryLoadSettings) -> Axes:
    """Each way to ask, in the first second and in the rest."""
    return {"asking": CASES, "is_rest": (False, True)}


@dataclass(frozen=True, slots=True)
class LoadRow:
    """One part of the time, and one line of the table."""

    case: str
    from_s: float
    until_s: float
    inquiries_per_s: float
    answers_per_s: float
    bsms_per_s: float
    busy_ratio: float
    """Share of the time in which the channel is busy."""
    bsms_received: float
    """Share of the BSMs that a car in range receives."""
    identified: int
    """Cars that know their lead."""


def run(settings: InquiryLoadSettings, case: LoadCase) -> LoadRow:
    """Run one way to ask, and count in its first second, or in the rest."""
    from_s, until_s = (1.0, settings.seconds) if case.is_rest else (0.0, 1.0)
    traffic = _Traffic(settings, case.asking)
    for step in range(round(until_s / CHANNEL_STEP_S)):
        traffic.step(step * CHANNEL_STEP_S, counts=step * CHANNEL_STEP_S >= from_s)
    seconds, cars = until_s - from_s, settings.cars
    bsms_per_s = _BSM_RATE_HZ * cars
    return LoadRow(
        case=case.asking,
        from_s=from_s,
        until_s=until_s,
        inquiries_per_s=traffic.sent["inquiry"] / seconds,
        answers_per_s=traffic.sent["answer"] / seconds,
        bsms_per_s=bsms_per_s,
        busy_ratio=traffic.airtime_s / seconds + bsms_per_s * _airtime_s(settings, BSM_BYTES),
        bsms_received=traffic.bsms_received / (seconds * _BSM_RATE_HZ * cars * (cars - 1)),
        identified=traffic.identified,
    )


def summary(results: Results[InquiryLoadSettings, LoadRow, LoadRow]) -> str:
    """The highest busy ratio."""
    return (
        f"the channel is busy {max(row.busy_ratio for row in results.rows):.0%} of the time at most"
    )


class _Traffic:
    """All cars and their channel; car n drives behind car n - 1."""

    def __init__(self, settings: InquiryLoadSettings, case: str) -> None:
        self._settings = settings
        self._asks = case != CASES[0]
        cars = range(settings.cars)
        rng = np.random.default_rng(settings.seed)
        positions_m = -settings.apart_m * np.arange(settings.cars, dtype=np.float64)
        self._channel = PlatoonChannel(settings.csma, positions_m, cars, 0, rng, begin_s=0.0)
        self._cores = [Identification(car_id_of(f"CAR{car}"), car.to_bytes(4), rng) for car in cars]
        self._vehicles = [self._vehicle(car, is_there=case == CASES[1]) for car in cars]
        self._frame_at = rng.uniform(0.0, _FRAME_S, settings.cars).tolist()
        self.sent: Counter[str] = Counter()
        self.airtime_s = 0.0
        self.bsms_received = 0

    @property
    def identified(self) -> int:
        """Number of cars that know their lead."""
        return sum(core.identity is not None for core in self._cores)

    def step(self, now: float, *, counts: bool) -> None:
        """Let all cars send and receive until `now`."""
        for car, core in enumerate(self._cores):
            if now >= self._frame_at[car]:
                self._frame_at[car] += _FRAME_S
                core.receive_speed(SPEED_M_S, now)
                if self._asks:
                    core.receive_lead(replace(self._vehicles[car], stamp_s=now), now)
            self._send(car, now, counts=counts)
        for message, receivers in list(self._channel.received(now)):
            for car in receivers:
                if isinstance(message, Inquiry | Answer):
                    self._cores[car].receive_message(message, None, now)
                self._send(car, now, counts=counts)
        for sender, receivers in self._channel.bsms_received(now):
            self.bsms_received += counts * len(receivers)
            for car in receivers:
                temporary_id = sender.to_bytes(4)
                self._cores[car].receive_speed_on_air(temporary_id, temporary_id, SPEED_M_S, now)

    def _send(self, car: int, now: float, *, counts: bool) -> None:
        for message in self._cores[car].messages_to_send():
            self._channel.send(car, message, now)
            if counts:
                self.sent[message.kind] += 1
                self.airtime_s += _airtime_s(self._settings, len(encode(message)))

    def _vehicle(self, car: int, *, is_there: bool) -> TrackedLead:
        first = f"CAR{car - 1}" if is_there and car else f"OTHER{car}"
        texts = [first, *(f"OTHER{car}.{number}" for number in range(1, MAX_NAMES))]
        probabilities = [LIKELIEST] + [(1.0 - LIKELIEST) / MAX_NAMES] * (MAX_NAMES - 1)
        candidates = (
            CandidateCar(text, car_id_of(text), probability)
            for text, probability in zip(texts, probabilities, strict=True)
        )
        return TrackedLead(0.0, car, GAP_M, 0.0, 0.3, tuple(candidates))


def _airtime_s(settings: InquiryLoadSettings, octets: int) -> float:
    return airtime_s(psdu_bytes(octets + SECURED_BYTES), settings.csma.data_rate_mbit_s)


STUDY = Study(
    name="inquiry-load",
    sentence="How busy the channel is when many cars at once ask who is ahead.",
    settings=InquiryLoadSettings,
    axes=axes,
    case=LoadCase,
    run=run,
    row=LoadRow,
    table=lambda _, rows: rows,
    line=LoadRow,
    summary=summary,
)
