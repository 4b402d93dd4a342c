"""How often another vehicle than the lead is taken for it.

A host vehicle has a new lead every few seconds, among many in range. Its camera reads the
plate by the model of photographs (`sim_rig/cars/plate_readings.py`). Of its cores `Identification`
is driven alone, as it ships: who may answer is then the study's choice. Some vehicles drive in the
host's stream and so almost at its speed; a fleet has consecutive plates. An insider may have read
the plate ahead and answer for it, with a vehicle of his own elsewhere.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from onboard.lcca.events import TrackedLead
from onboard.lcca.identification import Identification
from onboard.lcca.position_match import REFERENCE_M
from onboard.messages.lcca import NAME_BYTES, Answer, Inquiry
from onboard.settings import Settings
from sim_rig.cars.camera_view import FPS
from sim_rig.cars.gauss_markov import wandered
from sim_rig.rendering.plate_texts import BR_PATTERNS, EU_PATTERNS, US_PATTERNS, text_of
from sim_rig.scenario.setting_types import Several, Share, Span
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.lcca.host_errors import (
    CLOSING_SIGMA_M_S,
    SPEEDOMETER,
    ClosingError,
    shown_m_s,
)
from sim_rig.studies.lcca.plate_view import PlateView
from sim_rig.studies.lcca.study_lcca import car_id_of

PATTERNS = {"us": US_PATTERNS, "eu": EU_PATTERNS, "br": BR_PATTERNS}
CHANGES_A_RUN = 10
BSM_EVERY = 3
"""Images between two BSMs: 5 Hz at 15 images a second."""
WRONG_S = 1.0
"""Time for which another vehicle may be taken for the lead."""
PLACE_SIGMA_M = 1.0
"""Of the place that an insider sends, and of the host's."""


class Insider(StrEnum):
    """What an insider does who knows every plate."""

    NONE = "none"
    OWN_SPEED = "own_speed"
    """He answers for the plate ahead, and sends his own speed."""
    COPIED_SPEED = "copied_speed"
    """He also sends the speed of the lead, one BSM (0.2 s) late."""
    MIMICRY = "mimicry"
    """He sends that speed, and the place of the lead, and answers under his own ID only: he
    can prove no other."""
    SILENCE = "silence"
    """He sends the same, and answers nobody."""

    @property
    def is_alike(self) -> bool:
        """Whether he is where the lead is, by what he sends."""
        return self in (Insider.MIMICRY, Insider.SILENCE)


class FalseIdentitySettings(Settings):
    """One campaign; a run is one drive with `CHANGES_A_RUN` vehicles ahead."""

    seed: int = Field(1, ge=0)
    """Of the first drive; each further one of a case has the next."""
    runs: int = Field(500, ge=1)
    """Drives of each case."""
    vehicles: int = Field(200, ge=2, le=500)
    """Number of vehicles in range, of which one after the other is ahead."""
    fleet: int = Field(50, ge=0, le=500)
    """Vehicles with consecutive plates."""
    stream: Share = 0.3
    """Share of the vehicles that drive in the host's stream."""
    radios: Several[Share] = (1.0, 0.5)
    """Shares of the vehicles with a radio."""
    insiders: Several[Insider] = (Insider.NONE,)
    """What the insider does who knows every plate."""
    loss: Share = 0.1
    """Share of the answers that are lost."""
    plate_px: Span[float] = (28.0, 60.0)
    """Range of the width of the plate in the image, in pixels; it is uniform."""
    seconds: float = Field(6.0, ge=2.0, le=60.0)
    """Time with one lead."""
    region: Literal["us", "eu", "br"] = "eu"
    """Whose patterns of plates are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveCase(Case):
    """One drive."""

    radios: float
    """Share of the vehicles with a radio."""
    insider: Insider


def axes(settings: FalseIdentitySettings) -> Axes:
    """Every share of radios with every insider."""
    return {"radios": settings.radios, "insider": settings.insiders}


@dataclass(frozen=True, slots=True)
class DriveRow:
    """One drive with `CHANGES_A_RUN` vehicles ahead."""

    radios: float
    insider: Insider
    with_radio: int
    """Of the vehicles ahead."""
    identified_s: list[float]
    """Of each identified vehicle: how long that took."""
    wrong: int
    """Vehicles ahead for which another one was taken."""
    wrong_long: int
    """Of those, for longer than `WRONG_S`."""
    wrong_s: float
    """The longest such time."""


def run(settings: FalseIdentitySettings, case: DriveCase) -> DriveRow:
    """Simulate one drive."""
    rng = np.random.default_rng([settings.seed + case.repetition, 23])
    drive = _Drive(settings, case.radios, case.insider, rng)
    changes = [drive.follow() for _ in range(CHANGES_A_RUN)]
    return DriveRow(
        radios=case.radios,
        insider=case.insider,
        with_radio=sum(each.has_radio for each in changes),
        identified_s=[each.identified_s for each in changes if each.identified_s is not None],
        wrong=sum(each.wrong_s > 0.0 for each in changes),
        wrong_long=sum(each.wrong_s > WRONG_S for each in changes),
        wrong_s=max(each.wrong_s for each in changes),
    )


class _Change(NamedTuple):
    """One lead."""

    has_radio: bool
    identified_s: float | None
    """Until it was identified; `None` if it never was."""
    wrong_s: float
    """Longest time for which another vehicle was taken for it."""


class _Traffic:
    """Speeds of all vehicles: those of the stream follow one speed, the others their own."""

    def __init__(self, settings: FalseIdentitySettings, rng: np.random.Generator) -> None:
        self._rng = rng
        count = settings.vehicles
        self._in_stream = rng.random(count) < settings.stream
        self._means_m_s = np.where(self._in_stream, 0.0, rng.normal(20.0, 5.0, count))
        self._own_m_s = rng.normal(0.0, 0.7, count)
        self._stream_m_s = np.zeros(1)
        self._scales = rng.normal(*SPEEDOMETER, count)
        self.speeds_m_s = np.zeros(count)
        self.shown_m_s = np.zeros(count)
        """As the speedometers show them."""
        self.advance(0.0)

    def advance(self, seconds: float) -> None:
        """Let all speeds wander (Ornstein-Uhlenbeck, 8 and 10 s)."""
        noise = self._rng.standard_normal(len(self._own_m_s))
        self._own_m_s = wandered(self._own_m_s, 0.7, seconds / 8.0, noise)
        fresh = self._rng.standard_normal(1)
        self._stream_m_s = wandered(self._stream_m_s, 2.0, seconds / 10.0, fresh)
        stream_m_s = np.where(self._in_stream, 20.0 + self._stream_m_s, 0.0)
        self.speeds_m_s = np.maximum(0.0, self._means_m_s + stream_m_s + self._own_m_s)
        self.shown_m_s = shown_m_s(self.speeds_m_s, self._scales)

    def stream(self) -> list[int]:
        """Numbers of the vehicles in the host's stream."""
        return [int(car) for car in np.flatnonzero(self._in_stream)]


class _Drive:
    """A host vehicle among others; time goes on from one lead to the next."""

    def __init__(
        self,
        settings: FalseIdentitySettings,
        radios: float,
        insider: Insider,
        rng: np.random.Generator,
    ) -> None:
        self._settings, self._insider, self._rng = settings, insider, rng
        self._plates = list(_plates(settings, rng))
        self._has_radio = rng.random(settings.vehicles) < radios
        self._ids = [car_id_of(plate) for plate in self._plates]
        self._by_name = {
            car_id[:NAME_BYTES]: car for car, car_id in enumerate(self._ids) if self._has_radio[car]
        }
        self._by_name |= {_sender(car): car for car in np.flatnonzero(self._has_radio).tolist()}
        self._traffic = _Traffic(settings, rng)
        self._core = Identification(b"hostcar0", b"host", rng)
        self._frame = 0
        self._track_id = 0
        self._earlier_m_s = 20.0
        self._host_m_s = 20.0
        self._scale = rng.normal(*SPEEDOMETER, 1)

    def follow(self) -> _Change:
        """Follow a new vehicle of the stream."""
        rng, settings = self._rng, self._settings
        ahead = int(rng.choice(self._traffic.stream()))
        self._track_id += 1
        plate = PlateView(self._plates[ahead], rng)
        width_px, gap_m = float(rng.uniform(*settings.plate_px)), float(rng.uniform(10.0, 35.0))
        identified_s, wrong_from_s, wrong_s = None, None, 0.0
        closing_error = ClosingError(rng)
        for image in range(round(settings.seconds * FPS)):
            now = self._frame / FPS
            self._frame += 1
            self._traffic.advance(1 / FPS)
            ahead_m_s = float(self._traffic.speeds_m_s[ahead])
            self._host_m_s += (ahead_m_s - self._host_m_s) / FPS
            self._send_bsms(ahead, now)
            candidates = plate.look(width_px, now)
            (own_m_s,) = shown_m_s(np.array([self._host_m_s]), self._scale).tolist()
            self._core.receive_speed(own_m_s, now)
            closing_m_s = self._host_m_s - ahead_m_s + closing_error.next_m_s()
            if self._insider.is_alike:
                self._core.receive_offsets({_INSIDER: (gap_m + REFERENCE_M, 0.0, PLACE_SIGMA_M)})
            self._core.receive_lead(
                TrackedLead(now, self._track_id, gap_m, closing_m_s, CLOSING_SIGMA_M_S, candidates),
                now,
            )
            self._deliver(ahead, now)
            identity = self._core.identity
            is_right = identity is not None and identity.car_id == self._ids[ahead]
            if is_right and self._insider is not Insider.NONE:
                is_right = not self._is_insider_identified()
            if identity is None or is_right:
                wrong_from_s = None
            elif wrong_from_s is None:
                wrong_from_s = now
            if is_right and identified_s is None:
                identified_s = image / FPS
            if wrong_from_s is not None:
                wrong_s = max(wrong_s, now - wrong_from_s + 1 / FPS)
        return _Change(bool(self._has_radio[ahead]), identified_s, wrong_s)

    def _send_bsms(self, ahead: int, now: float) -> None:
        if self._frame % BSM_EVERY:
            return
        for car in np.flatnonzero(self._has_radio).tolist():
            shown_m_s = float(self._traffic.shown_m_s[car])
            self._core.receive_speed_on_air(_sender(car), _sender(car), shown_m_s, now)
        if self._insider is not Insider.NONE:
            speed_m_s = self._insider_m_s()
            self._core.receive_speed_on_air(_INSIDER, _INSIDER, speed_m_s, now)
        self._earlier_m_s = float(self._traffic.shown_m_s[ahead])

    def _deliver(self, ahead: int, now: float) -> None:
        """Let those who bear a name in the inquiries answer."""
        for message in self._core.messages_to_send():
            if not isinstance(message, Inquiry):
                continue
            answering = {self._by_name[name] for name in message.names if name in self._by_name}
            for car in sorted(answering):
                if self._rng.random() >= self._settings.loss:
                    speed_m_s = float(self._traffic.shown_m_s[car])
                    self._answer(message, self._ids[car], _sender(car), speed_m_s, now)
            claimed, names = self._ids[ahead], {self._ids[ahead][:NAME_BYTES]}
            if self._insider.is_alike:
                claimed, names = car_id_of("EVIL1"), {_INSIDER}
            answers = self._insider not in (Insider.NONE, Insider.SILENCE)
            if answers and not names.isdisjoint(message.names):
                self._answer(message, claimed, _INSIDER, self._insider_m_s(), now)
        while self._core.next_event() is not None:
            pass

    def _answer(
        self, inquiry: Inquiry, car_id: bytes, sender: bytes, speed_m_s: float, now: float
    ) -> None:
        answer = Answer(car_id, inquiry.sender_id, inquiry.sequence, sender, speed_m_s)
        self._core.receive_message(answer, None, now + 0.005)

    def _insider_m_s(self) -> float:
        if self._insider is Insider.COPIED_SPEED or self._insider.is_alike:
            return self._earlier_m_s
        return float(self._traffic.shown_m_s[0])

    def _is_insider_identified(self) -> bool:
        return self._core.sender == _INSIDER


_INSIDER = b"evil"


def _plates(settings: FalseIdentitySettings, rng: np.random.Generator) -> Iterator[str]:
    """Plates of all vehicles, those of the fleet with consecutive numbers at their end."""
    first = int(rng.integers(100, 899))
    letters = "".join(rng.choice(list("ABCDEFGHJKLMNPRSTUVWXYZ"), 3))
    for number in range(settings.vehicles):
        if number < settings.fleet:
            yield f"{letters}{first * 10 + number:04d}"
        else:
            yield text_of(str(rng.choice(PATTERNS[settings.region])), rng).replace(" ", "")


def _sender(car: int) -> bytes:
    return b"v" + car.to_bytes(3)


@dataclass(frozen=True, slots=True)
class IdentityLine:
    """One line of the table."""

    radios: float
    insider: str
    changes: int
    with_radio: int
    identified: float
    """Share of the vehicles with a radio that were identified."""
    median_s: float
    p90_s: float
    wrong: int
    wrong_longer_than_1_s: int
    longest_wrong_s: float


def table(settings: FalseIdentitySettings, rows: Sequence[DriveRow]) -> list[IdentityLine]:
    """A line for each share of radios and insider."""
    return [_line(case, rows) for case in STUDY.cases(settings)]


def _line(case: DriveCase, rows: Sequence[DriveRow]) -> IdentityLine:
    axes_of = case.radios, case.insider
    mine = [row for row in rows if (row.radios, row.insider) == axes_of]
    times_s = [time_s for row in mine for time_s in row.identified_s]
    with_radio = sum(row.with_radio for row in mine)
    return IdentityLine(
        radios=case.radios,
        insider=case.insider.value,
        changes=CHANGES_A_RUN * len(mine),
        with_radio=with_radio,
        identified=len(times_s) / with_radio if with_radio else math.nan,
        median_s=float(np.median(times_s)) if times_s else math.nan,
        p90_s=float(np.percentile(times_s, 90)) if times_s else math.nan,
        wrong=sum(row.wrong for row in mine),
        wrong_longer_than_1_s=sum(row.wrong_long for row in mine),
        longest_wrong_s=max(row.wrong_s for row in mine),
    )


def summary(results: Results[FalseIdentitySettings, DriveRow, IdentityLine]) -> str:
    """The worst case."""
    worst = max(results.table, key=lambda line: line.wrong_longer_than_1_s / line.changes)
    return (
        f"{worst.wrong_longer_than_1_s} of {worst.changes} vehicles ahead were taken for another"
        f" one for longer than {WRONG_S:g} s, with radios in {worst.radios:.0%} of the vehicles"
        f" and insider: {worst.insider}"
    )


STUDY = Study(
    name="false-identity",
    sentence="How often, and for how long, another vehicle is taken for the lead.",
    settings=FalseIdentitySettings,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=DriveCase,
    run=run,
    row=DriveRow,
    table=table,
    line=IdentityLine,
    summary=summary,
)
