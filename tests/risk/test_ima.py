"""Where two courses cross, and P_C averaged over what is not known exactly."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.risk import mean_collision_probability
from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Uniform
from onboard.risk.mean_collision_probability import (
    GAINING_M_S2,
    DrivenVehicle,
    mean_collision_probabilities,
)
from onboard.risk.path_crossing import CovarianceError, path_crossing
from onboard.risk.settings import ImaSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

SETTINGS = ImaSettings()
CAR = DrivenVehicle(5.0, 1.75)


def car(
    state: tuple[float, ...], sigma_m: float = 0.0, sigma_m_s: float = 0.0, name: str = "b"
) -> PerceivedObject:
    covariance = np.diag([sigma_m**2, sigma_m**2, sigma_m_s**2, sigma_m_s**2])
    rows = tuple(map(tuple, covariance.tolist()))
    return PerceivedObject(0.0, name, ObjectSource.BSM, state, rows, 0.0, frozenset())


def averaged(own: PerceivedObject, other: PerceivedObject) -> float:
    met = path_crossing(own, other)
    assert met is not None
    return float(mean_collision_probabilities([met], [CAR], CAR)[0])


def test_distances_are_along_the_courses_to_where_they_cross() -> None:
    met = path_crossing(car((-30.0, 0.0, 10.0, 0.0)), car((3.0, -44.0, 3.0, 4.0)))

    assert met is not None
    assert met.mean == pytest.approx([66.0, 10.0, 55.0, 5.0])
    assert met.angle_rad == pytest.approx(math.atan2(4.0, 3.0))


@given(
    heading=st.floats(0.0, 6.28),
    angle=st.floats(0.55, 2.7),
    d=st.tuples(st.floats(-50, 100), st.floats(-50, 100)),
    v=st.tuples(st.floats(1.5, 40), st.floats(1.5, 40)),
)
def test_any_heading_is_as_good_as_any_other(
    heading: float, angle: float, d: tuple[float, float], v: tuple[float, float]
) -> None:
    def approaching(course: float, distance_m: float, speed_m_s: float) -> PerceivedObject:
        along = np.array([math.cos(course), math.sin(course)])
        return car((*(-distance_m * along).tolist(), *(speed_m_s * along).tolist()))

    met = path_crossing(approaching(heading, d[0], v[0]), approaching(heading + angle, d[1], v[1]))

    assert met is not None
    assert met.mean == pytest.approx([d[0], v[0], d[1], v[1]], abs=1e-6)
    assert met.angle_rad == pytest.approx(angle)


@pytest.mark.parametrize(
    ("angle_deg", "speed_m_s", "sigma_m_s", "crosses"),
    [
        (30.0, 4.0, 0.9, False),
        (30.0, 4.0, 0.2, True),
        (30.0, 14.0, 0.9, True),
        (50.0, 4.0, 0.9, True),
        (90.0, 3.0, 1.0, True),
        (155.0, 4.0, 0.9, False),
    ],
)
def test_courses_that_may_be_parallel_do_not_cross(
    angle_deg: float, speed_m_s: float, sigma_m_s: float, crosses: bool
) -> None:
    """To two sigma: two cars of a queue, seen to 0.9 m/s, seem to drive at 25 degrees."""
    angle = math.radians(angle_deg)
    other = (20.0, -20.0, speed_m_s * math.cos(angle), speed_m_s * math.sin(angle))

    met = path_crossing(car((0.0, 0.0, speed_m_s, 0.0), 0.5, sigma_m_s), car(other, 0.5, sigma_m_s))

    assert (met is not None) == crosses


@pytest.mark.parametrize(
    ("ahead_m", "left_m", "speed_m_s", "angle_deg"),
    [(-28.7, -12.8, 9.8, 28.0), (-11.9, -3.8, 5.1, 26.0), (28.9, 2.1, 0.6, 25.0)],
    ids=["far behind", "behind", "at the corner"],
)
def test_who_drives_the_same_way_on_a_road_that_bends_does_not_cross(
    ahead_m: float, left_m: float, speed_m_s: float, angle_deg: float
) -> None:
    """Of a calm city: who slows down for a corner was warned of the next one behind him."""
    along = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    other = car((ahead_m, left_m, *(speed_m_s * along).tolist()))

    assert path_crossing(car((0.0, 0.0, 1.2, 0.0)), other) is None


@pytest.mark.parametrize(
    "other",
    [
        (-10.0, 3.5, 12.0, 0.0),
        (50.0, 3.5, -12.0, 0.0),
        (20.0, -30.0, 0.0, 0.0),
        (20.0, -500.0, 0.0, 12.0),
        (math.nan, -30.0, 0.0, 12.0),
        (20.0, -30.0, math.inf, 12.0),
    ],
    ids=["beside", "oncoming", "standing", "far", "not a number", "not finite"],
)
def test_courses_that_do_not_cross(other: tuple[float, ...]) -> None:
    assert path_crossing(car((-30.0, 0.0, 12.0, 0.0)), car(other)) is None


def test_exact_states_give_the_exact_p_c() -> None:
    limits = Uniform(np.array(-9.55), np.array(2.1))
    one, other = (
        Approach(np.array([[d]]), np.array([[v]]), np.array(70.0), limits)
        for d, v in ((20.0, 12.0), (22.0, 13.0))
    )
    size = CarSize(np.array(5.0), np.array(1.75))
    exact = collision_probability(one, other, XCrossing(size, size, np.array(np.pi / 2)))

    p_c = averaged(car((-20.0, 0.0, 12.0, 0.0)), car((0.0, -22.0, 0.0, 13.0)))

    assert p_c == pytest.approx(float(exact[0]), abs=1e-4)


@pytest.mark.long
@pytest.mark.parametrize(("sigma_m", "sigma_m_s"), [(0.5, 0.3), (1.5, 0.5), (3.0, 1.0)])
@pytest.mark.parametrize(
    ("d", "v"), [((20, 22), (12, 13)), ((12, 11), (10, 10)), ((30, 20), (14, 9))]
)
def test_the_average_is_that_of_drawn_states(
    sigma_m: float, sigma_m_s: float, d: tuple[float, float], v: tuple[float, float]
) -> None:
    own = car((-d[0], 0.0, v[0], 0.0), sigma_m, sigma_m_s)
    other = car((0.0, -d[1], 0.0, v[1]), sigma_m, sigma_m_s)
    rng = np.random.default_rng(4)
    sigmas = np.array([sigma_m, sigma_m, sigma_m_s, sigma_m_s])
    drawn = [
        path_crossing(
            *(car(tuple(each.state + sigmas * rng.normal(size=4))) for each in (own, other))
        )
        for _ in range(400)
    ]
    met = [each for each in drawn if each is not None]
    values = mean_collision_probabilities(met, [CAR] * len(met), CAR)
    standard_error = values.std() / math.sqrt(len(met))

    assert averaged(own, other) == pytest.approx(values.mean(), abs=4 * standard_error + 0.02)


def test_not_knowing_makes_a_sure_crash_less_sure() -> None:
    exact = averaged(car((-9.0, 0.0, 15.0, 0.0)), car((0.0, -9.0, 0.0, 15.0)))
    vague = averaged(car((-9.0, 0.0, 15.0, 0.0)), car((0.0, -9.0, 0.0, 15.0), 10.0, 1.4))

    assert vague < 0.7 * exact


@pytest.mark.parametrize(
    "diagonal", [(-1.0, 1.0, 1.0, 1.0), (1.0, 1.0, math.nan, 1.0), (1.0, math.inf, 1.0, 1.0)]
)
def test_what_is_no_covariance_is_refused(diagonal: tuple[float, ...]) -> None:
    rows = tuple(tuple(v if i == j else 0.0 for j in range(4)) for i, v in enumerate(diagonal))
    odd = PerceivedObject(
        0.0, "b", ObjectSource.SHARED, (0.0, -20.0, 0.0, 12.0), rows, 0.0, frozenset()
    )

    with pytest.raises(CovarianceError):
        path_crossing(car((-20.0, 0.0, 12.0, 0.0)), odd)


def test_no_other_vehicle() -> None:
    assert len(mean_collision_probabilities([], [], CAR)) == 0


def test_a_car_that_is_known_to_keep_its_speed_is_likelier_to_be_met_than_one_that_may_brake() -> (
    None
):
    met = path_crossing(car((-28.0, 0.0, 14.0, 0.0)), car((0.0, -28.0, 0.0, 14.0)))
    assert met is not None

    def p_c(own: float | None, other: float | None) -> float:
        cars = DrivenVehicle(5.0, 1.75, other), DrivenVehicle(5.0, 1.75, own)
        return float(mean_collision_probabilities([met], [cars[0]], cars[1])[0])

    assert p_c(0.0, 0.0) > p_c(0.0, None) > p_c(None, None)
    assert p_c(0.0, 0.0) > p_c(0.0, -4.0) > 0.0


def test_cars_of_known_and_unknown_acceleration_keep_their_order() -> None:
    rng = np.random.default_rng(4)
    others, met = [], []
    for k in range(60):
        state = (0.0, -float(rng.uniform(10, 40)), 0.0, float(rng.uniform(6, 15)))
        each = path_crossing(car((-25.0, 0.0, 14.0, 0.0), 0.5, 0.3), car(state, 0.5, 0.3))
        assert each is not None
        met.append(each)
        others.append(DrivenVehicle(5.0, 1.75, None if k % 3 else float(rng.uniform(-5, 1))))

    together = mean_collision_probabilities(met, others, CAR)

    for k in range(60):
        (alone,) = mean_collision_probabilities([met[k]], [others[k]], CAR)
        assert together[k] == pytest.approx(alone, abs=1e-12)


def test_a_vehicle_certainly_beyond_the_crossing_raises_nothing() -> None:
    """No point of the rule is farther than sqrt(6) sigma, so nothing is lost by not asking."""
    rng = np.random.default_rng(7)
    met = []
    for _ in range(200):
        east, north = rng.uniform(-30, 30, 2)
        state = (0.0, float(north), 0.0, float(rng.uniform(3, 15)))
        each = path_crossing(car((float(east), 0.0, 12.0, 0.0), 0.7, 0.5), car(state, 0.7, 0.5))
        assert each is not None
        met.append(each)

    asked = mean_collision_probability._mean(
        met, [CAR] * 200, CAR, mean_collision_probability._behaviour
    )

    may_meet = mean_collision_probability._may_meet(met, [CAR] * 200, CAR)
    assert 20 < may_meet.sum() < 120
    assert (asked[~may_meet] == 0.0).all()
    assert mean_collision_probabilities(met, [CAR] * 200, CAR) == pytest.approx(asked, abs=1e-12)


def meet(
    own_m: float,
    other_m: float,
    *,
    own: float | None = 0.0,
    other: float | None = 0.0,
    sideways: tuple[float | None, float | None] = (0.0, 0.0),
) -> float:
    """P_C at right angles, both at 14 m/s so far before the crossing, with how that changes."""
    met = path_crossing(car((-own_m, 0.0, 14.0, 0.0)), car((0.0, -other_m, 0.0, 14.0)))
    assert met is not None
    mine, others = (
        DrivenVehicle(5.0, 1.75, own, sideways[0]),
        [DrivenVehicle(5.0, 1.75, other, sideways[1])],
    )
    return float(mean_collision_probabilities([met], others, mine)[0])


def test_two_that_can_hardly_stop_any_more_are_taken_to_drive_on() -> None:
    """At 14 m/s, 2.5 m/s^2 stop in 39.2 m: less than what is left to the zone, or more."""
    still_stops, drives_on = meet(44.0, 44.0), meet(41.0, 41.0)

    assert still_stops < SETTINGS.caution_p_c
    assert drives_on > SETTINGS.warning_p_c
    assert meet(41.0, 44.0) < SETTINGS.caution_p_c  # the other one still stops
    assert meet(44.0, 41.0) > SETTINGS.warning_p_c  # the own driver has to react first


def test_who_has_begun_to_brake_may_still_brake_harder() -> None:
    """3.0 m/s^2 are needed: more than drivers begin with, less than they end with."""
    assert meet(36.0, 36.0, other=-0.2) > SETTINGS.warning_p_c
    assert meet(36.0, 36.0, other=-0.5) < SETTINGS.caution_p_c
    assert meet(36.0, 36.0, own=-1.2) < SETTINGS.caution_p_c


def test_a_slow_driver_who_does_not_brake_in_time_is_taken_to_drive_on() -> None:
    """At 5.6 m/s, 2.5 m/s^2 stop in 6.2 m; drivers who stop have begun 1.7 s before."""
    own = car((-12.5, 0.0, 5.6, 0.0))

    def p_c(left_m: float, acceleration_m_s2: float = 0.0) -> float:
        met = path_crossing(own, car((0.0, -left_m, 0.0, 5.6)))
        assert met is not None
        others = [DrivenVehicle(5.0, 1.75, acceleration_m_s2, 0.0)]
        me = DrivenVehicle(5.0, 1.75, 0.0, 0.0)
        return float(mean_collision_probabilities([met], others, me)[0])

    assert p_c(12.5) > SETTINGS.warning_p_c
    assert p_c(12.5, -0.5) < SETTINGS.caution_p_c
    assert p_c(13.5) < SETTINGS.caution_p_c


def test_who_sets_off_does_not_mean_to_stop() -> None:
    """At 4 m/s, 8 m before the zone: 3 m/s^2 stop in 2.7 m, but after a second of 2.5 m/s^2 not."""
    own = car((-35.0, 0.0, 14.0, 0.0))
    met = path_crossing(own, car((0.0, -11.4, 0.0, 4.0)))
    assert met is not None

    def p_c(acceleration_m_s2: float) -> float:
        others = [DrivenVehicle(5.0, 1.75, acceleration_m_s2, 0.0)]
        me = DrivenVehicle(5.0, 1.75, 0.0, 0.0)
        return float(mean_collision_probabilities([met], others, me)[0])

    assert p_c(2.5) > SETTINGS.warning_p_c
    assert p_c(GAINING_M_S2) < SETTINGS.caution_p_c


def test_who_brakes_or_is_out_of_turn_is_not_taken_to_drive_into_anybody() -> None:
    assert meet(35.0, 35.0, other=-3.5) < SETTINGS.warning_p_c
    assert meet(35.0, 35.0, own=-3.5) < SETTINGS.warning_p_c
    assert meet(35.0, 22.0) < SETTINGS.caution_p_c  # passes before us
    assert meet(35.0, 35.0, other=None) < SETTINGS.warning_p_c  # nobody knows what he does
    assert meet(35.0, 35.0, own=None) < SETTINGS.warning_p_c
    for sideways in ((1.5, 0.0), (0.0, -1.5), (None, 0.0), (0.0, None)):
        assert meet(35.0, 35.0, sideways=sideways) < SETTINGS.warning_p_c


@pytest.mark.long
@given(
    distance=st.tuples(st.floats(-20, 90), st.floats(-20, 90)),
    acceleration=st.tuples(st.floats(-9, 4), st.floats(-9, 4)),
    sigma_m=st.floats(0.0, 3.0),
)
def test_that_two_drive_on_never_makes_a_crash_less_likely(
    distance: tuple[float, float], acceleration: tuple[float, float], sigma_m: float
) -> None:
    met = path_crossing(
        car((-distance[0], 0.0, 14.0, 0.0), sigma_m, 0.5),
        car((0.0, -distance[1], 0.0, 11.0), sigma_m, 0.5),
    )
    own, other = (DrivenVehicle(5.0, 1.75, each, 0.0) for each in acceleration)
    assert met is not None

    (p_c,) = mean_collision_probabilities([met], [other], own)
    in_a_bend = replace(own, lateral_m_s2=None)
    (before,) = mean_collision_probabilities([met], [other], in_a_bend)

    assert before <= p_c <= 1.0


def test_two_cars_taken_for_a_fast_one_have_no_course() -> None:
    """28 m/s, known to 1.7 m/s on either axis: made of pictures of two cars that stand."""
    own = car((0.0, 0.0, 12.0, 0.0), 0.7, 0.5)

    assert path_crossing(own, car((20.0, -40.0, 0.0, 28.0), 1.0, 1.7)) is None
    assert path_crossing(own, car((20.0, -40.0, 0.0, 28.0), 1.0, 1.3)) is not None


def test_a_car_known_for_a_second_has_a_course_though_the_own_place_is_vague() -> None:
    """With 3 m of GNSS, which all pictures share, no velocity seen comes below 1.5 m/s."""
    own = car((0.0, 0.0, 12.0, 0.0), 0.7, 0.5)
    seen = replace(car((20.0, -20.0, 0.0, 10.0), 3.0, 1.8), source=ObjectSource.SENSOR)

    assert path_crossing(own, replace(seen, tracked_for_s=0.5)) is None
    assert path_crossing(own, replace(seen, tracked_for_s=1.0)) is not None


@pytest.mark.parametrize(("sigma_m_s", "has_course"), [(0.5, True), (1.0, False), (3.0, False)])
def test_a_car_that_was_just_seen_has_no_course_yet(sigma_m_s: float, has_course: bool) -> None:
    """The lead, of which three pictures say that it may drive sideways with 2.5 m/s."""
    ahead = car((13.0, 2.0, -0.1, 2.5), 1.0, sigma_m_s)

    met = path_crossing(car((0.0, 0.0, 12.0, 0.0), 0.7, 0.5), ahead)

    assert (met is not None) == has_course
