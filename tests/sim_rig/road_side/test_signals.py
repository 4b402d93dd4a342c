"""The signal controller, its messages, and the unit that sends them."""

import math

import numpy as np
import pytest

from onboard.intersections.approach_lane import approach_lanes
from onboard.intersections.signal_phase import message_age_s, signal_phases
from onboard.messages import map_data, spat
from onboard.messages.spat import MovementPhaseState
from onboard.security import ieee1609dot2, p256
from onboard.security.credentials import Credentials
from onboard.security.ieee1609dot2 import SignedData
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid, wsmp
from sim_rig.radio.air import Air, Delivery
from sim_rig.road_side.open_channel import open_channel, other_stations
from sim_rig.road_side.road_side_unit import NAME
from sim_rig.road_side.signal_controller import Shown, shown
from sim_rig.road_side.signal_messages import map_message, spat_message
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.earth import ORIGIN
from sim_rig.scenario.schema import Scenario, load_scenario
from sim_rig.scenario.signal_settings import SignalSettings
from tests.messages.crossing_messages import intersections_of
from tests.typed import a

SCENARIO = load_scenario("signal")
SETTINGS = a(SignalSettings, SCENARIO.signal)
GREEN = MovementPhaseState.PROTECTED_MOVEMENT_ALLOWED
YELLOW = MovementPhaseState.PROTECTED_CLEARANCE
RED = MovementPhaseState.STOP_AND_REMAIN
UTC_S = 1_750_000_000.0


@pytest.mark.parametrize(
    ("at_s", "avenue", "street"),
    [
        (0.0, Shown(GREEN, 25.0), Shown(RED, 30.0)),
        (25.0, Shown(YELLOW, 3.0), Shown(RED, 5.0)),
        (28.0, Shown(RED, 32.0), Shown(RED, 2.0)),
        (30.0, Shown(RED, 30.0), Shown(GREEN, 25.0)),
        (57.0, Shown(RED, 3.0), Shown(YELLOW, 1.0)),
        (61.0, Shown(GREEN, 24.0), Shown(RED, 29.0)),
    ],
)
def test_the_controller_repeats_its_cycle(at_s: float, avenue: Shown, street: Shown) -> None:
    assert shown(SETTINGS, at_s) == [avenue, street]


def test_the_map_has_the_lanes_of_the_scenario_s_roads() -> None:
    message = map_data.decode(map_data.encode(map_message(SCENARIO, SETTINGS)))
    (geometry,) = intersections_of(message)
    avenue, street = approach_lanes(geometry, ORIGIN)
    assert (avenue.signal_groups, street.signal_groups) == (frozenset({1}), frozenset({2}))
    assert avenue.points_m[0] == pytest.approx((0.0, -8.0), abs=0.02)
    assert avenue.points_m[-1] == pytest.approx((0.0, -208.0), abs=0.02)
    assert street.points_m[0] == pytest.approx((-8.0, 0.0), abs=0.02)
    assert street.place((-60.0, 1.0), (1.0, 0.0)) == pytest.approx((52.0, 1.0), abs=0.02)


@pytest.mark.parametrize("at_s", [0.0, 12.3, 40.0, 57.0])
def test_a_receiver_reads_what_the_controller_shows(at_s: float) -> None:
    """Also over the end of an hour, which `UTC_S + 2000` is."""
    for began_utc_s in (UTC_S, UTC_S + 2000.0 - at_s):
        utc_s = began_utc_s + at_s
        message = spat.decode(spat.encode(spat_message(SETTINGS, at_s, utc_s)))
        (state,) = message.intersections
        assert message_age_s(state, None, utc_s) == pytest.approx(0.0, abs=1e-3)
        for group, each in enumerate(shown(SETTINGS, at_s), start=1):
            phase = signal_phases(state, utc_s)[group]
            assert phase.state is each.state
            assert phase.min_left_s == pytest.approx(each.left_s, abs=0.06)
            assert phase.max_left_s == phase.min_left_s


def channel(scenario: Scenario, credentials: dict[str, Credentials] | None = None) -> Air:
    return open_channel(
        scenario,
        BreakpointRoad(scenario).cars_at,
        lambda now: now,
        np.random.default_rng(1),
        now=0.0,
        utc_s=UTC_S,
        credentials=credentials or {},
    )


def deliveries(until_s: float, credentials: dict[str, Credentials] | None = None) -> list[Delivery]:
    air = channel(SCENARIO, credentials)
    found = []
    while (at := air.get_timer()) <= until_s:
        found += air.wsms_to_deliver(at)
    return found


def test_the_unit_sends_ten_spats_and_one_map_a_second_to_every_car() -> None:
    sent = deliveries(2.95)
    assert {each.sender for each in sent} == {NAME}
    for car in SCENARIO.equipped:
        services = [wsmp.decode(each.wsm).psid for each in sent if each.receiver == car]
        assert services.count(psid.SPAT) == 30
        assert services.count(psid.MAP) == 3
    assert {each.receiver for each in sent} == set(SCENARIO.equipped)


def test_a_late_rig_sends_nothing_that_is_out_of_date() -> None:
    air = channel(SCENARIO)
    air.wsms_to_deliver(0.0)
    air.wsms_to_deliver(5.0)
    late = [each for each in air.wsms_to_deliver(5.05) if each.receiver == "goes"]
    assert len(late) == 1


def test_the_unit_signs_with_its_own_certificate() -> None:
    trial = make_trial(
        SCENARIO.equipped,
        {psid.BSM},
        UTC_S,
        p256.key_from(np.random.default_rng(1)),
        others=other_stations(SCENARIO),
    )
    payloads = [wsmp.decode(each.wsm).payload for each in deliveries(0.5, trial)]
    signers = [a(SignedData, ieee1609dot2.decode(each)).signer for each in payloads]
    (own,) = trial[NAME].pseudonyms
    assert {a(tuple, each)[0].hashed_id8 for each in signers} == {own.certificate.hashed_id8}
    permitted = {each.psid for each in own.certificate.subject.permissions}
    assert permitted == psid.OF_ROAD_SIDE_UNITS


def test_the_unit_is_in_reach_like_a_car() -> None:
    distant = SETTINGS.model_copy(update={"place_m": (5000.0, 0.0)})
    air = channel(SCENARIO.model_copy(update={"signal": distant}))
    assert [each for _ in range(20) for each in air.wsms_to_deliver(air.get_timer())] == []


def test_a_scenario_without_signals_has_the_channel_of_its_cars() -> None:
    plain = SCENARIO.model_copy(update={"signal": None})
    air = channel(plain)
    assert air.get_timer() == math.inf
