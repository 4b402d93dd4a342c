"""Pedestrians with a radio: what their devices send, and mistakes of scenarios with them."""

from pathlib import Path

import numpy as np
import pytest

from onboard.its_g5.road_users import bsm_of_vam
from onboard.messages import psm, vam
from onboard.messages.bsm_core import CoreData
from onboard.messages.psm_as_bsm import bsm_of_psm
from onboard.security import ieee1609dot2, p256
from onboard.security.security_services import SecurityServices
from onboard.settings import SettingsError
from onboard.tools.test_ca.authority import make_trial
from onboard.vehicle.framing import WaveFraming
from onboard.vehicle.its_g5_framing import ItsG5Framing
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile
from sim_rig.road_side.open_channel import open_channel, other_stations
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.earth import ORIGIN
from sim_rig.scenario.catalogue import SCENARIOS
from sim_rig.scenario.schema import load_scenario

UTC_S = 1_790_000_000.0


@pytest.mark.parametrize("profile", RadioProfile)
def test_a_device_sends_place_and_motion_ten_times_a_second(profile: RadioProfile) -> None:
    scenario = load_scenario("pedestrian", profile)
    trial = make_trial(
        scenario.equipped,
        scenario.psids,
        UTC_S,
        p256.key_from(np.random.default_rng(1)),
        others=other_stations(scenario),
    )
    air = open_channel(
        scenario,
        BreakpointRoad(scenario).cars_at,
        lambda now: now,
        np.random.default_rng(1),
        now=0.0,
        utc_s=UTC_S,
        credentials=trial,
    )
    is_its = profile is RadioProfile.ITS_G5
    framing = ItsG5Framing(psid.LCCA, lambda: None) if is_its else WaveFraming()
    service = psid.VAM if is_its else psid.PSM
    security = SecurityServices(UTC_S, trial["ann"])
    said: list[CoreData] = []
    while (at := air.get_timer()) < 8.0:
        for each in air.wsms_to_deliver(at):
            if each.receiver != "ann":
                continue
            frame = framing.read(each.wsm)
            assert (each.sender, frame.psid) == ("pia", service)
            assert ieee1609dot2.is_signed(frame.payload)
            opened = security.open(frame.payload, service, at)
            data = framing.payload_in(opened.payload, at)
            bsm = (
                bsm_of_vam(vam.decode(data), UTC_S + at) if is_its else bsm_of_psm(psm.decode(data))
            )
            said.append(bsm.core)

    assert len(said) == pytest.approx(80, abs=1)
    last = said[-1]
    assert last.latitude_deg is not None
    assert last.longitude_deg is not None
    east_m, north_m = ORIGIN.position_m(last.latitude_deg, last.longitude_deg)
    assert east_m == pytest.approx(180.0, abs=0.1)
    assert north_m == pytest.approx(-3.2, abs=0.2)
    assert last.speed_m_s == pytest.approx(1.4, abs=0.02)
    assert last.heading_rad == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("change", "mistake"),
    [
        (("pia:", "ann:"), "pedestrians.ann: is the name of a car"),
        (("road: footpath", "road: nowhere"), "pedestrians.pia.road: no such road"),
        (("{reach_m: 300.0}", "{neighbours: {ann: [ben]}}"), "pedestrians need reach_m"),
    ],
)
def test_a_mistake_names_the_field(tmp_path: Path, change: tuple[str, str], mistake: str) -> None:
    text = (SCENARIOS / "pedestrian.yaml").read_text("utf-8")
    file = tmp_path / "mistaken.yaml"
    file.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(SettingsError, match=mistake):
        load_scenario(str(file))
