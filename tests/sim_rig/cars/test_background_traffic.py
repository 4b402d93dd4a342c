"""Background traffic: cars that only send BSMs."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from onboard.messages import bsm
from onboard.security.security_services import SecurityServices
from onboard.wave_udp import psid
from onboard.wave_udp.wsmp import decode
from sim_rig.cars.background_traffic import BackgroundTraffic, background_names
from sim_rig.radio.air import Delivery
from sim_rig.radio.models import open_air
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.earth import ORIGIN
from sim_rig.scenario.background_settings import BackgroundSettings
from sim_rig.scenario.schema import Scenario, load_scenario

UTC_S = 1_750_000_000.0


def background(count: int) -> tuple[BackgroundTraffic, Scenario]:
    return opened(load_scenario("unsafe-driver").model_copy(update={"background_traffic": count}))


def opened(scenario: Scenario) -> tuple[BackgroundTraffic, Scenario]:
    road = BreakpointRoad(scenario)
    air = open_air(scenario.radio, road.cars_at, scenario.equipped, np.random.default_rng(1))
    traffic = BackgroundTraffic(
        air,
        scenario,
        road.cars_at,
        lambda now: now,
        np.random.default_rng(1),
        now=0.0,
        utc_s=UTC_S,
        credentials={},
    )
    return traffic, scenario


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


def test_traffic_of_a_trace_is_where_its_cars_are_and_silent_after_they_have_gone(
    tmp_path: Path,
) -> None:
    """`far` is farther from the scenario's cars than `near`, and only one is asked for."""
    trace = tmp_path / "trace.csv"
    lines = [
        f"{step / 10},{name},{22.25 + step},{north_m},0.0,10.0"
        for step in range(21)
        for name, north_m in (("far", 90.0), ("near", 0.0))
    ]
    trace.write_text("\n".join(["t,id,x,y,heading,v", *lines]), encoding="utf-8")
    air, _ = opened(
        load_scenario("unsafe-driver").model_copy(
            update={"background_traffic": 1, "traffic": BackgroundSettings(source=str(trace))}
        )
    )
    security = SecurityServices(UTC_S, None)
    places: dict[float, tuple[float, float]] = {}
    while (at := air.get_timer()) < 4.0:
        for delivery in air.wsms_to_deliver(at):
            opened_data = security.open(decode(delivery.wsm).payload, psid.BSM, at)
            core = bsm.decode(opened_data.payload).core
            assert core.latitude_deg is not None
            assert core.longitude_deg is not None
            east_m, north_m = ORIGIN.position_m(core.latitude_deg, core.longitude_deg)
            places[at] = float(east_m), float(north_m)

    assert 1.0 < max(places) <= 2.0
    for at_s, (east_m, north_m) in places.items():
        assert east_m == pytest.approx(20.0 + 10.0 * at_s, abs=3.5)
        assert north_m == pytest.approx(0.0, abs=3.5)
