"""Probability of each vehicle on the air, from texts, answers and motion."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.identity_posterior import COINCIDENCE, FLEET, vehicle_probabilities

A, B, C = b"a", b"b", b"c"
MANY = {number.to_bytes(2): 0.0 for number in range(200)}


def test_without_vehicles_there_is_nobody() -> None:
    assert vehicle_probabilities({}, {}) == {}


def test_one_answer_confirms_even_a_doubtful_text() -> None:
    assert vehicle_probabilities({A: 0.4}, {A: 1.4})[A] > 0.999
    assert vehicle_probabilities({A: 0.05}, {A: 1.5} | MANY)[A] > 0.98


def test_an_answer_for_a_text_that_nobody_reads_confirms_nothing() -> None:
    assert vehicle_probabilities({A: 1e-6}, {A: 0.0})[A] < 0.1


def test_two_answers_are_of_a_fleet_and_leave_the_decision_to_text_and_motion() -> None:
    alike = vehicle_probabilities({A: 0.6, B: 0.3}, {A: 0.0, B: 0.0})
    assert alike[A] == pytest.approx(2.0 * alike[B])
    assert alike[A] < 0.7
    assert vehicle_probabilities({A: 0.6, B: 0.3}, {A: 6.0, B: -6.0})[A] > 0.999
    assert vehicle_probabilities({A: 0.3, B: 0.2}, {A: 0.0, B: 0.0})[A] < 0.5


def test_a_vehicle_that_moves_otherwise_is_not_ahead_whatever_it_answers() -> None:
    assert vehicle_probabilities({A: 0.95}, {A: -20.0})[A] < 0.001


def test_motion_alone_needs_more_the_more_vehicles_are_on_the_air() -> None:
    assert vehicle_probabilities({}, {A: 8.0, B: -3.0})[A] > 0.999
    assert vehicle_probabilities({}, {A: 8.0} | MANY)[A] < 0.999


def test_the_weights_are_those_of_the_docstring() -> None:
    motion = {A: 0.7, B: -0.3, C: 0.1}
    n = len(motion)

    def chance(answers: int) -> float:
        return (1 - FLEET) * (COINCIDENCE * n) ** answers + FLEET * 0.5**answers

    weights = {
        A: 0.4 * math.exp(0.7) * 0.5 * chance(1),
        B: 0.1 * math.exp(-0.3) * 0.5 * chance(1),
        C: 0.5 * 0.5 / n * math.exp(0.1) * chance(2),
    }
    total = sum(weights.values()) + 0.5 * 0.5 * chance(2)
    found = vehicle_probabilities({A: 0.4, B: 0.1}, motion)
    assert found == pytest.approx({name: weight / total for name, weight in weights.items()})


@given(
    st.dictionaries(st.binary(max_size=2), st.floats(0.0, 1.0), max_size=16),
    st.dictionaries(st.binary(max_size=2), st.floats(-30.0, 12.0), max_size=40),
)
def test_whatever_comes_the_result_is_a_distribution(
    answered: dict[bytes, float], motion: dict[bytes, float]
) -> None:
    found = vehicle_probabilities(answered, motion)
    assert found.keys() == answered.keys() | motion.keys()
    assert all(0.0 <= each <= 1.0 for each in found.values())
    assert sum(found.values()) <= 1.0 + 1e-9
