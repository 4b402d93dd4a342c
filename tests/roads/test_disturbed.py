"""Events in a recording, and what drivers do: the rest of the world drives on as ever."""

import numpy as np
import pytest

from sim_rig.roads.crossing import CrossingSettings, crossing
from sim_rig.roads.disturbed import DisturbedTraffic, ReactionSettings
from sim_rig.roads.events import Event, Events, Kind, NoEventError
from sim_rig.roads.recording import STEP_S, Drive, Recording, keep_right, record

SPEED_M_S, GAP_M, LENGTH_M = 15.0, 20.0, 4.5
ALERT = ReactionSettings(
    unwarned_median_s=1.0, unwarned_sigma=0.0, distracted=0.0, warned_median_s=0.5, warned_sigma=0.0
)
LOST = ALERT.model_copy(update={"unwarned_median_s": 5.0})


def platoon(cars: int, seconds: float = 20.0) -> Recording:
    """Cars in one lane, the first ones ahead."""
    steps = round(seconds / STEP_S) + 1
    way = SPEED_M_S * STEP_S * np.arange(steps)
    return Recording(
        Drive(
            f"car{i}",
            0,
            np.stack([way - i * (GAP_M + LENGTH_M), np.zeros(steps)], axis=1),
            np.zeros(steps),
            np.full(steps, SPEED_M_S),
            LENGTH_M,
            1.8,
        )
        for i in range(cars)
    )


BRAKE = Event(Kind.SUDDEN_BRAKE, 0, 2.0, deceleration_m_s2=6.0)


def drive(
    reactions: ReactionSettings, event: Event | None = BRAKE, warned_at_s: float | None = None
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


def test_a_driver_who_looks_stops_and_one_who_does_not_crashes() -> None:
    assert drive(ALERT).crash is None

    crash = drive(LOST).crash

    assert crash is not None
    assert set(crash.names) == {"car0", "car1"}
    # 20 m and the stopping distance of 18.75 m at 15 m/s: 2.58 s after the brake.
    assert crash.at_s == pytest.approx(2.0 + (GAP_M + SPEED_M_S**2 / 12.0) / SPEED_M_S, abs=0.05)


def test_a_warning_in_time_helps_the_driver_who_does_not_look() -> None:
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


@pytest.fixture(scope="module")
def busy() -> Recording:
    return record(crossing(CrossingSettings(), np.random.default_rng(3)), 100.0, begin_s=60.0)


def test_events_are_drawn_by_seed_where_somebody_may_be_hit(busy: Recording) -> None:
    events = Events(busy, has_lights=True)
    for kind in Kind:
        first, again = (events.draw(kind, np.random.default_rng(5)) for _ in range(2))
        assert first == again
    crashes = 0
    for seed in range(8):
        event = events.draw(Kind.RED_LIGHT, np.random.default_rng(seed))
        traffic = DisturbedTraffic(busy, event, ALERT, seed)
        traffic.cars_at(event.at_s - 1.0)
        traffic.cars_at(event.at_s + 7.0)
        crashes += traffic.crash is not None
        assert traffic.crash is None or traffic.crash.at_s >= event.at_s
    assert crashes >= 3


def test_where_nobody_crosses_nobody_can_run_a_light() -> None:
    for has_lights in (True, False):
        events = Events(platoon(3), has_lights=has_lights)
        with pytest.raises(NoEventError, match="crosses another's way"):
            events.draw(Kind.RED_LIGHT, np.random.default_rng(0))
    with pytest.raises(NoEventError, match="followed closely"):
        Events(platoon(1), has_lights=False).draw(Kind.SUDDEN_BRAKE, np.random.default_rng(0))


def test_who_comes_out_of_his_turn_is_not_put_into_the_car_ahead_of_him() -> None:
    """Two go east, the second 24.5 m behind; one goes north 0.5 s before the first of them."""

    def straight(name: str, first: int, behind_m: float, heading: float) -> Drive:
        along = np.array([np.cos(heading), np.sin(heading)])
        way = SPEED_M_S * STEP_S * np.arange(-100, 101) - behind_m
        n = len(way)
        speeds = np.full(n, SPEED_M_S)
        return Drive(name, first, way[:, None] * along, np.full(n, heading), speeds, LENGTH_M, 1.8)

    east = [straight("car0", 100, 0.0, 0.0), straight("car1", 100, GAP_M + LENGTH_M, 0.0)]
    recording = Recording([*east, straight("north", 95, 0.0, np.pi / 2)])
    events = Events(recording, has_lights=False)

    drawn = [events.draw(Kind.RED_LIGHT, np.random.default_rng(seed)) for seed in range(40)]

    assert {event.car for event in drawn} == {0, 1, 2}
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
