"""How long before the contact the public test procedures are warned of, by sensor profile.

The car's own `Vehicle`, from the wires on, with the rig's errors. With the profile `bsm` it has no
sensor but its receiver, and the other car sends BSMs; with the others, the other car has no radio.
The host's bus has the yaw rate that every BSM carries.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydantic import Field

from onboard.errors import UserError
from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.observations import TurnSignal
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.roads.trajectory_drive import TrajectoryDrive
from sim_rig.scenario.sensor_settings import SENSOR_PROFILES, ReceiverSettings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.alarms.procedures import HOST, OTHER, PROCEDURES, Procedure, ProcedureName
from sim_rig.studies.alarms.wired_vehicle import HEIGHT_M, WiredVehicle, warnings
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study

BSM = "bsm"
"""Profile of a host that only hears the other car."""
_CASES = {f"{each.group}, {each.case}": each for group in PROCEDURES.values() for each in group}


class ProceduresSettings(Settings):
    """One campaign."""

    seed: int = Field(1, ge=0)
    """Of all draws, together with the number of the run."""
    runs: int = Field(3, ge=1)
    """Of each case with each profile, with other errors."""
    procedures: Several[ProcedureName] = tuple(ProcedureName)
    """Groups of cases."""
    profiles: Several[str] = (
        BSM,
        "radar-150",
        "corner-radar-80",
        "lidar-120",
        "plate-camera",
    )
    """Sensors of the host vehicle: `bsm`, or the name of a profile."""
    receivers: ReceiverSettings = ReceiverSettings()
    """Errors of the GNSS receivers."""
    risk: RiskSettings = RiskSettings()
    """Thresholds of the alarms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcedureCase(Case):
    """One case with one profile."""

    case: str
    profile: str


@dataclass(frozen=True, slots=True)
class ProcedureRow:
    """One run."""

    case: str
    profile: str
    asked_s: float
    lead_s: float | None
    """From the first warning to the contact; `None` without one."""
    cause: str
    """Of the warning; empty without one."""


@dataclass(frozen=True, slots=True)
class ProcedureLine:
    """One line of the table: a case with a profile."""

    procedure: str
    case: str
    profile: str
    asked_s: float
    lead_median_s: float
    """0 for a run without a warning."""
    lead_least_s: float
    cause: str
    runs: int
    passed: int


def checked(settings: ProceduresSettings) -> ProceduresSettings:
    """The settings, if all profiles exist."""
    unknown = set(settings.profiles) - {BSM, *SENSOR_PROFILES}
    if unknown:
        allowed = ", ".join((BSM, *SENSOR_PROFILES))
        raise UserError(f"profiles: {sorted(unknown)}; allowed: {allowed}")
    return settings


def axes(settings: ProceduresSettings) -> Axes:
    """Every case with every profile."""
    names = [name for name, each in _CASES.items() if each.group in settings.procedures]
    return {"case": names, "profile": settings.profiles}


def run(settings: ProceduresSettings, case: ProcedureCase) -> ProcedureRow:
    """Drive one case until the contact."""
    rng = np.random.default_rng((settings.seed, case.number))
    procedure = _CASES[case.case]
    contact_s = procedure.contact_s
    lead_s, cause = _first_warning(procedure, contact_s, settings, case.profile, rng)
    return ProcedureRow(case.case, case.profile, round(procedure.asked_s, 2), lead_s, cause)


def _first_warning(
    procedure: Procedure,
    contact_s: float,
    settings: ProceduresSettings,
    profile: str,
    rng: np.random.Generator,
) -> tuple[float | None, str]:
    drives = {
        HOST: TrajectoryDrive(procedure.host.trajectory(HOST), HEIGHT_M),
        OTHER: TrajectoryDrive(procedure.other.trajectory(OTHER), HEIGHT_M),
    }
    detector = SENSOR_PROFILES.get(profile)
    wired = partial(
        WiredVehicle,
        drives=drives,
        rng=rng,
        receivers=settings.receivers,
        risk=settings.risk,
        sky_seed=int(rng.integers(2**32)),
    )
    host = wired(HOST, detector=detector, has_yaw_rate=True)
    other = wired(OTHER, detector=None, beacons=profile == BSM)
    while (now := min(host.get_timer(), other.get_timer())) < contact_s:
        for car in (host, other):
            sampled = car.read_wires(now) is not None
            if sampled and car is host and procedure.signals_left:
                signal = TurnSignal(now, "left", is_on=True, source="can")
                host.vehicle.receive_observation(signal, now)
            for alarm in warnings(car.vehicle, now):
                if car is host:
                    return round(contact_s - alarm.stamp_s, 2), str(alarm.cause)
        for message in other.vehicle.messages_to_send(now):
            if isinstance(message, BasicSafetyMessage):
                host.vehicle.receive_message(bsm.decode(bsm.encode(message)), None, now, now)
    return None, ""


def table(settings: ProceduresSettings, rows: Sequence[ProcedureRow]) -> list[ProcedureLine]:
    """A line for each case with each profile."""
    found: dict[tuple[str, str], list[ProcedureRow]] = {}
    for row in rows:
        found.setdefault((row.case, row.profile), []).append(row)
    return [
        _pooled(_CASES[name], profile, found[name, profile])
        for name in axes(settings)["case"]
        for profile in settings.profiles
    ]


def _pooled(procedure: Procedure, profile: str, rows: list[ProcedureRow]) -> ProcedureLine:
    leads_s = [row.lead_s or 0.0 for row in rows]
    causes = sorted({row.cause for row in rows if row.cause})
    return ProcedureLine(
        procedure=procedure.group.value,
        case=procedure.case,
        profile=profile,
        asked_s=rows[0].asked_s,
        lead_median_s=float(np.median(leads_s)),
        lead_least_s=min(leads_s),
        cause=" ".join(causes),
        runs=len(rows),
        passed=sum(row.lead_s is not None and row.lead_s >= row.asked_s for row in rows),
    )


def summary(results: Results[ProceduresSettings, ProcedureRow, ProcedureLine]) -> str:
    """Cases that pass in every run, by procedure and profile."""
    parts = []
    for name in results.settings.procedures:
        for profile in results.settings.profiles:
            lines = [
                line
                for line in results.table
                if (line.procedure, line.profile) == (name.value, profile)
            ]
            passed = sum(line.passed == line.runs for line in lines)
            least_s = min((line.lead_least_s for line in lines), default=math.nan)
            parts.append(f"{name}, {profile}: {passed} of {len(lines)}, least {least_s:.2f} s")
    return "; ".join(parts)


STUDY = Study(
    name="procedures",
    sentence="How long before the contact the cases of public test procedures are warned of.",
    settings=ProceduresSettings,
    prepare=checked,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=ProcedureCase,
    run=run,
    row=ProcedureRow,
    table=table,
    line=ProcedureLine,
    summary=summary,
)
