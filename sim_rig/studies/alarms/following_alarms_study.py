"""FCW behind vehicles without radio, by sensor profile: false alarms, and delay after braking.

The car's own `Vehicle`, from the wires on (NMEA, the detector's JSON, whole km/h), with the rig's
errors. False alarms are counted on recorded platoons, of which every follower is the host vehicle
in turn, behind two others; a warning is false unless exact gaps and speeds raise one within
`SAME_S`. The delay is measured behind a vehicle that brakes from a constant speed; the host vehicle
does not react.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import Field
from scipy.stats import chi2

from onboard.detector.object_list import ObjectListReader
from onboard.errors import UserError
from onboard.gnss.nmea import NmeaReader
from onboard.gnss.settings import GnssSettings
from onboard.kinematics.units import KM_H
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import Lead, LeadIdentity, Sensor, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.risk.fcw import FCW
from onboard.risk.settings import RiskSettings
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.settings import PlateDigestSettings
from onboard.settings import Settings
from onboard.step import Observation
from onboard.vehicle.config import CarConfig, CarSettings
from onboard.vehicle.vehicle import Vehicle
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import ExternalDetector
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.roads.road import CarState
from sim_rig.roads.trace_files import read_trace
from sim_rig.roads.trajectory_drive import TrajectoryDrive
from sim_rig.scenario.sensor_settings import SENSOR_PROFILES, ReceiverSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study

START_UTC_S = 1_750_000_000.0
EVERY_S = 0.1
"""Period of the assessment, and of the samples of the host's speed."""
SPEED_AGE_S = 0.05
"""Of a sample of the host's speed."""
SAME_S = 1.0
LENGTH_M, WIDTH_M, HEIGHT_M = 4.5, 1.8, 1.5
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
        self._drives, self._host, self._lead = drives, drives[host], drives[lead]
        own_rng, sky_rng, camera_rng, vehicle_rng = rng.spawn(4)
        phases_s = rng.uniform(0.0, EVERY_S, 3)
        self._receiver = GnssReceiver(
            settings.receivers, self._host.state, START_UTC_S, own_rng, sky_rng
        )
        camera = VehicleCamera(SENSOR_PROFILES[profile], host, self._cars_at, camera_rng)
        self._detector = ExternalDetector(camera, phase_s=float(phases_s[0]))
        self._nmea = NmeaReader(GnssSettings(latency_s=settings.receivers.latency_s))
        self._objects = ObjectListReader()
        self._speed_at, self._lead_at = float(phases_s[1]), float(phases_s[2])
        self._vehicle = _vehicle(
            settings.risk, {Sensor.POSITION, Sensor.DETECTOR}, self._lead_at, vehicle_rng
        )
        self._exact = _vehicle(settings.risk, {Sensor.CAMERA}, self._lead_at, vehicle_rng)

    def drive(self, until_s: float) -> tuple[list[float], list[float]]:
        """Return when the vehicle warns, and when the one with exact data does."""
        warned: list[float] = []
        exact: list[float] = []
        while (now := self._next_at) < until_s:
            self._read_wires(now)
            if now >= self._speed_at:
                self._speed_at += EVERY_S
                self._receive_speed(now)
            if now >= self._lead_at:
                self._lead_at += EVERY_S
                self._exact.receive_observation(self._exact_lead(now), now)
            warned += _warnings(self._vehicle, now)
            exact += _warnings(self._exact, now)
        return warned, exact

    @property
    def _next_at(self) -> float:
        return min(
            self._receiver.get_timer(),
            self._detector.get_timer(),
            self._speed_at,
            self._lead_at,
            self._vehicle.get_timer(),
        )

    def _read_wires(self, now: float) -> None:
        if data := self._receiver.bytes_to_send(now):
            self._nmea.receive_bytes(data, now)
        if data := self._detector.bytes_to_send(now):
            self._objects.receive_bytes(data, now)
        for event in (*iter(self._nmea.next_event, None), *iter(self._objects.next_event, None)):
            if isinstance(event, Observation):
                self._vehicle.receive_observation(event, now)

    def _receive_speed(self, now: float) -> None:
        at_s = now - SPEED_AGE_S
        speed_m_s = self._host.state(at_s).speed_m_s
        whole_m_s = math.floor(speed_m_s / KM_H) * KM_H
        self._vehicle.receive_observation(Speed(at_s, whole_m_s, KM_H, "obd:7E8"), now)
        self._exact.receive_observation(Speed(at_s, speed_m_s, KM_H, "obd:7E8"), now)

    def _exact_lead(self, now: float) -> Lead:
        host, lead = self._host.state(now), self._lead.state(now)
        gap_m = lead.x_m - host.x_m - (lead.length_m + host.length_m) / 2.0
        return Lead(
            now,
            LeadIdentity.UNKNOWN,
            gap_m=gap_m,
            closing_speed_m_s=host.speed_m_s - lead.speed_m_s,
        )

    def _cars_at(self, at_s: float) -> Mapping[str, CarState]:
        return {name: drive.state(at_s) for name, drive in self._drives.items()}


def _vehicle(
    risk: RiskSettings, sensors: Collection[Sensor], now: float, rng: np.random.Generator
) -> Vehicle:
    """Return a vehicle without a radio that is first assessed at `now`."""
    config = CarConfig(
        car=CarSettings(plate="HOST", length_m=LENGTH_M, width_m=WIDTH_M),
        mvs=MvsSettings(sensing=SensingSettings(camera_ahead_m=LENGTH_M / 2.0)),
        risk=risk,
        beacons=False,
    )
    return Vehicle(
        config,
        {Sensor.SPEED, *sensors},
        rng,
        now=now,
        utc_offset_s=START_UTC_S,
        pseudonym=Pseudonym(bytes(8), b"host", 0, None, math.inf),
        digest=PlateDigest(PlateDigestSettings(scrypt_log2_n=1)),  # no plate is read
    )


def _warnings(vehicle: Vehicle, now: float) -> Iterator[float]:
    if vehicle.get_timer() <= now:
        vehicle.handle_timer(now)
    for event in iter(vehicle.next_event, None):
        if isinstance(event, Alarm) and event.cause == FCW and event.level is Level.WARNING:
            yield event.stamp_s


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
