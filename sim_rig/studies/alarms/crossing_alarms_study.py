"""Lead time, misses and false alarms at crossings, for the driver with right of way and the other.

The `RiskResponse` of either vehicle is given what its own sensors and the other's BSMs report, with
the rig's errors. Neither driver reacts to alarms. A run is some meetings of one kind.

A nuisance is a meeting with a warning in which each vehicle would have left the place that both
cross at least `NUISANCE_S` before the other enters it. Further warnings of one meeting are no
further ones: they have the same cause, and the bound takes nuisances as independent.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from pydantic import Field
from scipy.stats import chi2

from onboard.kinematics.heading import Heading
from onboard.kinematics.units import KM_H
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import ExteriorLights, VehicleSafetyExtensions
from onboard.mvs.host_vehicle import REPORTED_SPEED_SIGMA_M_S
from onboard.observations import Speed, TurnSignal, YawRate
from onboard.risk.alarm import Alarm, Level
from onboard.risk.settings import RiskSettings
from onboard.sensors.host_state import HostState
from onboard.settings import Settings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from onboard.tracking.slices import result_of
from onboard.vehicle.risk_response import RiskResponse
from sim_rig.scenario.sensor_settings import ReceiverSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.alarms.crossing_meetings import TICK_S, Array, Meeting, MeetingKind, meetings
from sim_rig.studies.campaigns.intervals import wilson
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study
from sim_rig.studies.joerer.traffic import TrafficSettings

ROLES = "right of way", "yields"
"""Of the first vehicle of a meeting, and of the second."""
EVERY_S = 0.1
"""Period of the assessment, of BSMs and of the samples of the host's speed."""
BSM_AGE_S = 0.15
"""Mean age of a BSM's state when it is evaluated."""
SPEED_AGE_S = 0.05
"""Of a sample of the host's speed."""
OTHER = "0a0b0c0d"
HEADING_SIGMA_RAD = 0.04
"""Of the heading that a receiver keeps at rest."""
LATE_S = 1.7
"""A warning that comes less than this before the contact is late (Euro NCAP)."""
YAW_RATE_SIGMA_RAD_S = 0.005
"""Noise of the host's yaw rate."""
NUISANCE_S = 1.0


class AlarmSettings(Settings):
    """One campaign."""

    seed: int = Field(1, ge=0)
    """Of all draws, together with the number of the run."""
    runs: int = Field(30, ge=1)
    """Of each kind of meetings."""
    kinds: Several[MeetingKind] = tuple(MeetingKind)
    """What the second vehicle does."""
    traffic: TrafficSettings = TrafficSettings(approaches=100)
    """`approaches` are the meetings of a run."""
    turn_signals: bool = True
    """Whether who turns left signals it, all the time."""
    receivers: ReceiverSettings = ReceiverSettings()
    """Errors of the GNSS receivers of both vehicles."""
    risk: RiskSettings = RiskSettings()
    """Thresholds of the alarms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetingsCase(Case):
    """Some meetings of one kind."""

    kind: MeetingKind


def axes(settings: AlarmSettings) -> Axes:
    """Every kind of meetings."""
    return {"kind": settings.kinds}


@dataclass(slots=True)
class RoleCounts:
    """What the driver of one role is warned of in some meetings."""

    hours: float = 0.0
    leads_s: list[float] = field(default_factory=list)
    """Of each crash that was warned of: from the warning to the contact."""
    missed: int = 0
    """Crashes without a warning."""
    nuisances: int = 0
    near_misses: int = 0
    """Meetings with a warning in which both came as near as `NUISANCE_S` without a contact."""


@dataclass(frozen=True, slots=True)
class MeetingsRow:
    """Some meetings of one kind."""

    meetings: MeetingKind
    roles: dict[str, RoleCounts]
    """By the names of `ROLES`."""


@dataclass(frozen=True, slots=True)
class CrossingLine:
    """One line of the table: a role in all meetings of one kind; bounds are of 95 % confidence."""

    meetings: str
    role: str
    hours: float
    crashes: int
    warned: int
    late: int
    """Warned of, but later than `LATE_S` before the contact."""
    warned_share_at_least: float
    lead_median_s: float
    lead_5_percent_s: float
    nuisances: int
    per_100_h: float
    """Nuisances."""
    per_100_h_at_most: float
    warnings_of_near_misses: int


def run(settings: AlarmSettings, case: MeetingsCase) -> MeetingsRow:
    """Judge some meetings of one kind, each for both drivers."""
    rng = np.random.default_rng((settings.seed, case.number))
    roles = {role: RoleCounts() for role in ROLES}
    for meeting in meetings(case.kind, settings.traffic, rng):
        for host, counts in enumerate(roles.values()):
            warned_s = list(_warned_s(meeting, host, settings, rng))
            counts.hours += len(meeting.speed_m_s) * TICK_S / 3600.0
            if math.isfinite(meeting.contact_s):
                counts.leads_s += [round(meeting.contact_s - at_s, 2) for at_s in warned_s[:1]]
                counts.missed += not warned_s
            elif meeting.gap_s >= NUISANCE_S:
                counts.nuisances += bool(warned_s)
            else:
                counts.near_misses += bool(warned_s)
    return MeetingsRow(case.kind, roles)


def table(settings: AlarmSettings, rows: Sequence[MeetingsRow]) -> list[CrossingLine]:
    """A line for each kind of meetings and role."""
    return [
        _pooled(kind, role, [row.roles[role] for row in rows if row.meetings == kind])
        for kind, role in product(settings.kinds, ROLES)
    ]


def _pooled(kind: MeetingKind, role: str, counts: list[RoleCounts]) -> CrossingLine:
    leads_s = [lead_s for each in counts for lead_s in each.leads_s]
    hours = sum(each.hours for each in counts)
    nuisances = sum(each.nuisances for each in counts)
    crashes = len(leads_s) + sum(each.missed for each in counts)
    _, least, _ = wilson(len(leads_s) / max(crashes, 1), max(crashes, 1))
    median_s, low_s = np.percentile(leads_s or [math.nan], [50.0, 5.0]).tolist()
    at_most = float(chi2.ppf(0.95, 2 * nuisances + 2)) / 2.0
    return CrossingLine(
        meetings=kind.value,
        role=role,
        hours=hours,
        crashes=crashes,
        warned=len(leads_s),
        late=sum(lead_s < LATE_S for lead_s in leads_s),
        warned_share_at_least=least,
        lead_median_s=median_s,
        lead_5_percent_s=low_s,
        nuisances=nuisances,
        per_100_h=100.0 * nuisances / hours,
        per_100_h_at_most=100.0 * at_most / hours,
        warnings_of_near_misses=sum(each.near_misses for each in counts),
    )


def summary(results: Results[AlarmSettings, MeetingsRow, CrossingLine]) -> str:
    """Crashes and nuisances of each kind and role."""
    return "; ".join(
        f"{line.meetings}, {line.role}: {line.warned} of {line.crashes} crashes warned of,"
        f" {line.lead_median_s:.2f} s ahead, {line.nuisances} nuisances in {line.hours:.1f} h"
        for line in results.table
    )


def _warned_s(
    meeting: Meeting, host: int, settings: AlarmSettings, rng: np.random.Generator
) -> Iterator[float]:
    """When vehicle `host` raises a warning of the other."""
    state, size_m = HostState(), (settings.traffic.length_m, settings.traffic.width_m)
    response = RiskResponse(settings.risk, size_m, state)
    own_share = math.sqrt(1.0 - settings.receivers.bias_shared)
    bias_m = own_share * settings.receivers.bias_sigma_m * rng.standard_normal((2, 2))
    heading_error_rad = HEADING_SIGMA_RAD * rng.standard_normal()
    for tick in range(0, len(meeting.speed_m_s), round(EVERY_S / TICK_S)):
        now = tick * TICK_S
        state.receive_observation(_obd_speed(meeting, tick, host))
        noise_rad_s = YAW_RATE_SIGMA_RAD_S * rng.standard_normal()
        state.receive_observation(yaw_rate(meeting, tick, host, noise_rad_s))
        own, other = (
            _perceived_object(
                meeting, (tick, car), bias_m[car], settings.receivers, is_host=car == host, rng=rng
            )
            for car in (host, 1 - host)
        )
        other_rad = _heading_rad(meeting, _before(tick, BSM_AGE_S), 1 - host)
        core = CoreData(1, bytes.fromhex(OTHER), heading_rad=other_rad)
        safety = None
        if settings.turn_signals and meeting.turns_left:
            if host == 1:
                state.receive_observation(TurnSignal(now, "left", is_on=True, source="can"))
            else:
                safety = VehicleSafetyExtensions(lights=ExteriorLights.LEFT_TURN_SIGNAL)
        response.monitor.receive_bsm(BasicSafetyMessage(core, safety), now)
        heading = Heading(_heading_rad(meeting, tick, host) + heading_error_rad, HEADING_SIGMA_RAD)
        result_of(response.assess_in_slices(own, [other], now, heading=heading))
        for event in iter(response.monitor.next_event, None):
            if isinstance(event, Alarm) and event.level is Level.WARNING:
                yield now


def _obd_speed(meeting: Meeting, tick: int, host: int) -> Speed:
    """Speed of the host as PID 0x0D reports it, in whole km/h."""
    true_m_s = float(meeting.speed_m_s[_before(tick, SPEED_AGE_S), host])
    return Speed(tick * TICK_S - SPEED_AGE_S, math.floor(true_m_s / KM_H) * KM_H, KM_H, "obd:7E8")


def yaw_rate(meeting: Meeting, tick: int, host: int, noise_rad_s: float) -> YawRate:
    """Return the yaw rate on the host's bus at a tick, positive to the right."""
    after = _before(tick, SPEED_AGE_S)
    before = max(after - 1, 0)
    turned_rad = meeting.course_rad[before, host] - meeting.course_rad[after, host]
    stamp_s = tick * TICK_S - SPEED_AGE_S
    return YawRate(stamp_s, float(turned_rad) / TICK_S + noise_rad_s, "can")


def _perceived_object(
    meeting: Meeting,
    at: tuple[int, int],
    bias_m: Array,
    receivers: ReceiverSettings,
    *,
    is_host: bool,
    rng: np.random.Generator,
) -> PerceivedObject:
    """A vehicle as its last fix reports it, predicted to the tick; `at` are tick and vehicle."""
    tick, car = at
    now, late_s = tick * TICK_S, receivers.latency_s if is_host else BSM_AGE_S
    fix_s = math.floor((now - late_s) * receivers.rate_hz + 1e-6) / receivers.rate_hz
    fix, age_s = _before(tick, now - fix_s), now - fix_s
    noise = rng.standard_normal(4) * np.repeat(
        [receivers.noise_sigma_m, receivers.speed_sigma_m_s], 2
    )
    course_rad, speed_m_s = meeting.course_rad[fix, car], meeting.speed_m_s[fix, car]
    velocity_m_s = speed_m_s * np.array([np.cos(course_rad), np.sin(course_rad)]) + noise[2:]
    position_m = meeting.position_m[fix, car] + bias_m + noise[:2] + age_s * velocity_m_s
    sigma_m = math.hypot(receivers.bias_sigma_m, receivers.noise_sigma_m)
    variances = np.repeat([sigma_m**2, REPORTED_SPEED_SIGMA_M_S**2], 2)
    reported = meeting.acceleration_m_s2[_before(tick, BSM_AGE_S), car]
    return PerceivedObject(
        stamp_s=now,
        name="own" if is_host else OTHER,
        source=ObjectSource.HOST if is_host else ObjectSource.BSM,
        state=(*position_m.tolist(), *velocity_m_s.tolist()),
        covariance=tuple(map(tuple, np.diag(variances).tolist())),
        age_s=age_s,
        provenance=frozenset(),
        acceleration_m_s2=None if is_host else float(reported),
    )


def _heading_rad(meeting: Meeting, tick: int, car: int) -> float:
    """Clockwise from north."""
    return float((math.pi / 2.0 - meeting.course_rad[tick, car]) % (2.0 * math.pi))


def _before(tick: int, age_s: float) -> int:
    return max(tick - round(age_s / TICK_S), 0)


STUDY = Study(
    name="crossing-alarms",
    sentence="How early the alarms at crossings warn, what they miss, and how often in vain.",
    settings=AlarmSettings,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=MeetingsCase,
    run=run,
    row=MeetingsRow,
    table=table,
    line=CrossingLine,
    summary=summary,
)
