"""Alarms that rest on the SDSMs of one signer about vehicles that own sensors never see."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import sdsm
from onboard.messages.sdsm import EquipmentType
from onboard.misbehaviour.signer_credibility import MOST_ALARMS
from onboard.mvs.sdsm_coding import MeasuredObject, Sender, message_of
from onboard.security import p256
from onboard.tools.test_ca.authority import make_trial
from onboard.tracking.evidence import Measurement, measurement_id
from onboard.wave_udp import psid
from sim_rig.studies.attacks.attack_world import (
    PLACE_SIGMA_M,
    SPEED_M_S,
    AttackedHost,
    Signer,
    placed,
)
from sim_rig.studies.attacks.attacks import PASS_S
from tests.security.trial import UTC_S

TRIAL = make_trial(
    ["host", "vehicle"],
    psid.OF_VEHICLES,
    UTC_S,
    p256.key_from(np.random.default_rng(30)),
    others={"unit": psid.OF_ROAD_SIDE_UNITS},
)
CROSSINGS = 5


def crossings_that_alarm(sender: str, crossings: int) -> int:
    """At each crossing one vehicle without radio; `sender` says so as road-side units there do."""
    host, signer = AttackedHost(TRIAL["host"], UTC_S), Signer(TRIAL[sender], UTC_S)

    def report(now: float) -> Iterator[bytes]:
        number, into_s = divmod(now, PASS_S)
        ahead_m = SPEED_M_S * (PASS_S - into_s)
        frame = LocalFrame(*placed(ahead_m, host.north_m + ahead_m))
        now_ms = round((UTC_S + now) * 1000)
        name = b"u" + int(number).to_bytes(3)
        place = Measurement(measurement_id(name, now_ms), np.zeros(2), PLACE_SIGMA_M**2 * np.eye(2))
        measured = MeasuredObject(int(number), place, np.array([-SPEED_M_S, 0.0]), 0.5)
        stands_at = placed(-20.0, (number + 1) * PASS_S * SPEED_M_S)
        unit = Sender(name, LocalFrame(*stands_at), 0.1)
        message = message_of([measured], unit, now_ms, frame, round(10.0 * now) % 128)
        yield signer.signed(
            sdsm.encode(replace(message, equipment=EquipmentType.RSU)), psid.SENSOR_SHARING, now
        )

    host.drive(crossings * PASS_S, report)
    return len(host.raised())


@pytest.mark.long
def test_a_road_side_unit_is_believed_more_often_than_a_vehicle() -> None:
    assert crossings_that_alarm("unit", CROSSINGS) == CROSSINGS


@pytest.mark.long
def test_a_vehicle_that_says_it_is_a_road_side_unit_is_not() -> None:
    assert crossings_that_alarm("vehicle", CROSSINGS) == MOST_ALARMS
