"""Events in a recording, and what drivers do: the rest of the world drives on as ever."""

import itertools

import numpy as np
import pytest

from sim_rig.roads.cars import Array, Cars
from sim_rig.roads.crossing import IntersectionSettings, crossing
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import NoEventError, TrafficEvent, TrafficEventKind, TrafficEvents
from sim_rig.roads.paths import DrivePath, blocked_at_m
from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory, record
from sim_rig.roads.right_lane import keep_right

SPEED_M_S, GAP_M, LENGTH_M = 15.0, 20.0, 4.5
ALERT = ReactionSettings(
    unwarned_median_s=1.0, unwarned_sigma=0.0, distracted=0.0, warned_median_s=0.5, warned_sigma=0.0
)
LOST = ALERT.model_copy(update={"unwarned_median_s": 5.0})


def in_line(cars: int, gap_m: float, speed_m_s: Array) -> RecordedTraffic:
    """Cars in one lane that all drive at the same speed, the first ones ahead."""
    way = np.concatenate([[0.0], np.cumsum((speed_m_s[1:] + speed_m_s[:-1]) / 2.0 * STEP_S)])
    return RecordedTraffic(
        Trajectory(
            f"car{i}",
            0,
            np.stack([way - i * (gap_m + LENGTH_M), np.zeros(len(way))], axis=1),
            np.zeros(len(way)),
            speed_m_s,
            LENGTH_M,
            1.8,
        )
        for i in range(cars)
    )


def platoon(cars: int, seconds: float = 20.0) -> RecordedTraffic:
    return in_line(cars, GAP_M, np.full(round(seconds / STEP_S) + 1, SPEED_M_S))


BRAKE = TrafficEvent(TrafficEventKind.SUDDEN_BRAKE, 0, 2.0, deceleration_m_s2=6.0)


def drive(
    reactions: ReactionSettings,
    event: TrafficEvent | None = BRAKE,
    warned_at_s: float | None = None,
) -> DisturbedTraffic:
    traffic = DisturbedTraffic(platoon(3), event, reactions, seed=1)
    for step in range(120):
        cars = traffic.cars_at(step * STEP_S)
        if warned_at_s is not None and step * STEP_S >= warned_at_s:
            traffic.warn("car1", cars.at_s)
        if traffic.crash is not None:
            break
    return traffic


def test_without_an_event_the_recording_is_as_it_was() -> None:
    traffic, recording = drive(ALERT, event=None), platoon(3)

    assert traffic.crash is None
    assert traffic.cars_at(12.05).middle_m == pytest.approx(recording.cars_at(12.05).middle_m)


def test_a_car_that_brakes_stands_after_v_squared_by_2a() -> None:
    traffic = DisturbedTraffic(platoon(1), BRAKE, ALERT, seed=1)
    traffic.cars_at(0.0)
    cars = traffic.cars_at(15.0)

    assert cars.speed_m_s[0] == 0.0
    assert cars.middle_m[0, 0] == pytest.approx(2.0 * SPEED_M_S + SPEED_M_S**2 / 12.0, abs=0.2)


def test_an_attentive_driver_stops_and_a_distracted_one_crashes() -> None:
    assert drive(ALERT).crash is None

    crash = drive(LOST).crash

    assert crash is not None
    assert set(crash.names) == {"car0", "car1"}
    # 20 m and the stopping distance of 18.75 m at 15 m/s: 2.58 s after the brake.
    assert crash.at_s == pytest.approx(2.0 + (GAP_M + SPEED_M_S**2 / 12.0) / SPEED_M_S, abs=0.05)


def test_a_warning_in_time_helps_a_distracted_driver() -> None:
    late = drive(LOST, warned_at_s=3.5).crash
    in_time = drive(LOST.model_copy(update={"braking_m_s2": (8.0, 8.0)}), warned_at_s=2.3)

    assert late is not None
    assert in_time.crash is None or "car1" in in_time.crash.names
    assert in_time.crash is None or set(in_time.crash.names) == {"car1", "car2"}


def test_a_driver_lets_go_of_the_brake_when_the_warning_is_over() -> None:
    traffic = DisturbedTraffic(platoon(1), None, ALERT, seed=1)
    traffic.cars_at(1.0)
    traffic.warn("car0", 1.0)

    slowed = traffic.cars_at(2.2).speed_m_s[0]
    later = traffic.cars_at(4.0).speed_m_s[0]

    assert 7.0 < slowed < SPEED_M_S - 1.0
    assert later > slowed


def test_a_car_brakes_as_requested_until_the_request_is_over_or_replaced() -> None:
    """Its driver, who sees nothing to brake for, does not."""
    traffic = DisturbedTraffic(platoon(1), None, ALERT, seed=1)
    traffic.cars_at(0.9)
    traffic.brake("car0", 1.0, 2.0, 6.0)
    traffic.brake("car0", 1.5, 5.0, 2.0)
    speeds = {at_s: float(traffic.cars_at(at_s).speed_m_s[0]) for at_s in (1.0, 1.5, 2.5)}
    traffic.brake("car0", 2.5, 2.5, 0.0)

    assert speeds == pytest.approx({1.0: SPEED_M_S, 1.5: SPEED_M_S - 3.0, 2.5: SPEED_M_S - 5.0})
    assert traffic.cars_at(4.0).speed_m_s[0] > speeds[2.5]


@pytest.fixture(scope="module")
def busy() -> RecordedTraffic:
    return record(crossing(IntersectionSettings(), np.random.default_rng(3)), 100.0, begin_s=60.0)


@pytest.mark.long
def test_events_are_where_a_collision_is_possible(busy: RecordedTraffic) -> None:
    events, found = TrafficEvents(busy, has_lights=True), []
    for kind in TrafficEventKind:
        found, again = (events.situations(kind, np.random.default_rng(5)) for _ in range(2))
        assert found == again
    crashes = 0
    for seed in range(8):
        event = found[seed * len(found) // 8].event
        traffic = DisturbedTraffic(busy, event, ALERT, seed)
        for second in range(-1, 8):
            traffic.cars_at(event.at_s + second)
            if traffic.crash is not None:
                break
        crashes += traffic.crash is not None
        assert traffic.crash is None or traffic.crash.at_s >= event.at_s
    assert crashes >= 3


def test_without_crossing_paths_there_is_no_red_light_runner() -> None:
    for has_lights in (True, False):
        events = TrafficEvents(platoon(3), has_lights=has_lights)
        with pytest.raises(NoEventError, match="no paths in this recording cross"):
            events.situations(TrafficEventKind.RED_LIGHT, np.random.default_rng(0))
    with pytest.raises(NoEventError, match="followed closely"):
        TrafficEvents(platoon(1), has_lights=False).situations(
            TrafficEventKind.SUDDEN_BRAKE, np.random.default_rng(0)
        )


def test_a_shifted_car_needs_distance_to_others() -> None:
    """Two cross each other's way, past cars that stand at the side of the road."""
    samples = 300
    still = np.zeros(samples)
    way_m, places_m = SPEED_M_S * STEP_S * np.arange(samples), np.arange(-120.0, -40.0, 8.0)
    drives = []
    for heading_rad, begin_m in ((0.0, -200.0), (np.pi / 2.0, -230.0)):
        ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        right = np.array([ahead[1], -ahead[0]])
        middles_m = [(begin_m + way_m)[:, None] * ahead]
        middles_m += [np.tile(place_m * ahead + 3.0 * right, (samples, 1)) for place_m in places_m]
        speeds_m_s = [still + SPEED_M_S] + len(places_m) * [still]
        drives += [
            Trajectory(
                f"{heading_rad:.0f}-{i}", 0, middle_m, still + heading_rad, speed_m_s, 4.5, 1.8
            )
            for i, (middle_m, speed_m_s) in enumerate(zip(middles_m, speeds_m_s, strict=True))
        ]
    events = TrafficEvents(RecordedTraffic(drives), has_lights=False)

    with pytest.raises(NoEventError, match="every shifted car would be within 7 m"):
        events.situations(TrafficEventKind.RED_LIGHT, np.random.default_rng(0))


def test_in_a_recording_of_a_few_seconds_nothing_happens() -> None:
    with pytest.raises(NoEventError, match="followed closely"):
        TrafficEvents(RecordedTraffic([]), has_lights=False).situations(
            TrafficEventKind.SUDDEN_BRAKE, np.random.default_rng(0)
        )


@pytest.mark.long
def test_a_shifted_car_does_not_overlap_the_lead() -> None:
    """Two go east, the second 24.5 m behind; one goes north 0.5 s before the first of them."""

    def straight(name: str, first: int, behind_m: float, heading: float) -> Trajectory:
        along = np.array([np.cos(heading), np.sin(heading)])
        way = SPEED_M_S * STEP_S * np.arange(-100, 101) - behind_m
        n = len(way)
        speeds = np.full(n, SPEED_M_S)
        return Trajectory(
            name, first, way[:, None] * along, np.full(n, heading), speeds, LENGTH_M, 1.8
        )

    east = [straight("car0", 100, 0.0, 0.0), straight("car1", 100, GAP_M + LENGTH_M, 0.0)]
    recording = RecordedTraffic([*east, straight("north", 95, 0.0, np.pi / 2)])
    events = TrafficEvents(recording, has_lights=False)

    drawn = [
        situation.event
        for seed in range(10)
        for situation in events.situations(TrafficEventKind.RED_LIGHT, np.random.default_rng(seed))
    ]

    assert {event.car for event in drawn} == {0, 1, 2}
    assert {type(event.at_s) for event in drawn} == {float}  # so that JSON can represent results
    for event in drawn:
        traffic = DisturbedTraffic(recording, event, LOST, seed=1)
        for step in range(50):
            cars = traffic.cars_at(event.at_s - 1.0 + step * STEP_S)
            one, other = (cars.index(f"car{i}") for i in (0, 1))
            if one is not None and other is not None and traffic.crash is None:
                assert np.hypot(*(cars.middle_m[one] - cars.middle_m[other])) > LENGTH_M


def test_cars_on_the_middle_of_a_road_are_moved_to_the_right() -> None:
    moved = keep_right(platoon(1), 1.75).cars_at(3.0)

    assert moved.middle_m[0] == pytest.approx([3.0 * SPEED_M_S, -1.75])


def queue_that_drives_off(seconds: float = 12.0) -> RecordedTraffic:
    """Two cars 3 m apart that both drive off at 2 m/s^2 at 2.0 s, as if tied together."""
    steps = np.arange(round(seconds / STEP_S) + 1)
    return in_line(2, 3.0, np.minimum(2.0 * np.maximum(steps * STEP_S - 2.0, 0.0), 12.0))


def test_no_driver_accelerates_towards_a_braking_car() -> None:
    """What he would have accelerated was his answer to a car that drives off."""
    brake = TrafficEvent(TrafficEventKind.SUDDEN_BRAKE, 0, 4.0, deceleration_m_s2=6.0)
    traffic = DisturbedTraffic(queue_that_drives_off(), brake, LOST, seed=1)

    traffic.cars_at(3.0)
    speeds = []
    for step in range(8):
        cars = traffic.cars_at(4.3 + step * STEP_S)
        speeds.append(float(cars.speed_m_s[cars.names.index("car1")]))

    assert all(later <= before + 1e-9 for before, later in itertools.pairwise(speeds))
    assert speeds[0] < 4.7


def test_a_reaction_time_is_counted_from_the_brake_lights_though_he_brakes_already() -> None:
    """Both slow down evenly with 2 m/s^2; then the one ahead brakes with 6."""
    steps = np.arange(120)
    recording = in_line(
        2, 15.0, np.maximum(15.0 - 2.0 * np.maximum(steps * STEP_S - 1.0, 0.0), 0.0)
    )
    traffic = DisturbedTraffic(recording, BRAKE, ALERT, seed=1)

    for step in range(50):
        cars = traffic.cars_at(step * STEP_S)
        acceleration_m_s2 = cars.acceleration_m_s2[cars.names.index("car1")]
        if step * STEP_S < 3.05:
            assert acceleration_m_s2 >= -2.1
        elif 3.25 < step * STEP_S < 3.75:
            assert acceleration_m_s2 < -2.5
    assert traffic.crash is None


def test_a_warned_driver_brakes_as_hard_as_needed() -> None:
    """He would not look for 5 s; warned drivers begin with 3 m/s^2, which is too little."""
    gentle = LOST.model_copy(update={"braking_m_s2": (3.0, 3.0)})

    assert drive(gentle).crash is not None
    crash = drive(gentle, warned_at_s=2.2).crash
    assert crash is None or set(crash.names) == {"car1", "car2"}


def stops_at_a_light() -> Trajectory:
    """East at 10 m/s, stands at x = 0 from 5 s to 15 s, then on."""
    times = np.arange(0.0, 25.0, STEP_S)
    speed = np.interp(times, [0.0, 2.0, 5.0, 15.0, 19.0, 25.0], [10.0, 10.0, 0.0, 0.0, 10.0, 10.0])
    way = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2.0 * STEP_S)])
    middle = np.stack([way - way[50], np.zeros(len(way))], axis=1)
    return Trajectory("east", 0, middle, np.zeros(len(way)), speed, LENGTH_M, 1.8)


def test_after_a_false_warning_a_driver_still_stops_at_the_light() -> None:
    traffic = DisturbedTraffic(RecordedTraffic([stops_at_a_light()]), None, ALERT, seed=1)
    traffic.cars_at(0.0)
    traffic.warn("east", 0.0)

    waits, later = traffic.cars_at(14.0), traffic.cars_at(20.0)

    assert waits.speed_m_s[0] < 0.2
    assert -4.0 < waits.middle_m[0, 0] < 0.5
    assert later.middle_m[0, 0] > 5.0


def test_a_warned_red_light_runner_yields_to_crossing_cars() -> None:
    """He sets off at red, is warned and stands; a car comes from the left 4 s later."""
    steps = np.arange(250)
    north = Trajectory(
        "north",
        0,
        np.stack([np.full(250, 12.0), 12.0 * (steps * STEP_S - 13.5)], axis=1),
        np.full(250, np.pi / 2),
        np.full(250, 12.0),
        LENGTH_M,
        1.8,
    )
    event = TrafficEvent(TrafficEventKind.RED_LIGHT, 0, 7.0, sets_off=True)
    traffic = DisturbedTraffic(RecordedTraffic([stops_at_a_light(), north]), event, LOST, seed=1)
    traffic.cars_at(6.0)
    for step in range(90):
        cars = traffic.cars_at(6.0 + step * STEP_S)
        if 8.0 <= cars.at_s <= 9.0:
            traffic.warn("east", cars.at_s)
        if 9.5 <= cars.at_s <= 11.5:
            assert cars.speed_m_s[cars.names.index("east")] == 0.0

    assert traffic.crash is None
    cars = traffic.cars_at(18.0)
    assert cars.middle_m[cars.names.index("east"), 0] > 12.0


def test_a_bumper_in_the_lane_is_in_the_way() -> None:
    """A car stands across, its middle beside the lane, half a metre of it in the way."""
    way = SPEED_M_S * STEP_S * np.arange(100)
    zero = np.zeros(100)
    east = Trajectory("east", 0, np.stack([way, zero], axis=1), zero, zero + SPEED_M_S, 4.5, 1.8)
    y_m = 0.9 + LENGTH_M / 2.0 - 0.5
    cars = Cars(
        0.0,
        ("east", "across"),
        np.array([[0.0, 0.0], [30.0, y_m]]),
        np.array([0.0, np.pi / 2]),
        np.array([SPEED_M_S, 0.0]),
        np.zeros(2),
        np.full(2, LENGTH_M),
        np.full(2, 1.8),
    )

    gap_m = blocked_at_m(DrivePath(east), 0.0, cars, 0, np.array([1]))[0]

    assert gap_m == pytest.approx(30.0 - 0.9 - LENGTH_M / 2.0, abs=1.01)
