"""Lead time of IMA alarms at crossings, missed alarms and false alarms.

In the first part, the risk monitor evaluates approaches to Joerer's crossing, with the rig's GNSS
errors and ten BSMs a second: crashes give lead times and misses, other approaches false alarms. The
second part runs the rig's scenarios of two crossing cars in virtual time with many seeds, through
the whole stack from NMEA sentences and frames to alarms.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydantic import Field

from onboard.mvs.perceived_object import ObjectSource, PerceivedObject
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.settings import Settings
from sim_rig.run_log.ground_truth import touch_s
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from sim_rig.scenario.sensor_settings import ReceiverSettings
from sim_rig.studies.joerer_traffic import (
    Approaches,
    ApproachOutcome,
    TrafficSettings,
    simulate_approaches,
)
from sim_rig.studies.results import write_results

EVERY_S = 0.1
LATE_S = 0.15
"""Mean age of a BSM's state when it is evaluated."""
PAIRS = (("shared-detection", "v1", "v3"), ("red-light", "ann", "ben"), ("bsm-loss", "ann", "ben"))
"""Scenario, the car whose alarms count, and the car that it collides with."""
_REPORTED_SPEED_SIGMA_M_S = 0.5
_COLUMNS = ("traffic", "n", "missed", "lead_median_s", "lead_5_percent_s", "false_alarms", "hours")


class AlarmSettings(Settings):
    """Amount of driving, and properties of traffic, receivers and monitor."""

    seed: int = Field(1, ge=0)
    approaches: int = Field(1000, ge=10)
    seeds: int = Field(10, ge=1)
    """Runs of each scenario."""
    traffic: TrafficSettings = TrafficSettings()
    receivers: ReceiverSettings = ReceiverSettings()
    risk: RiskSettings = RiskSettings()


def run(out_dir: Path, settings: AlarmSettings | None = None) -> str:
    """Write the table and the settings to `out_dir`; returns a summary."""
    settings = settings or AlarmSettings()
    rows = [*_of_approaches(settings), *_of_scenarios(settings)]
    write_results(out_dir, _COLUMNS, rows, settings)
    return "; ".join(
        f"{name}: {n - missed} of {n} warned, {median:.2f} s ahead, {false} false in {hours:.1f} h"
        for name, n, missed, median, _, false, hours in rows
    )


_Row = tuple[str, int, int, float, float, int, float]


def _of_approaches(settings: AlarmSettings) -> Iterator[_Row]:
    traffic = settings.traffic.model_copy(update={"approaches": settings.approaches})
    rng = np.random.default_rng(settings.seed)
    approaches = simulate_approaches(traffic, rng)
    warned_s = np.array(
        [_warned_s(approaches, n, settings, rng) for n in range(settings.approaches)]
    )
    crash = approaches.outcome == ApproachOutcome.CRASH
    lead_s = (approaches.end_s - warned_s)[crash & np.isfinite(warned_s)]
    harmless = approaches.outcome == ApproachOutcome.NO_CRASH
    yield (
        "approaches",
        int(crash.sum()),
        int(np.sum(crash & ~np.isfinite(warned_s))),
        *_median_and_5_percent(lead_s.tolist()),
        int(np.sum(harmless & np.isfinite(warned_s))),
        float(approaches.end_s[harmless].sum()) / 3600.0,
    )


def _warned_s(
    approaches: Approaches, n: int, settings: AlarmSettings, rng: np.random.Generator
) -> float:
    """When IMA first warns the first car of the second; infinite without a warning."""
    monitor = RiskMonitor(settings.risk, settings.traffic.length_m, settings.traffic.width_m)
    own_share = math.sqrt(1.0 - settings.receivers.bias_shared)
    bias_m = own_share * settings.receivers.bias_sigma_m * rng.standard_normal((2, 2))
    step = round(EVERY_S / approaches.tick_s)
    for tick in range(0, int(approaches.end_s[n] / approaches.tick_s), step):
        now = tick * approaches.tick_s
        own, other = (
            _perceived_object(approaches, (n, tick, car), bias_m[car], settings.receivers, rng)
            for car in (0, 1)
        )
        monitor.assess(own, [other], now)
        while (event := monitor.next_event()) is not None:
            if (
                isinstance(event, Alarm)
                and event.cause is Cause.IMA
                and event.level is Level.WARNING
            ):
                return now
    return math.inf


def _perceived_object(
    approaches: Approaches,
    at: tuple[int, int, int],
    bias_m: np.ndarray,
    receivers: ReceiverSettings,
    rng: np.random.Generator,
) -> PerceivedObject:
    """A car as its receiver or its BSM reports it: the first drives east, the second north."""
    n, tick, car = at
    age_s = LATE_S if car else LATE_S / 2
    before = max(tick - round(age_s / approaches.tick_s), 0)
    speed_m_s = float(approaches.speed_m_s[n, before, car])
    along_m = -float(approaches.distance_m[n, before, car]) + speed_m_s * age_s
    position_m = (0.0, along_m) if car else (along_m, 0.0)
    velocity = (0.0, speed_m_s) if car else (speed_m_s, 0.0)
    noise = rng.standard_normal(4) * np.repeat(
        [receivers.noise_sigma_m, receivers.speed_sigma_m_s], 2
    )
    state = np.array([*position_m, *velocity]) + noise + np.array([*bias_m, 0.0, 0.0])
    sigma_m = math.hypot(receivers.bias_sigma_m, receivers.noise_sigma_m)
    variances = np.repeat([sigma_m**2, _REPORTED_SPEED_SIGMA_M_S**2], 2)
    return PerceivedObject(
        stamp_s=tick * approaches.tick_s,
        name="other" if car else "own",
        source=ObjectSource.BSM if car else ObjectSource.HOST,
        state=tuple(state.tolist()),
        covariance=tuple(map(tuple, np.diag(variances).tolist())),
        age_s=age_s,
        provenance=frozenset(),
        acceleration_m_s2=float(approaches.acceleration_m_s2[n, before, car]) if car else None,
    )


def _of_scenarios(settings: AlarmSettings) -> Iterator[_Row]:
    for name, car, other in PAIRS:
        scenario = load_scenario(name)
        lead_s: list[float] = []
        false = 0
        for number in range(settings.seeds):
            log = run_virtual(scenario, settings.seed + number)
            warnings = log.of(car, "alarm", cause=Cause.IMA.value, level=Level.WARNING.value)
            first = next(warnings, None)
            contact_s = touch_s(log, car, other)
            if first is not None and contact_s is not None:
                lead_s.append(contact_s - log.at_s(first))
            false += sum(1 for _ in log.of(car, "alarm", 0.0, 3.0))
        hours = settings.seeds * scenario.duration_s / 3600.0
        missed = settings.seeds - len(lead_s)
        yield (name, settings.seeds, missed, *_median_and_5_percent(lead_s), false, hours)


def _median_and_5_percent(lead_s: list[float]) -> tuple[float, float]:
    if not lead_s:
        return math.nan, math.nan
    median, low = np.percentile(lead_s, [50.0, 5.0])
    return float(median), float(low)
