"""FCW behind vehicles without radio, by sensor profile: false alarms, and delay after braking.

The car's own cores, from the wires on (NMEA, the detector's JSON, whole km/h), with the rig's
errors. False alarms are counted on recorded platoons, of which every follower is the host vehicle
in turn, behind two others; a warning is false unless exact gaps and speeds raise one within
`SAME_S`. The delay is measured behind a vehicle that brakes from a constant speed; the host vehicle
does not react.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scipy.stats import chi2

from onboard.detector.object_list import ObjectListReader
from onboard.errors import UserError
from onboard.gnss.nmea import NmeaReader
from onboard.gnss.settings import GnssSettings
from onboard.kinematics.units import KM_H
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import DetectionList, Lead, LeadIdentity, Position, Speed
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.cars.vehicle_camera import VehicleCamera
from sim_rig.cars.vehicle_detector import ExternalDetector
from sim_rig.roads.recording import STEP_S, Trajectory
from sim_rig.roads.road import CarState
from sim_rig.roads.trace_files import read_trace
from sim_rig.roads.trajectory_drive import TrajectoryDrive
from sim_rig.scenario.sensor_settings import SENSOR_PROFILES, ReceiverSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.results import write_results

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
COLUMNS = (
    "profile", "hours", "false", "per_10_h", "per_10_h_at_most", "true", "brakings", "warned",
    "delay_median_s", "delay_95_percent_s", "exact_median_s",
)  # fmt: skip


class FollowingSettings(Settings):
    """One campaign; a run is one recording with one seed and one profile, and some brakings."""

    files: tuple[Path, ...] = Field(min_length=1)
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


def run(out_dir: Path, settings: FollowingSettings | None, workers: Workers) -> str:
    """Run the campaign and write its table.

    Args:
        out_dir: folder of table, settings and runs.
        settings: recordings, seeds and profiles.
        workers: processes or cluster.

    Returns:
        A summary.

    Raises:
        UserError: no recording is named, or no sensor profile has a name.
    """
    if settings is None:
        raise UserError("no recordings; name them with --files '[FILE.csv, ...]'")
    unknown = set(settings.profiles) - set(SENSOR_PROFILES)
    if unknown:
        raise UserError(f"profiles: {sorted(unknown)}; allowed: {', '.join(SENSOR_PROFILES)}")
    numbers = range(len(settings.files) * len(settings.seeds) * len(settings.profiles))
    rows = run_campaign(run_one, settings, numbers, out_dir / "runs", workers)
    table = [
        _pooled(profile, [row for row in rows if row["profile"] == profile])
        for profile in settings.profiles
    ]
    write_results(out_dir, COLUMNS, table, settings)
    return "; ".join(
        f"{profile}: {false} false in {hours:.1f} h, {delay_s:.2f} s (95 %: {late_s:.2f} s)"
        for profile, hours, false, _, _, _, _, _, delay_s, late_s, _ in table
    )


def run_one(settings: FollowingSettings, number: int) -> Row:
    """Follow in one recording, and behind some vehicles that brake."""
    cases = list(product(settings.files, settings.seeds, settings.profiles))
    file, seed, profile = cases[number]
    rng = np.random.default_rng((seed, number))
    row: Row = {"profile": profile, "hours": 0.0, "false": 0, "true": 0}
    recording = read_trace(file)
    drives: Mapping[str, TrajectoryDrive]
    drives = {each.name: TrajectoryDrive(each, HEIGHT_M) for each in recording.drives}
    for at, (lead, host) in enumerate(pairwise(drives)):
        near = {name: drives[name] for name in list(drives)[max(at - 1, 0) : at + 2]}
        car = _Follower(near, (lead, host), settings, profile, rng)
        warned, exact = car.drive(recording.end_s)
        row["hours"] += recording.end_s / 3600.0
        true = sum(any(abs(at_s - it_s) <= SAME_S for it_s in exact) for at_s in warned)
        row["true"] += true
        row["false"] += len(warned) - true
    row["delays_s"], row["exact_s"] = [], []
    for _ in range(settings.brakings):
        drives = _braking_pair(settings, float(rng.uniform(*settings.gaps_m)))
        car = _Follower(drives, ("lead", "host"), settings, profile, rng)
        for name, at_s in zip(
            ("delays_s", "exact_s"), car.drive(STEADY_S + WATCHED_S), strict=True
        ):
            after = [each for each in at_s if each >= STEADY_S]
            row[name].append(round(after[0] - STEADY_S, 3) if after else None)
    return row


def _pooled(profile: str, rows: list[Row]) -> tuple[Any, ...]:
    """Return one line of the table, with the bound of 95 % confidence."""
    hours, false, true = (sum(row[name] for row in rows) for name in ("hours", "false", "true"))
    at_most = float(chi2.ppf(0.95, 2 * false + 2)) / 2.0
    delays_s, exact_s = (
        [math.inf if each is None else each for row in rows for each in row[name]]
        for name in ("delays_s", "exact_s")
    )
    median_s, late_s = np.percentile(delays_s or [math.nan], [50.0, 95.0], method="lower").tolist()
    return (
        profile, hours, false, 10.0 * false / hours, 10.0 * at_most / hours, true, len(delays_s),
        sum(map(math.isfinite, delays_s)), median_s, late_s,
        float(np.median(exact_s or [math.nan])),
    )  # fmt: skip


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
    """A host vehicle with a receiver and a detector; beside it, a monitor with exact data."""

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
        own_rng, sky_rng, camera_rng, mvs_rng = rng.spawn(4)
        phases_s = rng.uniform(0.0, EVERY_S, 3)
        self._receiver = GnssReceiver(
            settings.receivers, self._host.state, START_UTC_S, own_rng, sky_rng
        )
        camera = VehicleCamera(SENSOR_PROFILES[profile], host, self._cars_at, camera_rng)
        self._detector = ExternalDetector(camera, phase_s=float(phases_s[0]))
        self._nmea = NmeaReader(GnssSettings(latency_s=settings.receivers.latency_s))
        self._objects = ObjectListReader()
        sensing = SensingSettings(camera_ahead_m=LENGTH_M / 2.0)
        self._mvs = MultiVehicleSensing(MvsSettings(sensing=sensing), b"host", mvs_rng, START_UTC_S)
        self._monitor, self._exact = (
            RiskMonitor(settings.risk, LENGTH_M, WIDTH_M) for _ in range(2)
        )
        self._speed_at, self._assess_at = float(phases_s[1]), float(phases_s[2])

    def drive(self, until_s: float) -> tuple[list[float], list[float]]:
        """Return when the monitor warns, and when the one with exact data does."""
        warned: list[float] = []
        exact: list[float] = []
        while (now := self._next_at) < until_s:
            self._read_wires(now)
            if now >= self._speed_at:
                self._speed_at += EVERY_S
                self._receive_speed(now)
            if now >= self._assess_at:
                self._assess_at += EVERY_S
                self._mvs.update(now)
                own, objects = self._mvs.host_vehicle(now), self._mvs.kinematic_info(now)
                self._monitor.assess(own, objects, now)
                self._exact.receive_lead(self._exact_lead(now), now)
            warned += _warnings(self._monitor)
            exact += _warnings(self._exact)
        return warned, exact

    @property
    def _next_at(self) -> float:
        devices_at = self._receiver.get_timer(), self._detector.get_timer()
        return min(*devices_at, self._speed_at, self._assess_at)

    def _read_wires(self, now: float) -> None:
        if data := self._receiver.bytes_to_send(now):
            self._nmea.receive_bytes(data, now)
        if data := self._detector.bytes_to_send(now):
            self._objects.receive_bytes(data, now)
        for event in (*iter(self._nmea.next_event, None), *iter(self._objects.next_event, None)):
            if isinstance(event, Position):
                self._mvs.receive_position(event)
                self._monitor.receive_position(event)
            elif isinstance(event, DetectionList):
                for detection in event.cars:
                    self._mvs.receive_detection(detection)

    def _receive_speed(self, now: float) -> None:
        at_s = now - SPEED_AGE_S
        speed_m_s = self._host.state(at_s).speed_m_s
        whole_m_s = math.floor(speed_m_s / KM_H) * KM_H
        self._monitor.receive_speed(Speed(at_s, whole_m_s, KM_H, "obd:7E8"))
        self._exact.receive_speed(Speed(at_s, speed_m_s, KM_H, "obd:7E8"))

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


def _warnings(monitor: RiskMonitor) -> Iterator[float]:
    for event in iter(monitor.next_event, None):
        if isinstance(event, Alarm) and event.cause is Cause.FCW and event.level is Level.WARNING:
            yield event.stamp_s
