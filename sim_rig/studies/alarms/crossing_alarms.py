"""Lead time, misses and false alarms at crossings, for the driver with right of way and the other.

The risk monitor of either vehicle is given what its own sensors and the other's BSMs report, with
the rig's errors. Neither driver reacts to alarms. A run is some meetings of one kind.

A nuisance is a warning of a meeting in which each vehicle would have left the place that both cross
at least `NUISANCE_S` before the other enters it.
"""

import math
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scipy.stats import chi2

from onboard.kinematics.heading import Heading
from onboard.kinematics.units import KM_H
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import ExteriorLights, VehicleSafetyExtensions
from onboard.mvs.host_vehicle import SPEED_SIGMA_M_S
from onboard.observations import Speed, TurnSignal
from onboard.risk.alarm import Alarm, Level
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from sim_rig.scenario.sensor_settings import ReceiverSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.alarms.crossing_meetings import TICK_S, Array, Meeting, MeetingKind, meetings
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.intervals import wilson
from sim_rig.studies.campaigns.results import write_results
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
NUISANCE_S = 1.0
COLUMNS = (
    "meetings", "role", "hours", "crashes", "warned", "warned_share_at_least", "lead_median_s",
    "lead_5_percent_s", "nuisances", "per_100_h", "per_100_h_at_most", "warnings_of_near_misses",
)  # fmt: skip


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


def run(out_dir: Path, settings: AlarmSettings | None, workers: Workers) -> str:
    """Run the campaign and write its table.

    Args:
        out_dir: folder of table, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster.

    Returns:
        A summary.
    """
    chosen = settings or AlarmSettings()
    numbers = range(chosen.runs * len(chosen.kinds))
    rows = run_campaign(run_one, chosen, numbers, out_dir / "runs", workers)
    table = [
        _pooled(kind, role, [row["roles"][role] for row in rows if row["meetings"] == kind])
        for kind, role in product(map(str, chosen.kinds), ROLES)
    ]
    write_results(out_dir, COLUMNS, table, chosen)
    return "; ".join(
        f"{kind}, {role}: {warned} of {crashes} crashes warned of, {lead_s:.2f} s ahead,"
        f" {nuisances} nuisances in {hours:.1f} h"
        for kind, role, hours, crashes, warned, _, lead_s, _, nuisances, *_ in table
    )


def run_one(settings: AlarmSettings, number: int) -> Row:
    """Judge some meetings of one kind, each for both drivers."""
    rng = np.random.default_rng((settings.seed, number))
    kind = settings.kinds[number % len(settings.kinds)]
    roles: dict[str, Row] = {
        role: {"hours": 0.0, "leads_s": [], "missed": 0, "nuisances": 0, "near_misses": 0}
        for role in ROLES
    }
    for meeting in meetings(kind, settings.traffic, rng):
        for host, row in enumerate(roles.values()):
            warned_s = list(_warned_s(meeting, host, settings, rng))
            row["hours"] += len(meeting.speed_m_s) * TICK_S / 3600.0
            if math.isfinite(meeting.contact_s):
                row["leads_s"] += [round(meeting.contact_s - at_s, 2) for at_s in warned_s[:1]]
                row["missed"] += not warned_s
            else:
                counted = "nuisances" if meeting.gap_s >= NUISANCE_S else "near_misses"
                row[counted] += len(warned_s)
    return {"meetings": kind.value, "roles": roles}


def _pooled(kind: str, role: str, rows: list[Row]) -> tuple[Any, ...]:
    """Return one line of the table, with the bounds of 95 % confidence."""
    leads_s = [lead_s for row in rows for lead_s in row["leads_s"]]
    hours, missed, nuisances, near_misses = (
        sum(row[name] for row in rows) for name in ("hours", "missed", "nuisances", "near_misses")
    )
    crashes = len(leads_s) + missed
    _, least, _ = wilson(len(leads_s) / max(crashes, 1), max(crashes, 1))
    median_s, low_s = np.percentile(leads_s or [math.nan], [50.0, 5.0]).tolist()
    at_most = float(chi2.ppf(0.95, 2 * nuisances + 2)) / 2.0
    return (
        kind, role, hours, crashes, len(leads_s), least, median_s, low_s,
        nuisances, 100.0 * nuisances / hours, 100.0 * at_most / hours, near_misses,
    )  # fmt: skip


def _warned_s(
    meeting: Meeting, host: int, settings: AlarmSettings, rng: np.random.Generator
) -> Iterator[float]:
    """When the monitor of vehicle `host` raises a warning of the other."""
    monitor = RiskMonitor(settings.risk, settings.traffic.length_m, settings.traffic.width_m)
    own_share = math.sqrt(1.0 - settings.receivers.bias_shared)
    bias_m = own_share * settings.receivers.bias_sigma_m * rng.standard_normal((2, 2))
    heading_error_rad = HEADING_SIGMA_RAD * rng.standard_normal()
    for tick in range(0, len(meeting.speed_m_s), round(EVERY_S / TICK_S)):
        now = tick * TICK_S
        monitor.receive_speed(_obd_speed(meeting, tick, host))
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
                monitor.receive_turn_signal(TurnSignal(now, "left", is_on=True, source="can"))
            else:
                safety = VehicleSafetyExtensions(lights=ExteriorLights.LEFT_TURN_SIGNAL)
        monitor.receive_bsm(BasicSafetyMessage(core, safety), now)
        heading = Heading(_heading_rad(meeting, tick, host) + heading_error_rad, HEADING_SIGMA_RAD)
        monitor.assess(own, [other], now, heading=heading)
        for event in iter(monitor.next_event, None):
            if isinstance(event, Alarm) and event.level is Level.WARNING:
                yield now


def _obd_speed(meeting: Meeting, tick: int, host: int) -> Speed:
    """Speed of the host as PID 0x0D reports it, in whole km/h."""
    true_m_s = float(meeting.speed_m_s[_before(tick, SPEED_AGE_S), host])
    return Speed(tick * TICK_S - SPEED_AGE_S, math.floor(true_m_s / KM_H) * KM_H, KM_H, "obd:7E8")


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
    variances = np.repeat([sigma_m**2, SPEED_SIGMA_M_S**2], 2)
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
