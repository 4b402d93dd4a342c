"""Messages for the benchmarks: a BSM with path history, path prediction and MVS footer."""

import math
from dataclasses import replace
from functools import cache

from onboard.messages import mvs_footer
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import AccelerationSet, CoreData, PositionalAccuracy, VehicleSize
from onboard.messages.bsm_safety import (
    PathHistory,
    PathHistoryPoint,
    PathPrediction,
    VehicleSafetyExtensions,
)
from onboard.messages.mvs_footer import MvsFooter, ObserverRun, SharedEstimate, SharedMeasurement

UTC_S = 1_790_000_000.0
OBSERVERS = 4
HISTORY_POINTS = 5
"""Points for some 200 m of road with a bend."""


@cache
def _template(entries: int) -> BasicSafetyMessage:
    history = tuple(
        PathHistoryPoint(
            latitude_offset_deg=-3e-4 * n,
            longitude_offset_deg=2e-4 * n,
            elevation_offset_m=0.5 * n,
            age_s=2.5 * n,
        )
        for n in range(1, HISTORY_POINTS + 1)
    )
    return BasicSafetyMessage(
        core=CoreData(
            msg_cnt=0,
            temporary_id=bytes(4),
            latitude_deg=25.0330,
            longitude_deg=121.5654,
            elevation_m=12.0,
            accuracy=PositionalAccuracy(1.5, 1.5, 0.0),
            speed_m_s=13.9,
            heading_rad=0.3,
            acceleration=AccelerationSet(-0.4, 0.1, 0.0, 0.02),
            size=VehicleSize(1.8, 4.5),
        ),
        safety=VehicleSafetyExtensions(
            path_history=PathHistory(None, None, history),
            path_prediction=PathPrediction(None, 0.5),
        ),
        footer=mvs_footer.encode(footer(entries)) if entries else None,
    )


def bsm(entries: int, car: int, count: int) -> BasicSafetyMessage:
    """A BSM.

    Args:
        entries: number of entries in its footer.
        car: number of the sender.
        count: number of the message.
    """
    template = _template(entries)
    core = replace(
        template.core,
        msg_cnt=count % 128,
        temporary_id=car.to_bytes(4),
        sec_mark_s=count * 0.1 % 60.0,
        heading_rad=car * 0.1 % math.tau,
    )
    return replace(template, core=core)


def footer(entries: int) -> MvsFooter:
    """A footer: half measurements, half estimates from six measurements of two observers."""
    state = mvs_footer.SharedState(
        3, 12.5, -40.0, 3.0, 13.0, 0.6, 0.9, 0.4, 0.5, 0.1, 0.2, 0.0, 0.0, 0.3, -0.1, runs=2
    )
    estimates = entries // 2
    return MvsFooter(
        reference_ms=round(UTC_S * 1000),
        latitude_deg=25.0330,
        longitude_deg=121.5654,
        observers=tuple(n.to_bytes(4) for n in range(OBSERVERS)),
        measurements=tuple(
            SharedMeasurement(n % OBSERVERS, n, 10 * n, 0, 5.0 * n, 30.0, 0.5, 0.5, 0.1)
            for n in range(entries - estimates)
        ),
        estimates=tuple(
            SharedEstimate(
                state,
                (
                    ObserverRun(n % OBSERVERS, (10, 110, 210)),
                    ObserverRun((n + 1) % OBSERVERS, (20, 120, 220)),
                ),
            )
            for n in range(estimates)
        ),
    )
