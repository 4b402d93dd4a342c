"""P_C is the integral of eq. 4, whatever the crossing; certain is 1 and impossible is 0."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.risk.collision_probability import Approach, collision_probability
from onboard.risk.conflict_zone import CarSize, XCrossing
from onboard.risk.driver_behaviour import Behaviour, Triangular, Uniform
from onboard.risk.trajectory import acceleration_to_cover, reached_after_s, travelled_m

# Table I.
A_MIN_M_S2, A_MAX_M_S2 = np.array(-9.55), np.array(2.1)
CAR = CarSize(length_m=np.array(5.0), width_m=np.array(1.75))
TOP_M_S = 17.0
UNIFORM = Uniform(A_MIN_M_S2, A_MAX_M_S2)
TRIANGULAR = Triangular(A_MIN_M_S2, np.array(0.3), A_MAX_M_S2)
RIGHT_ANGLE = XCrossing(CAR, CAR, np.array(np.pi / 2))


def approach(distance_m: float, speed_m_s: float, behaviour: Behaviour = UNIFORM) -> Approach:
    return Approach(np.array([[distance_m]]), np.array([[speed_m_s]]), np.array(TOP_M_S), behaviour)


def p_c(a: Approach, b: Approach, zone: XCrossing = RIGHT_ANGLE) -> float:
    return float(collision_probability(a, b, zone)[0])


def overlap(s_a: np.ndarray, x_b: np.ndarray, y_b: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Separating axes of two rectangles, straight from their corners' half vectors."""
    dx, dy = x_b - s_a, y_b
    cosine, sine = np.cos(heading), np.sin(heading)
    length, width = CAR.length_m / 2, CAR.width_m / 2
    touching = np.abs(dx) < length + length * np.abs(cosine) + width * np.abs(sine)
    touching &= np.abs(dy) < width + length * np.abs(sine) + width * np.abs(cosine)
    along, across = dx * cosine + dy * sine, dy * cosine - dx * sine
    touching &= np.abs(along) < length + length * np.abs(cosine) + width * np.abs(sine)
    touching &= np.abs(across) < width + length * np.abs(sine) + width * np.abs(cosine)
    return np.asarray(touching)


def brute_force(
    a: Approach, b: Approach, angle_rad: float, drawn_a: np.ndarray, drawn_b: np.ndarray
) -> np.ndarray:
    """Step every pair of accelerations through 30 s; returns whether it collides."""
    time_s = np.arange(0.0, 30.0, 0.02)
    s_a, s_b = (
        -car.distance_m + travelled_m(time_s, drawn[:, None], car.speed_m_s, car.top_speed_m_s)
        for car, drawn in ((a, drawn_a), (b, drawn_b))
    )
    heading = np.full_like(s_b, angle_rad)
    touching = overlap(s_a, s_b * np.cos(angle_rad), s_b * np.sin(angle_rad), heading)
    return np.asarray(touching.any(axis=1))


@pytest.mark.long
@pytest.mark.parametrize("behaviour", [UNIFORM, TRIANGULAR], ids=["uniform", "triangular"])
@pytest.mark.parametrize("angle_deg", [90.0, 60.0, 25.0, 130.0, -75.0])
@pytest.mark.parametrize(("a", "b"), [((25.0, 12.0), (27.0, 12.0)), ((12.0, 6.0), (20.0, 10.0))])
def test_agrees_with_monte_carlo_over_stepped_trajectories(
    behaviour: Behaviour, angle_deg: float, a: tuple[float, float], b: tuple[float, float]
) -> None:
    rng = np.random.default_rng(7)
    n = 2_000
    angle = np.deg2rad(angle_deg)
    one, other = approach(*a, behaviour), approach(*b, behaviour)
    drawn = [behaviour.quantile(rng.uniform(size=n)) for _ in "ab"]

    share = brute_force(one, other, angle, *drawn).mean()

    standard_error = np.sqrt(max(share * (1 - share), 1 / n) / n)
    assert p_c(one, other, XCrossing(CAR, CAR, np.array(angle))) == pytest.approx(
        share, abs=4 * standard_error
    )


@pytest.mark.parametrize("behaviour", [UNIFORM, TRIANGULAR], ids=["uniform", "triangular"])
def test_quadrature_error_is_below_one_in_a_thousand(behaviour: Behaviour) -> None:
    """Against the same inner integral under a midpoint rule fine enough to be the truth."""
    from onboard.risk.collision_probability import _colliding_share

    rng = np.random.default_rng(3)
    middle = (np.arange(20_000) + 0.5) / 20_000
    for _ in range(40):
        (a_m, a_m_s), (b_m, b_m_s) = rng.uniform([-2.0, 0.0], [50.0, 16.0], (2, 2))
        a, b = approach(a_m, a_m_s, behaviour), approach(b_m, b_m_s, behaviour)
        fine = _colliding_share(behaviour.quantile(middle)[None, :], a, b, RIGHT_ANGLE).mean()
        assert p_c(a, b) == pytest.approx(fine, abs=1e-3)


def colliding_share(acceleration: np.ndarray, a: Approach, b: Approach, zone: XCrossing) -> float:
    """Share of B's accelerations that collide, from A's positions in small steps."""
    start = -a.distance_m
    stop = start + travelled_m(np.array(np.inf), acceleration, a.speed_m_s, a.top_speed_m_s)
    first, last = zone.extent_m()
    begin, end = np.maximum(start, first), np.minimum(stop, last)
    s_a = begin + np.linspace(0.0, 1.0, 150)[:, None] * (end - begin)
    at_s = reached_after_s(s_a - start, acceleration, a.speed_m_s, a.top_speed_m_s)
    low, high = (
        acceleration_to_cover(edge + b.distance_m, at_s, b.speed_m_s, b.top_speed_m_s)
        for edge in zone.interval_m(s_a)
    )
    waits = np.where(stop <= last, np.inf, at_s[-1:])
    stays = acceleration_to_cover(
        zone.interval_m(end)[0] + b.distance_m, waits, b.speed_m_s, b.top_speed_m_s
    )
    lowest = np.minimum(low.min(axis=0), stays)
    share = b.behaviour.cdf(high.max(axis=0)) - b.behaviour.cdf(lowest)
    return float(np.where((start < last) & (stop > first), np.maximum(share, 0.0), 0.0).mean())


@pytest.mark.long
@pytest.mark.parametrize("known", [False, True], ids=["uniform", "triangular"])
def test_the_error_at_any_angle_is_below_two_in_a_thousand(known: bool) -> None:
    """Sampled in eight places, the zone's ends were off by up to 0.023 where B hardly moved."""
    rng = np.random.default_rng(8)
    probability = ((np.arange(1_500) + 0.5) / 1_500)[None, :]
    low, high = [[-3.0, 0.0, -5.0]] * 2, [[60.0, 20.0, 2.0]] * 2
    cases = [(rng.uniform(20.0, 160.0), rng.uniform(low, high)) for _ in range(80)]
    cases.append((154.6, np.array([[20.0, 12.8, -3.0], [0.7, 0.9, 0.5]])))
    for angle_deg, pair in cases:
        a, b = (
            Approach(
                np.array([[distance_m]]),
                np.array([[speed_m_s]]),
                np.array(70.0),
                Triangular(A_MIN_M_S2, np.array(present_m_s2), A_MAX_M_S2) if known else UNIFORM,
            )
            for distance_m, speed_m_s, present_m_s2 in pair
        )
        zone = XCrossing(CAR, CAR, np.array([[np.deg2rad(angle_deg)]]))
        fine = colliding_share(a.behaviour.quantile(probability), a, b, zone)
        assert p_c(a, b, zone) == pytest.approx(fine, abs=2e-3)


def test_both_cars_inside_is_certain_and_exactly_one() -> None:
    assert p_c(approach(0.0, 5.0), approach(0.5, 3.0)) == 1.0


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (approach(-10.0, 10.0), approach(5.0, 10.0)),
        (approach(5.0, 10.0), approach(-10.0, 10.0)),
        (approach(3.0, 15.0), approach(200.0, 5.0)),
        (approach(20.0, 0.0), approach(20.0, 0.0, Uniform(A_MIN_M_S2, np.array(-0.1)))),
    ],
    ids=["A is past", "B is past", "A is long gone", "B never starts"],
)
def test_what_cannot_happen_is_exactly_zero(a: Approach, b: Approach) -> None:
    assert p_c(a, b) == 0.0


@pytest.mark.long
@settings(max_examples=150)
@given(
    d=st.tuples(st.floats(-60.0, 200.0), st.floats(-60.0, 200.0)),
    v=st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 60.0)),
    angle_deg=st.floats(20.0, 160.0),  # nothing shallower is asked for (CrossingSettings)
    triangular=st.booleans(),
)
def test_is_a_probability_and_symmetric_in_both_cars(
    d: tuple[float, float], v: tuple[float, float], angle_deg: float, triangular: bool
) -> None:
    behaviour = TRIANGULAR if triangular else UNIFORM
    a, b = (approach(*car, behaviour) for car in zip(d, v, strict=True))
    angle = np.array(np.deg2rad(angle_deg))

    one, other = p_c(a, b, XCrossing(CAR, CAR, angle)), p_c(b, a, XCrossing(CAR, CAR, -angle))

    assert 0.0 <= one <= 1.0
    assert one == pytest.approx(other, abs=0.03)


def test_a_batch_gives_what_its_pairs_give_alone() -> None:
    rng = np.random.default_rng(5)
    d, v = rng.uniform(0, 40, (2, 50, 1)), rng.uniform(0, 15, (2, 50, 1))
    a, b = (Approach(d[i], v[i], np.array(TOP_M_S), UNIFORM) for i in (0, 1))

    batch = collision_probability(a, b, RIGHT_ANGLE)

    alone = [
        p_c(approach(d[0, i, 0], v[0, i, 0]), approach(d[1, i, 0], v[1, i, 0])) for i in range(50)
    ]
    assert batch == pytest.approx(np.array(alone), abs=1e-12)


def test_limits_may_differ_from_car_to_car() -> None:
    gentle = Uniform(np.array(-2.0), np.array(1.0))

    assert p_c(approach(15.0, 14.0, gentle), approach(15.0, 14.0, gentle)) > p_c(
        approach(15.0, 14.0), approach(15.0, 14.0)
    )


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (approach(np.nan, 5.0), "finite"),
        (approach(5.0, -1.0), "speed_m_s must not be negative"),
        (approach(5.0, 5.0, Uniform(np.array(2.0), np.array(-2.0))), "below"),
    ],
)
def test_invalid_approaches_are_refused(bad: Approach, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        p_c(bad, approach(5.0, 5.0))
