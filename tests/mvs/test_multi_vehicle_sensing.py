"""Several cars, each with its own core, clock and frame, joined by a fake radio in virtual time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.messages import mvs_footer
from onboard.mvs import own_car
from onboard.mvs.evidence import Measurement, MeasurementId
from onboard.mvs.fusion import fuse, propagate
from onboard.mvs.known_car import KnownBy, KnownCar
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import BeliefSettings, MvsSettings
from onboard.mvs.sharing import read
from onboard.mvs.told import OWN
from onboard.mvs.track import Track
from onboard.observations import Position, SensedCar
from tests.mvs.world import EXACT, Car, Message, World, to_degrees


def assert_lists_each_measurement_once(world: World) -> None:
    """The invariant: whatever is known, its evidence has no measurement in common."""
    for name, mvs in world.mvs.items():
        for track in mvs._tracks:
            used = [identity for piece in track.used for identity in piece.provenance]
            assert len(used) == len(set(used)), name
        for known in world.without_radio(name):
            assert known.provenance
            assert all(stamp_ms <= world.t * 1000 + 1 for _, stamp_ms in known.provenance)


def only(known: list[KnownCar]) -> KnownCar:
    (car,) = known
    return car


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
    assert v3.known_by is KnownBy.TOLD
    assert {observer for observer, _ in v3.provenance} == {world.car("v4").id}
    difference = world.place_of("v1", v3) - world.truth("v3")
    assert np.abs(difference[:2]).max() < 1.0
    assert np.abs(difference[2:]).max() < 1.5
    assert only(world.without_radio("v4")).known_by is KnownBy.SEEN


def test_a_car_without_a_radio_is_known_since_it_was_first_seen() -> None:
    world = figure_1()

    world.run(1.5)

    assert 1.2 < only(world.without_radio("v4")).known_for_s <= 1.5


def test_a_car_with_a_radio_is_known_by_it() -> None:
    world = figure_1()

    world.run(0.5)

    (v4,) = [car for car in world.known("v1") if car.known_by is KnownBy.RADIO]
    assert v4.name == world.car("v4").id.hex()
    assert not v4.provenance
    assert np.abs(world.place_of("v1", v4) - world.truth("v4"))[:2].max() < 1.5


def test_the_own_car_stands_in_the_same_frame() -> None:
    world = figure_1()
    world.run(0.3)

    own = world.mvs["v1"].own_car(world.t + 70.0)

    assert own is not None
    assert own.known_by is KnownBy.ITSELF
    assert np.abs(world.place_of("v1", own) - world.truth("v1"))[:2].max() < 1.5


def test_what_v4_no_longer_sees_is_forgotten_by_all() -> None:
    world = figure_1()
    world.run(1.0)
    assert world.without_radio("v1")

    world.car("v4").sees = frozenset()
    world.run(1.3)

    assert world.without_radio("v1") == []
    assert world.without_radio("v4") == []


# --- Nothing counts twice ------------------------------------------------------------------------


def ring(n: int, **changes: object) -> World:
    """n cars with radios around one without; each sees it, all hear each other."""
    cars = [
        Car(
            f"c{k}",
            40 * math.cos(2 * math.pi * k / n),
            40 * math.sin(2 * math.pi * k / n),
            clock_offset_s=100.0 * k,
            sees=frozenset({"x"}),
            heading_rad=k * 0.5,
        )
        for k in range(n)
    ]
    return World([*cars, Car("x", -5, 3, 4.0, -2.0, radio=False)], **changes)  # type: ignore[arg-type]


def test_evidence_forwarded_in_circles_is_used_once() -> None:
    world = ring(4)

    for _ in range(15):
        world.run(0.2)
        assert_lists_each_measurement_once(world)

    for k in range(4):
        x = only(world.without_radio(f"c{k}"))
        assert {observer for observer, _ in x.provenance} == {car.id for car in world.with_radio}
        assert np.abs(world.place_of(f"c{k}", x) - world.truth("x"))[:2].max() < 0.7


def test_a_ring_that_has_lost_sight_does_not_keep_a_car_alive() -> None:
    world = ring(4)
    world.run(2.0)

    for car in world.cars:
        car.sees = frozenset()
    world.run(1.5)

    assert all(world.without_radio(f"c{k}") == [] for k in range(4))
    assert all(len(message.footer) == mvs_footer.HEAD.size_bytes for message in world.sent[-4:])


@settings(max_examples=12)
@given(
    seed=st.integers(0, 2**16),
    loss=st.sampled_from([0.0, 0.3, 0.8]),
    longest_delay=st.sampled_from([0.0, 0.25, 1.5]),
    doubled=st.sampled_from([0.0, 0.5]),
)
def test_whatever_the_radio_does_no_measurement_is_used_twice(
    seed: int, loss: float, longest_delay: float, doubled: float
) -> None:
    rng = np.random.default_rng(seed)

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        copies = 0 if rng.random() < loss else 2 if rng.random() < doubled else 1
        return [0.002 + longest_delay * rng.random() for _ in range(copies)]

    world = ring(3, radio=radio, seed=seed)
    for _ in range(4):
        world.run(0.4)
        assert_lists_each_measurement_once(world)


def test_what_a_car_knows_is_what_a_central_filter_of_all_measurements_knows() -> None:
    """The limit: a filter that is handed every car's measurements, unrounded and without radio."""
    world = ring(4)
    mvs = world.mvs["c0"]
    everything: dict[MeasurementId, Measurement] = {}
    for _ in range(20):
        world.run(0.1)
        for core in world.mvs.values():
            frame, own_frame = mvs._own.frame, core._own.frame
            assert frame is not None
            assert own_frame is not None
            mapping = frame.mapping_from(own_frame)
            for held in (held for track in core._tracks for held in track.evidence.values()):
                piece = held.piece
                if isinstance(piece, Measurement) and held.teller == OWN:
                    everything[piece.id] = piece.mapped(*mapping)
    x = only(world.without_radio("c0"))

    (central,) = fuse([list(everything.values())], EXACT.acceleration_density)
    (track,) = mvs.cars_without_radio(world.t)

    assert x.provenance <= set(everything)
    assert len(x.provenance) > 0.85 * len(everything)
    states, _ = propagate([central], track.estimate.stamp_ms, EXACT.acceleration_density)
    apart = states[:, 0] - track.estimate.state
    assert np.abs(apart[:2]).max() < 0.3
    assert np.abs(apart[2:]).max() < 0.6
    sigma_m = np.sqrt(np.diagonal(track.estimate.covariance)[:2].sum())
    central_sigma_m = np.sqrt(np.diagonal(central.covariance)[:2].sum())
    assert sigma_m == pytest.approx(central_sigma_m, rel=0.25)


def test_without_the_selection_measurements_would_be_used_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The property above can fail: it is the selection that keeps it."""

    def use_everything(track: Track) -> bool:
        track.chosen = track.held
        return True

    monkeypatch.setattr(Track, "choose", use_everything)
    world = ring(3)
    world.run(1.0)

    with pytest.raises(AssertionError):
        assert_lists_each_measurement_once(world)


def test_a_measurement_that_was_lost_comes_in_an_estimate() -> None:
    """Figure 5: dm<v, t> is lost on its way, but e<v, T> with t in T arrives by another."""

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [] if (message.sender.name, receiver.name) == ("a", "c") else [0.002]

    cars = [
        Car("a", -30, 0, sees=frozenset({"x"}), heading_rad=0.0),
        Car("b", 30, 0, sees=frozenset({"x"}), heading_rad=0.0),
        Car("c", 0, 60, heading_rad=0.0),
        Car("x", 0, 0, 3.0, 0.0, radio=False),
    ]
    world = World(cars, radio=radio)

    world.run(2.0)

    x = only(world.without_radio("c"))
    assert {observer for observer, _ in x.provenance} == {cars[0].id, cars[1].id}


def test_when_everything_is_lost_a_car_knows_what_it_sees() -> None:
    world = ring(3, radio=lambda message, receiver, t: [])

    world.run(1.0)

    x = only(world.without_radio("c0"))
    assert {observer for observer, _ in x.provenance} == {world.car("c0").id}
    assert len(x.provenance) == 10


def test_a_late_message_is_used_where_it_belongs_and_the_state_is_of_now() -> None:
    world = ring(2, radio=lambda message, receiver, t: [0.4])

    world.run(3.0)

    x = only(world.without_radio("c0"))
    assert {observer for observer, _ in x.provenance} == {b"--c0", b"--c1"}
    assert np.abs(world.place_of("c0", x) - world.truth("x"))[:2].max() < 0.8


def test_the_same_message_a_hundred_times_changes_nothing() -> None:
    once, often = ring(2), ring(2)
    once.run(1.0)
    often.run(1.0)

    message = often.sent[-1]
    mvs = often.mvs["c0"]
    for _ in range(100):
        mvs.receive_bsm(message.sender.id, None, message.footer, often.t)
    once.run(0.1)
    often.run(0.1)

    assert only(once.without_radio("c0")).state == only(often.without_radio("c0")).state
    assert "too_often" in often.discarded("c0")


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
    assert all(len(m.footer) == mvs_footer.HEAD.size_bytes for m in world.sent)


def test_the_own_car_reported_back_is_recognised() -> None:
    """b does not hear a, so to b it is a car without a radio, and b tells everybody."""

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
    assert only(world.without_radio("b")).known_by is KnownBy.SEEN


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


def test_a_radio_that_falls_silent_hides_nobody_on_its_way() -> None:
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


@pytest.mark.parametrize("lane_m", [3.0, 3.5])
def test_a_car_that_is_only_told_of_is_known_beside_one_with_a_radio(lane_m: float) -> None:
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
        assert only(world.without_radio("v")).known_by is KnownBy.TOLD


def test_a_car_whose_radio_falls_silent_is_one_without() -> None:
    silent = False

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [] if silent and message.sender.name == "b" else [0.002]

    world = World([Car("a", 0, 0, 0, 10, sees=frozenset({"b"})), Car("b", 0, 30, 0, 10)], radio)
    world.run(1.0)
    assert world.without_radio("a") == []

    silent = True
    world.run(2.5)

    assert only(world.known("a")).known_by is KnownBy.SEEN


def test_a_single_false_detection_is_not_a_car() -> None:
    world = World([Car("a", 0, 0, 0, 10), Car("b", 0, 50, 0, 10)])
    world.run(0.5)

    world.mvs["a"].receive_sensed_car(SensedCar(world.t, 77, 20.0, 0.5, 0.1, 0.01))
    world.run(0.5)

    assert world.without_radio("a") == []
    assert world.without_radio("b") == []


# --- Position ------------------------------------------------------------------------------------


def test_without_a_position_there_is_no_mvs() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))

    mvs.receive_sensed_car(SensedCar(10.0, 1, 20.0, 0.5, 0.1, 0.01))
    mvs.receive_bsm(b"-you", Position(10.0, 48.0, 11.0, None, 1.0, 5.0, 0.0), b"\x01", 10.0)

    assert not mvs.has_position(10.0)
    assert mvs.footer_to_send(10.0) == b""
    assert mvs.kinematic_info(10.0) == []
    assert mvs.own_car(10.0) is None


def test_a_position_that_is_too_old_is_none() -> None:
    world = figure_1()
    world.run(1.0)

    later = world.t + 5.0 + 70.0

    assert not world.mvs["v1"].has_position(later)
    assert world.mvs["v1"].footer_to_send(later) == b""


def test_without_a_heading_the_camera_is_of_no_use_but_the_radio_is() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    mvs.receive_position(Position(10.0, 48.0, 11.0, None, 1.0, 0.0, None))
    mvs.receive_sensed_car(SensedCar(10.0, 1, 20.0, 0.5, 0.1, 0.01))
    mvs.receive_bsm(b"-you", Position(10.0, 48.0, 11.0005, None, 1.0, 5.0, 0.0), None, 10.0)

    (you,) = mvs.kinematic_info(10.0)

    assert you.known_by is KnownBy.RADIO
    event = mvs.next_event()
    assert event is not None
    assert event.reason == "no_heading"


def test_a_standing_car_keeps_its_last_heading() -> None:
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    east = math.pi / 2
    mvs.receive_position(Position(10.0, 48.0, 11.0, None, 0.1, 8.0, east))
    for k in range(1, 11):  # stopped: the receiver's course turns in circles
        mvs.receive_position(Position(10.0 + k / 10, 48.0, 11.0, None, 0.1, 0.1, float(k)))
        mvs.receive_sensed_car(SensedCar(10.0 + k / 10, 1, 20.0, 0.5, 0.0, 0.01))

    (ahead,) = mvs.kinematic_info(11.0)

    assert ahead.state[:2] == pytest.approx((20.0, 0.0), abs=0.1)


def test_on_a_long_way_the_frame_moves_along_and_nobody_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(own_car, "NEW_ORIGIN_M", 100.0)
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
        frames.add(world.mvs["a"]._own.frame)
        x = only(world.without_radio("a"))
        assert np.abs(world.place_of("a", x) - world.truth("x"))[:2].max() < 1.5
        assert sum(car.known_by is KnownBy.RADIO for car in world.known("a")) == 1
    assert len(frames) == 4


# --- Pseudonyms, clocks, size --------------------------------------------------------------------


def test_after_a_change_of_pseudonym_the_own_measurements_are_still_own() -> None:
    world = ring(2)
    world.run(1.0)

    world.mvs["c0"].set_own_id(b"-new")
    world.run(0.3)

    x = only(world.without_radio("c0"))
    assert x.known_by is KnownBy.SEEN
    assert {b"--c0", b"-new"} <= {observer for observer, _ in x.provenance}
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
    known: list[KnownCar] = []
    for k in range(40):
        now = 1000.0 + k * 0.05
        if k == 30:
            assert only(known)
            mvs.set_utc_offset(step_s)
        mvs.receive_position(Position(now, 48.1, 11.5, None, 0.5, 0.0, 0.0))
        seen = SensedCar(now, 1, 30.0 + 15.0 * (now - 1000.0), 0.5, 0.0, 0.01)
        mvs.receive_sensed_car(seen)
        known = mvs.kinematic_info(now)
        if k >= 34:
            car = only(known)
            assert car.age_s == pytest.approx(0.0, abs=0.01)
            assert car.state[1] - seen.range_m - 2.2 == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("selection", ["mvs", "mo", "rs"])
def test_a_footer_keeps_to_m_entries_and_to_its_bytes(selection: str) -> None:
    observers = [Car("a", 0, 0, 0, 10, sees=frozenset(f"x{k}" for k in range(12)))]
    observers += [Car("b", 200, 0, 0, 10, sees=frozenset(f"x{k}" for k in range(12)))]
    others = [Car(f"x{k}", 8.0 * k - 40, 60 + k, 0, 10, radio=False) for k in range(12)]
    changes = {"selection": selection, "most_entries": 5, "most_bytes": 150}
    world = World(
        observers + others, settings=MvsSettings.model_validate(
            EXACT.model_dump(mode="python") | changes, strict=False)
    )  # fmt: skip

    world.run(2.0)

    footers = [mvs_footer.decode(message.footer) for message in world.sent[20:]]
    entries = [len(footer.measurements) + len(footer.estimates) for footer in footers]
    assert max(entries) <= 5
    assert max(len(message.footer) for message in world.sent) <= 150
    assert min(entries) >= 2
    assert_lists_each_measurement_once(world)


@pytest.mark.parametrize("interval_s", [0.07, 0.1, 0.105, 0.25])
def test_what_was_heard_is_passed_on_once_however_punctual_the_footers_are(
    interval_s: float,
) -> None:
    cars = [Car("a", 0, 0, 0, 10, sees=frozenset({"x"})), Car("x", 0, 40, 0, 10, radio=False)]
    world = World(cars)
    world.run(4.0)
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    told: list[int] = []
    for k in range(round(4.0 / interval_s)):
        now = world.start + 0.14 + k * interval_s
        fix = Position(now, *to_degrees(0.0, -50.0), None, 0.5, 0.0, 0.0)
        mvs.receive_position(fix)
        while world.sent and (heard_at := world.sent[0].state.stamp_s + 0.02) <= now:
            message = world.sent.pop(0)
            mvs.receive_bsm(message.sender.id, message.state, message.footer, heard_at)
        for provenance in read(mvs.footer_to_send(now)).provenances:
            told += [stamp_ms for _, stamp_ms in provenance]

    assert len(told) == len(set(told))
    assert set(range(1_001_000, 1_003_600, 100)) <= set(told)


def test_what_comes_back_from_others_is_not_told_again() -> None:
    """Else old news would ride on every new measurement, and make it too old to be passed on."""

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [0.03 + 0.1 * (round(t * 10) % 2)]  # so b has two to tell of at a time

    cars = [
        Car("a", 0, 0, 0, 10, sees=frozenset({"x"})),
        Car("b", 0, -60, 0, 10),
        Car("x", 0, 40, 0, 10, radio=False),
    ]
    world = World(cars, radio=radio)

    world.run(3.0)

    of_a = [read(m.footer) for m in world.sent if m.sender.name == "a"]
    of_b = [read(m.footer) for m in world.sent if m.sender.name == "b"]
    assert [len(provenance) for told in of_a[5:] for provenance in told.provenances] == [1] * 25
    assert {len(provenance) for told in of_b for provenance in told.provenances} == {2}


def test_two_cars_alive_never_go_by_one_number_on_the_wire() -> None:
    """A number has 8 bits there: of cars 1 and 257 neither was ever known to who was told."""
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    told: list[tuple[int, ...]] = []
    for k in range(12):
        at = 1000.0 + k / 10
        mvs.receive_position(Position(at, 48.1, 11.5, None, 0.5, 0.0, 0.0))
        for number in range(1 if k < 4 else 2):
            mvs.receive_sensed_car(SensedCar(at, number, 30.0, 0.3, 0.6 * number, 0.01))
        told.append(read(mvs.footer_to_send(at)).cars)
        mvs._tracks._last_number = 256

    assert {track.number for track in mvs._tracks} == {1, 257}
    assert (1,) in told
    assert set(told[-1]) == {1, 2}


def test_what_did_not_fit_into_a_footer_is_told_first_in_the_next() -> None:
    """Else the last of three cars in view would never be told of, where two fit at most."""
    tight = EXACT.model_copy(update={"most_bytes": 50})
    mvs = MultiVehicleSensing(tight, b"-own", np.random.default_rng(0))
    told: list[int] = []
    for k in range(12):
        now = 1000.0 + k / 10
        mvs.receive_position(Position(now, 48.1, 11.5, None, 0.5, 0.0, 0.0))
        for number in range(3):
            mvs.receive_sensed_car(SensedCar(now, number, 30.0, 0.3, 0.5 * number, 0.01))
        told += read(mvs.footer_to_send(now)).cars

    times_told = [told.count(car) for car in sorted(set(told))]
    assert len(times_told) == 3
    assert max(times_told) - min(times_told) <= 1


def test_nobody_tells_more_measurements_at_once_than_are_believed() -> None:
    """Estimates that come back grow with each round, up to all that anybody measured lately."""
    most = BeliefSettings(measurements_per_estimate=8)
    names = [f"r{k}" for k in range(4)]
    cars = [Car(name, 9.0 * k, 0, 0, 10, sees=frozenset({"x"})) for k, name in enumerate(names)]
    world = World(
        [*cars, Car("x", 12, 50, 0, 10, radio=False)],
        settings=EXACT.model_copy(update={"belief": most}),
    )

    world.run(2.0)

    assert [world.discarded(name) for name in names] == [[]] * 4
    longest = [max(map(len, read(message.footer).provenances)) for message in world.sent[20:]]
    assert max(longest) == 8
    assert all(len(world.without_radio(name)) == 1 for name in names)
