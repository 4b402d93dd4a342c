"""Invalid footers: counted by reason, bounded, dropped or weighted down (docs/design/mvs.md)."""

import cProfile
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.messages.mvs_footer import (
    MvsFooter,
    ObserverRun,
    SharedEstimate,
    SharedMeasurement,
    SharedState,
)
from onboard.mvs.footer_coding import footer_of
from onboard.mvs.multi_vehicle_sensing import (
    MAX_OBSERVER_SIGMA_M,
    UPDATE_S,
    MultiVehicleSensing,
)
from onboard.observations import Position, VehicleDetection
from onboard.tracking.evidence import Estimate, Measurement, measurement_id, observer_of
from onboard.tracking.fusion import propagate
from onboard.tracking.track import MAX_EVIDENCE, MAX_SETTLED
from onboard.tracking.tracks import DEFAULTS, MAX_TRACKS_PER_SENDER
from tests.mvs.attacker import (
    ATTACKER,
    HERE,
    NOW,
    OWN,
    RECENT,
    WITNESS,
    estimate_at,
    footer_with,
    say,
    victim,
)


def tracks(mvs: MultiVehicleSensing, now: float = NOW) -> list[Estimate]:
    """What it holds of cars without a radio, known or not yet."""
    mvs.update(now)
    return [track.estimate for track in mvs._tracks]


def test_a_valid_footer_is_accepted() -> None:
    mvs = victim()

    assert say(mvs, footer_with(estimate_at(20, 60, RECENT))) == []
    assert len(tracks(mvs)) == 1


def test_positions_on_the_moon_are_far() -> None:
    mvs = victim()
    footer = dataclasses.replace(
        footer_with(estimate_at(20, 60, RECENT)), latitude_deg=-30.0, longitude_deg=100.0
    )

    assert say(mvs, footer) == ["far"]
    assert tracks(mvs) == []


def test_a_car_cannot_measure_beyond_its_camera_but_may_relay_what_others_measured() -> None:
    mvs = victim()
    far = np.array([0.0, 800.0])
    measured = Measurement(measurement_id(ATTACKER, 999_900), far, np.eye(2))
    relayed = Measurement(measurement_id(WITNESS, 999_900), far, np.eye(2))

    assert say(mvs, footer_with(measured)) == ["far"]
    assert say(mvs, footer_with(relayed), NOW + 0.1) == []


def test_a_footer_of_a_sender_far_away_is_discarded() -> None:
    mvs = victim()

    mvs.receive_bsm(ATTACKER, Position(NOW, 49.0, 11.5, None, 1.0, 0.0, 0.0), b"", NOW)

    event = mvs.next_event()
    assert event is not None
    assert event.reason == "sender_far"
    assert mvs.kinematic_info(NOW) == []


def test_stamps_from_the_future_are_dropped_and_nearly_so_are_not() -> None:
    ahead = footer_with(estimate_at(20, 60, [1_000_300, 1_000_400]), reference_ms=1_000_500)
    nearly = footer_with(estimate_at(20, 60, [999_900, 1_000_050]), reference_ms=1_000_050)

    assert say(victim(), ahead) == ["future"]
    assert say(victim(), nearly) == []


def test_stale_evidence_is_dropped() -> None:
    old = footer_with(estimate_at(20, 60, [996_500, 999_900]))

    assert say(victim(), old) == ["stale"]


@pytest.mark.parametrize("observer", [bytes(4), ATTACKER])
def test_what_was_measured_before_1970_is_out_of_range(observer: bytes) -> None:
    measured = Measurement(measurement_id(observer, 999_900), np.array([20.0, 60.0]), np.eye(2))
    footer = footer_with(measured)
    before = dataclasses.replace(footer, reference_ms=0)
    assert say(victim(), before) == ["out_of_range"]


def test_what_we_never_measured_is_not_ours() -> None:
    assert say(victim(), footer_with(estimate_at(20, 60, RECENT, OWN))) == ["not_my_measurement"]


def test_thousands_of_provenance_entries_do_not_fit_and_hundreds_are_too_many() -> None:
    footer = footer_with(estimate_at(20, 60, RECENT))
    runs = tuple(ObserverRun(0, tuple(range(16 * k, 16 * k + 16))) for k in range(100))
    state = dataclasses.replace(footer.estimates[0].state, runs=100)
    footer = dataclasses.replace(footer, estimates=(SharedEstimate(state, runs),))

    assert say(victim(), footer) == ["too_many_measurements"]
    with pytest.raises(ValueError, match="300"):
        mvs_footer.encode(
            dataclasses.replace(
                footer, estimates=(SharedEstimate(dataclasses.replace(state, runs=300), runs * 3),)
            )
        )


def test_a_footer_with_too_many_entries_is_dropped_whole() -> None:
    cars = [estimate_at(10.0 * k, 60, RECENT) for k in range(65)]

    assert say(victim(), footer_with(*cars)) == ["too_many_entries"]


def test_the_same_estimate_a_hundred_times_is_one() -> None:
    mvs, once = victim(), victim()
    estimate = estimate_at(20, 60, RECENT)
    say(once, footer_with(estimate))

    say(mvs, footer_with(*[estimate] * 60))
    for k in range(1, 100):
        say(mvs, footer_with(estimate), NOW + k * 0.001)

    (repeated,), (sent_once,) = tracks(mvs), tracks(once)
    assert (repeated.state == sent_once.state).all()
    assert (repeated.covariance == sent_once.covariance).all()


def test_a_sender_without_pauses_is_limited_to_the_rate_of_a_fast_one() -> None:
    """Eight at once, and one for every 50 ms."""
    mvs = victim()
    reasons = [
        say(mvs, footer_with(estimate_at(20, 60, RECENT)), NOW + k / 1000) for k in range(99)
    ]

    assert sum(reason == ["too_often"] for reason in reasons) == 99 - (8 + 1)


def test_delayed_footers_are_accepted_together() -> None:
    mvs = victim()
    for k in range(50):
        together = NOW + 0.4 * (k // 4) + 0.001 * (k % 4)
        assert say(mvs, footer_with(estimate_at(20, 60, RECENT)), together) != ["too_often"]


def test_ghosts_without_end_are_bounded_and_leave_room_for_the_own_camera() -> None:
    mvs, reasons, near = victim(), list[str](), list[Estimate]()
    for k in range(30):
        now = NOW + k * 0.06
        stamps = [round(now * 1000) - age for age in (10, 60, 110)]
        ghosts = [
            estimate_at(-700 + 20.0 * (k * 24 + i), 60 + 9 * (k % 9), stamps) for i in range(24)
        ]
        near = [ghost for ghost in ghosts if abs(ghost.state[0]) < 1200]
        reasons = say(mvs, footer_with(*near, reference_ms=round(now * 1000)), now)

    assert len(tracks(mvs, NOW + 1.0)) <= MAX_TRACKS_PER_SENDER
    assert "too_many_cars" in reasons or len(near) == 0


def variances_of_a_seen_car(
    attack_every: int = 0, span_ms: int = 0, sigma_m: float = 1.0, sigma_m_s: float = 1.0
) -> np.ndarray:
    """Of its place and speed at each of 50 pictures, 0.05 s apart.

    Every so many pictures the attacker repeats, in one estimate, the own measurements of the last
    `span_ms`, adds one of his own, and says that he hardly knows where the car is.
    """
    mvs, rng, found = victim(), np.random.default_rng(1), []
    for k in range(50):
        at, ahead_m = NOW + 0.05 * k, 0.5 * k
        place = LocalFrame(48.1 + ahead_m / 111_200, 11.5)
        mvs.receive_position(
            Position(at, place.latitude_deg, place.longitude_deg, None, 0.5, 10.0, 0.0)
        )
        mvs.receive_detection(
            VehicleDetection(at, 1, 30.0 + rng.normal(0, 0.3), 0.5, rng.normal(0, 0.005), 0.01)
        )
        stamps = [round(1000 * (NOW + 0.05 * earlier)) for earlier in range(k + 1)]
        now_ms = stamps[-1] + 10
        if attack_every and k >= 20 and k % attack_every == 0:
            own = {measurement_id(OWN, stamp) for stamp in stamps if stamp > now_ms - span_ms}
            lie = Estimate(
                frozenset(own | {measurement_id(ATTACKER, now_ms - 1)}),
                np.array([0.0, 30.0 + ahead_m, 0.0, 10.0]),
                np.diag([sigma_m**2, sigma_m**2, sigma_m_s**2, sigma_m_s**2]),
            )
            say(mvs, footer_with(lie, reference_ms=now_ms), at + 0.01)
        mvs.update(at + 0.02)
        (track,) = (track for track in mvs._tracks if track.is_sensed)
        _, covariances = propagate([track.estimate], stamps[-1] + 20, DEFAULTS.acceleration_density)
        x, y, vx, vy = np.diagonal(covariances[:, :, 0])
        found.append((x + y, vx + vy))
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize(
    ("attack_every", "span_ms", "sigma_m", "sigma_m_s"),
    [(2, 100, 20.0, 1000.0), (4, 200, 20.0, 1000.0), (4, 200, 20.0, 0.8), (4, 200, 0.5, 1000.0)],
)
def test_repeated_own_measurements_do_not_make_a_measured_car_vague(
    attack_every: int, span_ms: int, sigma_m: float, sigma_m_s: float
) -> None:
    """Chosen for one measurement more, it made the variances 1,200 times as large."""
    alone = variances_of_a_seen_car()

    with_lies = variances_of_a_seen_car(attack_every, span_ms, sigma_m, sigma_m_s)

    assert (with_lies[20:] <= 1.2 * alone[20:]).all()


def test_a_ghost_gets_no_smaller_covariance_than_its_provenance_allows() -> None:
    """Two positions of 0.1 m, 0.1 s apart, cannot tell a speed to better than 1.4 m/s."""
    mvs = victim()
    sure = Estimate(
        frozenset(measurement_id(ATTACKER, stamp) for stamp in (999_800, 999_900)),
        np.array([20.0, 60.0, 0.0, 10.0]),
        np.diag([1e-4, 1e-4, 1e-4, 1e-4]),
    )

    assert say(mvs, footer_with(sure)) == ["too_sure"]

    (track,) = mvs._tracks
    sigmas = np.sqrt(np.diagonal(track.estimate.covariance))
    assert sigmas[:2].min() > 0.07
    assert sigmas[2:].min() > 1.4


def test_a_single_attacker_does_not_move_a_car_that_others_measure() -> None:
    """The false position is outside the gate: another car, known by one sender only."""
    mvs, now = victim(), NOW
    for k in range(10):
        now = NOW + k / 10
        seen = [
            Measurement(measurement_id(WITNESS, round(now * 1000) - 5), p, np.eye(2) * 0.1)
            for p in (np.array([0.0, 50.0 + k]),)
        ]
        footer = mvs_footer.encode(footer_with(*seen, reference_ms=round(now * 1000)))
        place = Position(now, 48.1003, 11.5, None, 0.5, 10.0, 0.0)
        mvs.receive_bsm(WITNESS, place, footer, now)
        stamps = [round(now * 1000) - age for age in (10, 60, 110)]
        lie = estimate_at(0.0, 56.0 + k, stamps, sigma_m=0.3)
        say(mvs, footer_with(lie, reference_ms=round(now * 1000)), now)

    observers = {
        frozenset(observer_of(each) for each in car.provenance) for car in tracks(mvs, now)
    }
    assert observers == {frozenset({WITNESS}), frozenset({ATTACKER})}


@given(st.binary(max_size=400), st.booleans())
def test_no_bytes_stop_the_car(data: bytes, with_head: bool) -> None:
    mvs = victim()
    if with_head:
        head = mvs_footer.encode(footer_with())
        data = head[:15] + data

    say(mvs, data)

    mvs.update(NOW)
    for car in mvs.kinematic_info(NOW):
        assert np.isfinite(car.state).all()
        assert np.isfinite(car.covariance).all()
        assert np.linalg.eigvalsh(np.array(car.covariance))[0] > 0


@given(st.lists(st.tuples(st.integers(0, 2**96 - 1)), max_size=20), st.integers(0, 2**168 - 1))
def test_whatever_entries_say_the_state_is_finite_and_positive(
    measurements: list[tuple[int]], estimate: int
) -> None:
    """Every combination of bits that decodes."""
    mvs = victim()
    shared = []
    for (bits,) in measurements:
        try:
            entry = mvs_footer.MEASUREMENT.decode(bits.to_bytes(12))
        except DecodeError:
            continue
        shared.append(dataclasses.replace(entry, observer=0, age_ms=entry.age_ms % 500))
    footer = dataclasses.replace(
        footer_with(estimate_at(20, 60, RECENT)), measurements=tuple(shared)
    )
    try:
        state = mvs_footer.STATE.decode(estimate.to_bytes(21))
    except DecodeError:
        pass
    else:
        state = dataclasses.replace(state, runs=1)
        footer = dataclasses.replace(
            footer, estimates=(SharedEstimate(state, footer.estimates[0].provenance),)
        )

    say(mvs, footer)

    assert_sound(mvs)


HANGING = [
    "020000000f42401cab7a4006dac2c00100016c69617201001180c9400000009fa7e003fb81787f88818101000016",
    "020000000f42401cab7a4006dac2c00100016c69617200fffcc0c94000000060c00fecc200817f817f0001000024",
]
"""Footers that once stopped the loop: weighting down left of a needle what is no covariance."""


def drive_with(footers: Sequence[bytes], end_s: float = 0.48) -> MultiVehicleSensing:
    """The attacker's footers one after the other, about the place of a car that the camera sees."""
    mvs = victim()
    for k in range(round(end_s / 0.06)):
        at = NOW + k * 0.06
        mvs.receive_position(Position(at, 48.1, 11.5, None, 0.5, 0.0, 0.0))
        mvs.receive_detection(VehicleDetection(at - 0.005, 1, 30.0, 0.5, 0.0, 0.01))
        if k < len(footers):
            say(mvs, footers[k], at)
        mvs.footer_to_send(at + 0.02)
    return mvs


def assert_sound(mvs: MultiVehicleSensing) -> None:
    for track in mvs._tracks:
        assert np.isfinite(track.estimate.state).all()
        eigenvalues = np.linalg.eigvalsh(track.estimate.covariance)
        assert eigenvalues[0] > -1e-9 * eigenvalues[-1]
        assert (track.estimate.covariance == track.estimate.covariance.T).all()


@pytest.mark.parametrize("footer", HANGING)
def test_a_needle_about_a_seen_car_stops_nothing(footer: str) -> None:
    mvs = drive_with([bytes.fromhex(footer)])

    assert_sound(mvs)
    assert any(track.is_reported and track.is_sensed for track in mvs._tracks)


CORNERS_OF_CORRELATION = st.sampled_from([-127 / 128, -120 / 128, 0.0, 120 / 128, 127 / 128])
LOPSIDED = st.tuples(
    st.integers(0, 1),
    st.floats(-1.0, 1.0),
    st.tuples(*[st.sampled_from([0.01, 0.1, 1.0, 20.0])] * 2),
    st.tuples(*[st.sampled_from([0.01, 0.1, 1.0, 20.0, 100.0, 1900.0])] * 2),
    st.tuples(*[CORNERS_OF_CORRELATION] * 6),
    st.lists(st.integers(0, 60), min_size=1, max_size=2, unique=True),
)


@pytest.mark.long
@settings(max_examples=60)
@given(st.lists(st.lists(LOPSIDED, min_size=1, max_size=3), min_size=2, max_size=8))
def test_footers_about_a_seen_car_leave_all_states_finite_and_positive(footers: list[Any]) -> None:
    """Covariances as lopsided as can be encoded, fused with each other and with own pictures."""
    encoded = []
    for k, said in enumerate(footers):
        estimates = tuple(
            SharedEstimate(
                SharedState(*(number, x_m, 32.2, 0.0, 0.0, *sigmas, *of_speed, *correlations, 1)),
                (ObserverRun(0, tuple(ages_ms)),),
            )
            for number, x_m, sigmas, of_speed, correlations, ages_ms in said
        )
        at_ms = round((NOW + k * 0.06) * 1000)
        encoded.append(mvs_footer.encode(MvsFooter(at_ms, 48.1, 11.5, (ATTACKER,), (), estimates)))

    assert_sound(drive_with(encoded))


def test_pairs_that_leave_all_open_cost_no_more_than_their_number() -> None:
    """650 bytes of pairs and what joins their ends once took 2^20 states, seconds a tick."""
    mvs, n = victim(), 20
    say(mvs, footer_with(estimate_at(20, 60, [999_999])))
    ends, others = range(999_860, 999_860 + n), range(999_960, 999_960 + n)
    pairs = [estimate_at(20, 60.6, list(pair)) for pair in zip(ends, others, strict=True)]
    whole = [estimate_at(20, 60.6, list(ids)) for ids in (ends, others)]

    footer = footer_of([(0, e) for e in [*whole, *pairs]], 1_000_060, HERE, HERE)
    with cProfile.Profile() as profile:
        say(mvs, footer, NOW + 0.06)

    calls = sum(each.callcount for each in profile.getstats())
    assert calls < 20_000


def test_a_thousand_invented_measurements_a_second_of_one_car_take_bounded_time() -> None:
    """900 pieces of evidence took 60 ms of each tick, for as long as they came."""
    mvs = victim()
    for k in range(8):
        at = NOW + 0.05 * k
        observers = tuple(bytes([k, i, 0, 0]) for i in range(16))
        invented = tuple(
            SharedMeasurement(i % 16, i, 650 + i // 16, 0, 20.0, 60.0, 0.5, 0.5, 0.0)
            for i in range(64)
        )
        say(mvs, MvsFooter(round(at * 1000), 48.1, 11.5, observers, invented, ()), at)

    (track,) = mvs._tracks
    assert len(track.chosen) <= MAX_SETTLED + MAX_EVIDENCE


def test_an_observer_corrects_what_others_repeat_of_its_measurement() -> None:
    mvs = victim()
    hearsay = Measurement(measurement_id(WITNESS, 999_900), np.array([0.0, 50.0]), np.eye(2))
    own_word = Measurement(measurement_id(WITNESS, 999_900), np.array([0.6, 50.0]), np.eye(2))
    say(mvs, footer_with(hearsay))

    place = Position(NOW, 48.1003, 11.5, None, 0.5, 10.0, 0.0)
    mvs.receive_bsm(WITNESS, place, mvs_footer.encode(footer_with(own_word)), NOW)

    mvs.update(NOW + UPDATE_S)
    (track,) = mvs._tracks
    assert track.estimate.state[0] == pytest.approx(0.6, abs=0.01)


def test_a_measurement_names_its_observer() -> None:
    entry = SharedMeasurement(3, 0, 100, 0, 1.0, 2.0, 0.5, 0.5, 0.0)
    footer = dataclasses.replace(footer_with(), measurements=(entry,))

    assert say(victim(), footer) == ["unknown_observer"]


def test_a_sender_that_states_a_poor_position_makes_no_car_too_uncertain_to_be_reported() -> None:
    mvs = victim()
    for tenth in range(3):
        at = NOW + tenth / 10
        mvs.receive_position(Position(at, 48.1, 11.5, None, 0.5, 10.0, 0.0))
        recent = [stamp_ms + tenth * 100 for stamp_ms in RECENT]
        footer = footer_with(estimate_at(20, 60, recent), reference_ms=round(at * 1000))
        poor = Position(at, 48.1009, 11.5, None, 50.0, 10.0, 0.0)
        mvs.receive_bsm(ATTACKER, poor, mvs_footer.encode(footer), at)
        mvs.update(at)

    (track,) = mvs.reported_tracks()
    assert 1.0 < track.common_variance_m2 < MAX_OBSERVER_SIGMA_M**2
