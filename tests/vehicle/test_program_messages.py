"""Why `study attacks` has no row of programs that send through the interface.

Its insiders send what vehicles act upon. No configuration lets a program send in a service of
these messages, and what it sends in another service nobody reads, whatever it contains.
"""

import numpy as np
import pytest

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, PositionalAccuracy, VehicleSize
from onboard.observations import Position, Sensor
from onboard.settings import SettingsError, parse_settings
from onboard.step import ProgramMessage, ReceivedWsm
from onboard.vehicle.config import CarConfig
from onboard.vehicle.its_messages import ItsMessages
from onboard.vehicle.message_set import J2735Messages
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid

UTC_S = 1_790_000_000.0
TIM = 0x83


def config(service: int, profile: str = "wave", **port: int) -> CarConfig:
    tree = {
        "car": {"plate": "AAA1"},
        "radio": {"endpoint": "raw", "interface": "air", "profile": profile},
        "interface": {"sends": [{"psid": service} | port]},
    }
    return parse_settings(tree, CarConfig, "car.yaml")


USED = {*J2735Messages.components, *ItsMessages.components, psid.LCCA, psid.PEER_TO_PEER, psid.CRL}


@pytest.mark.parametrize("service", sorted(USED))
def test_no_program_may_send_in_a_service_that_vehicles_use(service: int) -> None:
    for profile, port in (("wave", {}), ("its-g5", {"btp_port": 2006})):
        with pytest.raises(SettingsError, match=f"psid 0x{service:X} is"):
            config(service, profile, **port)


@pytest.mark.parametrize(("service", "perceived"), [(TIM, []), (psid.BSM, ["66616b65"])])
def test_a_bsm_in_another_service_is_not_read(service: int, perceived: list[str]) -> None:
    """As a BSM the same octets are an object of the receiver."""
    sender, receiver = (
        Stack(
            config(TIM),
            (Sensor.POSITION,),
            np.random.default_rng(seed),
            now=0.0,
            utc_s=UTC_S,
        )
        for seed in (1, 2)
    )
    for now in np.arange(0.1, 1.0, 0.1).tolist():
        invented = CoreData(
            msg_cnt=round(10 * now),
            temporary_id=b"fake",
            sec_mark_s=(UTC_S + now) % 60.0,
            latitude_deg=48.0005,
            longitude_deg=11.0,
            accuracy=PositionalAccuracy(0.5, 0.5, 0.0),
            speed_m_s=0.0,
            heading_rad=0.0,
            size=VehicleSize(1.8, 4.5),
        )
        message = ProgramMessage(now, service, 2, bsm.encode(BasicSafetyMessage(invented)))
        sent = sender.step([message], now).wsms
        fix = Position(now, 48.0, 11.0, 500.0, 0.5, 10.0, 0.0)
        receiver.step([fix, *(ReceivedWsm(now, each.data) for each in sent)], now)
    _, others = receiver.surroundings
    assert [each.name for each in others if each.name == b"fake".hex()] == perceived
