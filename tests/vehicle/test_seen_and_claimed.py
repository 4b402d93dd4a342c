"""What the own sensors see is never explained away by what others claim."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, PositionalAccuracy
from onboard.observations import DetectionList, Position, Speed, VehicleDetection
from onboard.risk.alarm import Alarm, Level
from onboard.risk.ima import IMA
from onboard.security import ieee1609dot2
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

CROSSING = LocalFrame(48.1, 11.5)
SPEED_M_S = 14.0
BEGIN_M, STEPS = 70.0, 45
ELEVATION_M = 500.0

Claim = Callable[[CoreData, int], CoreData | None]
"""What the attacker makes of the true BSM of the vehicle that is seen, by the number of steps."""


def placed(east_m: float, north_m: float) -> tuple[float, float]:
    metres_per_degree = 111_200.0
    latitude = CROSSING.latitude_deg + north_m / metres_per_degree
    longitude = CROSSING.longitude_deg + east_m / (
        metres_per_degree * math.cos(math.radians(CROSSING.latitude_deg))
    )
    return latitude, longitude


def alarms(claim: Claim) -> list[Alarm]:
    """Drive north while a vehicle comes from the right, which the own detector sees."""
    tree = {"car": {"plate": "AAA1"}, "gnss": {}, "detector": {}}
    config = parse_settings(tree, CarConfig, "test")
    stack = Stack(config, config.sensors(), np.random.default_rng(1), now=0.0, utc_s=0.0)
    to_face_m = config.mvs.sensing.face_to_centre_m
    rng = np.random.default_rng(7)
    raised: list[Alarm] = []
    for k in range(STEPS):
        now = k / 10
        left_m = BEGIN_M - SPEED_M_S * now
        fix = Position(now, *placed(0.0, -left_m), ELEVATION_M, 0.5, SPEED_M_S, 0.0)
        range_m = math.sqrt(2.0) * left_m - to_face_m + float(rng.normal(0.0, 0.2))
        seen = VehicleDetection(now, 1, max(range_m, 0.1), 0.3, math.pi / 4, 0.005)
        inputs: list[Input] = [fix, Speed(now, SPEED_M_S, 0.1, "dbc"), DetectionList(now, (seen,))]
        latitude_deg, longitude_deg = placed(left_m, 0.0)
        true = CoreData(
            k % 128,
            b"evil",
            now,
            latitude_deg,
            longitude_deg,
            ELEVATION_M,
            PositionalAccuracy(0.5, 0.5),
            speed_m_s=SPEED_M_S,
            heading_rad=3.0 * math.pi / 2.0,
        )
        claimed = claim(true, k)
        if claimed is not None:
            payload = bsm.encode(BasicSafetyMessage(claimed))
            data = ieee1609dot2.encode_unsecured(payload)
            wsm = wsmp.encode(WaveShortMessage(psid=psid.BSM, payload=data))
            inputs.append(ReceivedWsm(now, wsm))
        outputs = stack.step(inputs, now)
        raised += [event for event in outputs.events if isinstance(event, Alarm)]
    return raised


def first_warning_s(claim: Claim) -> float:
    return min(
        alarm.stamp_s
        for alarm in alarms(claim)
        if alarm.cause == IMA and alarm.level is Level.WARNING
    )


def higher(core: CoreData, _: int) -> CoreData:
    return replace(core, elevation_m=ELEVATION_M + 30.0)


def standing(core: CoreData, _: int) -> CoreData:
    return replace(core, speed_m_s=0.0)


def vague(core: CoreData, _: int) -> CoreData:
    return replace(core, accuracy=PositionalAccuracy(12.7, 12.7))


def sometimes_elsewhere(core: CoreData, k: int) -> CoreData:
    """True in one message of five, else as far off as passes for a jump of the receiver."""
    if k % 5 == 0:
        return core
    assert core.longitude_deg is not None
    return replace(core, longitude_deg=core.longitude_deg + 15.0 / 74_000)


@pytest.mark.long
@pytest.mark.parametrize("claim", [higher, standing, vague, sometimes_elsewhere])
def test_a_bsm_at_the_place_of_a_vehicle_that_is_seen_does_not_hide_it(claim: Claim) -> None:
    assert first_warning_s(claim) <= first_warning_s(lambda _core, _k: None) + 0.35
