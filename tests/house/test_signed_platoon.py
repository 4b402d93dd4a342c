"""Whole cars that sign: who is believed, and what others read on the air."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from onboard.messages import bsm
from onboard.observations import HardBrake
from onboard.trace import as_record
from onboard.units import KM_H
from onboard.wave_udp.capture import PcapWriter
from tests.house.platoon import SPEED_M_S, Platoon, car
from tests.security.trial import ALICE, BOB, UTC_S


@pytest.fixture
def platoon() -> Platoon:
    """AAA1 leads BBB2, and both have driven for 3 s."""
    cars = {"AAA1": ALICE, "BBB2": BOB}
    driven = Platoon(
        {plate: car(plate, credentials=keys, utc_s=UTC_S) for plate, keys in cars.items()}
    )
    driven.drive(3.0)
    return driven


def reasons(platoon: Platoon, plate: str) -> list[str]:
    return [as_record(event)["reason"] for event in platoon.said(plate, "discarded")]


def test_a_car_that_brakes_warns_the_car_behind_as_soon_as_its_speeds_show_it(
    platoon: Platoon,
) -> None:
    platoon.speed_m_s["AAA1"] = SPEED_M_S - 3 * KM_H
    platoon.drive(0.1)
    brake = HardBrake(platoon.now, 7.0, source="obd")
    platoon.cars["AAA1"].receive_observation(brake, platoon.now)

    platoon.settle()

    assert len(list(platoon.said("BBB2", "warning"))) == 1


def test_a_car_that_claims_a_brake_and_drives_on_is_not_believed(platoon: Platoon) -> None:
    platoon.cars["AAA1"].press_brake_button(platoon.now)
    platoon.drive(1.0)

    assert list(platoon.said("BBB2", "warning")) == []
    assert "implausible_brake" in reasons(platoon, "BBB2")


def test_wireshark_finds_nothing_malformed_in_a_drive(platoon: Platoon, tmp_path: Path) -> None:
    if shutil.which("tshark") is None:
        pytest.skip("tshark is not installed")
    platoon.cars["AAA1"].press_brake_button(platoon.now)
    platoon.drive(0.5)
    capture = tmp_path / "drive.pcap"
    with capture.open("wb") as file:
        writer = PcapWriter(file)
        for wsm in platoon.on_air:
            writer.write(wsm, UTC_S, b"\x02CAR01")

    shown = subprocess.run(
        ["tshark", "-n", "-r", str(capture), "-T", "json", "--no-duplicate-keys"],
        capture_output=True,
        check=True,
        timeout=60,
    ).stdout
    packets = [json.dumps(packet["_source"]["layers"]) for packet in json.loads(shown)]

    assert len(packets) == len(platoon.on_air) > 60
    for packet in packets:
        assert '"wsmp.psid"' in packet
        assert "_ws.malformed" not in packet
        assert "_ws.expert" not in packet
    # Wireshark looks for 1609.2 data under the PSIDs that it knows; the group's is our own.
    bsms = [packet for packet in packets if f'"wsmp.psid": "0x{bsm.PSID:08x}"' in packet]
    assert len(bsms) > 60
    assert all("ieee1609dot2.ecdsaNistP256Signature" in packet for packet in bsms)
