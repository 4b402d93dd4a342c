"""Several cars, each with its own core, clock and frame, joined by a fake radio in virtual time."""

import math

import numpy as np
import pytest

from onboard.messages import mvs_footer
from onboard.mvs import host_vehicle
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings
from onboard.observations import Position, VehicleDetection
from onboard.tracking.evidence import observer_of
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.mvs.world import EXACT, Car, Message, World, only, ring
from tests.typed import a

# --- The paper's Figure 1 ------------------------------------------------------------------------


def figure_1(**changes: object) -> World:
    """v1 drives north, v3 runs the red light from the west; only v4 sees it."""
    cars = [
        Car("v1", 5, -80, 0, 12, clock_offset_s=-70.0),
        Car("v2", 60, 3, -6, 0, radio=False),
        Car("v3", -70, -2, 11, 0, radio=False),
        Car("v4", -3, 40, 0, -8, sees=frozenset({"v3"}), clock_offset_s=900.0),
    ]
    return World(cars, **changes)  # type: ignore[arg-type]


def test_v1_learns_of_v3_which_only_v4_sees() -> None:
    world = figure_1()

    world.run(1.5)

    v3 = only(world.without_radio("v1"))
    assert v3.source is ObjectSource.SHARED
    assert {observer_of(each) for each in v3.provenance} == {world.car("v4").id}
    difference = world.place_of("v1", v3) - world.truth("v3")
    assert np.abs(difference[:2]).max() < 1.0
    assert np.abs(difference[2:]).max() < 1.5
    assert only(world.without_radio("v4")).source is ObjectSource.SENSOR


def test_a_car_without_a_radio_is_known_since_it_was_first_seen() -> None:
    world = figure_1()

    world.run(1.5)

    assert 1.2 < only(world.without_radio("v4")).tracked_for_s <= 1.5


def test_a_car_with_a_radio_is_known_by_it() -> None:
    world = figure_1()

    world.run(0.5)

    (v4,) = [car for car in world.known("v1") if car.source is ObjectSource.BSM]
    assert v4.name == world.car("v4").id.hex()
    assert not v4.provenance
    assert np.abs(world.place_of("v1", v4) - world.truth("v4"))[:2].max() < 1.5


def test_the_host_vehicle_is_in_the_same_frame() -> None:
    world = figure_1()
    world.run(0.3)

    own = world.mvs["v1"].host_vehicle(world.t + 70.0)

    assert own is not None
    assert own.source is ObjectSource.HOST
    assert np.abs(world.place_of("v1", own) - world.truth("v1"))[:2].max() < 1.5


def test_what_v4_no_longer_sees_is_forgotten_by_all() -> None:
    world = figure_1()
    world.run(1.0)
    assert world.without_radio("v1")

    world.car("v4").sees = frozenset()
    world.run(1.3)

    assert world.without_radio("v1") == []
    assert world.without_radio("v4") == []


# --- Who is who ----------------------------------------------------------------------------------


def test_a_seen_car_with_a_radio_is_not_reported_as_one_without() -> None:
    cars = [
        Car("a", 0, 0, 0, 10, sees=frozenset({"b"})),
        Car("b", 3, 25, 0, 10),
        Car("c", 0, -60, 0, 10),
    ]
    world = World(cars)

    for _ in range(20):
        world.run(0.2)
        assert all(not world.without_radio(name) for name in "abc")
    assert all(len(a(bytes, m.footer)) == mvs_footer.HEADER.size_bytes for m in world.sent)


def test_the_host_vehicle_reported_back_is_recognised() -> None:
    """b receives nothing from a, so to b it is a car without a radio, and b shares it."""

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [] if (message.sender.name, receiver.name) == ("a", "b") else [0.002]

    cars = [
        Car("a", 0, 0, 0, 10),
        Car("b", 3, -25, 0, 10, sees=frozenset({"a"})),
        Car("c", -4, 40, 0, 10),
    ]
    world = World(cars, radio=radio)

    for _ in range(20):
        world.run(0.2)
        # Neither does a meet itself, nor does c, which hears both, know a twice.
        assert world.without_radio("a") == []
        assert world.without_radio("c") == []
    assert only(world.without_radio("b")).source is ObjectSource.SENSOR


@pytest.mark.long
def test_two_cars_side_by_side_are_two() -> None:
    """Neighbouring lanes, one overtakes the other; one observer, then two."""
    for observers in (1, 2):
        cars = [
            Car("a", 0, -20, 0, 10, sees=frozenset({"x", "y"})),
            Car("b", 8, 50, 0, 10, sees=frozenset({"x", "y"} if observers == 2 else ())),
            Car("x", 0, 20, 0, 9, radio=False),
            Car("y", 3.5, 10, 0, 12, radio=False),
        ]
        world = World(cars, seed=observers)
        world.run(0.6)
        for _ in range(25):
            world.run(0.2)
            known = [world.place_of("b", car) for car in world.without_radio("b")]
            assert len(known) == 2
            for name in "xy":
                truth = world.truth(name)[:2]
                assert min(math.dist(place[:2], truth) for place in known) < 1.6


@pytest.mark.long
def test_a_car_without_a_radio_beside_one_with_is_still_known() -> None:
    cars = [
        Car("a", 0, -20, 0, 10, sees=frozenset({"x", "b"})),
        Car("b", 3.5, 10, 0, 10),
        Car("x", 0, 10, 0, 10, radio=False),
    ]
    world = World(cars)
    world.run(0.6)

    for _ in range(20):
        world.run(0.2)
        x = only(world.without_radio("b"))
        assert math.dist(world.place_of("b", x)[:2], world.truth("x")[:2]) < 1.0


@pytest.mark.long
def test_a_remote_vehicle_that_falls_silent_hides_no_track_on_its_path() -> None:
    """It may have braked behind the queue through which its last word would have led it."""

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [] if message.sender.name == "r" and t > 1002.0 else [0.002]

    queue = frozenset({"a", "b"})
    cars = [
        Car("v", -10, 0, heading_rad=0.0, sees=queue),
        Car("r", 0, -10, 0, 13),
        Car("a", 0, 29, radio=False),
        Car("b", 0, 36, radio=False),
    ]
    world = World(cars, radio=radio)
    world.run(1.5)
    for _ in range(25):
        world.run(0.1)
        assert len(world.without_radio("v")) == 2


@pytest.mark.parametrize("lane_m", [3.0, pytest.param(3.5, marks=pytest.mark.long)])
def test_a_car_that_only_others_report_is_known_beside_one_with_a_radio(lane_m: float) -> None:
    """From 80 m away it is placed to 0.9 m across: that may be the next lane, and is not."""
    cars = [
        Car("v", 0, 0, 0, 12),
        Car("r", lane_m, 60, 0, 12),
        Car("x", 0, 60, 0, 12, radio=False),
        Car("w", 0, -20, 0, 12, sees=frozenset({"r", "x"})),
    ]
    world = World(cars, bearing_sigma_rad=0.015)
    world.run(1.5)
    for _ in range(20):
        world.run(0.1)
        assert only(world.without_radio("v")).source is ObjectSource.SHARED


def test_a_car_whose_radio_its_observer_does_not_receive_is_not_reported_as_one_without() -> None:
    """A camera places it some metres off along its course, where no other vehicle can drive."""

    def radio(message: Message, receiver: Car, _: float) -> list[float]:
        return [] if {message.sender.name, receiver.name} == {"w", "r"} else [0.002]

    cars = [
        Car("v", 0, -40, 0, 12),
        Car("r", 3.5, 40, 0, 12),
        Car("w", 0, 0, 0, 12, sees=frozenset({"r"})),
    ]
    world = World(cars, range_sigma_m=3.0, radio=radio)
    world.run(1.5)
    for _ in range(40):
        world.run(0.1)
        assert world.without_radio("v") == []


def test_a_car_whose_radio_falls_silent_is_one_without() -> None:
    silent = False

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [] if silent and message.sender.name == "b" else [0.002]

    world = World([Car("a", 0, 0, 0, 10, sees=frozenset({"b"})), Car("b", 0, 30, 0, 10)], radio)
    world.run(1.0)
    assert world.without_radio("a") == []

    silent = True
    world.run(2.5)

    assert only(world.known("a")).source is ObjectSource.SENSOR


def test_a_single_false_detection_is_not_a_car() -> None:
    world = World([Car("a", 0, 0, 0, 10), Car("b", 0, 50, 0, 10)])
    world.run(0.5)

    world.mvs["a"].receive_detection(VehicleDetection(world.t, 77, 20.0, 0.5, 0.1, 0.01))
    world.run(0.5)

    assert world.without_radio("a") == []
    assert world.without_radio("b") == []


# --- Position ------------------------------------------------------------------------------------


def test_without_a_position_there_is_no_mvs() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))

    mvs.receive_detection(VehicleDetection(10.0, 1, 20.0, 0.5, 0.1, 0.01))
    mvs.receive_bsm(b"-you", Position(10.0, 48.0, 11.0, None, 1.0, 5.0, 0.0), b"\x01", 10.0)

    assert not mvs.has_position(10.0)
    assert mvs.footer_to_send(10.0) == b""
    mvs.update(10.0)
    assert mvs.kinematic_info(10.0) == []
    assert mvs.host_vehicle(10.0) is None


def test_what_is_seen_without_a_position_is_not_kept_for_when_there_is_one() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    for tenth in range(100):
        mvs.receive_detection(VehicleDetection(tenth / 10, 1, 20.0, 0.5, 0.1, 0.01))

    mvs.receive_position(Position(60.0, 48.0, 11.0, None, 1.0, 5.0, 0.0))

    mvs.update(60.0)
    assert mvs.kinematic_info(60.0) == []
    assert mvs.next_event() is None


def test_a_position_that_is_too_old_is_none() -> None:
    world = figure_1()
    world.run(1.0)

    later = world.t + 5.0 + 70.0

    assert not world.mvs["v1"].has_position(later)
    assert world.mvs["v1"].footer_to_send(later) == b""


def test_without_a_heading_the_camera_is_of_no_use_but_the_radio_is() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    mvs.receive_position(Position(10.0, 48.0, 11.0, None, 1.0, 0.0, None))
    mvs.receive_detection(VehicleDetection(10.0, 1, 20.0, 0.5, 0.1, 0.01))
    mvs.receive_bsm(b"-you", Position(10.0, 48.0, 11.0005, None, 1.0, 5.0, 0.0), None, 10.0)

    mvs.update(10.0)
    (you,) = mvs.kinematic_info(10.0)

    assert you.source is ObjectSource.BSM
    event = mvs.next_event()
    assert event is not None
    assert event.reason == "no_heading"


def test_a_standing_car_keeps_its_last_heading() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    east = math.pi / 2
    mvs.receive_position(Position(10.0, 48.0, 11.0, None, 0.1, 8.0, east))
    for k in range(1, 11):  # stopped: the receiver's course turns in circles
        mvs.receive_position(Position(10.0 + k / 10, 48.0, 11.0, None, 0.1, 0.1, float(k)))
        mvs.receive_detection(VehicleDetection(10.0 + k / 10, 1, 20.0, 0.5, 0.0, 0.01))

    mvs.update(11.0)
    (ahead,) = mvs.kinematic_info(11.0)

    assert ahead.state[:2] == pytest.approx((20.0, 0.0), abs=0.1)


@pytest.mark.long
def test_on_a_long_drive_the_frame_moves_and_no_track_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(host_vehicle, "MAX_ORIGIN_DISTANCE_M", 100.0)
    cars = [
        Car("a", 0, 0, 0, 60, sees=frozenset({"x"})),
        Car("b", 30, 50, 0, 60),
        Car("x", 0, 60, 0, 60, radio=False),
    ]
    world = World(cars)
    world.run(0.6)

    frames = set()
    for _ in range(50):
        world.run(0.1)
        frames.add(world.mvs["a"]._host.frame)
        x = only(world.without_radio("a"))
        assert np.abs(world.place_of("a", x) - world.truth("x"))[:2].max() < 1.5
        assert sum(car.source is ObjectSource.BSM for car in world.known("a")) == 1
    assert len(frames) == 4


# --- Pseudonyms, clocks --------------------------------------------------------------------------


def test_after_a_change_of_pseudonym_the_own_measurements_are_still_own() -> None:
    world = ring(2)
    world.run(1.0)

    world.mvs["c0"].set_own_id(b"-new")
    world.run(0.3)

    x = only(world.without_radio("c0"))
    assert x.source is ObjectSource.SENSOR
    assert {b"--c0", b"-new"} <= {observer_of(each) for each in x.provenance}
    assert "not_my_measurement" not in world.discarded("c0")


def test_a_car_that_changes_its_pseudonym_is_one_car() -> None:
    cars = [Car("a", 0, 0, 0, 10), Car("b", 3.5, 40, 0, 10), Car("c", 0, 40, 0, 10)]
    world = World(cars)
    world.run(1.0)

    world.cars[1].name = "new"
    world.mvs["new"] = world.mvs.pop("b")
    world.mvs["new"].set_own_id(world.cars[1].id)
    world.run(0.4)

    assert {known.name for known in world.known("a")} == {car.id.hex() for car in cars[1:]}


@pytest.mark.parametrize("step_s", [-5.0, -0.5, -0.08, 0.5, 5.0])
def test_when_utc_is_corrected_a_car_in_view_is_known_again_at_once(step_s: float) -> None:
    """The car drives along: whoever goes on with the old clock places it elsewhere."""
    mvs = MultiVehicleSensing(MvsSettings(), b"-own", np.random.default_rng(0))
    known: list[PerceivedObject] = []
    for k in range(40):
        now = 1000.0 + k * 0.05
        if k == 30:
            assert len(known) == 1
            mvs.set_utc_offset(step_s)
        mvs.receive_position(Position(now, 48.1, 11.5, None, 0.5, 10.0, 0.0))
        seen = VehicleDetection(now, 1, 30.0 + 15.0 * (now - 1000.0), 0.5, 0.0, 0.01)
        mvs.receive_detection(seen)
        mvs.update(now)
        known = mvs.kinematic_info(now)
        if k >= 34:
            car = only(known)
            assert car.age_s == pytest.approx(0.0, abs=0.01)
            assert car.state[1] - seen.range_m - 2.2 == pytest.approx(0.0, abs=1.0)
