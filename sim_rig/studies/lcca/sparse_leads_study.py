"""How often another car than the lead is taken for it where few cars are on the air.

Cars drive in rows (`sparse_road.py`), and some of them have a radio. A host follows one lead for a
long time, whose plate its camera reads, or cannot read: that of a motorcycle, or a dirty one. Of
its cores `Identification` is driven alone, as it ships. Where the lead has no radio, no car is the
right one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from onboard.lcca.events import TrackedLead
from onboard.lcca.identification import Identification
from onboard.messages.lcca import NAME_BYTES, Answer, Inquiry
from onboard.settings import Settings
from sim_rig.cars.camera_view import FPS
from sim_rig.rendering.plate_texts import EU_PATTERNS, text_of
from sim_rig.scenario.setting_types import Positive, Several, Share, Span
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.lcca.host_errors import (
    CLOSING_SIGMA_M_S,
    SPEEDOMETER,
    ClosingError,
    shown_m_s,
)
from sim_rig.studies.lcca.plate_view import PlateView
from sim_rig.studies.lcca.sparse_road import OWN, SparseRoad
from sim_rig.studies.lcca.study_lcca import car_id_of

WRONG_S = 1.0
"""Time for which another car may be taken for the lead."""
SETTLING_S = 20.0
"""In which the rows form."""
NEAR_S = 2.5
"""Headway of the hosts at first; leads from 3 s on are not asked for."""
BSM_EVERY = 3
"""Images between two BSMs: 5 Hz at 15 images a second."""
GNSS_SIGMA_M = 3.0
"""Of each receiver's error, which lasts as long as a run."""


class SparseLeadsSettings(Settings):
    """One campaign; a run is one road, on which some of the cars are hosts."""

    seed: int = Field(1, ge=0)
    """Of the first road; each further one of a case has the next."""
    runs: int = Field(100, ge=1)
    """Roads of each case."""
    hosts: int = Field(4, ge=1)
    """Cars of a road that look ahead, each with one lead."""
    vehicles: Several[Annotated[int, Field(ge=2, le=500)]] = (8, 24, 60)
    """Numbers of cars in range."""
    radios: Several[Share] = (0.2, 0.5, 1.0)
    """Shares of the cars with a radio."""
    legible: Several[Share] = (1.0, 0.0)
    """Shares of the leads whose plate can be read."""
    positions: Several[bool] = (False,)
    """Whether host and cars have GNSS."""
    speed_m_s: Span[Positive] = (12.0, 30.0)
    """Range of the speed of a road; it is uniform."""
    plate_px: Span[Positive] = (28.0, 60.0)
    """Range of the width of the plate in the image, in pixels; it is uniform."""
    loss: Share = 0.1
    """Share of the answers that are lost."""
    seconds: float = Field(60.0, ge=2.0, le=600.0)
    """Time with one lead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseCase(Case):
    """One road."""

    vehicles: int
    radios: float
    """Share of the cars with a radio."""
    legible: float
    """Share of the leads whose plate can be read."""
    positions: bool


def axes(settings: SparseLeadsSettings) -> Axes:
    """Every number of cars with every share of radios, plates, and positions."""
    return {
        "vehicles": settings.vehicles,
        "radios": settings.radios,
        "legible": settings.legible,
        "positions": settings.positions,
    }


@dataclass(frozen=True, slots=True)
class SparseRow:
    """One road."""

    vehicles: int
    radios: float
    legible: float
    positions: bool
    leads: int
    with_radio: int
    """Of the leads."""
    identified_s: list[float]
    """Of each lead with a radio that was identified: how long that took."""
    wrong: int
    """Leads for which another car was taken for longer than `WRONG_S`."""
    wrong_s: float
    """The longest such time."""


def run(settings: SparseLeadsSettings, case: SparseCase) -> SparseRow:
    """Let the hosts of one road follow their leads."""
    drive = _Drive(settings, case, np.random.default_rng([settings.seed + case.repetition, 41]))
    for _ in range(round(settings.seconds * FPS)):
        drive.advance()
    hosts = drive.hosts
    return SparseRow(
        vehicles=case.vehicles,
        radios=case.radios,
        legible=case.legible,
        positions=case.positions,
        leads=len(hosts),
        with_radio=sum(host.lead in drive.radios for host in hosts),
        identified_s=[each.identified_s for each in hosts if each.identified_s is not None],
        wrong=sum(host.longest_wrong_s > WRONG_S for host in hosts),
        wrong_s=max((host.longest_wrong_s for host in hosts), default=0.0),
    )


class _Host:
    """One car of the row, with its camera and its core."""

    def __init__(self, car: int, plate: PlateView | None, rng: np.random.Generator) -> None:
        """Look at the next car ahead; `plate` is what can be read of it."""
        self.car, self.lead = car, car - 1
        self.core = Identification(b"hostcar0", b"host", rng)
        self._plate = plate
        self._closing_error = ClosingError(rng)
        self.identified_s: float | None = None
        """When its lead was identified."""
        self._wrong_s = self.longest_wrong_s = 0.0

    def look(self, road: SparseRoad, own_shown_m_s: float, width_px: float, now: float) -> None:
        """Take an image, and the speed of its bus; what the core then sends is to be delivered."""
        own_m_s, lead_m_s = road.speeds_m_s[[self.car, self.lead]].tolist()
        self.core.receive_speed(own_shown_m_s, now)
        candidates = () if self._plate is None else self._plate.look(width_px, now)
        gap_m, closing_m_s = float(road.gaps_m[self.car]), own_m_s - lead_m_s
        measured_m_s = closing_m_s + self._closing_error.next_m_s()
        lead = TrackedLead(now, 1, gap_m, measured_m_s, CLOSING_SIGMA_M_S, candidates)
        self.core.receive_lead(lead, now)

    def judge(self, now: float) -> None:
        """Note whom the core takes for the lead in an image."""
        while self.core.next_event() is not None:
            pass
        is_right = self.core.sender == _sender(self.lead)
        is_wrong = self.core.identity is not None and not is_right
        self._wrong_s = self._wrong_s + 1 / FPS if is_wrong else 0.0
        self.longest_wrong_s = max(self.longest_wrong_s, self._wrong_s)
        if is_right and self.identified_s is None:
            self.identified_s = now


class _Drive:
    """One road with its hosts."""

    def __init__(
        self, settings: SparseLeadsSettings, case: SparseCase, rng: np.random.Generator
    ) -> None:
        self._rng, self._loss, self._has_positions = rng, settings.loss, case.positions
        self._road = SparseRoad(case.vehicles, float(rng.uniform(*settings.speed_m_s)), rng)
        for _ in range(round(SETTLING_S * FPS)):
            self._road.advance(1 / FPS)
        self.radios = frozenset(np.flatnonzero(rng.random(case.vehicles) < case.radios).tolist())
        plates = [text_of(str(rng.choice(EU_PATTERNS)), rng) for _ in range(case.vehicles)]
        self._ids = [car_id_of(plate.replace(" ", "")) for plate in plates]
        self._by_name = {self._ids[car][:NAME_BYTES]: car for car in self.radios}
        self._by_name |= {_sender(car): car for car in self.radios}
        self._scales = rng.normal(*SPEEDOMETER, case.vehicles)
        self._errors_m = rng.normal(0.0, GNSS_SIGMA_M, (case.vehicles, 2))
        is_near = self._road.gaps_m < NEAR_S * self._road.speeds_m_s
        followers = np.flatnonzero((self._road.lanes == OWN) & is_near)
        chosen = rng.permutation(followers)[: settings.hosts].tolist()
        self.hosts = [
            _Host(car, _plate_view(plates[car - 1], case.legible, rng), rng) for car in chosen
        ]
        self._widths_px = rng.uniform(*settings.plate_px, len(self.hosts)).tolist()
        self._frame = 0

    def advance(self) -> None:
        """Go on to the next image of all hosts."""
        self._frame += 1
        now = self._frame / FPS
        self._road.advance(1 / FPS)
        shown = shown_m_s(self._road.speeds_m_s, self._scales).tolist()
        for host, width_px in zip(self.hosts, self._widths_px, strict=True):
            if self._frame % BSM_EVERY == 0:
                self._send_bsms(host, shown, now)
            host.look(self._road, shown[host.car], width_px, now)
            self._deliver(host, shown, now)
            host.judge(now)

    def _send_bsms(self, host: _Host, shown: Sequence[float], now: float) -> None:
        senders = sorted(self.radios - {host.car})
        for car in senders:
            host.core.receive_speed_on_air(_sender(car), _sender(car), shown[car], now)
        if self._has_positions:
            errors_m = self._errors_m - self._errors_m[host.car]
            offsets_m = (self._road.offsets_m(host.car) + errors_m).tolist()
            host.core.receive_offsets(
                {_sender(car): (*offsets_m[car], GNSS_SIGMA_M) for car in senders}
            )

    def _deliver(self, host: _Host, shown: Sequence[float], now: float) -> None:
        """Let those who bear a name in the inquiries answer."""
        for message in host.core.messages_to_send():
            if not isinstance(message, Inquiry):
                continue
            answering = {self._by_name[name] for name in message.names if name in self._by_name}
            for car in sorted(answering - {host.car}):
                if self._rng.random() >= self._loss:
                    sender = _sender(car)
                    answer = Answer(
                        self._ids[car], message.sender_id, message.sequence, sender, shown[car]
                    )
                    host.core.receive_message(answer, None, now + 0.005)


def _plate_view(plate: str, legible: float, rng: np.random.Generator) -> PlateView | None:
    return PlateView(plate.replace(" ", ""), rng) if rng.random() < legible else None


def _sender(car: int) -> bytes:
    return b"v" + car.to_bytes(3)


@dataclass(frozen=True, slots=True)
class SparseLine:
    """One line of the table."""

    vehicles: int
    radios: float
    legible: float
    positions: bool
    leads: int
    with_radio: int
    identified: float
    """Share of the leads with a radio that were identified."""
    median_s: float
    p90_s: float
    wrong_longer_than_1_s: int
    longest_wrong_s: float


def table(settings: SparseLeadsSettings, rows: Sequence[SparseRow]) -> list[SparseLine]:
    """A line for each kind of road."""
    return [_line(case, rows) for case in STUDY.cases(settings)]


def _line(case: SparseCase, rows: Sequence[SparseRow]) -> SparseLine:
    of = case.vehicles, case.radios, case.legible, case.positions
    mine = [row for row in rows if (row.vehicles, row.radios, row.legible, row.positions) == of]
    times_s = [time_s for row in mine for time_s in row.identified_s]
    with_radio = sum(row.with_radio for row in mine)
    return SparseLine(
        *of,
        leads=sum(row.leads for row in mine),
        with_radio=with_radio,
        identified=len(times_s) / with_radio if with_radio else math.nan,
        median_s=float(np.median(times_s)) if times_s else math.nan,
        p90_s=float(np.percentile(times_s, 90)) if times_s else math.nan,
        wrong_longer_than_1_s=sum(row.wrong for row in mine),
        longest_wrong_s=max(row.wrong_s for row in mine),
    )


def summary(results: Results[SparseLeadsSettings, SparseRow, SparseLine]) -> str:
    """All roads together."""
    wrong = sum(line.wrong_longer_than_1_s for line in results.table)
    leads = sum(line.leads for line in results.table)
    return f"{wrong} of {leads} leads were taken for another car for longer than {WRONG_S:g} s"


STUDY = Study(
    name="sparse-leads",
    sentence="How often another car is taken for the lead where few cars have a radio.",
    settings=SparseLeadsSettings,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=SparseCase,
    run=run,
    row=SparseRow,
    table=table,
    line=SparseLine,
    summary=summary,
)
