"""Probability of each vehicle on the air, from texts, answers and motion."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.identity_posterior import (
    CALIBRATION,
    COINCIDENCE,
    FLEET,
    FLEET_ANSWERS,
    IMITATION,
    LOST,
    ON_AIR,
    UNLISTED_NEAR,
    AskedText,
    vehicle_probabilities,
)

A, B, C, D = b"a", b"b", b"c", b"d"
MANY = {number.to_bytes(2): 0.0 for number in range(200)}
TEXTS = st.from_regex(r"[A-C]{2}[0-9]{3}", fullmatch=True)


def asked(text: str, probability: float, inquiries: int = 3) -> AskedText:
    return AskedText(text, probability, inquiries)


def test_without_vehicles_there_is_nobody() -> None:
    assert vehicle_probabilities([], {}, {}) == {}


def test_one_answer_confirms_even_a_doubtful_text() -> None:
    texts = [asked("AB123", 0.4), asked("XB123", 0.3), asked("AC123", 0.3)]
    assert vehicle_probabilities(texts, {A: "AB123"}, {A: 1.4})[A] > 0.999
    texts = [asked("AB123", 0.05), asked("XB123", 0.95)]
    assert vehicle_probabilities(texts, {A: "AB123"}, {A: 1.5} | MANY)[A] > 0.99


def test_an_answer_for_a_text_that_nobody_reads_confirms_nothing() -> None:
    assert vehicle_probabilities([asked("AB123", 1e-6)], {A: "AB123"}, {A: 0.0})[A] < 0.1


def test_answers_for_near_numbers_leave_the_decision_to_text_and_motion() -> None:
    texts = [asked("AB123", 0.6), asked("AB128", 0.3)]
    both = {A: "AB123", B: "AB128"}
    alike = vehicle_probabilities(texts, both, {A: 0.0, B: 0.0})
    assert alike[A] == pytest.approx(2.0**CALIBRATION * alike[B])
    assert alike[A] < 0.7
    assert vehicle_probabilities(texts, both, {A: 8.0, B: -6.0})[A] > 0.999


def test_a_silent_text_near_the_one_answered_keeps_its_weight() -> None:
    """The lead may have no radio, and its neighbour in number answers."""
    texts = [asked("AB128", 0.9), asked("AB123", 0.1)]
    assert vehicle_probabilities(texts, {A: "AB123"}, {A: 2.0})[A] < 0.99
    assert vehicle_probabilities(texts, {A: "AB123"}, {A: 7.0})[A] > 0.999


@pytest.mark.parametrize("other", ["AC128", "A8128", "AB178", "AB1234"])
def test_a_silent_text_that_is_of_no_fleet_with_the_one_answered_does_not(other: str) -> None:
    texts = [asked(other, 0.9), asked("AB123", 0.1)]
    assert vehicle_probabilities(texts, {A: "AB123"}, {A: 2.0})[A] > 0.999


def test_a_text_not_asked_for_yet_may_still_be_answered() -> None:
    later, sooner = (
        vehicle_probabilities(
            [asked("AB128", 0.5, n), asked("AB123", 0.5)], {A: "AB123"}, {A: 3.0, B: 3.0}
        )
        for n in (4, 0)
    )
    assert sooner[A] < later[A]
    assert sooner[B] > 10.0 * later[B]


def test_a_vehicle_that_moves_otherwise_is_not_ahead_whatever_it_answers() -> None:
    assert vehicle_probabilities([asked("AB123", 0.95)], {A: "AB123"}, {A: -20.0})[A] < 0.001


def test_motion_alone_needs_more_the_more_vehicles_are_on_the_air() -> None:
    assert vehicle_probabilities([], {}, {A: 8.0, B: -3.0})[A] > 0.999
    assert vehicle_probabilities([], {}, {A: 8.0} | MANY)[A] < 0.999


def test_motion_that_another_place_in_the_row_explains_as_well_decides_nothing() -> None:
    alone = vehicle_probabilities([], {}, {A: 11.0, B: -3.0})
    assert alone[A] > 0.999
    row = vehicle_probabilities([], {}, {A: 11.0, B: -3.0}, {}, {A: 10.0, B: -3.0})
    assert row[A] < 0.9
    other = vehicle_probabilities([], {}, {A: 11.0, B: -3.0}, {}, {A: 2.0, B: -3.0})
    assert other[A] > 0.999


def test_whoever_moves_just_as_the_lead_is_not_it_if_its_plate_is_another() -> None:
    """An insider copies speed and place of a lead without radio, and answers for itself."""
    read = [asked("AB120", 0.9, 5)]

    assert vehicle_probabilities(read, {}, {A: 20.0}, {A: 0})[A] < 0.999
    assert vehicle_probabilities(read, {}, {A: 20.0})[A] > 0.999
    assert vehicle_probabilities([], {}, {A: 20.0}, {A: 0})[A] > 0.999


def test_whoever_moves_just_as_the_lead_and_answers_nobody_keeps_no_other_from_being_it() -> None:
    read = [asked("AB120", 0.9)]

    def of_the_one_that_answers(asked_by_motion: dict[bytes, int]) -> float:
        motion = {A: 6.0, B: 16.0}
        return vehicle_probabilities(read, {A: "AB120"}, motion, asked_by_motion)[A]

    assert of_the_one_that_answers({}) < 0.1
    assert of_the_one_that_answers({B: 1}) > 0.999


def test_the_weights_are_those_of_the_docstring() -> None:
    texts = [asked("AB120", 0.4), asked("AB160", 0.1), asked("AB140", 0.2, 1), asked("XY", 0.1)]
    powers = [each.probability**CALIBRATION for each in texts]
    p = [0.8 * power / sum(powers) for power in powers]
    motion = {A: 0.7, B: -0.3, C: 0.1, D: 9.0}
    n = len(motion)

    def chance(near: int, far: int) -> float:
        rare = COINCIDENCE * n
        return rare**far * ((1 - FLEET) * rare**near + FLEET * FLEET_ANSWERS**near)

    beside = UNLISTED_NEAR * (p[0] + p[1])
    unlisted = 0.2 * (beside * chance(2, 0) + (1 - beside) * chance(0, 2))
    nobody = p[2] * chance(2, 0) + p[3] * chance(0, 2) + unlisted
    lost = p[2] * LOST * chance(2, 0) + p[3] * LOST**3 * chance(0, 2) + unlisted
    in_row = {A: 1.0, C: 2.0, D: -3.0}
    weights = {
        A: p[0] * math.exp(0.7) * ON_AIR * chance(1, 0),
        B: p[1] * math.exp(-0.3) * ON_AIR * chance(1, 0),
        C: ON_AIR / n * math.exp(0.1) / (0.5 + 0.5 * math.exp(2.0)) * lost,
        D: ON_AIR / n * LOST**2 / IMITATION / (0.5 + 0.5 * math.exp(-3.0)) * lost,
    }
    total = sum(weights.values()) + (1 - ON_AIR) * nobody
    got = vehicle_probabilities(texts, {A: "AB120", B: "AB160"}, motion, {D: 2}, in_row)
    assert got == pytest.approx({name: weight / total for name, weight in weights.items()})


def test_a_text_that_has_left_the_camera_s_list_is_less_likely_than_those_on_it() -> None:
    listed = [asked(text, 0.1) for text in ("AB123", "AC123", "AD123")]
    heard = {A: "AB123", B: "AE123"}
    alike = vehicle_probabilities(listed, heard, {A: 0.0, B: 0.0})
    assert alike[A] > 4.0 * alike[B]
    assert vehicle_probabilities(listed, heard, {A: -9.0, B: 7.0})[B] > 0.999


@pytest.mark.long
@given(
    st.dictionaries(TEXTS, st.tuples(st.floats(0.0, 1.0), st.integers(0, 9)), max_size=16),
    st.dictionaries(st.binary(max_size=2), TEXTS, max_size=32),
    st.dictionaries(st.binary(max_size=2), st.floats(-30.0, 12.0), max_size=40),
    st.dictionaries(st.binary(max_size=2), st.integers(0, 9), max_size=40),
    st.floats(-30.0, 12.0),
)
def test_whatever_comes_the_result_is_a_distribution(
    listed: dict[str, tuple[float, int]],
    answered: dict[bytes, str],
    motion: dict[bytes, float],
    asked_by_motion: dict[bytes, int],
    in_row: float,
) -> None:
    texts = {text: AskedText(text, *rest) for text, rest in listed.items()}
    elsewhere = dict.fromkeys(motion, in_row)
    probabilities = vehicle_probabilities(
        texts.values(), answered, motion, asked_by_motion, elsewhere
    )
    assert probabilities.keys() == answered.keys() | motion.keys()
    assert all(0.0 <= each <= 1.0 for each in probabilities.values())
    assert sum(probabilities.values()) <= 1.0 + 1e-9
