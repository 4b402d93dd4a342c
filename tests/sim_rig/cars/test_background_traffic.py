"""Background traffic: cars that only send BSMs."""

import math
from collections import Counter

import numpy as np

from onboard.wave_udp import psid
from onboard.wave_udp.wsmp import decode
from sim_rig.cars.background_traffic import BackgroundTraffic, background_names
from sim_rig.radio.air import Delivery
from sim_rig.radio.models import open_air
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.schema import Scenario, load_scenario


def background(count: int) -> tuple[BackgroundTraffic, Scenario]:
    scenario = load_scenario("unsafe-driver").model_copy(update={"background_traffic": count})
    road = BreakpointRoad(scenario)
    air = open_air(scenario.radio, road.cars_at, scenario.equipped, np.random.default_rng(1))
    return BackgroundTraffic(
        air, scenario, now=0.0, utc_s=1_750_000_000.0, credentials={}
    ), scenario


def test_every_background_car_is_received_by_all_twice_a_second() -> None:
    air, scenario = background(5)
    heard: Counter[tuple[str, str]] = Counter()
    while (at := air.get_timer()) < 4.0:
        for delivery in air.wsms_to_deliver(at):
            assert decode(delivery.wsm).psid == psid.BSM
            heard[delivery.sender, delivery.receiver] += 1

    assert set(heard) == {
        (name, car) for name in background_names(scenario) for car in scenario.equipped
    }
    assert set(heard.values()) <= {6, 7}


def test_without_background_traffic_the_channel_is_unchanged() -> None:
    air, _ = background(0)
    assert air.get_timer() == math.inf
    air.receive_wsm("close", b"\x00" * 50, 5, 1.0)

    delivered: list[Delivery] = []
    assert air.get_timer() < math.inf
    while (at := air.get_timer()) < math.inf:
        delivered = air.wsms_to_deliver(at)
    assert {delivery.receiver for delivery in delivered} <= {"calm", "switched_off"}
