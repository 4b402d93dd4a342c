"""FCW behind vehicles without radio, by sensor profile: false alarms, and delay after braking.

The car's own `Vehicle`, from the wires on (NMEA, the detector's JSON, whole km/h), with the rig's
errors. False alarms are counted on recorded platoons, of which every follower is the host vehicle
in turn, behind two others; a warning is false unless exact gaps and speeds raise one within
`SAME_S`. The delay is measured behind a vehicle that brakes from a constant speed; the host vehicle
does not react.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import Field
from scipy.stats import chi2

from onboard.errors import UserError
from onboard.observations import Lead, LeadIdentity, Sensor
from onboard.risk.fcw import FCW
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from onboard.vehicle.vehicle import Vehicle
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.roads.trace_files import read_trace
from sim_rig.roads.trajectory_drive import TrajectoryDrive
from sim_rig.scenario.sensor_settings import SENSOR_PROFILES, ReceiverSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.alarms.wired_vehicle import (
    EVERY_S,
    HEIGHT_M,
    LENGTH_M,
    WIDTH_M,
    WiredVehicle,
    vehicle,
    warnings,
)
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study

SAME_S = 1.0
STEADY_S = 5.0
"""Time of constant speed before a vehicle brakes."""
WATCHED_S = 3.0


class FollowingSettings(Settings):
    """One campaign; a run is one recording with one seed and one profile, and some brakings."""

    files: Several[Path]
    """Recordings of cars in one lane, the first one ahead."""
    seeds: Several[int] = (1,)
    """Each recording is run with each of them."""
    profiles: Several[str] = tuple(SENSOR_PROFILES)
    """Sensors of the host vehicle, by the name of their profile."""
    brakings: int = Field(10, ge=0)
    """In each run."""
    speed_m_s: float = Field(20.0, gt=2.0)
    """Of both vehicles before one brakes."""
    gaps_m: tuple[float, float] = (12.0, 22.0)
    """The gaps are uniform between these."""
    braking_m_s2: float = Field(6.0, gt=0.0)
    """Deceleration of the vehicle that brakes."""
    receivers: ReceiverSettings = ReceiverSettings()
    """Errors of the GNSS receiver of the host vehicle."""
    risk: RiskSettings = RiskSettings()
    """Thresholds of the alarms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowingCase(Case):
    """One recording with one seed and one profile."""

    file: Path
    seed: int
    profile: str


def axes(settings: FollowingSettings) -> Axes:
    """Every recording with every seed and every profile."""
    return {"file": settings.files, "seed": settings.seeds, "profile": settings.profiles}


@dataclass(slots=True)
class FollowingRow:
    """All followers of one recording, and some brakings."""

    profile: str
    hours: float = 0.0
    false: int = 0
    """Warnings that exact gaps and speeds do not raise."""
    true: int = 0
    delays_s: list[float | None] = field(default_factory=list)
    """From each braking to the warning; `None` without one."""
    exact_s: list[float | None] = field(default_factory=list)
    """The same with exact gaps and speeds."""


@dataclass(frozen=True, slots=True)
class FollowingLine:
    """One line of the table: a profile; the bound is of 95 % confidence."""

    profile: str
    hours: float
    false: int
    per_10_h: float
    """False warnings."""
    per_10_h_at_most: float
    true: int
    brakings: int
    warned: int
    delay_median_s: float
    delay_95_percent_s: float
    exact_median_s: float


def checked(settings: FollowingSettings) -> FollowingSettings:
    """The settings, if all profiles exist."""
    unknown = set(settings.profiles) - set(SENSOR_PROFILES)
    if unknown:
        raise UserError(f"profiles: {sorted(unknown)}; allowed: {', '.join(SENSOR_PROFILES)}")
    return settings


def run(settings: FollowingSettings, case: FollowingCase) -> FollowingRow:
    """Follow in one recording, and behind some vehicles that brake."""
    rng = np.random.default_rng((case.seed, case.number))
    row = FollowingRow(case.profile)
    recording = read_trace(case.file)
    drives: Mapping[str, TrajectoryDrive]
    drives = {each.name: TrajectoryDrive(each, HEIGHT_M) for each in recording.drives}
    for at, (lead, host) in enumerate(pairwise(drives)):
        near = {name: drives[name] for name in list(drives)[max(at - 1, 0) : at + 2]}
        car = _Follower(near, (lead, host), settings, case.profile, rng)
        warned, exact = car.drive(recording.end_s)
        row.hours += recording.end_s / 3600.0
        true = sum(any(abs(at_s - it_s) <= SAME_S for it_s in exact) for at_s in warned)
        row.true += true
        row.false += len(warned) - true
    for _ in range(settings.brakings):
        drives = _braking_pair(settings, float(rng.uniform(*settings.gaps_m)))
        car = _Follower(drives, ("lead", "host"), settings, case.profile, rng)
        warned, exact = car.drive(STEADY_S + WATCHED_S)
        row.delays_s.append(_delay_s(warned))
        row.exact_s.append(_delay_s(exact))
    return row


def _delay_s(warned_s: Iterable[float]) -> float | None:
    """From the braking to the first warning after it."""
    after = [at_s for at_s in warned_s if at_s >= STEADY_S]
    return round(after[0] - STEADY_S, 3) if after else None


def table(settings: FollowingSettings, rows: Sequence[FollowingRow]) -> list[FollowingLine]:
    """A line for each profile."""
    return [
        _pooled(profile, [row for row in rows if row.profile == profile])
        for profile in settings.profiles
    ]


def _pooled(profile: str, rows: list[FollowingRow]) -> FollowingLine:
    hours, false = sum(row.hours for row in rows), sum(row.false for row in rows)
    at_most = float(chi2.ppf(0.95, 2 * false + 2)) / 2.0
    delays_s = [_or_never(delay_s) for row in rows for delay_s in row.delays_s]
    exact_s = [_or_never(delay_s) for row in rows for delay_s in row.exact_s]
    median_s, late_s = np.percentile(delays_s or [math.nan], [50.0, 95.0], method="lower").tolist()
    return FollowingLine(
        profile=profile,
        hours=hours,
        false=false,
        per_10_h=10.0 * false / hours,
        per_10_h_at_most=10.0 * at_most / hours,
        true=sum(row.true for row in rows),
        brakings=len(delays_s),
        warned=sum(map(math.isfinite, delays_s)),
        delay_median_s=median_s,
        delay_95_percent_s=late_s,
        exact_median_s=float(np.median(exact_s or [math.nan])),
    )


def _or_never(delay_s: float | None) -> float:
    return math.inf if delay_s is None else delay_s


def summary(results: Results[FollowingSettings, FollowingRow, FollowingLine]) -> str:
    """False alarms and delay of each profile."""
    return "; ".join(
        f"{line.profile}: {line.false} false in {line.hours:.1f} h, {line.delay_median_s:.2f} s"
        f" (95 %: {line.delay_95_percent_s:.2f} s)"
        for line in results.table
    )


def _braking_pair(settings: FollowingSettings, gap_m: float) -> Mapping[str, TrajectoryDrive]:
    """A vehicle that brakes after `STEADY_S`, and one that follows and does not."""
    at_s = np.arange(0.0, STEADY_S + WATCHED_S + STEP_S, STEP_S)
    steady = np.full(len(at_s), settings.speed_m_s)
    braked_s = np.maximum(at_s - STEADY_S, 0.0)
    braking = np.maximum(settings.speed_m_s - settings.braking_m_s2 * braked_s, 0.0)
    drives = {}
    for name, speed_m_s, begin_m in (("lead", braking, gap_m + LENGTH_M), ("host", steady, 0.0)):
        steps_m = (speed_m_s[1:] + speed_m_s[:-1]) / 2.0 * STEP_S
        x_m = begin_m + np.concatenate([[0.0], np.cumsum(steps_m)])
        middle_m = np.stack([x_m, np.zeros(len(at_s))], axis=1)
        straight = np.zeros(len(at_s))
        trajectory = Trajectory(name, 0, middle_m, straight, speed_m_s, LENGTH_M, WIDTH_M)
        drives[name] = TrajectoryDrive(trajectory, HEIGHT_M)
    return drives


class _Follower:
    """A host vehicle with a receiver and a detector; beside it, one that knows its lead exactly."""

    def __init__(
        self,
        drives: Mapping[str, TrajectoryDrive],
        pair: tuple[str, str],
        settings: FollowingSettings,
        profile: str,
        rng: np.random.Generator,
    ) -> None:
        lead, host = pair
        self._lead = drives[lead]
        self._car = car = WiredVehicle(
            host,
            drives,
            SENSOR_PROFILES[profile],
            rng,
            receivers=settings.receivers,
            risk=settings.risk,
        )
        self._lead_at = car.assesses_at
        self._exact = vehicle(host, settings.risk, {Sensor.CAMERA}, self._lead_at, car.rng)

    def drive(self, until_s: float) -> tuple[list[float], list[float]]:
        """Return when the vehicle warns, and when the one with exact data does."""
        warned: list[float] = []
        exact: list[float] = []
        while (now := min(self._car.get_timer(), self._lead_at)) < until_s:
            speed = self._car.read_wires(now)
            if speed is not None:
                self._exact.receive_observation(speed, now)
            if now >= self._lead_at:
                self._lead_at += EVERY_S
                self._exact.receive_observation(self._exact_lead(now), now)
            warned += _warned_s(self._car.vehicle, now)
            exact += _warned_s(self._exact, now)
        return warned, exact

    def _exact_lead(self, now: float) -> Lead:
        host, lead = self._car.drive.state(now), self._lead.state(now)
        gap_m = lead.x_m - host.x_m - (lead.length_m + host.length_m) / 2.0
        return Lead(
            now,
            LeadIdentity.UNKNOWN,
            gap_m=gap_m,
            closing_speed_m_s=host.speed_m_s - lead.speed_m_s,
        )


def _warned_s(of: Vehicle, now: float) -> list[float]:
    return [alarm.stamp_s for alarm in warnings(of, now) if alarm.cause == FCW]


STUDY = Study(
    name="following-alarms",
    sentence="How often FCW warns falsely in recorded platoons, and how late behind who brakes.",
    settings=FollowingSettings,
    needs="no recordings; name them with --files '[FILE.csv, ...]'",
    prepare=checked,
    axes=axes,
    case=FollowingCase,
    run=run,
    row=FollowingRow,
    table=table,
    line=FollowingLine,
    summary=summary,
)
