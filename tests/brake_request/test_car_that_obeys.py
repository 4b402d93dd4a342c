"""The rig's car that brakes as requested: its motion, and the crash that this avoids."""

import json
from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import VALIDITY_S, BrakeRequest
from onboard.errors import DecodeError
from onboard.risk.fcw import FCW
from onboard.settings import SettingsError, parse_settings
from sim_rig.cars.brake_controller import BRAKE_DELAY_S, BrakeController
from sim_rig.cars.camera_server import CameraServer
from sim_rig.reporting.report import failures
from sim_rig.roads.breakpoints import BreakpointRoad, braked
from sim_rig.roads.piecewise_linear import PiecewiseLinear
from sim_rig.run_log.ground_truth import touch_s
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario, load_scenario

PLANNED = ((0.0, 16.0), (4.0, 16.0), (6.0, 10.0), (8.0, 20.0))


@pytest.mark.long
def test_the_scenario_s_crash_happens_without_the_requested_braking() -> None:
    scenario = load_scenario("requested-braking")
    ann = scenario.cars["ann"].model_copy(update={"obeys_request": False})
    disobedient = scenario.model_copy(update={"cars": {**scenario.cars, "ann": ann}})

    log = run_virtual(disobedient)

    assert touch_s(log, "ann", "eva") == pytest.approx(8.5, abs=0.1)
    assert sorted(each.split()[0] for each in failures(disobedient, log)) == ["ann", "ann"]


@given(
    st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 1.0), st.floats(0.0, 8.0)), max_size=12)
)
def test_a_braked_car_never_jumps_nor_gains_speed(pulses: list[tuple[float, float, float]]) -> None:
    course: Sequence[tuple[float, float]] = PLANNED
    begin_s = 0.0
    for wait_s, length_s, deceleration_m_s2 in pulses:
        before = PiecewiseLinear(course)
        begin_s += wait_s
        course = braked(course, PLANNED, begin_s, begin_s + length_s, deceleration_m_s2)
        after = PiecewiseLinear(course)
        speeds_m_s = [after.value(begin_s + step / 10.0) for step in range(100)]
        assert speeds_m_s[0] == pytest.approx(before.value(begin_s))
        assert all(later <= sooner + 1e-9 for sooner, later in pairwise(speeds_m_s))
        assert min(speeds_m_s) >= 0.0
        assert after.value(begin_s / 2.0) == pytest.approx(before.value(begin_s / 2.0))


def test_a_pulse_takes_its_deceleration_times_its_length() -> None:
    course = PiecewiseLinear(braked(PLANNED, PLANNED, 1.0, 2.0, 5.0))

    assert course.value(1.5) == pytest.approx(13.5)
    assert course.value(3.0) == pytest.approx(11.0)
    assert course.value(6.0) == pytest.approx(5.0)  # the driver brakes too
    assert course.value(9.0) == pytest.approx(5.0)


def test_the_position_goes_on_where_the_braking_begins() -> None:
    scenario = load_scenario("requested-braking")
    road, free = BreakpointRoad(scenario), BreakpointRoad(scenario)
    road.brake("ann", 2.0, 3.0, 6.0)

    assert road.car_at("ann", 2.0).front_m == free.car_at("ann", 2.0).front_m
    assert road.cars_at(3.0)["ann"].front_m == pytest.approx(free.car_at("ann", 3.0).front_m - 3.0)


def test_the_controller_brakes_after_a_delay_and_as_long_as_a_request_is_valid() -> None:
    braking: list[tuple[float, float, float]] = []
    controller = BrakeController(lambda *each: braking.append(each))
    request = BrakeRequest(70.0, 5.0, 0.9, VALIDITY_S, 0, (FCW,))
    controller.receive_bytes(datagram.encode(request), 2.0)

    assert braking == [(2.0 + BRAKE_DELAY_S, 2.0 + BRAKE_DELAY_S + VALIDITY_S, 5.0)]
    with pytest.raises(DecodeError, match="no_request"):
        controller.receive_bytes(b"brake!", 2.0)


def test_the_cameras_show_the_braking() -> None:
    scenario = load_scenario("requested-braking")
    server = CameraServer(scenario, seed=1)
    server.receive_line("12.5\n")
    server.receive_line(json.dumps(["ann", 2.0, 3.0, 6.0]))

    assert server.clock.start_s == 12.5
    assert server.road.car_at("ann", 3.0).speed_m_s == pytest.approx(10.0)


@pytest.mark.parametrize("other", [{"equipped": False}, {"trajectory": "trace.csv"}])
def test_only_a_car_with_a_daemon_and_breakpoints_can_obey(other: dict[str, object]) -> None:
    car = {"plate": "A1", "obeys_request": True} | other
    if "trajectory" not in other:
        car |= {"start_m": 0.0, "speed_m_s": 1.0}
    tree = {
        "title": "A car that is to obey nobody, or cannot.", "seed": 1, "duration_s": 1.0,
        "cars": {"ann": car}, "radio": {"reach_m": 1.0}, "expect": [],
    }  # fmt: skip

    with pytest.raises(SettingsError, match="obeys_request needs a daemon, and no trajectory"):
        parse_settings(tree, Scenario, "test")
